// The state of the viewer, which keys and panel change, and what is drawn over the picture.
#pragma once

#include <string>

#include <SDL.h>

#include "scene_view.h"

namespace dermis::viewer {

struct State {
  Shot shot;  ///< what should be shown
  bool isPlaying = true;
  bool showsJoints = false, showsHelp = false;
  bool takesScreenshot = false, quits = false;  ///< requests

  // Shown in the window.
  std::string file;   ///< of the model, without folders
  std::string notes;  ///< problems of the file, or what was left out
  std::string device;
  std::string loading;  ///< what is being done; empty: nothing is loaded
  std::string notice;   ///< result of the last action
  std::string error;    ///< last error; empty: none
};

inline constexpr std::uint32_t panelWidth = 300;  ///< at the left of the window

/// A time in a clip that is repeated. The end of the clip is a separate pose.
double repeatedTime(double time, double duration);

/// `view` is null if there is no model.
void handleKey(const SDL_KeyboardEvent& key, const SceneView* view, State& state);

/// Sets the style of Dear ImGui's context.
void styleInterface();

/// Draws panel and overlay. Call between `Window::begin` and `show`.
void drawInterface(const SceneView* view, State& state);

}  // namespace dermis::viewer
