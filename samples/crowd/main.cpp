// What an engine does for a crowd: figures that come and go, each in a clip and phase of its own,
// in front of a camera that moves. Now and then a figure changes to another clip, and fades to it.
// The scene samples and blends their poses. Figures in the distance are skinned less often, figures
// out of view not at all, and several frames are in flight. Every N-th frame, the pose of each
// displayed figure is compared with the clips of the file, and each of its vertices, with its
// position in the frame before, with the double-precision reference of that pose.
//
//   dermis_crowd --figures 2200 --frames 60
//   dermis_crowd --device cpu                 the same without Vulkan
//   dermis_crowd --picture crowd.png          draws the last frame by one indirect draw: picture.h
//
// Read `createOnDevice`, `Crowd` and `skinFrame` first: they are what an engine adds. Figures are
// skinned in the space of the character. The vertex shader that draws a figure applies its
// transform. So a figure that moves without changing its pose is not skinned again, and float32 is
// as exact far from the origin as near it.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numbers>
#include <numeric>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "crowd_check.h"
#include "dermis/cpu.h"
#include "dermis/vulkan/scene_recorder.h"
#include "kit/batch_runner.h"
#include "kit/buffer.h"
#include "kit/character.h"
#include "kit/device.h"
#include "kit/file_name.h"
#include "kit/frame_loop.h"
#include "kit/in_parallel.h"
#include "kit/output_file.h"
#include "kit/program.h"
#include "kit/render/picture.h"
#include "kit/timestamps.h"
#include "picture.h"

namespace {

using namespace dermis;
using namespace dermis::samples;
using Json = nlohmann::ordered_json;

struct Options {
  std::uint32_t figures = 200, frames = 120;
  std::string model = DERMIS_SAMPLE_FIGURE;
  std::string device = "auto";
  std::uint32_t framesInFlight = 3;
  std::uint32_t outputBudget = 0;  ///< MiB; 0: enough for all figures
  bool culledOnGpu = false;        ///< the GPU decides which instances are visible
  bool verifies = true;
  std::uint32_t checkInterval = 10;  ///< every N-th frame is compared
  bool validates = false;            ///< with the validation layer
  std::string json;
  std::string picture;         ///< of the last frame
  bool drawsOneByOne = false;  ///< although the device has indirect draws

