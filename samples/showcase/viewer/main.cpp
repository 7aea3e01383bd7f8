// dermis_viewer: shows a skinned model in a window, with any method and its cost.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <filesystem>

#include "kit/file_name.h"
#include "kit/program.h"
#include "viewer.h"

#ifdef DERMIS_RUNTIME_COMPILER
#include "dermis/compilers.h"
#endif

namespace {

using namespace dermis;
using samples::ExitStatus;

/// The command line.
struct Options {
  viewer::ViewerOptions viewer;
  samples::DeviceOptions device;
  std::uint32_t width = 1280, height = 800;
  std::string shaders;  ///< folder of the kernels to compile; empty: those of the library
};

std::string methodNames() {
  std::string names;
  for (const Method method : allMethods)
    names += (names.empty() ? "" : ", ") + std::string(methodName(method));
  return names;
}

Method readMethod(const char* option, const std::string& name) {
  if (const std::optional<Method> method = methodFromName(name)) return *method;
  throw CLI::ValidationError(
      option, fmt::format("there is no method '{}'; the methods are {}", name, methodNames()));
}

/// Empty if the program should continue. Otherwise help or an error was printed.
std::optional<ExitStatus> readOptions(int argc, char** argv, Options& options) {
  CLI::App app("Shows skinned models with every method of Dermis. H in the window shows the keys.",
               "dermis_viewer");
  app.footer(
      "Exit status: 0 success, 2 wrong usage, 3 bad input, 4 no usable device, 5 any other error.");
  viewer::ViewerOptions& shown = options.viewer;
  app.add_option("MODEL", shown.model, "A .gltf or .glb file [none: drop one on the window]");
  app.add_option_function<std::string>(
      "--method", [&](const std::string& name) { shown.method = readMethod("--method", name); },
      methodNames() + " [dual_quaternion]");
  app.add_option_function<std::string>(
      "--compare",
      [&](const std::string& name) { shown.comparison = readMethod("--compare", name); },
      "A second method, to show side by side with the first");
  app.add_option("--time", shown.time, "Seconds into the clip [0]");
  app.add_flag("--paused", shown.isPaused, "Start with the clip paused");
  const CLI::Range sides(64u, 16384u);
  app.add_option("--width", options.width, "Width of the window [1280]")->check(sides);
  app.add_option("--height", options.height, "Height of the window [800]")->check(sides);
  app.add_option("--device", options.device.device,
                 "auto, a number from 'dermis devices', or part of a name");
#ifdef DERMIS_RUNTIME_COMPILER
  app.add_option("--shaders", options.shaders,
                 "Compile the kernels from this folder of GLSL, and again whenever a file changes");
#endif
  app.add_option("--frames", shown.frames, "End after this number of frames, or the first error");
  app.add_option("--screenshot", shown.screenshot,
                 "Write the last picture of the window to a .png file");
  app.add_flag("--validation", options.device.validation,
               "Run with the Vulkan validation layer, and fail if it reports anything");
  if (const auto ended = samples::parseOptions(app, argc, argv)) return ended;
  if (!std::isfinite(shown.time))
    return samples::reportWrongUsage("--time must be a number of seconds");
  if (!shown.screenshot.empty() && !samples::hasEnding(shown.screenshot, ".png")) {
    return samples::reportWrongUsage(
        fmt::format("--screenshot must end in .png; it is '{}'", shown.screenshot));
  }
  const samples::RequestedOutput screenshot{"--screenshot", shown.screenshot};
  const std::filesystem::path input = samples::pathOf(shown.model);
  if (Result<void> kept = samples::checkOutputFiles({&screenshot, 1}, {&input, 1}); !kept)
    return samples::reportWrongUsage(kept.error().message);
  return std::nullopt;
}

ExitStatus run(int argc, char** argv) {
  Options options;
  if (const auto ended = readOptions(argc, argv, options)) return *ended;
#ifdef DERMIS_RUNTIME_COMPILER
  std::optional<RuntimeCompiler> compiler;
  if (!options.shaders.empty()) {
    Result<RuntimeCompiler> made = RuntimeCompiler::create(samples::pathOf(options.shaders));
    if (!made) return samples::reportDeviceError(made.error());
    options.viewer.compiler = &compiler.emplace(std::move(*made));
    options.device.kernels = compiler->source();
  }
#endif
  const Result<std::unique_ptr<viewer::Window>> window =
      viewer::Window::open(options.width, options.height, options.device);
  if (!window) return samples::reportDeviceError(window.error());
  ExitStatus status = ExitStatus::done;
  {
    viewer::Viewer program(options.viewer, **window);
    const Result<ExitStatus> done = program.run();
    status = done ? *done : samples::reportError(ExitStatus::stopped, done.error().message);
  }
  // Messages of the validation layer make the program fail.
  for (const std::string& message : (*window)->device().device->takeValidationMessages())
    status = samples::reportError(ExitStatus::stopped, message);
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  return samples::runProgram("dermis_viewer", argc, argv, run);
}
