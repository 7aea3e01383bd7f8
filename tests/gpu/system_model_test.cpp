// Random steps on the GPU beside the model (model_steps.h). Half of the tests record into secondary
// command buffers.
#include <gtest/gtest.h>

#include <array>
#include <cstring>
#include <span>
#include <string>

#include "model_steps.h"
#include "system_test.h"

namespace dermis::test {
namespace {

class GpuModelTest : public SystemTest,
                     public ModelSteps<SystemEngine>,
                     public ::testing::WithParamInterface<std::uint32_t> {
 protected:
  GpuModelTest() : ModelSteps(GetParam()) {}
  void TearDown() override {
    engine_.reset();
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
    vulkan::SkinningSystemDescription small = description();
    small.framesInFlight = framesInFlight;
    small.meshCapacity = {2048, 512 << 10};
    small.jointCapacity = {8, 8 * 40};
    small.gpuJointCapacity = {0, 8 * 40};
    small.instanceCapacity = {4, 200};
    small.boundsCapacity = {1};
    small.outputCapacity = outputCapacity;
    for (samples::MappedBuffer& words : words_)
      words = must(
          samples::MappedBuffer::create(device(), 4096 * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
    engine_.emplace(device(), small);
    engine_->recordsSecondary = recordsSecondary();
  }
  void prepare(const InstanceDescription& instance) override { must(system().prepare(instance)); }
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
  void submit() override {
    showSome();
    engine_->submit({nextWords().handle(), 0});
  }
  void abandon() override {
    showSome();
    engine_->abandon({nextWords().handle(), 0}, [this] { changeMeanwhile(); });
  }
  std::uint64_t outputGeneration() override { return system().outputGeneration(); }
  Streams skinAlone(const PackedMesh& mesh, std::span<const JointMatrix> pose,
                    const InstanceDescription& description,
                    std::span<const MorphWeight> morphs) override {
    return alone(mesh, pose, description, morphs);
  }

  std::array<samples::MappedBuffer, framesInFlight> words_;
};

TEST_P(GpuModelTest, EveryStepGivesWhatTheModelSays) {
  run();
}
INSTANTIATE_TEST_SUITE_P(Seeds, GpuModelTest, ::testing::Values(1u, 2u, 3u));

}  // namespace
}  // namespace dermis::test
