#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <functional>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "commands.h"
#include "crowd.h"
#include "drawn_scene.h"
#include "kit/batch_runner.h"
#include "kit/buffer.h"
#include "kit/device.h"
#include "kit/file_name.h"
#include "kit/program.h"
#include "kit/render/picture.h"
#include "method_options.h"
#include "skinned_scene.h"

namespace dermis::cli {
namespace {

/// Reports the progress of the device in one long submission.
class PassCounter {
 public:
  /// `device` must outlive it.
  static Result<PassCounter> create(samples::Device& device, std::uint32_t passes);

  /// Record this between two passes: it marks one more pass as done.
  void record(VkCommandBuffer commandBuffer);

  /// Submits and waits. Calls `onPass` for each completed pass, at about the time when it
  /// completes. Fails with `vulkanError`.
  Result<void> submitAndWait(VkCommandBuffer commandBuffer,
                             const std::function<void()>& onPass) const;

 private:
  Result<void> wait(VkFence fence, const std::function<void()>& onPass) const;

  samples::Device* device_ = nullptr;
  samples::MappedBuffer words_;  ///< one per pass; not 0 when it is done
  std::uint32_t passes_ = 0, recorded_ = 0;
};

constexpr std::uint64_t pollInterval = 100'000'000;  // nanoseconds

Result<PassCounter> PassCounter::create(samples::Device& device, std::uint32_t passes) {
  PassCounter counter;
  counter.device_ = &device;
  counter.passes_ = passes;
  Result<samples::MappedBuffer> words =
      samples::MappedBuffer::create(device, std::uint64_t{passes} * sizeof(std::uint32_t),
                                    VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  if (!words) return words.error();
  counter.words_ = std::move(*words);
  std::ranges::fill(counter.words_.bytes(), std::byte{0});
  return counter;
}

void PassCounter::record(VkCommandBuffer commandBuffer) {
  if (recorded_ == passes_) return;
  const VkDeviceSize offset = std::uint64_t{recorded_++} * sizeof(std::uint32_t);
  device_->functions().CmdFillBuffer(commandBuffer, words_.handle(), offset, sizeof(std::uint32_t),
                                     1);
}

Result<void> PassCounter::wait(VkFence fence, const std::function<void()>& onPass) const {
  std::uint32_t told = 0;
  VkResult result = VK_TIMEOUT;
  while (result == VK_TIMEOUT) {
    result =
        device_->functions().WaitForFences(device_->handle(), 1, &fence, VK_TRUE, pollInterval);
    // A value read before the fence may be outdated; then a pass is only reported a moment later.
    for (; told < recorded_; ++told) {
      std::uint32_t word = 0;
      std::memcpy(&word, words_.bytes().data() + std::size_t{told} * sizeof(word), sizeof(word));
      if (word == 0 && result != VK_SUCCESS) break;
      onPass();
    }
  }
  return samples::checkVulkan("drawing", result);
}

Result<void> PassCounter::submitAndWait(VkCommandBuffer commandBuffer,
                                        const std::function<void()>& onPass) const {
  const samples::VulkanFunctions& functions = device_->functions();
  VkFenceCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_FENCE_CREATE_INFO;
  VkFence fence = VK_NULL_HANDLE;
  Result<void> done = samples::checkVulkan(
      "drawing", functions.CreateFence(device_->handle(), &info, nullptr, &fence));
  if (!done) return done;
  VkSubmitInfo submit{};
  submit.sType = VK_STRUCTURE_TYPE_SUBMIT_INFO;
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commandBuffer;
  done =
      samples::checkVulkan("drawing", functions.QueueSubmit(device_->queue(), 1, &submit, fence));
  if (done) done = wait(fence, onPass);
  functions.DestroyFence(device_->handle(), fence, nullptr);
  return done;
}

namespace render = samples::render;
using samples::Progress;
using samples::render::PictureKind;
using samples::render::PictureWriter;

struct RenderOptions {
  std::string model;
  std::string output;
  std::vector<std::string> clips;
  std::string rig;
  std::optional<std::string> animation;
  double time = 0;
  std::optional<std::uint32_t> frames;
  double framesPerSecond = 30;
  std::uint32_t instances = 1;
  std::string method = std::string(methodName(Method::dualQuaternion));
  MethodShares shares;
  std::uint32_t width = 1280, height = 720;
  bool isOrthographic = false;
  std::optional<double> azimuth, elevation;
  std::string device = "auto";
  bool strict = false;
};

constexpr std::uint32_t largestSide = 16384;
constexpr std::uint32_t mostDrawnInstances = 100'000;

ExitStatus checkNumbers(const RenderOptions& options) {
  if (!std::isfinite(options.time)) return reportWrongUsage("--time must be a number of seconds");
  if (!(options.framesPerSecond > 0) || !std::isfinite(options.framesPerSecond))
    return reportWrongUsage("--fps must be a number above 0");
  if (options.frames && *options.frames == 0)
    return reportWrongUsage("--frames must be at least 1");
  if (options.instances == 0 || options.instances > mostDrawnInstances)
    return reportWrongUsage(fmt::format("--instances must be from 1 to {}", mostDrawnInstances));
  for (const std::uint32_t side : {options.width, options.height}) {
    if (side < 16 || side > largestSide)
      return reportWrongUsage(
          fmt::format("--width and --height must be from 16 to {} pixels", largestSide));
  }
  if (!std::isfinite(options.azimuth.value_or(0)))
    return reportWrongUsage("--azimuth must be a number of degrees");
  if (!(std::abs(options.elevation.value_or(0)) <= 90))
    return reportWrongUsage("--elevation must be from -90 to 90 degrees");
  return checkShares(options.shares);
}

ExitStatus checkUsage(const RenderOptions& options) {
  const std::optional<PictureKind> kind = samples::render::pictureKind(options.output);
  if (!kind) {
    return reportWrongUsage(
        fmt::format("-o OUT must end in .png, .mp4, .gif or .apng; it is '{}'", options.output));
  }
  if (!methodFromName(options.method)) {
    return reportWrongUsage(fmt::format("--method: there is no method '{}'; the methods are {}",
                                        options.method, methodNames("and")));
  }
  if (samples::needsNoVulkan(options.device)) {
    return reportWrongUsage(fmt::format(
        "--device {} cannot draw; use a Vulkan device, such as lavapipe ('dermis devices')",
        options.device));
  }
  if (const ExitStatus numbers = checkNumbers(options); numbers != ExitStatus::done) return numbers;
  if (*kind != PictureKind::png)
    return options.frames ? ExitStatus::done : reportWrongUsage("a film needs --frames");
  if (samples::hasWrongPattern(options.output))
    return reportWrongUsage("-o OUT may have one placeholder for a number, from %01d to %09d");
  const bool pattern = samples::frameName(options.output, 0).has_value();
  if (options.frames && !pattern) {
    return reportWrongUsage(
        "--frames needs a placeholder for the number in -o OUT, such as frame%04d.png, or a film: "
        ".mp4, .gif or .apng");
  }
  if (!options.frames && pattern)
    return reportWrongUsage("-o OUT has a placeholder for a number, so --frames is required");
  return ExitStatus::done;
}

/// Renders the pictures of a scene.
class Film {
 public:
  Film(const RenderOptions& options, const Scene& scene, std::uint32_t clip,
       samples::OpenDevice& device)
      : options_(options),
        scene_(scene),
        device_(device),
        roles_(castCrowd(*scene.model, clip, !options.animation, options.instances)) {}

  Result<void> prepare();
  Result<render::Picture> draw(double time);

 private:
  Result<void> skin();
  Result<void> skinAndDraw();
  Result<void> look(const Role& role, double time, std::optional<Box>& around);
  Result<std::optional<Box>> lookThrough(const Role& role, std::uint32_t poses);
  Result<void> frameFigures();
  render::CameraOptions cameraOptions() const;
  render::ShadowSizes shadowSizes() const;
  double timeOf(const Role& role, double time) const;

  const RenderOptions& options_;
  const Scene& scene_;
  samples::OpenDevice& device_;
  std::vector<Role> roles_;
  std::optional<render::Renderer> renderer_;
  std::optional<DrawnScene> drawn_;
  std::optional<render::RenderFrame> frame_;
  std::vector<JointMatrix> places_;
  render::View view_;
};

/// A still shows the requested time; in crowds and films the clip repeats.
double Film::timeOf(const Role& role, double time) const {
  return options_.frames || roles_.size() > 1 ? timeInClip(*scene_.model, role, time) : time;
}

Result<void> Film::prepare() {
  Result<render::Renderer> renderer = render::Renderer::create(*device_.device);
  if (!renderer) return renderer.error();
  renderer_.emplace(std::move(*renderer));
  Result<DrawnScene> drawn = DrawnScene::create(device_, *renderer_, scene_, options_.instances,
                                                *methodFromName(options_.method));
  if (!drawn) return drawn.error();
  drawn_.emplace(std::move(*drawn));
  for (const std::string& note : drawn_->notes()) reportNote(note);
  if (Result<void> framed = frameFigures(); !framed) return framed;
  render::FrameDescription description;
  description.width = options_.width;
  description.height = options_.height;
  description.shadows = shadowSizes();
  Result<render::RenderFrame> frame = renderer_->createFrame(description);
  if (!frame) return frame.error();
  frame_.emplace(std::move(*frame));
  return {};
}

/// Each shadow map draws everything again. Large crowds get fewer shadow maps with higher
/// resolution, since their figures are small.
render::ShadowSizes Film::shadowSizes() const {
  double triangles = 0;
  for (const ScenePart& part : scene_.parts)
    triangles += static_cast<double>(part.primitive->triangles.size()) / 3;
  triangles *= options_.instances;
  render::ShadowSizes sizes;
  sizes.skyLights =
      static_cast<std::uint32_t>(std::clamp(4e7 / std::max(triangles, 1.0), 3.0, 28.0));
  if (options_.instances > 3) sizes.skyMap = 512;
  if (options_.instances > 20) {
    sizes.keyMap = 4096;
    sizes.skyMap = 1024;
  }
  return sizes;
}

/// Poses the first figure and extends the box to contain it.
Result<void> Film::look(const Role& role, double time, std::optional<Box>& around) {
  if (Result<void> begun = drawn_->beginFrame(); !begun) return begun;
  if (Result<void> posed = drawn_->setPose(0, scenePose(scene_, role.clip, time)); !posed)
    return posed;
  if (Result<void> done = skin(); !done) return done;
  if (Result<void> begun = drawn_->beginFrame(); !begun) return begun;
  const Result<std::optional<Box>> box = drawn_->bounds(0);
  if (!box) return box.error();
  if (!*box) return {};
  around = around ? render::unite(std::vector<Box>{*around, **box}) : *box;
  return {};
}

/// The box around the figure over a whole clip.
Result<std::optional<Box>> Film::lookThrough(const Role& role, std::uint32_t poses) {
  std::optional<Box> around;
  const double duration =
      role.clip < scene_.model->clips.size() ? scene_.model->clips[role.clip].duration : 0;
  const std::uint32_t count = duration > 0 ? poses : 1;
  for (std::uint32_t pose = 0; pose < count; ++pose) {
    if (Result<void> done = look(role, duration * pose / count, around); !done) return done.error();
  }
  return around;
}

/// For a crowd, the camera is higher and nearer, so that the last rows are visible and the first
/// rows are large.
render::CameraOptions Film::cameraOptions() const {
  const bool isCrowd = options_.instances > 1;
  render::CameraOptions camera;
  camera.isOrthographic = options_.isOrthographic;
  camera.azimuth = options_.azimuth.value_or(isCrowd ? 20 : 30);
  camera.elevation = options_.elevation.value_or(isCrowd ? 18 : 12);
  if (isCrowd) {
    camera.fieldOfView = 42;
    camera.margin = 0.04;
  }
  return camera;
}

/// The ground is at the lowest point of the clip, so that no foot goes through it. If the pose of a
/// still is only slightly above that point, the ground is at the lowest point of the pose. It is
/// lowered a little, because a flat sole would otherwise coincide with it.
float groundUnder(const Box& pose, const Box& extent) {
  const float height = extent.max[1] - extent.min[1];
  const bool hovers = pose.min[1] - extent.min[1] < 0.04f * height;
  return (hovers ? pose.min[1] : extent.min[1]) - 1e-3f * render::radiusOf(extent);
}

Result<void> Film::frameFigures() {
  const Error nothing{ErrorCode::invalidData, "there is nothing to draw: no vertex is finite"};
  const std::uint32_t poses = 24;
  std::optional<Box> extent;
  std::set<std::uint32_t> clips;
  for (const Role& role : roles_) {
    if (!clips.insert(role.clip).second) continue;
    const Result<std::optional<Box>> box = lookThrough(role, poses);
    if (!box) return box.error();
    if (*box) extent = extent ? render::unite(std::vector<Box>{*extent, **box}) : **box;
  }
  std::optional<Box> pose;
  const bool isStill = !options_.frames && roles_.size() == 1;
  if (isStill) {
    if (Result<void> done = look(roles_[0], options_.time, pose); !done) return done;
    if (pose) extent = extent ? render::unite(std::vector<Box>{*extent, *pose}) : *pose;
  }
  if (!extent) return nothing;
  if (!pose) pose = extent;

  places_ = placeCrowd(*extent, options_.instances);
  std::vector<Box> boxes;
  for (const JointMatrix& place : places_) boxes.push_back(moved(*pose, place));
  const Box casters = render::unite(boxes);
  const float radius = render::radiusOf(casters);
  Box ground = casters;
  for (const std::size_t axis : {0u, 2u}) {
    ground.min[axis] -= 4 * radius;
    ground.max[axis] += 4 * radius;
  }
  ground.min[1] = groundUnder(*pose, *extent);
  view_.area.extent = {options_.width, options_.height};
  view_.casters = casters;
  view_.groundHeight = groundUnder(*pose, *extent);
  view_.groundRadius = 5 * radius;
  if (options_.instances > 1) view_.style.haze = options_.instances > 200 ? 0.3f : 0.12f;
  view_.camera =
      render::frameBoxes(boxes, ground, cameraOptions(),
                         static_cast<float>(options_.width) / static_cast<float>(options_.height));
  return {};
}

/// Skins the figures that have been posed.
Result<void> Film::skin() {
  return device_.device->run(
      [this](VkCommandBuffer commandBuffer) { return drawn_->recordSkinning(commandBuffer); });
}

/// Skins the posed figures and draws them, in one command buffer.
Result<void> Film::skinAndDraw() {
  const std::uint32_t passes = 1 + render::Renderer::passCount(*frame_, 1);
  Result<PassCounter> counter = PassCounter::create(*device_.device, passes);
  if (!counter) return counter.error();
  const samples::VulkanFunctions& functions = device_.device->functions();
  const VkCommandBuffer commandBuffer = device_.device->allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  functions.BeginCommandBuffer(commandBuffer, &begin);
  Result<void> done = drawn_->recordSkinning(commandBuffer);
  counter->record(commandBuffer);
  std::vector<render::Draw> draws;
  for (std::uint32_t figure = 0; figure < drawn_->figureCount() && done; ++figure)
    done = drawn_->addDraws(figure, places_[figure], draws);
  view_.draws = draws;
  const auto afterPass = [&] { counter->record(commandBuffer); };
  if (done) done = renderer_->record(commandBuffer, *frame_, {&view_, 1}, afterPass);
  view_.draws = {};
  if (done) frame_->target().recordReadBack(*device_.device, commandBuffer);
  functions.EndCommandBuffer(commandBuffer);
  // For a film, progress counts pictures.
  Progress progress("rendering", options_.frames ? 1 : passes);
  if (done) done = counter->submitAndWait(commandBuffer, [&] { progress.step(); });
  device_.device->freeCommandBuffer(commandBuffer);
  return done;
}

Result<render::Picture> Film::draw(double time) {
  if (Result<void> begun = drawn_->beginFrame(); !begun) return begun.error();
  for (std::uint32_t figure = 0; figure < roles_.size(); ++figure) {
    const Role& role = roles_[figure];
    if (Result<void> posed =
            drawn_->setPose(figure, scenePose(scene_, role.clip, timeOf(role, time)));
        !posed)
      return posed.error();
  }
  if (Result<void> done = skinAndDraw(); !done) return done.error();
  return render::Picture{options_.width, options_.height, frame_->target().pixels()};
}

ExitStatus writePictures(const RenderOptions& options, Film& film, PictureWriter& writer) {
  const std::uint32_t count = options.frames.value_or(1);
  Progress progress("rendering", count);
  for (std::uint32_t frame = 0; frame < count; ++frame) {
    const Result<render::Picture> picture =
        film.draw(options.time + frame / options.framesPerSecond);
    if (!picture) return reportDeviceError(picture.error());
    if (Result<void> written = writer.write(*picture); !written)
      return reportError(ExitStatus::stopped, written.error().message);
    progress.step();
  }
  if (Result<void> finished = writer.finish(); !finished)
    return reportError(ExitStatus::stopped, finished.error().message);
  return ExitStatus::done;
}

Result<std::unique_ptr<PictureWriter>> openWriter(const RenderOptions& options) {
  const PictureKind kind = *samples::render::pictureKind(options.output);
  if (kind == PictureKind::png) return samples::render::writePngs(options.output);
  return samples::render::writeFilm(options.output, kind, options.width, options.height,
                                    options.framesPerSecond);
}

ExitStatus checkScene(const RenderOptions& options, const Scene& scene) {
  for (const std::string& warning : scene.warnings) reportWarning(warning);
  for (const std::string& remark : scene.remarks) reportNote(remark);
  for (const std::string& note : scene.notes) reportNote(note);
  if (scene.parts.empty()) {
    return reportError(ExitStatus::badInput,
                       fmt::format("{} has no skinned mesh in its scene", options.model));
  }
  if (!allows(scene, *methodFromName(options.method))) {
    return reportError(
        ExitStatus::badInput,
        fmt::format("{}: {} needs centers of rotation, which would take too long to compute",
                    options.model, options.method));
  }
  return ExitStatus::done;
}

samples::RequestedOutput requestedOutput(const RenderOptions& options) {
  return {"-o", options.output, options.frames.value_or(1)};
}

/// Checks the output files before anything is drawn.
ExitStatus checkOutput(const RenderOptions& options) {
  const samples::RequestedOutput output = requestedOutput(options);
  if (const ExitStatus kept = checkInput(options.model, {&output, 1}, options.clips, options.rig);
      kept != ExitStatus::done)
    return kept;
  if (*samples::render::pictureKind(options.output) == PictureKind::png) return ExitStatus::done;
  const Result<void> film = samples::render::checkFilmProgram(options.output);
  return film ? ExitStatus::done : reportError(ExitStatus::stopped, film.error().message);
}

ExitStatus renderModel(const RenderOptions& options) {
  if (const ExitStatus usage = checkUsage(options); usage != ExitStatus::done) return usage;
  if (const ExitStatus checked = checkOutput(options); checked != ExitStatus::done) return checked;
  MeshPreparation preparation;
  preparation.strict = options.strict;
  preparation.clips = options.clips;
  preparation.rig = options.rig;
  preparation.images = true;
  preparation.rigidMeshes = true;
  preparation.centersOfRotation = needsCentersOfRotation(*methodFromName(options.method));
  preparation.mostCenterTerms = mostCenterTermsAsked;
  preparation.dualQuaternionWeight = static_cast<float>(options.shares.dualQuaternionWeight);
  preparation.bulgeStrength = static_cast<float>(options.shares.bulgeStrength);
  const Result<Scene> scene = loadScene(samples::pathOf(options.model), preparation);
  if (!scene) return reportModelError(scene.error());
  const samples::RequestedOutput output = requestedOutput(options);
  if (const ExitStatus kept = checkSideFiles(*scene->model, {&output, 1}); kept != ExitStatus::done)
    return kept;
  if (const ExitStatus checked = checkScene(options, *scene); checked != ExitStatus::done)
    return checked;
  const Result<std::uint32_t> clip = chooseClip(*scene, options.animation);
  if (!clip) return reportWrongUsage(clip.error().message);

  // Opened first, so that an output that cannot be written fails before anything is prepared.
  Result<std::unique_ptr<PictureWriter>> writer = openWriter(options);
  if (!writer) return reportError(ExitStatus::stopped, writer.error().message);
  samples::DeviceOptions deviceOptions;
  deviceOptions.device = options.device;
  deviceOptions.graphics = true;
  Result<samples::OpenDevice> open = samples::openDevice(deviceOptions);
  if (!open) return reportDeviceError(open.error());
  Film film(options, *scene, *clip, *open);
  if (Result<void> prepared = film.prepare(); !prepared) {
    if (prepared.error().code == ErrorCode::invalidData) return reportModelError(prepared.error());
    return reportDeviceError(prepared.error());
  }
  return writePictures(options, film, **writer);
}

}  // namespace

Run addRender(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("render", "Draw a picture or a film of a model, or of a crowd");
  const auto options = std::make_shared<RenderOptions>();
  command->add_option("MODEL", options->model, "A .gltf or .glb file")->required();
  command
      ->add_option("-o,--output", options->output,
                   "The picture to write: .png; with --frames, a name with %04d in it, or a film: "
                   ".mp4, .gif, .apng (with ffmpeg)")
      ->required();
  addClipFiles(*command, options->clips);
  addRigFile(*command, options->rig);
  command->add_option("--animation", options->animation,
                      "A clip's number, name or FILE:NAME, or none for the rest pose [the first; a "
                      "crowd plays all of them]");
  command->add_option("--time", options->time, "Seconds into the clip [0]");
  CLI::Option* frames = command->add_option(
      "--frames", options->frames, "Number of pictures, from --time on; the clip is repeated");
  command->add_option("--fps", options->framesPerSecond, "Pictures per second [30]")->needs(frames);
  command->add_option("--instances", options->instances,
                      "Number of instances, each at a different time of the clip [1]");
  command->add_option("--method", options->method, methodNames("or") + " [dual_quaternion]");
  addShares(*command, options->shares);
  command->add_option("--width", options->width, "Width in pixels [1280]");
  command->add_option("--height", options->height, "Height in pixels [720]");
  command->add_flag("--orthographic", options->isOrthographic, "Draw without perspective");
  command->add_option(
      "--azimuth", options->azimuth,
      "Angle of the camera around the model in degrees; 0 is the front [30; a crowd: 20]");
  command->add_option("--elevation", options->elevation,
                      "Angle of the camera above the ground in degrees [12; a crowd: 18]");
  command->add_option("--device", options->device,
                      "auto, a number from 'dermis devices', or part of a name");
  command->add_flag("--strict", options->strict, strictHelp);
  return [options] { return renderModel(*options); };
}

}  // namespace dermis::cli
