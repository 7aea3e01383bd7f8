// Many frames in flight, and the validation layer's silence; and that its silence is worth
// something: barriers that are left out on purpose are reported.
//
// The layer follows accesses inside a command buffer and, where it is told to, from submission to
// submission of a queue: that of Debian 12 (1.3.239) by an environment variable, newer ones of
// themselves. It knows nothing of what the CPU writes through a mapping: that no place of a frame
// in flight is written again is shown by the bytes, in system_model_test.cpp.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <random>

#include "command_log.h"
#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t framesInFlight = 3;

std::size_t countHazards(const std::vector<std::string>& messages) {
  return static_cast<std::size_t>(
      std::count_if(messages.begin(), messages.end(),
                    [](const std::string& message) { return message.starts_with("SYNC-HAZARD"); }));
}

/// A device whose layer follows accesses from submission to submission.
class SystemSynchronizationTest : public SystemTest {
 protected:
  void SetUp() override {
    SystemTest::SetUp();
    if (device_ == nullptr) return;
    for (const auto& [name, value] : layerSettings) setenv(name, value, 1);
    Result<samples::OpenDevice> opened = samples::openDevice(testDeviceOptions());
    for (const auto& [name, value] : layerSettings) unsetenv(name);
    open_.emplace(must(std::move(opened)));
  }
  void TearDown() override {
    if (open_) {
      for (const std::string& message : open_->device->takeValidationMessages())
        ADD_FAILURE() << message;
    }
    open_.reset();
    SystemTest::TearDown();
  }
  samples::Device& strictDevice() { return *open_->device; }
  vulkan::SceneRecorderDescription strictDescription() {
    vulkan::SceneRecorderDescription strict = description();
    strict.scene.framesInFlight = framesInFlight;
    strict.scene.outputCapacity = Capacity::fixed(256 << 10);
    strict.scene.instanceCapacity = Capacity::fixed(1000);
    return strict;
  }

  /// The same hazard is to be reported as often as it is there.
  static constexpr std::pair<const char*, const char*> layerSettings[] = {
      {"VK_LAYER_ENABLES", "VALIDATION_CHECK_ENABLE_SYNCHRONIZATION_VALIDATION_QUEUE_SUBMIT"},
      {"VK_LAYER_DUPLICATE_MESSAGE_LIMIT", "1000000"},
      {"VK_LAYER_ENABLE_MESSAGE_LIMIT", "false"}};
  std::optional<samples::OpenDevice> open_;
};

/// A scene that does everything a system can do, frame by frame. Each frame the engine culls by a
/// command of its own, and copies the output as if it drew from it.
class BusyScene {
 public:
  BusyScene(samples::Device& device, const vulkan::Context& context,
            const vulkan::SceneRecorderDescription& system)
      : device_(device), engine_(device, context, system) {
    const VkBufferUsageFlags usage =
        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    visibility_ =
        must(samples::MappedBuffer::create(device, engine_->visibilityCount() * 4, usage));
    for (samples::MappedBuffer& drawn : drawn_)
      drawn = must(
          samples::MappedBuffer::create(device, system.scene.outputCapacity.initial, usage, true));
    size_ = system.scene.outputCapacity.initial;
    instance_.layout = motionLayout();
    instance_.bounds = true;
    engine_.beforeRecord = [this](VkCommandBuffer buffer) { cull(buffer); };
    engine_.afterRecord = [this](VkCommandBuffer buffer) { draw(buffer); };
  }

  ~BusyScene() { engine_.finish(); }
  BusyScene(const BusyScene&) = delete;
  BusyScene& operator=(const BusyScene&) = delete;

  void runFrame(std::uint32_t underWay = framesInFlight - 1) {
    engine_.begin(underWay);
    change();
    engine_.submit(visibility_.range());
    mostUnderWay_ = std::max(mostUnderWay_, engine_.frame() - engine_.completedFrame());
  }
  SystemEngine& engine() { return engine_; }
  std::uint64_t mostUnderWay() const { return mostUnderWay_; }

