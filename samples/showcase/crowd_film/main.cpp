// A film of a crowd: figures stand and wave, others walk around them in rings, and a camera flies
// over and through them. It draws straight from the output buffer of a SceneRecorder, in the
// command buffer that skinned it. Figures in the distance are skinned less often, figures out of
// the picture not at all.
//
//   dermis_crowd_film -o crowd.mp4 --figures 1000 --frames 720
//   dermis_crowd_film -o frame.png --time 9

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/trigonometric.hpp>

#include "dermis/vulkan/scene_recorder.h"
#include "gait.h"
#include "kit/character.h"
#include "kit/device.h"
#include "kit/file_name.h"
#include "kit/frame_loop.h"
#include "kit/program.h"
#include "kit/render/appearances.h"
#include "kit/render/draw.h"
#include "kit/render/picture.h"
#include "kit/render/renderer.h"
#include "stroll.h"
#include "wardrobe.h"

namespace {

using namespace dermis;
using namespace crowd_film;
using samples::Character;
using samples::ExitStatus;
using samples::must;
using samples::Part;
namespace render = samples::render;

constexpr std::uint32_t framesInFlight = 3;
/// Height of a figure in units of the flight plan.
constexpr double figureHeight = 1.75;
/// Direction of the sun in degrees. It does not move with the camera.
constexpr float sunAzimuth = 205, sunElevation = 38;

struct Options {
  std::string output;
  std::uint32_t frames = 0;
  StrollOptions stroll;
  std::string model = DERMIS_SAMPLE_FIGURE;
  std::string device = "auto";
  bool validates = false;  ///< with the validation layer
};

/// The figures, skinned. All of them are there in all frames.
class SkinnedCrowd {
 public:
  SkinnedCrowd(vulkan::Context& context, const Character& character, const Stroll& stroll)
      : context_(&context),
        character_(&character),
        stroll_(&stroll),
        recorder_(create(context, character, stroll)) {
    const ClipsHandle clips = must(recorder_.scene().addClips(
        must(packClips(character.skeleton(), gltf::clips(character.model())))));
    std::vector<MeshHandle> meshes;
    for (const Part& part : character.parts())
      meshes.push_back(must(recorder_.scene().addMesh(part.packed)));
    for (std::uint32_t index = 0; index < stroll.count(); ++index) {
      Figure& figure = figures_.emplace_back();
      figure.handle = must(recorder_.scene().addFigure(clips));
      for (std::size_t part = 0; part < meshes.size(); ++part) {
        InstanceDescription description = describe(character.parts()[part]);
        description.mesh = meshes[part];
        description.pose =
            must(recorder_.scene().pose(figure.handle, character.parts()[part].skin));
        if (index == 0) must(recorder_.prepare(description));
        figure.instances.push_back(must(recorder_.scene().addInstance(description)));
      }
    }
  }

  void skinFrame(std::uint64_t frame, std::uint64_t completedFrame, VkCommandBuffer commandBuffer) {
    must(recorder_.scene().beginFrame(frame, completedFrame));
    std::vector<InstanceVisibility> visibility;
    for (std::uint32_t index = 0; index < figures_.size(); ++index) {
      Figure& figure = figures_[index];
      figure.now = stroll_->at(index, frame);
      for (const InstanceHandle instance : figure.instances)
        visibility.push_back({instance, figure.now.isInView, figure.now.updateInterval});
    }
    must(recorder_.scene().setVisibility(visibility));
    std::vector<ClipLayer> layers;
    std::vector<FigurePlay> plays;
    layers.reserve(2 * figures_.size());  // plays point to them
    for (const Figure& figure : figures_) {
      const std::size_t first = layers.size();
      character_->addLayers(figure.now.playing, layers);
      plays.push_back({figure.handle, std::span(layers).subspan(first)});
    }
    must(recorder_.scene().play(plays));
    context_->recordBarrier(commandBuffer, Use::vertexInput, Use::dermis);
    must(recorder_.record(commandBuffer));
    context_->recordBarrier(commandBuffer, Use::dermis, Use::vertexInput);
  }

  /// The figures in the picture. Near ones are first, so that hidden ones are not shaded.
  std::vector<std::uint32_t> nearestFirst() const {
    std::vector<std::uint32_t> seen;
    for (std::uint32_t index = 0; index < figures_.size(); ++index) {
      if (figures_[index].now.isInView) seen.push_back(index);
    }
    std::ranges::stable_sort(seen, {},
                             [this](std::uint32_t index) { return figures_[index].now.distance; });
    return seen;
  }