  bool checks(std::uint64_t frame) const {
    return verifies && (frame % checkInterval == 0 || frame == frames);
  }
};

// -- The game: what each figure does. Everything that can happen to a figure happens often.

struct FigureState {
  bool isPresent = false;  ///< figures come and go
  Playing playing;
  bool teleports = false;  ///< its pose is unrelated to the pose of the last frame
  bool isInView = false;   ///< neither behind the camera nor too far away
  std::uint32_t updateInterval = 1;
  double x = 0, z = 0;  ///< where it stands, in radii of the world
};

/// It turns in the middle and moves from side to side.
struct Walker {
  explicit Walker(std::uint64_t frame)
      : x(0.5 * std::sin(2 * std::numbers::pi * static_cast<double>(frame) / 240)),
        turn(2 * std::numbers::pi * static_cast<double>(frame) / 160) {}
  double x, turn;
};

/// The clock of an event that happens to each figure once in every period, in different frames for
/// different figures.
std::uint64_t clockOf(std::uint32_t figure, std::uint64_t frame, std::uint32_t spread) {
  return frame + std::uint64_t{figure} * spread;
}

// [crowd-bounds]
/// How far a figure reaches sideways from where it stands.
struct Reach {
  double clip = 0;   ///< at any time of a clip
  double blend = 0;  ///< in any blend of clips
};

Reach reachOf(const Character& character, const PackedClips& clips) {
  const Method method = InstanceDescription().method;
  const auto sideways = [](const Box& box) {
    return double{std::max({-box.min[0], box.max[0], -box.min[2], box.max[2]})};
  };
  std::vector<std::uint32_t> all(clips.clipCount());
  std::iota(all.begin(), all.end(), 0u);
  Reach reach;
  for (const Part& part : character.parts()) {
    const std::uint32_t joints = character.jointCounts()[part.skin];
    const JointBounds mesh = must(jointBounds(part.primitive.mesh(), joints));
    for (const std::uint32_t clip : all) {
      const Box box = must(clipBounds(clips, clip, part.skin, mesh, method));
      reach.clip = std::max(reach.clip, sideways(box));
    }
    const Box box = must(blendBounds(clips, all, part.skin, mesh, method));
    reach.blend = std::max(reach.blend, sideways(box));
  }
  if (all.empty()) reach.clip = reach.blend;  // the rest pose
  return reach;
}
// [/crowd-bounds]

/// A disk in which a figure stands for each square meter.
struct World {
  World(const Character& character, const PackedClips& clips, std::uint32_t figureCount)
      : figures(figureCount),
        radius(std::sqrt(figureCount / std::numbers::pi) + 1),
        reach(reachOf(character, clips)) {}
  std::uint32_t figures;
  double radius;  ///< meters
  Reach reach;    ///< of a figure, in meters
};

FigureState stateOf(const Character& character, const World& world, std::uint32_t figure,
                    std::uint64_t frame) {
  constexpr std::uint32_t awayPeriod = 90, awayFrames = 5, awaySpread = 37;
  constexpr std::uint32_t jumpPeriod = 131, jumpSpread = 53;
  constexpr std::uint32_t changePeriod = 120, changeSpread = 23, fadeFrames = 10;
  FigureState state;
  const std::uint64_t away = clockOf(figure, frame, awaySpread);
  const std::uint64_t jumps = clockOf(figure, frame, jumpSpread);
  state.isPresent = away % awayPeriod >= awayFrames;
  state.teleports = jumps % jumpPeriod == 0;
  // A figure fades to the next clip. After a jump, it is at another time of its clip.
  const std::uint64_t changes = clockOf(figure, frame, changeSpread);
  const auto play = [&](std::uint64_t change) -> PoseKey {
    const auto clip = static_cast<std::uint32_t>((figure + change) % character.clipCount());
    const std::uint32_t ticks = character.tickCount(clip);
    const std::uint64_t phase = std::uint64_t{figure} * 7 + jumps / jumpPeriod * (ticks / 3);
    return {clip, static_cast<std::uint32_t>((frame + phase) % ticks)};
  };
  const std::uint64_t change = changes / changePeriod, since = changes % changePeriod;
  state.playing.pose = play(change);
  if (change > 0 && since < fadeFrames && character.clipCount() > 1) {
    state.playing.before = play(change - 1);
    state.playing.weight = static_cast<float>(since + 1) / (fadeFrames + 1);
  }

  // Figures stand in a sunflower spiral (Vogel 1979) of radius 1.
  const Walker camera(frame);
  const double angle = std::numbers::pi * (3 - std::sqrt(5.0)) * figure;
  const double radius = std::sqrt((figure + 0.5) / world.figures);
  state.x = radius * std::cos(angle);
  state.z = radius * std::sin(angle);
  const double x = state.x - camera.x, z = state.z, distance = std::hypot(x, z);
  const double ahead = x * std::cos(camera.turn) + z * std::sin(camera.turn);
  state.updateInterval = distance < 0.3 ? 1 : distance < 0.6 ? 2 : distance < 0.9 ? 4 : 8;
  // A figure up to a meter behind the camera may still cast a shadow into the picture.
  const double reach = state.playing.fades() ? world.reach.blend : world.reach.clip;
  state.isInView = distance < 1.3 + reach / world.radius && ahead > -(1 + reach) / world.radius;
  return state;
}

// -- The crowd: what an engine adds.

/// The handles of a figure.
struct Figure {
  FigureHandle handle;
  std::vector<InstanceHandle> instances;  ///< by part; empty: it is not there
  FigureState now;