 private:
  void cull(VkCommandBuffer commandBuffer) {
    // The last frame's words have been read by a kernel.
    engine_.recordBarrier(commandBuffer, Use::dermis, Use::copyWrite);
    device_.functions().CmdFillBuffer(commandBuffer, visibility_.handle(), 0, VK_WHOLE_SIZE,
                                      engine_.frame() % 5 != 0 ? 1 : 0);
    engine_.recordBarrier(commandBuffer, Use::copyWrite, Use::dermis);
  }
  void draw(VkCommandBuffer commandBuffer) {
    const VkBufferCopy all{0, 0, size_};
    device_.functions().CmdCopyBuffer(commandBuffer, engine_.recorder().outputBuffer(),
                                      drawn_[engine_.frame() % framesInFlight].handle(), 1, &all);
  }
  std::uint32_t below(std::size_t count) { return static_cast<std::uint32_t>(random_() % count); }
  void add() {
    const std::uint32_t seed = below(100);
    if (palettes_.size() < 12) palettes_.push_back(engine_.addPose(systemPose(seed)));
    if (meshes_.size() < 4) meshes_.push_back(engine_.addMesh(systemMesh(seed, 30 + seed)));
    instance_.pose = palettes_[below(palettes_.size())];
    instance_.mesh = meshes_[below(meshes_.size())];
    instance_.culledOnGpu = below(2) == 0;
    instance_.method = below(2) == 0 ? Method::linear : Method::dualQuaternion;
    must(engine_.recorder().prepare(instance_));
    const Result<InstanceHandle> added = engine_->addInstance(instance_);
    if (added) instances_.push_back(*added);
  }
  void change() {
    for (int i = 0; i < 3; ++i) add();
    for (const PoseHandle palette : palettes_)
      if (below(3) != 0) engine_.writePose(palette, systemPose(below(100)));
    for (int i = 0; i < 2 && instances_.size() > 5; ++i) {
      std::swap(instances_[below(instances_.size())], instances_.back());
      must(engine_->removeInstance(instances_.back()));
      instances_.pop_back();
    }
    must(engine_->change({.instance = instances_[0], .visible = below(2) == 0}));
    const MorphWeight morph{below(3), 0.5f};
    must(engine_->change(
        {.instance = instances_[1], .morphs = std::span<const MorphWeight>(&morph, 1)}));
    if (engine_.frame() % 4 == 0) engine_->compact(10'000);
    if (engine_.frame() % 7 == 0)
      static_cast<void>(
          engine_->change({.instance = instances_[2], .mesh = meshes_[below(meshes_.size())]}));
  }

  samples::Device& device_;
  SystemEngine engine_;
  samples::MappedBuffer visibility_;
  std::array<samples::MappedBuffer, framesInFlight> drawn_;
  std::uint64_t size_ = 0, mostUnderWay_ = 0;
  InstanceDescription instance_;
  std::vector<PoseHandle> palettes_;
  std::vector<MeshHandle> meshes_;
  std::vector<InstanceHandle> instances_;
  std::mt19937 random_{1};
};

TEST_F(SystemSynchronizationTest, AHundredFramesWithThreeInFlightAreSilent) {
  BusyScene scene(strictDevice(), open_->context, strictDescription());
  for (int frame = 0; frame < 100; ++frame) scene.runFrame();
  EXPECT_EQ(scene.mostUnderWay(), framesInFlight);
  for (const std::string& message : strictDevice().takeValidationMessages())
    ADD_FAILURE() << message;
}

TEST_F(SystemSynchronizationTest, WithoutBarriersInsideACommandBufferTheLayerSpeaks) {
  InterceptedDevice intercepted(strictDevice().description());
  CommandLog log(intercepted);
  vulkan::Context forgetful = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = strictDescription();
  BusyScene scene(strictDevice(), forgetful, system);
  for (int frame = 0; frame < 5; ++frame) scene.runFrame(0);
  EXPECT_TRUE(strictDevice().takeValidationMessages().empty());
  log.forgetsBarrier = [](std::uint32_t) { return true; };
  for (int frame = 0; frame < 5; ++frame) scene.runFrame(0);
  EXPECT_GE(countHazards(strictDevice().takeValidationMessages()), 1u);
}

/// Three frames in which things happen that need barriers. Every time the same.
class EventfulFrames {
 public:
  /// What happens besides uploads and moves, so that barriers of one thing do not make up for
  /// another's.
  struct Events {
    bool grows = false, culls = false, bounds = false;
    bool gpuPoses = false;  ///< the engine writes some poses by commands
    bool draws = false;     ///< the engine copies the output, as if it drew from it
  };

