// The command line of dermis_crowd.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "crowd.h"

namespace crowd {

enum class ExitStatus : int {
  done = 0,
  verificationFailed = 1,
  wrongUsage = 2,
  badInput = 3,
  noDevice = 4,
  stopped = 5,  ///< output not writable, device lost, out of memory
};

/// One line on standard error: "dermis_crowd: error: …". Returns the status.
ExitStatus reportError(ExitStatus status, const std::string& message);

struct FilmRequest {
  std::string output;  ///< empty: there is no film
  std::uint32_t width = 1280, height = 720;
  double framesPerSecond = 30;
  double start = 0;  ///< seconds into the camera's flight
};

struct Options {
  std::uint32_t figures = 200;
  std::uint32_t frames = 120;
  std::string model = DERMIS_SAMPLE_FIGURE;
  std::string device = "auto";
  std::string policy = "refuse";
  std::string json;
  CrowdOptions crowd;
  FilmRequest film;
  bool verifies = true;
  std::uint32_t checkInterval = 10;  ///< frames from one that is compared to the next
  bool validates = false;            ///< with the validation layer
};

/// Nothing where the program is to go on.
std::optional<ExitStatus> readOptions(int argc, char** argv, Options& options);

}  // namespace crowd
