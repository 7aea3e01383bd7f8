// Poses that the kernels sample: all tests of clips_models_test.cpp and clips_sample_test.cpp that
// compare poses with the reference, on the device.
#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <string>

#include "clip_rig.h"
#include "lone_figure.h"
#include "played_clips.h"
#include "smooth_walk.h"
#include "system_engine.h"
#include "test_device.h"

namespace dermis::test {
namespace {

class OnDevice : public ::testing::Environment {
 public:
  void SetUp() override {
    std::string reason;
    samples::OpenDevice* const open = testDevice(true, reason);
    if (open == nullptr) {
      if (isContinuousIntegration()) FAIL() << reason;
      GTEST_SKIP() << reason;
    }
    device_ = open->device.get();
    setClipSampler([open](const PackedClips& clips) {
      const auto figure = std::make_shared<LoneFigure>(*open->device, open->context, clips);
      return [figure](std::span<const ClipLayer> layers, std::uint32_t skin) {
        return figure->sample(layers, skin);
      };
    });
  }
  void TearDown() override {
    setClipSampler({});
    if (device_ == nullptr) return;
    for (const std::string& message : device_->takeValidationMessages()) ADD_FAILURE() << message;
  }

 private:
  samples::Device* device_ = nullptr;
};

TEST(ClipsOnDevice, PosesPromiseToBeRigidIfNoClipScales) {
  std::string reason;
  samples::OpenDevice* const open = testDevice(true, reason);
  ASSERT_NE(open, nullptr) << reason;
  const LoneFigure lone(*open->device, open->context, playedClips());
  const auto needs = [&](std::uint32_t skin) {
    return must(lone.scene().pipelineNeeds({.pose = must(lone.scene().pose(lone.figure(), skin))}));
  };
  EXPECT_EQ(needs(0).promise, JointPromise::scaling);
  EXPECT_EQ(needs(1).promise, JointPromise::rigid);
  EXPECT_TRUE(needs(0).figures);
}

/// Nothing moves, so there is nothing to sample, and all joints are at rest.
TEST(ClipsOnDevice, ABankThatMovesNothingGivesTheRestPose) {
  std::string reason;
  samples::OpenDevice* const open = testDevice(true, reason);
  ASSERT_NE(open, nullptr) << reason;
  PackedRig rig(armRig());
  rig.clips.clear();
  ASSERT_TRUE(rig.pack());
  EXPECT_EQ(rig.bank->nodeCount(), 0u);
  for (std::uint32_t skin = 0; skin < rig.skeleton.skins.size(); ++skin) {
    std::vector<JointMatrix> expected(rig.bank->jointCount(skin));
    must(samplePose(*rig.bank, {}, skin, expected));
    EXPECT_TRUE(areSame(rig.sample(std::span<const ClipLayer>(), skin), expected));
  }
}

TEST(SmoothWalkOnDevice, SeldomUpdatesAreAsSmoothAsTheBarsSay) {
  std::string reason;
  samples::OpenDevice* const open = testDevice(true, reason);
  ASSERT_NE(open, nullptr) << reason;
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  SmoothWalk(*data).check<SystemEngine>(
      [&](std::optional<SystemEngine>& engine) {
        vulkan::SceneRecorderDescription description;
        engine.emplace(*open->device, open->context, description);
      },
      [](SystemEngine& engine, const InstanceDescription& instance) {
        must(engine.recorder().prepare(instance));
      });
}

const auto* const onDevice =
    (destroyDevicesAtTheEnd(), ::testing::AddGlobalTestEnvironment(new OnDevice));

}  // namespace
}  // namespace dermis::test