  bool isThere() const { return !instances.empty(); }
};

InstanceDescription describe(const Part& part, const Options& options) {
  InstanceDescription description;
  description.layout.positions = VertexFormat::float32x3;
  if (part.packed.info().hasNormals) description.layout.normals = VertexFormat::octahedral16x2;
  description.layout.motion = true;  // for motion vectors
  description.culledOnGpu = options.culledOnGpu;
  return description;
}

/// So large that nothing has to grow later.
SceneDescription describeScene(const Character& character, const PackedClips& clips,
                               const Options& options) {
  SceneDescription scene;
  scene.framesInFlight = options.framesInFlight;
  scene.meshCapacity.initial = 2 * clips.bytes().size();
  std::uint64_t joints = 0, outputBytes = 0;
  for (const std::uint32_t count : character.jointCounts()) joints += count;
  for (const Part& part : character.parts()) {
    const VertexLayout layout = describe(part, options).layout;
    outputBytes += must(placeVertices(layout, part.packed.vertexCount())).size;
    scene.meshCapacity.initial += part.packed.info().byteSize;
  }
  // Memory of removed objects is reused once the GPU has finished the current frame, so there is
  // room for a quarter more.
  const auto withSlack = [](std::uint64_t count) { return count + count / 4 + 64; };
  const std::uint64_t parts = character.parts().size();
  Capacity& jointCapacity = options.device == "cpu" ? scene.jointCapacity : scene.gpuJointCapacity;
  jointCapacity.initial = withSlack((options.figures + 1) * joints);
  scene.instanceCapacity.initial = withSlack((options.figures + 1) * parts);
  scene.outputCapacity.initial = withSlack((options.figures + 1) * outputBytes);
  if (options.outputBudget != 0)
    scene.outputCapacity = Capacity::fixed(std::uint64_t{options.outputBudget} << 20);
  return scene;
}

// [crowd-set-up]
/// Builds pipelines, so call it from a loading thread.
vulkan::SceneRecorder createOnDevice(const vulkan::Context& context, const Character& character,
                                     const PackedClips& clips, const Options& options,
                                     bool measuresGpuTime) {
  vulkan::SceneRecorderDescription description;
  description.scene = describeScene(character, clips, options);
  description.measuresGpuTime = measuresGpuTime;
  vulkan::SceneRecorder recorder = must(vulkan::SceneRecorder::create(context, description));
  for (const Part& part : character.parts()) {
    PipelineNeeds needs = must(recorder.scene().pipelineNeeds(describe(part, options)));
    needs.figures = true;
    must(context.prepare(needs));
  }
  return recorder;
}
// [/crowd-set-up]

/// The figures of a scene, on a device or on the CPU.
class Crowd {
 public:
  Crowd(Scene& scene, const Character& character, const PackedClips& clips, const Options& options)
      : scene_(&scene),
        character_(&character),
        options_(&options),
        world_(character, clips, options.figures),
        clips_(must(scene.addClips(PackedClips(clips)))),
        figures_(options.figures) {
    for (const Part& part : character.parts())
      meshes_.push_back(must(scene_->addMesh(part.packed)));
  }

  /// Call it in each frame, before it is executed.
  void update(std::uint64_t frame) {
    comeAndGo(frame);
    move();
    play();
  }

  Scene& scene() { return *scene_; }
  const World& world() const { return world_; }
  std::span<const Figure> figures() const { return figures_; }
  std::span<const MeshHandle> meshes() const { return meshes_; }  ///< by part
  /// How often there was no room for a figure.
  std::uint64_t refusals() const { return refusals_; }

 private:
  // [crowd-add]
  /// A figure has a pose for each skin of its clips, and an instance of each mesh: body, hair,
  /// clothes.
  Result<void> add(Figure& figure) {
    const Result<FigureHandle> handle = scene_->addFigure(clips_);
    if (!handle) return handle.error();
    figure.handle = *handle;
    for (std::size_t index = 0; index < meshes_.size(); ++index) {
      const Part& part = character_->parts()[index];
      InstanceDescription description = describe(part, *options_);
      description.mesh = meshes_[index];
      description.pose = must(scene_->pose(figure.handle, part.skin));
      const Result<InstanceHandle> instance = scene_->addInstance(description);
      if (!instance) return instance.error();
      figure.instances.push_back(*instance);
    }
    return {};
  }

  /// May be called at any time: vertices of frames in flight stay valid until those frames
  /// complete.
  void remove(Figure& figure) {
    for (const InstanceHandle instance : std::exchange(figure.instances, {}))
      must(scene_->removeInstance(instance));
    if (figure.handle) must(scene_->removeFigure(std::exchange(figure.handle, {})));
  }

  void comeAndGo(std::uint64_t frame) {
    constexpr std::uint64_t maxMovedBytes = 1 << 20;  // so that no frame moves many
    bool hasGaps = false;
    for (std::uint32_t index = 0; index < figures_.size(); ++index) {
      Figure& figure = figures_[index];
      figure.now = stateOf(*character_, world_, index, frame);
      if (!figure.isThere() || figure.now.isPresent) continue;
      remove(figure);
      hasGaps = true;
    }
    for (Figure& figure : figures_) {
      if (figure.isThere() || !figure.now.isPresent) continue;
      const Result<void> added = add(figure);
      if (added) continue;
      remove(figure);
      if (added.error().code != ErrorCode::limitExceeded) must(added);
      ++refusals_;  // it is added when others have been removed
      break;
    }
    if (hasGaps) scene_->compact(maxMovedBytes);
  }
  // [/crowd-add]

  // [crowd-move]
  void move() {
    visibility_.clear();
    for (const Figure& figure : figures_) {
      for (const InstanceHandle instance : figure.instances) {
        const bool isVisible = figure.now.isInView || options_->culledOnGpu;
        visibility_.push_back({instance, isVisible, figure.now.updateInterval});
        if (figure.now.teleports) must(scene_->change({.instance = instance, .teleports = true}));
      }
    }
    must(scene_->setVisibility(visibility_));
  }

