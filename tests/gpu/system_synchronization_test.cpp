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
  vulkan::SkinningSystemDescription strictDescription() {
    vulkan::SkinningSystemDescription strict = description();
    strict.context = &open_->context;
    strict.framesInFlight = framesInFlight;
    strict.outputCapacity = Capacity::fixed(256 << 10);
    strict.instanceCapacity = Capacity::fixed(1000);
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
  BusyScene(samples::Device& device, const vulkan::SkinningSystemDescription& system)
      : device_(device), engine_(device, system) {
    const VkBufferUsageFlags usage =
        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
    visibility_ =
        must(samples::MappedBuffer::create(device, engine_->instanceCapacity() * 4, usage));
    for (samples::MappedBuffer& drawn : drawn_)
      drawn =
          must(samples::MappedBuffer::create(device, system.outputCapacity.initial, usage, true));
    size_ = system.outputCapacity.initial;
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
    engine_.submit({visibility_.handle(), 0});
    mostUnderWay_ = std::max(mostUnderWay_, engine_.frame() - engine_.completedFrame());
  }
  SystemEngine& engine() { return engine_; }
  std::uint64_t mostUnderWay() const { return mostUnderWay_; }

 private:
  void cull(VkCommandBuffer commandBuffer) {
    // The last frame's words have been read by a kernel.
    engine_.recordBarrier(commandBuffer, {{VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0},
                                          {VK_PIPELINE_STAGE_TRANSFER_BIT, 0}});
    device_.functions().CmdFillBuffer(commandBuffer, visibility_.handle(), 0, VK_WHOLE_SIZE,
                                      engine_.frame() % 5 != 0 ? 1 : 0);
    engine_.recordBarrier(commandBuffer, vulkan::inputScope(vulkan::PreviousUse::transferWrite));
  }
  void draw(VkCommandBuffer commandBuffer) {
    const VkBufferCopy all{0, 0, size_};
    device_.functions().CmdCopyBuffer(commandBuffer, engine_->outputBuffer(),
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
    must(engine_->prepare(pipelineNeeds(instance_)));
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
  BusyScene scene(strictDevice(), strictDescription());
  for (int frame = 0; frame < 100; ++frame) scene.runFrame();
  EXPECT_EQ(scene.mostUnderWay(), framesInFlight);
  for (const std::string& message : strictDevice().takeValidationMessages())
    ADD_FAILURE() << message;
}

TEST_F(SystemSynchronizationTest, WithoutBarriersInsideACommandBufferTheLayerSpeaks) {
  InterceptedDevice intercepted(strictDevice().description());
  CommandLog log(intercepted);
  vulkan::Context forgetful = must(vulkan::Context::create(intercepted.description()));
  vulkan::SkinningSystemDescription system = strictDescription();
  system.context = &forgetful;
  BusyScene scene(strictDevice(), system);
  for (int frame = 0; frame < 5; ++frame) scene.runFrame(0);
  EXPECT_TRUE(strictDevice().takeValidationMessages().empty());
  log.forgetsBarrier = [](std::uint32_t) { return true; };
  for (int frame = 0; frame < 5; ++frame) scene.runFrame(0);
  EXPECT_GE(countHazards(strictDevice().takeValidationMessages()), 1u);
}

// Each barrier of a frame on its own. Not reported are the first, which the engine's own barriers
// make up for here, the last, behind which is the host, whose accesses no layer sees, and the one
// between the two passes over what is visible, where Debian 12's layer is blind.
TEST_F(SystemSynchronizationTest, TheLayerMissesBarriersOneByOne) {
  InterceptedDevice intercepted(strictDevice().description());
  CommandLog log(intercepted);
  vulkan::Context forgetful = must(vulkan::Context::create(intercepted.description()));
  vulkan::SkinningSystemDescription system = strictDescription();
  system.context = &forgetful;
  BusyScene scene(strictDevice(), system);
  for (int frame = 0; frame < 5; ++frame) scene.runFrame(0);
  EXPECT_TRUE(strictDevice().takeValidationMessages().empty());
  std::set<std::uint32_t> seen, reported;
  for (std::uint32_t frame = 0; frame < 64; ++frame) {
    log.calls.clear();
    log.forgetsBarrier = [frame](std::uint32_t number) { return number == frame % 8; };
    scene.runFrame(0);
    if (log.count("vkCmdPipelineBarrier") <= frame % 8) continue;
    seen.insert(frame % 8);
    if (countHazards(strictDevice().takeValidationMessages()) != 0) reported.insert(frame % 8);
  }
  const std::set<std::uint32_t> followed{1, 3, 4, 5};  // uploads, indirect, palettes, read-back
  EXPECT_EQ(seen.size(), 7u);
  EXPECT_TRUE(std::ranges::includes(reported, followed)) << reported.size();
}

// Where the system copies nothing back, all that stands between it and who draws is the engine's.
TEST_F(SystemSynchronizationTest, WithoutTheEnginesBarriersTheLayerSpeaks) {
  SingleInstance one(strictDevice(), strictDescription(), motionLayout());
  const std::uint64_t size = strictDescription().outputCapacity.initial;
  const samples::MappedBuffer drawn = must(
      samples::MappedBuffer::create(strictDevice(), size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true));
  one.engine.afterRecord = [&](VkCommandBuffer commandBuffer) {
    const VkBufferCopy all{0, 0, size};
    strictDevice().functions().CmdCopyBuffer(commandBuffer, one.engine->outputBuffer(),
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
  vulkan::SkinningSystemDescription system = strictDescription();
  system.context = &forgetful;
  SingleInstance one(strictDevice(), system, motionLayout());
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
