// The state that keys, mouse and panel change, and that the viewer acts on.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "error_check.h"
#include "orbit_camera.h"
#include "playback.h"
#include "scene_view.h"

namespace dermis::viewer {

struct State {
  std::array<Method, 2> methods{Method::dualQuaternion, Method::linear};
  bool isSideBySide = false;
  bool showsJoints = false;
  bool showsHelp = false;
  bool showsPanel = true;
  Coloring coloring = Coloring::surface;
  std::uint32_t joint = 0;  ///< in `SceneView::joints`
  std::uint32_t clip = gltf::none;
  Playback playback;
  OrbitCamera camera;
  std::string error;   ///< last error; empty: none
  std::string notice;  ///< last action, shown for a short time
  std::string path;    ///< contents of the text field

  // Requests, each done once.
  std::optional<std::string> opens;
  bool frames = false;
  bool takesScreenshot = false;
  bool editsPath = false;
  bool quits = false;

  std::uint32_t views() const { return isSideBySide ? 2 : 1; }
};

/// Information that the panel shows.
struct Facts {
  const SceneView* view = nullptr;  ///< null: no model
  std::string file;                 ///< file name without folders
  /// The methods that are shown, which differ from the chosen ones while those still wait for data.
  std::array<Method, 2> methods{};
  std::vector<std::string> notes;  ///< problems of the file, or what was left out
  std::string device;
  std::string kernels;         ///< folder that they are compiled from; empty: the library's
  std::string kernelsSummary;  ///< how many were compiled
  std::string kernelsUpdate;   ///< result of the last change of a file; empty: none so far
  bool kernelsAreBroken = false;
  bool isLoading = false;
  std::string loading;  ///< what is being loaded
  const CheckResult* errors = nullptr;
  double framesPerSecond = 0;  ///< 0: nothing moves
  float scale = 1;             ///< `Quality::scale` of the last picture
};

/// A part of the window, in the units of mouse and interface.
struct Area {
  float x = 0, y = 0, width = 0, height = 0;

  bool holds(float px, float py) const {
    return px >= x && px < x + width && py >= y && py < y + height;
  }
  /// One of `count` parts of equal width.
  Area part(std::uint32_t index, std::uint32_t count) const {
    const float each = width / static_cast<float>(count);
    return {x + each * static_cast<float>(index), y, each, height};
  }
};

}  // namespace dermis::viewer
