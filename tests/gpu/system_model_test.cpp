// Random steps on the GPU beside the model (model_steps.h). Half of the tests record into secondary
// command buffers.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <span>
#include <string>

#include "command_log.h"
#include "counting_memory.h"
#include "lone_figure.h"
#include "model_steps.h"
#include "system_test.h"

namespace dermis::test {
namespace {

class GpuModelTest : public SystemTest,
                     public ModelSteps<SystemEngine>,
                     public ::testing::WithParamInterface<std::uint32_t> {
 protected:
  GpuModelTest() : ModelSteps(GetParam()) {}
  void SetUp() override {
    SystemTest::SetUp();
    if (device_ == nullptr) return;
    intercepted_.emplace(device().description());
    log_.emplace(*intercepted_);
    watched_.emplace(must(vulkan::Context::create(intercepted_->description())));
    memory_.emplace(device());
  }
  void TearDown() override {
    engine_.reset();
    watched_.reset();
    for (samples::MappedBuffer& words : words_) words = {};
    if (device_ != nullptr && recordsSecondary()) {
      // When a frame is submitted, newer layers do not count the barriers in secondary command
      // buffers (KhronosGroup/Vulkan-ValidationLayers, issue 10693).
      for (const std::string& message : device().takeValidationMessages()) {
        const bool isIgnored = message.find("SYNC-HAZARD") != std::string::npos &&
                               message.find("vkQueueSubmit()") != std::string::npos;
        if (!isIgnored) ADD_FAILURE() << message;
      }
    }
    SystemTest::TearDown();
  }
  static bool recordsSecondary() { return GetParam() % 2 == 0; }

  void makeEngine() override {
    engine_.reset();
    EXPECT_EQ(memory_->allocations, memory_->frees);
    vulkan::SceneRecorderDescription small = description();
    small.scene.framesInFlight = framesInFlight;
    small.scene.meshCapacity = {2048, 512 << 10};
    small.scene.jointCapacity = {8, 8 * 40};
    small.scene.gpuJointCapacity = {0, 8 * 40};
    small.scene.instanceCapacity = instanceCapacity;
    small.scene.boundsCapacity = Capacity::fixed(boundsCapacity);
    small.scene.outputCapacity = outputCapacity;
    if (++systems_ % 2 == 0) small.buffers = memory_->callbacks();
    for (samples::MappedBuffer& words : words_)
      words = must(
          samples::MappedBuffer::create(device(), 4096 * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
    engine_.emplace(device(), *watched_, small);
    engine_->recordsSecondary = recordsSecondary();
  }
  Result<void> tryToPrepare(const InstanceDescription& instance) override {
    return engine_->recorder().prepare(instance);
  }
  samples::MappedBuffer& nextWords() { return words_[submittedFrames_ % framesInFlight]; }
  void showSome() {
    const std::span<std::byte> words = nextWords().bytes();
    for (ModelInstance& instance : model_->instances) {
      if (!instance.description.culledOnGpu) continue;
      if (chance(20)) instance.isShownByGpu = !instance.isShownByGpu;
      const std::uint32_t index = must(system().visibilityIndex(instance.handle));
      const std::uint32_t word = instance.isShownByGpu ? 1u << below(32) : 0u;
      std::memcpy(words.data() + index * 4, &word, sizeof(word));
    }
  }
  Result<void> trySubmit() override {
    showSome();
    return engine_->trySubmit(nextWords().range());
  }
  void failAt(int call) override {
    log_->failsAt = call;
    memory_->failsAt = call < 0 ? ~0u : memory_->allocations + static_cast<std::uint32_t>(call);
  }
  void addRefusedCalls(std::vector<RefusedCall>& calls) override {
    const std::uint64_t frame = engine_->frame(), completed = engine_->completedFrame();
    const auto begin = [&](std::uint64_t next, std::uint64_t complete) {
      calls.push_back({[this, next, complete] { return system().beginFrame(next, complete); }});
    };
    begin(frame, completed);
    begin(frame + 1, frame + 1);
    if (completed != 0) begin(frame + 1, completed - 1);
    calls.push_back({[this, frame] { return system().abandonFrame(frame); }});
    calls.push_back({[this] { return withoutValue(system().addMesh(tooLarge_)); }});
    calls.push_back({[this] { return engine_->recorder().prepare({.mesh = {0, 7777}}); }});
    for (const auto& [number, its] : model_->poses) {
      const PoseHandle pose = its.handle;
      if (its.figure) continue;
      if (engine_->recorder().poseRange(pose).ok()) {
        calls.push_back({[this, pose] { return withoutValue(system().writePose(pose)); }});
      } else {
        calls.push_back({[this, pose] { return system().markWritten({&pose, 1}); }});
      }
    }
    for (const ModelInstance& its : model_->instances) {
      const InstanceHandle instance = its.handle;
      if (its.description.morphWriter != MorphWriter::cpu) {
        calls.push_back({[this, instance] {
          return system().change({.instance = instance, .morphs = morphSets[0]});
        }});
      } else {
        calls.push_back({[this, instance] { return system().markMorphsWritten({&instance, 1}); }});
      }
    }
    const bool culls = std::ranges::any_of(model_->instances, [](const ModelInstance& instance) {
      return instance.description.culledOnGpu && instance.isVisible;
    });
    if (culls) calls.push_back({[this] { return engine_->recorder().record(VK_NULL_HANDLE); }});
    calls.push_back({[this] {
      return engine_->recorder().record(VK_NULL_HANDLE, {nextWords().handle(), 2});
    }});
  }
  std::vector<RefusedCall> callsBetweenFrames() override {
    return {{[this] { return engine_->recorder().record(VK_NULL_HANDLE); }},
            {[this] { return system().abandonFrame(engine_->frame() - 1); }},
            {[this] { return withoutValue(system().writePose({})); }}};
  }
  void abandon() override {
    showSome();
    engine_->abandon(nextWords().range(), [this] { changeMeanwhile(); });
  }
  std::uint64_t outputNow() override { return engine_->recorder().outputGeneration(); }
  std::vector<JointMatrix> sampleAlone(std::uint32_t play, std::uint32_t skin) override {
    const std::vector<JointMatrix> sampled =
        LoneFigure(device(), *watched_, playedClips()).sample(playedLayers(play), skin);
    expectNear(sampled, playedPose(play, skin));
    return sampled;
  }
  std::vector<JointMatrix> driveAlone(std::span<const JointMatrix> written) override {
    SystemEngine lone(device(), *watched_, {});
    const RigHandle rig = must(lone->addRig(smallRig()));
    const PoseHandle pose = lone.addPose(written, {.rig = rig});
    const MeshHandle mesh = lone.addMesh(must(pack(randomMesh(1, 3, 1, 1).view(), 1)));
    lone.addInstance({.mesh = mesh, .pose = pose});
    lone.runFrame();
    std::vector<JointMatrix> all(written.begin(), written.end());
    const Driven driven = lone.readDriven(pose, 3);
    expectNear(driven.joints, evaluated(smallRig(), written, {}).joints);
    all.insert(all.end(), driven.joints.begin(), driven.joints.end());
    return all;
  }
  /// As exact as float32 permits.
  static void expectNear(std::span<const JointMatrix> a, std::span<const JointMatrix> b) {
    ASSERT_EQ(a.size(), b.size());
    for (std::size_t joint = 0; joint < a.size(); ++joint) {
      for (std::size_t i = 0; i < 12; ++i)
        EXPECT_NEAR(a[joint].m[i / 4][i % 4], b[joint].m[i / 4][i % 4], 2e-5) << joint << ' ' << i;
    }
  }
  Streams skinAlone(const PackedMesh& mesh, std::span<const JointMatrix> pose,
                    const InstanceDescription& description,
                    std::span<const MorphWeight> morphs) override {
    return alone(mesh, pose, description, morphs);
  }

  std::optional<InterceptedDevice> intercepted_;
  std::optional<CommandLog> log_;
  std::optional<vulkan::Context> watched_;
  std::optional<CountingMemory> memory_;
  std::uint32_t systems_ = 0;  ///< of which every second has the memory of `memory_`
  const PackedMesh tooLarge_ = systemMesh(99, 10'000);  ///< more than the maximum of meshes
  std::array<samples::MappedBuffer, framesInFlight> words_;
};

/// What a system cannot be made to say: it calls these functions of its scene itself, and palettes
/// have no maximum. core_scene_test expects these errors.
bool isOfScenesOnly(const std::string& text) {
  return std::ranges::any_of(
      std::array{"there is no plan to commit", "read back", "read-back", "fewer than the ",
                 "that the frame copied", "on the CPU", "CPU path", "the CPU skins it",
                 "its mesh has no targets", "frames up to ", "newer than the last",
                 "were committed", "begins while the GPU", "more frames are in flight",
                 "call abandonFrame", "of palettes for ", "its first vertex is number ",
                 " of the buffer"},
      [&](const char* part) { return text.find(part) != std::string::npos; });
}

TEST_P(GpuModelTest, EveryStepGivesWhatTheModelSays) {
  run();
  std::set<std::string> texts = errorTexts("vulkan/recorder/frame.cpp");
  for (const char* file : {"meshes_and_poses.cpp", "figures.cpp", "frame.cpp", "instances.cpp",
                           "rigs.cpp", "slot_map.h", "stores.cpp"})
    texts.merge(errorTexts(std::string("core/scene/") + file));
  EXPECT_GT(texts.size(), 30u);
  std::erase_if(texts, isOfScenesOnly);
  texts.insert({"vkCreateShaderModule", "vkCreateComputePipelines", "vkCreateBuffer",
                "the engine's allocator has had enough"});
  expectAllGiven(texts);
}
INSTANTIATE_TEST_SUITE_P(Seeds, GpuModelTest, ::testing::Values(1u, 2u));

}  // namespace
}  // namespace dermis::test
