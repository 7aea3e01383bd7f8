// What each key does, and the help that says so.
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

/// `view` may be null: no model.
void handleKey(const SDL_KeyboardEvent& key, const SceneView* view, State& state);

/// Plays another clip, by its number, from its beginning; `gltf::none`: the rest pose.
void chooseClip(const SceneView& view, std::uint32_t clip, State& state);

}  // namespace dermis::viewer