  /// What draws the vertices of a part of a figure.
  render::Draw draw(std::uint32_t figure, std::uint32_t part) const {
    const InstanceOutput output = must(recorder_.scene().output(figures_[figure].instances[part]));
    const auto stream = [&](const OutputAttribute& attribute) -> render::VertexStream {
      return {recorder_.outputBuffer(), attribute.offset, attribute.stride, attribute.format};
    };
    render::Draw draw;
    draw.positions = stream(output.places[Stream::positions]);
    if (output.places[Stream::normals].format != VertexFormat::none)
      draw.normals = stream(output.places[Stream::normals]);
    draw.transform = figures_[figure].now.place;
    return draw;
  }

 private:
  struct Figure {
    FigureHandle handle;
    std::vector<InstanceHandle> instances;  ///< by part
    FigureState now;
  };

  static InstanceDescription describe(const Part& part) {
    InstanceDescription description;
    description.layout.positions = VertexFormat::float32x3;
    if (part.packed.info().hasNormals) description.layout.normals = VertexFormat::octahedral16x2;
    return description;
  }

  static vulkan::SceneRecorder create(vulkan::Context& context, const Character& character,
                                      const Stroll& stroll) {
    vulkan::SceneRecorderDescription description;
    description.scene.framesInFlight = framesInFlight;
    description.scene.instanceCapacity.initial = stroll.count() * character.parts().size();
    std::uint64_t joints = 0, outputBytes = 0;
    for (const std::uint32_t count : character.jointCounts()) joints += count;
    for (const Part& part : character.parts())
      outputBytes += must(placeVertices(describe(part).layout, part.packed.vertexCount())).size;
    description.scene.gpuJointCapacity.initial = stroll.count() * joints;
    description.scene.outputCapacity.initial = stroll.count() * outputBytes;
    return must(vulkan::SceneRecorder::create(context, description));
  }

  const vulkan::Context* context_;
  const Character* character_;
  const Stroll* stroll_;
  vulkan::SceneRecorder recorder_;
  std::vector<Figure> figures_;
};

/// Draws the crowd, dressed, in the light of the sun and the sky.
class Painter {
 public:
  Painter(samples::Device& device, const Character& character, const Stroll& stroll,
          const StrollOptions& options)
      : device_(&device),
        stroll_(&stroll),
        width_(options.width),
        height_(options.height),
        wardrobe_(character),
        renderer_(must(render::Renderer::create(device))),
        appearances_(device, renderer_, character.model()),
        isMirrored_(samples::render::isMirrored(character.pose({}, 0))) {
    std::uint64_t triangles = 0;
    for (const Part& part : character.parts()) {
      triangles += part.source->triangles.size() / 3 * stroll.count();
      parts_.push_back(
          {must(appearances_.geometry(*part.source)), must(appearances_.surface(*part.source))});
    }
    for (const std::string& note : appearances_.notes()) samples::reportNote(note);
    render::FrameDescription description{width_, height_, 1, {}};
    // The maps are large, since the figures in a picture are small. Each map draws everything
    // again, so larger crowds get fewer maps for the light of the sky.
    description.shadows.keyMap = 4096;
    description.shadows.skyMap = 2048;
    description.shadows.skyLights = static_cast<std::uint32_t>(
        std::clamp(2e8 / static_cast<double>(std::max<std::uint64_t>(triangles, 1)), 8.0, 24.0));
    for (std::uint32_t index = 0; index < framesInFlight; ++index)
      frames_.push_back(must(renderer_.createFrame(description)));
  }

  /// Records the picture, after `SkinnedCrowd::skinFrame`.
  void record(const SkinnedCrowd& crowd, std::uint64_t frame, VkCommandBuffer commandBuffer) {
    const std::vector<std::uint32_t> figures = crowd.nearestFirst();
    std::vector<render::Draw> draws;
    for (std::uint32_t part = 0; part < parts_.size(); ++part) {
      for (const std::uint32_t figure : figures) {
        render::Draw& draw = draws.emplace_back(crowd.draw(figure, part));
        draw.geometry = parts_[part].geometry;
        draw.surface = parts_[part].surface;
        const glm::vec3 tint = wardrobe_.tint(figure, part);
        for (int i = 0; i < 3; ++i) draw.surface.baseColor[static_cast<std::size_t>(i)] *= tint[i];
        draw.isMirrored = isMirrored_;
      }
    }
    render::View view = viewAt(frame);
    view.draws = draws;
    render::RenderFrame& target = frames_[frame % framesInFlight];
    must(renderer_.record(commandBuffer, target, {&view, 1}));
    target.target().recordReadBack(*device_, commandBuffer);
  }