  /// Whether this frame may show a new pose of the figure. What the GPU culls may become visible
  /// in any frame.
  bool needsPose(const Figure& figure) const {
    return options_->culledOnGpu ||
           std::ranges::any_of(figure.instances, [&](InstanceHandle instance) {
             return must(scene_->isDue(instance));
           });
  }

  /// One call for all figures. The scene samples the poses of those that it skins.
  void play() {
    layers_.clear();
    plays_.clear();
    layers_.reserve(2 * figures_.size());  // plays point to them
    for (const Figure& figure : figures_) {
      if (!figure.isThere() || !needsPose(figure)) continue;
      const std::size_t first = layers_.size();
      character_->addLayers(figure.now.playing, layers_);
      plays_.push_back({figure.handle, std::span(layers_).subspan(first)});
    }
    must(scene_->play(plays_));
  }
  // [/crowd-move]

  Scene* scene_;
  const Character* character_;
  const Options* options_;
  World world_;
  ClipsHandle clips_;
  std::vector<MeshHandle> meshes_;  ///< by part
  std::vector<Figure> figures_;
  std::vector<InstanceVisibility> visibility_;  ///< of the frame
  std::vector<ClipLayer> layers_;               ///< of the frame
  std::vector<FigurePlay> plays_;               ///< of the frame
  std::uint64_t refusals_ = 0;
};

/// Writes a word for each instance: its figure is visible or not. An engine's culling does it on
/// the GPU. Here the CPU writes mapped memory before the submission, which needs no barrier.
vulkan::BufferRange writeVisibility(Crowd& crowd, Device& device, MappedBuffer& buffer) {
  const std::uint64_t size = std::uint64_t{crowd.scene().visibilityCount()} * 4;
  if (buffer.bytes().size() < size)
    buffer = must(MappedBuffer::create(device, size, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
  for (const Figure& figure : crowd.figures()) {
    const std::uint32_t word = figure.now.isInView ? 1 : 0;
    for (const InstanceHandle instance : figure.instances) {
      const std::size_t index = must(crowd.scene().visibilityIndex(instance));
      std::memcpy(buffer.bytes().data() + index * 4, &word, 4);
    }
  }
  return buffer.range();
}

// [crowd-frame]
/// Call it in each frame, outside a render pass. `completedFrame` is the newest frame that the GPU
/// has completed. `visibility` is a buffer that no frame in flight uses.
void skinFrame(vulkan::SceneRecorder& recorder, Crowd& crowd, std::uint64_t frame,
               std::uint64_t completedFrame, OpenDevice& open, VkCommandBuffer commandBuffer,
               MappedBuffer& visibility, const Options& options) {
  must(crowd.scene().beginFrame(frame, completedFrame));
  crowd.update(frame);
  vulkan::BufferRange words;
  if (options.culledOnGpu) words = writeVisibility(crowd, *open.device, visibility);

  // The check copies the vertices. An engine that draws in each frame uses `Use::vertexInput` in
  // both barriers.
  open.context.recordBarrier(commandBuffer, Use::copyRead, Use::dermis);
  must(recorder.record(commandBuffer, words));
  const Use use = options.picture.empty() ? Use::copyRead : Use::copyRead | Use::vertexInput;
  open.context.recordBarrier(commandBuffer, Use::dermis, use);
}
// [/crowd-frame]

// -- The report: what the crowd costs.

/// What a frame cost.
struct Cost {
  SceneStatistics scene;
  std::uint32_t dispatches = 0;
  std::uint64_t uploadedBytes = 0;
  double cpuSeconds = 0;              ///< to record it
  std::optional<double> skinSeconds;  ///< of the newest complete frame, if they are known
  std::uint64_t deviceMemory = 0;     ///< bytes
};

Cost costOf(const vulkan::SceneRecorder& recorder) {
  const vulkan::RecorderStatistics own = recorder.statistics();
  return {recorder.scene().statistics(),       own.dispatches, own.uploadedBytes,
          own.planSeconds + own.recordSeconds, own.gpuSeconds, own.deviceMemory};
}

class Report {
 public:
  /// `driver` is empty without Vulkan.
  Report(const Character& character, const Options& options, const std::string& device,
         const std::string& driver)
      : options_(&options) {
    json_ = {{"device", device},
             {"driver", driver},
             {"model", pathOf(options.model).filename().string()},
             {"meshes", character.parts().size()},
             {"verticesOfFigure", character.vertexCount()},
             {"framesInFlight", driver.empty() ? 0 : options.framesInFlight},
             {"culledOnGpu", options.culledOnGpu},
             {"frames", options.frames},
             {"rows", Json::array()}};
    fmt::print("device    {}{}\n", device, driver.empty() ? "" : ", driver " + driver);
    fmt::print("model     {} vertices in {} skinned meshes\n", character.vertexCount(),
               character.parts().size());
  }

  /// Call it after each record.
  void add(std::span<const Figure> figures, const Cost& cost) {
    const SceneStatistics::Frame& work = cost.scene.lastFrame;
    std::uint32_t present = 0, inView = 0;
    for (const Figure& figure : figures) {
      if (figure.isThere()) ++present;
      if (figure.now.isInView) inView += static_cast<std::uint32_t>(figure.instances.size());
      if (figure.isThere() && figure.now.playing.fades()) ++fading_;
    }
    ++frames_;
    instances_ += work.instances;
    outOfView_ += work.instances - inView;
    skinned_ += work.skinnedInstances;
    vertices_ += work.skinnedVertices;
    cpuSeconds_ += cost.cpuSeconds;
    complete(cost);
    if (frames_ % 20 == 0 || frames_ == options_->frames) addRow(present, cost);
  }

  /// Call it for each frame that the GPU has completed.
  void complete(const Cost& cost) {
    const SceneStatistics::Culling& completed = cost.scene.lastCompletedFrame;
    if (completed.frame <= std::exchange(completedFrame_, completed.frame)) return;
    skinned_ += completed.skinnedInstances;
    gpuSeconds_ += cost.skinSeconds.value_or(0);
  }

  /// Prints and writes the totals. `validation` has the messages of the validation layer.
  ExitStatus finish(const Cost& cost, std::uint64_t refusals, const crowd::CrowdCheck& check,
                    std::span<const std::string> validation = {}) {
    const SceneStatistics& memory = cost.scene;
    const std::uint64_t withinInterval = instances_ - outOfView_ - skinned_;
    Json verticesPerSecond;
    if (gpuSeconds_ > 0 && !options_->culledOnGpu)
      verticesPerSecond = static_cast<double>(vertices_) / gpuSeconds_;
    const auto store = [](const SceneStatistics::Store& bytes) -> Json {
      return {
          {"capacity", bytes.capacity}, {"used", bytes.used}, {"largestFree", bytes.largestFree}};
    };
    json_["totals"] = {{"instances", instances_},
                       {"skinned", skinned_},
                       {"outOfView", outOfView_},
                       {"withinInterval", withinInterval},
                       {"fading", fading_},
                       {"refusals", refusals},
                       {"vertices", options_->culledOnGpu ? Json() : Json(vertices_)},
                       {"verticesPerSecond", verticesPerSecond},
                       {"cpuSeconds", cpuSeconds_}};
    json_["memory"] = {{"meshes", store(memory.meshes)},
                       {"palettes", store(memory.palettes)},
                       {"outputs", store(memory.outputs)},
                       {"device", cost.deviceMemory}};
    fmt::print("instances {}: {} skinned, {} out of view, {} not due\n", instances_, skinned_,
               outOfView_, withinInterval);
    if (refusals != 0) fmt::print("refused   {} times: there was no room for a figure\n", refusals);
    fmt::print("memory    {:.1f} MiB of outputs; {:.1f} MiB of device memory in total\n",
               static_cast<double>(memory.outputs.used) / (1 << 20),
               static_cast<double>(cost.deviceMemory) / (1 << 20));
    const crowd::CrowdCheck::Totals& checked = check.totals();
    json_["check"] = nullptr;
    if (options_->verifies) {
      json_["check"] = {{"frames", checked.frames},     {"instances", checked.instances},
                        {"vertices", checked.vertices}, {"failures", checked.failures},
                        {"worst", checked.worst},       {"firstFailure", checked.firstFailure},
                        {"poses", checked.poses},       {"worstPose", checked.worstPose}};
      if (checked.worstPose <= 1)
        fmt::print(
            "clips     {} poses that figures play are at most {:.2f} of their bound from the "
            "file's\n",
            checked.poses, checked.worstPose);
      if (checked.failures == 0)
        fmt::print(
            "checked   in {} frames: all {} vertices of {} instances are inside their bounds; the "
            "largest error is {:.0f} % of its bound\n",
            checked.frames, checked.vertices, checked.instances, 100 * checked.worst);
    }
    if (!options_->json.empty()) {
      const std::string text = json_.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
      const Result<void> written = writeFile(pathOf(options_->json), text);
      if (!written) return reportError(ExitStatus::stopped, written.error().message);
    }
    const std::string complaint =
        validation.empty() ? check.complaint() : "the validation layer says: " + validation.front();
    return complaint.empty() ? ExitStatus::done
                             : reportError(ExitStatus::verificationFailed, complaint);
  }

 private:
  void addRow(std::uint32_t present, const Cost& cost) {
    const SceneStatistics::Frame& work = cost.scene.lastFrame;
    const SceneStatistics::Culling& completed = cost.scene.lastCompletedFrame;
    // If the GPU culls, the CPU learns what it skinned when the frame is complete.
    const bool culledOnGpu = options_->culledOnGpu;
    const auto skinned = culledOnGpu ? completed.skinnedInstances : work.skinnedInstances;
    const auto settled = culledOnGpu ? completed.settledInstances : work.settledInstances;
    const double nanoseconds = work.instances == 0 ? 0 : cost.cpuSeconds * 1e9 / work.instances;
    json_["rows"].push_back({{"frame", frames_},
                             {"figures", present},
                             {"instances", work.instances},
                             {"skinned", skinned},
                             {"settled", settled},
                             {"vertices", culledOnGpu ? Json() : Json(work.skinnedVertices)},
                             {"dispatches", cost.dispatches},
                             {"uploadedBytes", cost.uploadedBytes},
                             {"cpuNanosecondsPerInstance", nanoseconds},
                             {"gpuSeconds", cost.skinSeconds ? Json(*cost.skinSeconds) : Json()}});
    fmt::print(
        "frame {:3} {} figures, {} instances: {} skinned, {} settled; {} dispatches, {} KiB "
        "uploaded, {:.0f} ns an instance to plan and record{}\n",
        frames_, present, work.instances, skinned, settled, cost.dispatches,
        cost.uploadedBytes / 1024, nanoseconds,
        cost.skinSeconds ? fmt::format("; {:.1f} ms to skin", 1e3 * *cost.skinSeconds) : "");
    std::fflush(stdout);
  }

  const Options* options_;
  Json json_;
  std::uint32_t frames_ = 0;
  std::uint64_t completedFrame_ = 0;
  std::uint64_t instances_ = 0, outOfView_ = 0, skinned_ = 0, fading_ = 0, vertices_ = 0;
  double cpuSeconds_ = 0, gpuSeconds_ = 0;
};

// -- The program: the frame loop, with the check.

/// Tells the check what the system was asked to show.
void follow(crowd::CrowdCheck& check, Crowd& crowd, std::uint64_t frame, bool culledOnGpu) {
  std::vector<crowd::AskedInstance> asked;
  for (const Figure& figure : crowd.figures()) {
    const FigureState& now = figure.now;
    for (std::uint32_t part = 0; part < figure.instances.size(); ++part)
      asked.push_back({figure.instances[part], part, now.playing, now.isInView, now.teleports,
                       now.updateInterval});
  }
  check.follow(frame, asked, crowd.scene().skinnedInstances(), culledOnGpu);
}

/// A copy of the output of a frame in flight. No instances: there is nothing to compare.
struct ReadBack {
  std::vector<crowd::ShownInstance> instances;
  MappedBuffer buffer;
};

/// Records a copy of the output from its beginning to its last visible instance.
void recordReadBack(Device& device, VkCommandBuffer commandBuffer,
                    const vulkan::SceneRecorder& recorder, ReadBack& readBack) {
  std::uint64_t size = 0;
  for (const crowd::ShownInstance& instance : readBack.instances)
    size = std::max(size, instance.output.offset + instance.output.places.size);
  if (size == 0) return;
  if (readBack.buffer.bytes().size() < size) {
    readBack.buffer =
        must(MappedBuffer::create(device, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
  }
  const VkBufferCopy region{0, 0, size};
  device.functions().CmdCopyBuffer(commandBuffer, recorder.outputBuffer(), readBack.buffer.handle(),
                                   1, &region);
  recordBarrier(device, commandBuffer, Use::copyWrite, Use::hostRead);
}

/// The parts of the figures in view, in the world.
std::vector<crowd::Drawn> drawnParts(const Crowd& crowd) {
  const auto figures = crowd.figures();
  const double radius = crowd.world().radius;
  std::vector<crowd::Drawn> drawn;
  for (std::uint32_t number = 0; number < figures.size(); ++number) {
    const Figure& figure = figures[number];
    if (!figure.now.isInView) continue;
    JointMatrix place;  // the identity
    place.m[0][3] = static_cast<float>(radius * figure.now.x);
    place.m[2][3] = static_cast<float>(radius * figure.now.z);
    const auto hue = static_cast<float>(number * number % 97);  // near figures differ
    const glm::vec3 color(0.55f + 0.35f * std::cos(hue), 0.55f + 0.35f * std::cos(hue + 2.1f),
                          0.55f + 0.35f * std::cos(hue + 4.2f));
    for (std::uint32_t part = 0; part < figure.instances.size(); ++part)
      drawn.push_back({figure.instances[part], part, place, color});
  }
  return drawn;
}

/// Above the place of the camera, looking along its direction and down.
glm::mat4 viewOf(const World& world, std::uint64_t frame) {
  const Walker camera(frame);
  const auto radius = static_cast<float>(world.radius);
  const glm::vec3 ahead(std::cos(camera.turn), -0.25, std::sin(camera.turn));
  const glm::vec3 place(radius * static_cast<float>(camera.x), 2.6f, 0);
  return crowd::viewProjection(place - glm::vec3(2 * ahead.x, 0, 2 * ahead.z), ahead);
}

ExitStatus playOnDevice(OpenDevice& open, const Character& character, const PackedClips& clips,
                        const Options& options) {
  Device& device = *open.device;
  const bool hasTimestamps = must(Timestamps::create(device)).has();
  vulkan::SceneRecorder recorder =
      createOnDevice(open.context, character, clips, options, hasTimestamps);
  Crowd crowd(recorder.scene(), character, clips, options);
  VulkanTarget sampling(device, open.context);
  crowd::CrowdCheck check(character, clips, sampling, InstanceDescription().method);
  Report report(character, options, device.info().name, driverVersion(device));
  const std::uint64_t inFlight = options.framesInFlight;
  std::vector<MappedBuffer> visibility(inFlight);
  std::vector<ReadBack> readBacks(inFlight);
  const auto compare = [&](std::uint64_t completedFrame) {
    ReadBack& readBack = readBacks[completedFrame % inFlight];
    check.compare(completedFrame, readBack.instances, readBack.buffer.bytes());
  };

  std::optional<crowd::Painter> painter;
  if (!options.picture.empty())
    painter.emplace(device, character, crowd.meshes(),
                    describe(character.parts()[0], options).layout, options.drawsOneByOne);

  FrameLoop loop(device, options.framesInFlight);  // destroyed first: it waits
  for (std::uint64_t frame = 1; frame <= options.frames; ++frame) {
    const VkCommandBuffer commandBuffer = must(loop.begin());
    const std::size_t slot = frame % inFlight;
    if (frame > inFlight && options.checks(loop.completed())) compare(loop.completed());
    skinFrame(recorder, crowd, frame, loop.completed(), open, commandBuffer, visibility[slot],
              options);
    report.add(crowd.figures(), costOf(recorder));
    follow(check, crowd, frame, options.culledOnGpu);
    if (options.checks(frame)) {
      readBacks[slot].instances = check.shown(crowd.scene());
      recordReadBack(device, commandBuffer, recorder, readBacks[slot]);
    }
    if (painter && frame == options.frames) {
      painter->record(commandBuffer, crowd.scene(), recorder.outputBuffer(), drawnParts(crowd),
                      viewOf(crowd.world(), frame));
    }
    must(loop.submit());
  }
  const std::uint64_t compared = loop.completed();
  must(loop.finish());
  if (painter) must(render::writePngs(options.picture)->write(painter->picture()));
  for (std::uint64_t frame = compared + 1; frame <= options.frames; ++frame) {
    if (options.checks(frame)) compare(frame);
    must(crowd.scene().beginFrame(frame + inFlight, frame));
    report.complete(costOf(recorder));
  }
  return report.finish(costOf(recorder), crowd.refusals(), check, device.takeValidationMessages());
}

/// Without Vulkan. All cores skin; the result is there when the jobs are done.
ExitStatus playOnCpu(const Character& character, const PackedClips& clips, const Options& options) {
  cpu::SceneRunner runner =
      must(cpu::SceneRunner::create(describeScene(character, clips, options)));
  Crowd crowd(runner.scene(), character, clips, options);
  CpuTarget sampling;
  crowd::CrowdCheck check(character, clips, sampling, InstanceDescription().method);
  Report report(character, options, CpuTarget().name(), "");
  Cost cost;
  for (std::uint64_t frame = 1; frame <= options.frames; ++frame) {
    using Clock = std::chrono::steady_clock;
    must(crowd.scene().beginFrame(frame, frame - 1));
    crowd.update(frame);
    const auto begin = Clock::now();
    const std::span<const cpu::PlannedJob> jobs = must(runner.jobs());
    const auto planned = Clock::now();
    inParallel(jobs.size(), [&](std::size_t index) { cpu::run(jobs[index]); });
    const std::chrono::duration<double> planning = planned - begin,
                                        skinning = Clock::now() - planned;

    cost.scene = crowd.scene().statistics();
    cost.scene.lastCompletedFrame.frame = frame;
    cost.cpuSeconds = planning.count();
    cost.skinSeconds = skinning.count();
    report.add(crowd.figures(), cost);
    follow(check, crowd, frame, false);
    if (options.checks(frame)) check.compare(frame, check.shown(crowd.scene()), runner.output());
  }
  return report.finish(cost, crowd.refusals(), check);
}

/// Empty if the program should continue.
std::optional<ExitStatus> readOptions(int argc, char** argv, Options& options) {
  CLI::App app("Skins a crowd with a SceneRecorder, and compares its vertices with the reference.",
               "dermis_crowd");
  app.footer(exitStatusHelp);
  app.add_option("--figures", options.figures, "Number of figures [200]")
      ->check(CLI::Range(1u, 100'000u));
  app.add_option("--frames", options.frames, "Number of frames [120]")
      ->check(CLI::Range(1u, 1'000'000u));
  app.add_option("--model", options.model, "A .gltf or .glb file [the sample figure]");
  app.add_option("--device", options.device,
                 "auto, cpu (without Vulkan), a number from 'dermis devices', or part of a name");
  const CLI::Option* inFlight =
      app.add_option("--frames-in-flight", options.framesInFlight, "Maximum frames in flight [3]")
          ->check(CLI::Range(1u, 16u));
  app.add_option("--output-budget", options.outputBudget,
                 "Memory for skinned vertices in MiB; figures that do not fit are added later "
                 "[enough for all]")
      ->check(CLI::Range(1u, 1u << 20));
  app.add_option("--json", options.json, "Write the results to a file as JSON");
  app.add_option("--check-every", options.checkInterval,
                 "Compare all vertices of every N-th frame and of the last frame [10]")
      ->check(CLI::Range(1u, 1'000'000u));
  app.add_flag_callback(
      "--no-verify", [&options] { options.verifies = false; }, "Do not compare; for measurements");
  app.add_flag("--gpu-culling", options.culledOnGpu,
               "Let the GPU decide which instances are visible");
  app.add_option("--picture", options.picture, "Draw the last frame into a PNG file");
  app.add_flag("--single-draws", options.drawsOneByOne,
               "Draw the picture by one command for each part of a figure");
  app.add_flag("--validate", options.validates, "Run with the Vulkan validation layer");
  if (const auto ended = parseOptions(app, argc, argv)) return ended;
  if (options.device != "cpu") return std::nullopt;
  for (const auto& [isAsked, name] : {std::pair{options.culledOnGpu, "--gpu-culling"},
                                      {inFlight->count() != 0, "--frames-in-flight"},
                                      {!options.picture.empty(), "--picture"},
                                      {options.validates, "--validate"}}) {
    if (!isAsked) continue;
    return reportWrongUsage(fmt::format("{} needs a Vulkan device; --device cpu is not one", name));
  }
  return std::nullopt;
}

ExitStatus run(int argc, char** argv) {
  Options options;
  if (const auto ended = readOptions(argc, argv, options)) return *ended;
  const Result<Character> character = Character::load(pathOf(options.model));
  if (!character) return reportModelError(character.error());
  std::vector<std::filesystem::path> inputs = character->model().sideFiles;
  inputs.push_back(pathOf(options.model));
  const std::array<RequestedOutput, 2> outputs{
      {{"--json", options.json}, {"--picture", options.picture}}};
  if (const Result<void> kept = checkOutputFiles(outputs, inputs); !kept)
    return reportWrongUsage(kept.error().message);
  try {
    const std::vector<ClipView> views = gltf::clips(character->model());
    const Result<PackedClips> clips = packClips(character->skeleton(), views);
    if (!clips) return reportModelError(clips.error());
    if (options.device == "cpu") return playOnCpu(*character, *clips, options);
    DeviceOptions wanted;
    wanted.device = options.device;
    wanted.validation = options.validates;
    wanted.graphics = !options.picture.empty();
    OpenDevice open = must(openDevice(wanted));
    return playOnDevice(open, *character, *clips, options);
  } catch (const Failure& failure) {
    return reportDeviceError(failure.error());
  }
}

}  // namespace

int main(int argc, char** argv) {
  return runProgram("dermis_crowd", argc, argv, run);
}
