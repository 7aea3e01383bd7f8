// The command line of dermis_crowd.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "crowd.h"
#include "kit/exit_status.h"

namespace crowd {

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
  std::string json;
  CrowdOptions crowd;
  FilmRequest film;
  bool verifies = true;
  std::uint32_t checkInterval = 10;  ///< every N-th frame is compared
  bool validates = false;            ///< with the validation layer
};

/// Fails with `invalidArgument` if an output would overwrite one of these input files.
dermis::Result<void> checkOutputFiles(const Options& options,
                                      std::span<const std::filesystem::path> inputs);

/// Empty if the program should continue.
std::optional<dermis::samples::ExitStatus> readOptions(int argc, char** argv, Options& options);

}  // namespace crowd