  /// The picture of a frame that the GPU has completed, one of the last in flight.
  render::Picture picture(std::uint64_t frame) const {
    return {width_, height_, frames_[frame % framesInFlight].target().pixels()};
  }

 private:
  struct DressedPart {
    const render::Geometry* geometry = nullptr;
    render::Surface surface;
  };

  render::View viewAt(std::uint64_t frame) const {
    const FlightPlan& plan = stroll_->flight().plan();
    render::View view;
    view.area.extent = {width_, height_};
    view.camera = stroll_->flight().camera(stroll_->eye(frame));
    // A box around the whole crowd in all frames, so that shadows do not crawl.
    const auto side = static_cast<float>(plan.crowdRadius + plan.unit);
    view.casters = {{-side, 0, -side},
                    {side, static_cast<float>(1.3 * figureHeight * plan.unit), side}};
    // The haze begins half a radius in front of this distance.
    view.camera.distance =
        0.5f * render::radiusOf(view.casters) + static_cast<float>(5 * plan.unit);
    view.style.keyAzimuth =
        sunAzimuth - glm::degrees(std::atan2(view.camera.towardsEye.x, view.camera.towardsEye.z));
    view.style.keyElevation = sunElevation;
    view.style.haze = 0.55f;
    view.style.horizonColor = {0.64f, 0.605f, 0.55f};
    view.style.zenithColor = {0.26f, 0.33f, 0.42f};
    // Slightly below the soles, because flat soles would otherwise coincide with the ground.
    view.groundHeight = static_cast<float>(-0.004 * plan.unit);
    view.groundRadius = static_cast<float>(3 * plan.crowdRadius);
    return view;
  }