  static constexpr std::uint32_t none = ~0u;
  std::vector<std::string> names;  ///< of all barriers, the system's and the engine's

  /// Leaves out one of them. Returns whether the layer reports it.
  bool run(samples::Device& device, vulkan::Context& context, CommandLog& log,
           vulkan::SceneRecorderDescription system, const Events& events, std::uint32_t leftOut) {
    names.clear();
    if (events.grows) {
      system.scene.meshCapacity = {1024};
      system.scene.outputCapacity = {4096};
    }
    SystemEngine engine(device, context, system);
    const VkBufferUsageFlags usage =
        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    const samples::MappedBuffer words = must(samples::MappedBuffer::create(device, 4096, usage));
    const samples::MappedBuffer drawn =
        must(samples::MappedBuffer::create(device, 1 << 20, usage, true));
    const auto forgets = [&](const std::string& name) {
      names.push_back(name);
      return names.size() - 1 == leftOut;
    };
    log.forgetsBarrier = [&](std::uint32_t) {
      const auto [source, destination] = log.barriers.back();
      return forgets(stageNames(source) + " to " + stageNames(destination));
    };
    engine.recordsBarriers = events.draws;
    engine.forgetsBarrier = [&](Use before, Use after) {
      const vulkan::Barrier barrier = vulkan::barrierBetween(before, after);
      return forgets("the engine's " + stageNames(barrier.sourceStages) + " to " +
                     stageNames(barrier.destinationStages));
    };
    engine.beforeRecord = [&](VkCommandBuffer commandBuffer) {
      if (!events.culls) return;
      engine.recordBarrier(commandBuffer, Use::dermis, Use::copyWrite);
      device.functions().CmdFillBuffer(commandBuffer, words.handle(), 0, VK_WHOLE_SIZE, 1);
      engine.recordBarrier(commandBuffer, Use::copyWrite, Use::dermis);
    };
    engine.afterRecord = [&](VkCommandBuffer commandBuffer) {
      if (!events.draws) return;
      const VkBufferCopy all{0, 0, engine->statistics().outputs.capacity};
      device.functions().CmdCopyBuffer(commandBuffer, engine.recorder().outputBuffer(),
                                       drawn.handle(), 1, &all);
    };
    InstanceDescription instance;
    instance.layout = motionLayout();
    instance.bounds = events.bounds;
    std::vector<InstanceHandle> instances;
    std::vector<PoseHandle> poses;
    for (std::uint32_t frame = 1; frame <= 3; ++frame) {
      engine.begin(framesInFlight - 1);
      if (frame != 3) instance.mesh = engine.addMesh(systemMesh(frame, 60));
      for (std::uint32_t i = 0; frame != 3 && i < 4; ++i) {
        const bool isOfGpu = events.gpuPoses && i % 2 == 0;
        poses.push_back(engine.addPose(systemPose(i), {.writtenByGpu = isOfGpu}));
        instance.pose = poses.back();
        instance.culledOnGpu = events.culls && i < 2;
        instance.method = i == 3 ? Method::linear : Method::dualQuaternion;
        instances.push_back(engine.addInstance(instance));
      }
      if (frame == 2) must(engine->removeInstance(instances[2]));
      for (std::uint32_t i = 0; i < poses.size(); ++i)
        engine.writePose(poses[i], systemPose(frame + i));
      if (frame == 3) engine->compact(100'000);
      engine.submit(words.range());
    }
    engine.finish();
    const bool isReported = countHazards(device.takeValidationMessages()) != 0;
    log.forgetsBarrier = nullptr;
    return isReported;
  }

 private:
  static std::string stageNames(VkPipelineStageFlags stages) {
    std::string names;
    for (const auto& [stage, name] : {std::pair{VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, "compute "},
                                      {VK_PIPELINE_STAGE_TRANSFER_BIT, "copy "},
                                      {VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT, "indirect "},
                                      {VK_PIPELINE_STAGE_HOST_BIT, "host "}}) {
      if ((stages & static_cast<VkPipelineStageFlags>(stage)) != 0) names += name;
    }
    return names.substr(0, names.size() - 1);
  }
};

// Each barrier on its own. Every one of the system's is reported where no other makes up for it,
// but the last, behind which is the host, whose accesses no layer sees. Of the engine's those after
// `record` are, and those before a pose is overwritten. What the engine records before `record`
// after copies, and before it overwrites visibility words, the system's own barriers make up for.
TEST_F(SystemSynchronizationTest, EachBarrierThatIsLeftOutIsReported) {
  InterceptedDevice intercepted(strictDevice().description());
  CommandLog log(intercepted);
  vulkan::Context forgetful = must(vulkan::Context::create(intercepted.description()));
  using Events = EventfulFrames::Events;
  const std::string begin = "compute copy indirect to compute copy", tables = "copy to compute",
                    palettes = "compute to compute", arguments = "compute to compute indirect",
                    toCopy = "compute to copy", afterGrowing = "copy to copy",
                    engines = "the engine's compute to copy";
  struct Case {
    Events events;
    std::set<std::string> reported;
  };
  const Case cases[] = {
      {{}, {begin, tables, palettes}},
      {{.grows = true}, {begin, afterGrowing, tables, palettes}},
      {{.culls = true}, {begin, tables, palettes, arguments, toCopy}},
      {{.bounds = true}, {tables, palettes, toCopy}},
      {{.gpuPoses = true}, {tables, palettes, engines}},
      {{.draws = true}, {begin, tables, palettes, engines}},
  };
  for (const Case& expected : cases) {
    SCOPED_TRACE(&expected - cases);
    EventfulFrames frames;
    const auto run = [&](std::uint32_t left) {
      return frames.run(strictDevice(), forgetful, log, strictDescription(), expected.events, left);
    };
    EXPECT_FALSE(run(EventfulFrames::none));
    const std::vector<std::string> names = frames.names;
    std::set<std::string> reported;
    for (std::uint32_t left = 0; left < names.size(); ++left)
      if (run(left)) reported.insert(names[left]);
    for (const std::string& name : expected.reported) EXPECT_TRUE(reported.contains(name)) << name;
  }
}

// Where the system copies nothing back, all that stands between it and who draws is the engine's.
TEST_F(SystemSynchronizationTest, WithoutTheEnginesBarriersTheLayerSpeaks) {
  SingleInstance one(strictDevice(), open_->context, strictDescription(), motionLayout());
  const std::uint64_t size = strictDescription().scene.outputCapacity.initial;
  const samples::MappedBuffer drawn = must(
      samples::MappedBuffer::create(strictDevice(), size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
  one.engine.afterRecord = [&](VkCommandBuffer commandBuffer) {
    const VkBufferCopy all{0, 0, size};
    strictDevice().functions().CmdCopyBuffer(commandBuffer, one.engine.recorder().outputBuffer(),
                                             drawn.handle(), 1, &all);
  };
  one.engine.submit();
  EXPECT_TRUE(strictDevice().takeValidationMessages().empty());
  one.engine.begin();
  one.engine.writePose(one.description.pose, systemPose(2));
  one.engine.recordsBarriers = false;
  one.engine.submit();
  one.engine.finish();
  EXPECT_GE(countHazards(strictDevice().takeValidationMessages()), 1u);
}

// Between submissions: nobody draws, so that every barrier there is between two frames is the
// system's own.
TEST_F(SystemSynchronizationTest, WithoutBarriersBetweenSubmissionsTheLayerSpeaks) {
  InterceptedDevice intercepted(strictDevice().description());
  CommandLog log(intercepted);
  vulkan::Context forgetful = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = strictDescription();
  SingleInstance one(strictDevice(), forgetful, system, motionLayout());
  one.engine.recordsBarriers = false;
  one.engine.submit();
  const auto move = [&](std::uint32_t pose) {
    one.engine.begin(framesInFlight - 1);
    one.engine.writePose(one.description.pose, systemPose(pose));
    one.engine.submit();
  };
  for (std::uint32_t pose = 0; pose < 5; ++pose) move(pose);
  EXPECT_TRUE(strictDevice().takeValidationMessages().empty())
      << "the system's barriers are enough where nobody reads the output";
  // The first barrier of a frame is the one that looks back.
  log.calls.clear();
  log.forgetsBarrier = [](std::uint32_t number) { return number == 0; };
  move(10);
  EXPECT_GE(countHazards(strictDevice().takeValidationMessages()), 1u);
  one.engine.finish();
}

}  // namespace
}  // namespace dermis::test
