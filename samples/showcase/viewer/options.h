// The command line options of the viewer.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "dermis/method.h"
#include "kit/exit_status.h"

namespace dermis::viewer {

struct Options {
  std::string model;  ///< empty: no model
  Method method = Method::dualQuaternion;
  std::optional<Method> comparison;  ///< shown next to `method`
  std::optional<std::string> animation;
  double time = 0;  ///< seconds
  bool isPaused = false;
  std::uint32_t width = 1280, height = 800;  ///< of the window
  std::string device = "auto";
  std::string shaders;      ///< folder of the kernels to compile; empty: those of the library
  std::string shaderCache;  ///< cache folder for compiled kernels; empty: no cache
  std::optional<std::uint32_t> frames;  ///< end after this number of frames
  std::string screenshot;               ///< written at the end; empty: none
  bool validates = false;
};

/// Empty if the program should continue. Otherwise help or an error was printed.
std::optional<samples::ExitStatus> readOptions(int argc, char** argv, Options& options);

}  // namespace dermis::viewer