  samples::Device* device_;
  const Stroll* stroll_;
  std::uint32_t width_, height_;
  Wardrobe wardrobe_;
  render::Renderer renderer_;
  samples::Appearances appearances_;
  bool isMirrored_;
  std::vector<DressedPart> parts_;
  std::vector<render::RenderFrame> frames_;  ///< one for each frame in flight
};

void film(samples::OpenDevice& open, const Character& character, const Stroll& stroll,
          const Options& options, samples::render::PictureWriter& writer) {
  SkinnedCrowd crowd(open.context, character, stroll);
  Painter painter(*open.device, character, stroll, options.stroll);
  samples::Progress progress("rendering", options.frames);
  samples::FrameLoop loop(*open.device, framesInFlight);  // destroyed first: it waits for frames
  std::uint64_t written = 0;
  const auto writeUpTo = [&](std::uint64_t completedFrame) {
    while (written < completedFrame) {
      must(writer.write(painter.picture(++written)));
      progress.step();
    }
  };
  for (std::uint64_t frame = 1; frame <= options.frames; ++frame) {
    const VkCommandBuffer commandBuffer = must(loop.begin());
    writeUpTo(loop.completed());
    crowd.skinFrame(frame, loop.completed(), commandBuffer);
    painter.record(crowd, frame, commandBuffer);
    must(loop.submit());
  }
  must(loop.finish());
  writeUpTo(loop.completed());
  must(writer.finish());
}

/// What is wrong with the options; empty if nothing is.
std::string complaintAbout(const Options& options) {
  const std::optional<samples::render::PictureKind> kind =
      samples::render::pictureKind(options.output);
  if (!kind) {
    return fmt::format("--output must end in .mp4, .gif, .apng or .png; it is '{}'",
                       options.output);
  }
  // CLI::Range lets NaN pass.
  const double framesPerSecond = options.stroll.framesPerSecond, start = options.stroll.start;
  if (!(framesPerSecond >= 1 && framesPerSecond <= 240)) return "--fps must be from 1 to 240";
  if (!(start >= 0 && start <= 1e6)) return "--time must be from 0 to 1000000 seconds";
  if (*kind != samples::render::PictureKind::png) return {};
  if (samples::hasWrongPattern(options.output))
    return "--output may have one placeholder for a number, from %01d to %09d";
  if (options.frames > 1 && !samples::frameName(options.output, 0)) {
    return "--frames needs a placeholder for the number in --output, such as frame%04d.png, or a "
           "film: .mp4, .gif or .apng";
  }
  return {};
}

/// Empty if the program should continue.
std::optional<ExitStatus> readOptions(int argc, char** argv, Options& options) {
  CLI::App app(
      "Draws a film of a crowd that walks, stands and waves, from a camera that flies "
      "over it and through it.",
      "dermis_crowd_film");
  app.footer(samples::exitStatusHelp);
  StrollOptions& stroll = options.stroll;
  app.add_option("-o,--output", options.output,
                 "The film (.mp4, .gif or .apng, with ffmpeg), numbered pictures (frame%04d.png), "
                 "or one picture (.png)")
      ->required();
  app.add_option("--figures", stroll.figures, "Number of figures [1000]")
      ->check(CLI::Range(1u, 100'000u));
  app.add_option("--frames", options.frames, "Number of pictures [1 for .png, or else one flight]")
      ->check(CLI::Range(1u, 1'000'000u));
  app.add_option("--fps", stroll.framesPerSecond, "Pictures per second [30]");
  app.add_option("--time", stroll.start,
                 "Start, in seconds of the camera flight, which takes 24 s [0]");
  app.add_option("--width", stroll.width, "Width in pixels [1280]")->check(CLI::Range(64u, 16384u));
  app.add_option("--height", stroll.height, "Height in pixels [720]")
      ->check(CLI::Range(64u, 16384u));
  app.add_option("--model", options.model, "A .gltf or .glb file [the sample figure]");
  app.add_option("--device", options.device,
                 "auto, a number from 'dermis devices', or part of a name");
  app.add_flag("--validate", options.validates, "Run with the Vulkan validation layer");
  if (const auto ended = samples::parseOptions(app, argc, argv)) return ended;
  const std::string complaint = complaintAbout(options);
  if (!complaint.empty()) return samples::reportWrongUsage(complaint);
  if (options.frames == 0) {
    const bool isOnePicture =
        samples::render::pictureKind(options.output) == samples::render::PictureKind::png &&
        !samples::frameName(options.output, 0);
    options.frames =
        isOnePicture
            ? 1
            : static_cast<std::uint32_t>(std::lround(Flight::seconds * stroll.framesPerSecond));
  }
  return std::nullopt;
}

Result<std::unique_ptr<samples::render::PictureWriter>> openWriter(const Options& options) {
  const samples::render::PictureKind kind = *samples::render::pictureKind(options.output);
  if (kind == samples::render::PictureKind::png) return samples::render::writePngs(options.output);
  return samples::render::writeFilm(options.output, kind, options.stroll.width,
                                    options.stroll.height, options.stroll.framesPerSecond);
}

ExitStatus run(int argc, char** argv) {
  Options options;
  if (const auto ended = readOptions(argc, argv, options)) return *ended;
  // Ticks are the frames of the film, so that feet do not slide on the ground.
  constexpr double maxClipSeconds = 20;
  samples::CharacterOptions characterOptions;
  characterOptions.ticksPerSecond = options.stroll.framesPerSecond;
  characterOptions.maxTicks =
      static_cast<std::uint32_t>(maxClipSeconds * options.stroll.framesPerSecond);
  characterOptions.images = true;
  const std::filesystem::path model = samples::pathOf(options.model);
  const Result<Character> character = Character::load(model, characterOptions);
  if (!character) return samples::reportModelError(character.error());
  std::vector<std::filesystem::path> inputs = character->model().sideFiles;
  inputs.push_back(model);
  const std::array<samples::RequestedOutput, 1> outputs{
      {{"--output", options.output, options.frames}}};
  if (const Result<void> kept = samples::checkOutputFiles(outputs, inputs); !kept)
    return samples::reportWrongUsage(kept.error().message);
  const Result<std::unique_ptr<samples::render::PictureWriter>> writer = openWriter(options);
  if (!writer) return samples::reportError(ExitStatus::stopped, writer.error().message);

  samples::DeviceOptions wanted;
  wanted.device = options.device;
  wanted.validation = options.validates;
  wanted.graphics = true;
  try {
    const Gait gait = measureGait(*character);
    const Stroll stroll(*character, gait, options.stroll);
    samples::OpenDevice open = must(samples::openDevice(wanted));
    film(open, *character, stroll, options, **writer);
    const std::vector<std::string> messages = open.device->takeValidationMessages();
    if (messages.empty()) return ExitStatus::done;
    return samples::reportError(ExitStatus::verificationFailed,
                                "the validation layer says: " + messages.front());
  } catch (const samples::Failure& failure) {
    return samples::reportDeviceError(failure.error());
  }
}

}  // namespace

int main(int argc, char** argv) {
  return samples::runProgram("dermis_crowd_film", argc, argv, run);
}
