// A few of the device tests, for a device that the profile layer makes look like one of another
// kind. tests/CMakeLists.txt runs them with each profile; the validation layer knows its limits.

#include <gtest/gtest.h>

#include <cstdlib>

#include "device_profiles.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"
#include "verify_product.h"

namespace dermis::test {
namespace {

class ProfileTest : public DeviceTest {
 protected:
  void SetUp() override {
    const char* name = std::getenv("DERMIS_DEVICE_PROFILE");
    if (name == nullptr) GTEST_SKIP() << "only with DERMIS_DEVICE_PROFILE";
    for (const DeviceProfile& one : deviceProfiles) {
      if (one.name == name) profile_ = &one;
    }
    ASSERT_NE(profile_, nullptr) << name;
    DeviceTest::SetUp();
  }
  void TearDown() override {
    if (profile_ != nullptr) DeviceTest::TearDown();
  }

  const DeviceProfile* profile_ = nullptr;
};

TEST_F(ProfileTest, TheDeviceLooksLikeIt) {
  VkPhysicalDeviceProperties properties{};
  device().functions().GetPhysicalDeviceProperties(device().physicalDevice(), &properties);
  EXPECT_EQ(properties.deviceType, profile_->type);
  EXPECT_GE(properties.limits.minStorageBufferOffsetAlignment, profile_->storageAlignment);
  EXPECT_LE(properties.limits.maxTexelBufferElements, profile_->texels);
  EXPECT_LE(properties.limits.maxPerStageDescriptorStorageBuffers, profile_->storageBuffers);
  EXPECT_LE(context().limits().maxStorageBuffersPerStage, profile_->storageBuffers);
  EXPECT_GE(context().limits().minStorageBufferOffsetAlignment, profile_->storageAlignment);
}

TEST_F(ProfileTest, SomeCombinationsAreInsideTheirBounds) {
  samples::VulkanTarget target(device(), context());
  verifyProduct(target, 16);
}

// Defaults of a kind of device: reads, stores, and the tuning.
TEST_F(ProfileTest, DefaultsChangeNoBit) {
  OwnedMesh mesh = randomMesh(1, 333, 20, 4);
  const PackedMesh packed = *pack(mesh.view(), 20);
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t i = 0; i < 10; ++i) poses.push_back(randomPose(i, 20, Rigidity::rigid));
  vulkan::DeviceDescription description = device().description();
  description.texelBuffers = false;
  description.stagedStores = false;
  Result<vulkan::Context> plain = vulkan::Context::create(description);
  ASSERT_TRUE(plain.ok());
  for (const Method method : {Method::linear, Method::dualQuaternion}) {
    std::vector<samples::SkinRequest> requests;
    for (const std::vector<JointMatrix>& pose : poses)
      requests.push_back({&packed, pose, JointPromise::scaleIgnored, method});
    samples::RunOptions options;
    options.tuning = context().tuning();
    const Result<samples::BatchResult> defaults =
        samples::runBatch(device(), context(), requests, options);
    options.tuning = {8, 1};
    const Result<samples::BatchResult> other =
        samples::runBatch(device(), *plain, requests, options);
    ASSERT_TRUE(defaults.ok() && other.ok());
    EXPECT_EQ(defaults->untouchedBytesChanged, 0u);
    for (std::size_t i = 0; i < requests.size(); ++i)
      EXPECT_EQ(defaults->instances[i].streams, other->instances[i].streams) << i;
  }
}

}  // namespace
}  // namespace dermis::test
