#include "options.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <filesystem>
#include <utility>

#include "kit/file_name.h"
#include "kit/program.h"
#include "kit/render/picture_writer.h"

using namespace dermis;

namespace crowd {
namespace {

constexpr std::uint32_t mostFigures = 100'000, mostFrames = 1'000'000, mostFramesInFlight = 16;
constexpr std::uint32_t mostMebibytes = 1u << 20;

constexpr std::uint32_t smallestSide = 64, largestSide = 16384;
constexpr double mostFramesPerSecond = 240, latestStart = 1e6;

/// What is wrong with the options of the film; empty if nothing is.
std::string complaintAbout(const FilmRequest& film, bool hasFrames) {
  const std::optional<samples::PictureKind> kind = samples::pictureKind(film.output);
  if (!kind)
    return fmt::format("--film must end in .mp4, .gif, .apng or .png; it is '{}'", film.output);
  for (const std::uint32_t side : {film.width, film.height}) {
    if (side < smallestSide || side > largestSide) {
      return fmt::format("--width and --height must be from {} to {} pixels", smallestSide,
                         largestSide);
    }
  }
  if (!(film.framesPerSecond >= 1 && film.framesPerSecond <= mostFramesPerSecond))
    return fmt::format("--fps must be from 1 to {}", mostFramesPerSecond);
  if (!(film.start >= 0 && film.start <= latestStart))
    return fmt::format("--time must be from 0 to {} seconds", latestStart);
  if (*kind != samples::PictureKind::png) return {};
  if (samples::hasWrongPattern(film.output))
    return "--film may have one placeholder for a number, from %01d to %09d";
  if (hasFrames && !samples::frameName(film.output, 0)) {
    return "--frames needs a placeholder for the number in --film, such as frame%04d.png, or a "
           "film: .mp4, .gif or .apng";
  }
  return {};
}

/// Adds the options of the film. Each of them needs --film.
void addFilm(CLI::App& app, FilmRequest& film) {
  CLI::Option* output = app.add_option(
      "--film", film.output,
      "Draw the crowd as a film (.mp4, .gif or .apng, with ffmpeg), as numbered pictures "
      "(frame%04d.png), or as one picture (.png)");
  app.add_option("--width", film.width, "Width of the film in pixels [1280]")->needs(output);
  app.add_option("--height", film.height, "Height of the film in pixels [720]")->needs(output);
  app.add_option("--fps", film.framesPerSecond, "Pictures per second [30]")->needs(output);
  app.add_option("--time", film.start,
                 "Start, in seconds of the camera flight, which takes 24 s [0]")
      ->needs(output);
}

}  // namespace

Result<void> checkOutputFiles(const Options& options,
                              std::span<const std::filesystem::path> inputs) {
  const std::array<samples::RequestedOutput, 2> outputs{
      {{"--film", options.film.output, options.frames}, {"--json", options.json}}};
  return samples::checkOutputFiles(outputs, inputs);
}

std::optional<samples::ExitStatus> readOptions(int argc, char** argv, Options& options) {
  CLI::App app("Skins a crowd with a SkinningSystem, and compares its vertices with the reference.",
               "dermis_crowd");
  app.footer(samples::exitStatusHelp);
  bool skipsVerification = false;
  std::uint32_t outputMebibytes = 0;
  app.add_option("--figures", options.figures, "Number of figures [200]")
      ->check(CLI::Range(1u, mostFigures));
  const CLI::Option* frames =
      app.add_option("--frames", options.frames, "Number of frames [120; for one picture 1]")
          ->check(CLI::Range(1u, mostFrames));
  app.add_option("--model", options.model, "A .gltf or .glb file [the sample figure]");
  app.add_option("--device", options.device,
                 "auto, cpu (without Vulkan), a number from 'dermis devices', or part of a name");
  const CLI::Option* inFlight = app.add_option("--frames-in-flight", options.crowd.framesInFlight,
                                               "Maximum frames in flight [3]")
                                    ->check(CLI::Range(1u, mostFramesInFlight));
  app.add_option(
         "--output-budget", outputMebibytes,
         "Memory for skinned vertices in MiB; figures that do not fit are added later [enough "
         "for all]")
      ->check(CLI::Range(1u, mostMebibytes));
  app.add_option("--json", options.json, "Write the results to a file as JSON");
  app.add_option("--check-every", options.checkInterval,
                 "Compare all vertices of every N-th frame and of the last frame [10]")
      ->check(CLI::Range(1u, mostFrames));
  app.add_flag("--no-verify", skipsVerification, "Do not compare; for measurements");
  app.add_flag("--gpu-culling", options.crowd.culledOnGpu,
               "Let the GPU decide which instances are visible");
  addFilm(app, options.film);
  app.add_flag("--validate", options.validates, "Run with the Vulkan validation layer");
  if (const auto ended = samples::parseOptions(app, argc, argv)) return ended;
  if (options.device == "cpu") {
    for (const auto& [isAsked, name] : {std::pair{!options.film.output.empty(), "--film"},
                                        {options.crowd.culledOnGpu, "--gpu-culling"},
                                        {inFlight->count() != 0, "--frames-in-flight"},
                                        {options.validates, "--validate"}}) {
      if (isAsked) {
        return samples::reportWrongUsage(
            fmt::format("{} needs a Vulkan device; --device cpu is not one", name));
      }
    }
  }
  if (!options.film.output.empty()) {
    const std::string complaint = complaintAbout(options.film, frames->count() != 0);
    if (!complaint.empty()) return samples::reportWrongUsage(complaint);
    const bool isOnePicture =
        samples::pictureKind(options.film.output) == samples::PictureKind::png &&
        !samples::frameName(options.film.output, 0);
    if (isOnePicture) options.frames = 1;
  }
  const std::filesystem::path model = options.model;
  if (Result<void> kept = checkOutputFiles(options, {&model, 1}); !kept)
    return samples::reportWrongUsage(kept.error().message);
  options.verifies = !skipsVerification;
  options.crowd.outputBudget = std::uint64_t{outputMebibytes} << 20;
  return std::nullopt;
}

}  // namespace crowd
