#include "options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>

#include "kit/file_name.h"
#include "kit/program.h"

namespace dermis::viewer {
namespace {

constexpr std::uint32_t largestSide = 16384;

std::string methodNames() {
  std::string names;
  for (const Method method : allMethods)
    names += (names.empty() ? "" : ", ") + std::string(methodName(method));
  return names;
}

std::optional<samples::ExitStatus> readMethod(const char* option, const std::string& name,
                                              std::optional<Method>& method) {
  if (name.empty()) return std::nullopt;
  method = methodFromName(name);
  if (method) return std::nullopt;
  return samples::reportWrongUsage(
      fmt::format("{}: there is no method '{}'; the methods are {}", option, name, methodNames()));
}

std::string sampleFigure() {
  std::error_code error;
  return std::filesystem::exists(DERMIS_SAMPLE_FIGURE, error) ? DERMIS_SAMPLE_FIGURE : "";
}

}  // namespace

std::optional<samples::ExitStatus> readOptions(int argc, char** argv, Options& options) {
  CLI::App app("Shows skinned models with every method of Dermis. F1 in the window shows the keys.",
               "dermis_viewer");
  app.footer(
      "Exit status: 0 success, 2 wrong usage, 3 bad input, 4 no usable device, 5 any other error.");
  std::string method, comparison;
  bool isEmpty = false;
  CLI::Option* model =
      app.add_option("MODEL", options.model, "A .gltf or .glb file [the sample figure]");
  CLI::Option* empty = app.add_flag("--empty", isEmpty, "Start without a model")->excludes(model);
  app.add_option("--method", method, methodNames() + " [dual_quaternion]");
  app.add_option("--compare", comparison, "A second method, to show side by side with the first");
  app.add_option("--animation", options.animation,
                 "A clip's number or name, or none for the rest pose [the first]")
      ->excludes(empty);
  app.add_option("--time", options.time, "Seconds into the clip [0]")->excludes(empty);
  app.add_flag("--paused", options.isPaused, "Start with the clip paused");
  app.add_option("--width", options.width, "Width of the window [1280]")
      ->check(CLI::Range(64u, largestSide));
  app.add_option("--height", options.height, "Height of the window [800]")
      ->check(CLI::Range(64u, largestSide));
  app.add_option("--device", options.device,
                 "auto, a number from 'dermis devices', or part of a name");
#ifdef DERMIS_RUNTIME_COMPILER
  CLI::Option* shaders = app.add_option(
      "--shaders", options.shaders,
      "Compile the kernels from this folder of GLSL, and again whenever a file changes");
  app.add_option("--shader-cache", options.shaderCache,
                 "Folder that keeps compiled kernels for the next run")
      ->needs(shaders);
#endif
  app.add_option("--frames", options.frames, "End after this number of frames");
  app.add_option("--screenshot", options.screenshot,
                 "Write the last picture of the window to a .png file");
  app.add_flag("--validation", options.validates,
               "Run with the Vulkan validation layer, and fail if it reports anything");
  if (const auto ended = samples::parseOptions(app, argc, argv)) return ended;
  std::optional<Method> first;
  if (const auto status = readMethod("--method", method, first)) return status;
  if (const auto status = readMethod("--compare", comparison, options.comparison)) return status;
  options.method = first.value_or(options.method);
  if (!std::isfinite(options.time))
    return samples::reportWrongUsage("--time must be a number of seconds");
  if (!options.screenshot.empty() && !samples::hasEnding(options.screenshot, ".png")) {
    return samples::reportWrongUsage(
        fmt::format("--screenshot must end in .png; it is '{}'", options.screenshot));
  }
  const samples::RequestedOutput screenshot{"--screenshot", options.screenshot};
  const std::filesystem::path input = options.model;
  if (Result<void> kept = samples::checkOutputFiles({&screenshot, 1}, {&input, 1}); !kept)
    return samples::reportWrongUsage(kept.error().message);
  if (options.model.empty() && !isEmpty) options.model = sampleFigure();
  return std::nullopt;
}

}  // namespace dermis::viewer
