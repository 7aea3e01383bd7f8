// What each key does, and the help text for it.
#pragma once

#include <span>

#include <SDL.h>

#include "state.h"

namespace dermis::viewer {

struct KeyHelp {
  const char* keys;
  const char* what;
};

/// In the order of the help; null keys begin a new group.
std::span<const KeyHelp> keyHelp();

/// `view` is null if there is no model.
void handleKey(const SDL_KeyboardEvent& key, const SceneView* view, State& state);

/// Starts a clip, given by its index, from its beginning; `gltf::none`: the rest pose.
void chooseClip(const SceneView& view, std::uint32_t clip, State& state);

}  // namespace dermis::viewer
