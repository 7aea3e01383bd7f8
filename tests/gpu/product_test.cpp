// The product of methods, inputs and outputs, by pairs, over random meshes with awkward counts,
// with the validation layer watching. Of common values, each of which meets every method, as in
// `dermis verify --quick`; exhaustive_test has all values and more kinds of devices.

#include <gtest/gtest.h>

#include "exhaustive.h"
#include "intercepted_device.h"
#include "test_device.h"
#include "verify_product.h"

namespace dermis::test {
namespace {

class ProductTest : public DeviceTest {
 protected:
  /// One case in every `step`.
  void verify(vulkan::Context& context, std::size_t step) {
    samples::VulkanTarget target(device(), context);
    verifyProduct(target, step, isExhaustive ? samples::Coverage::full : samples::Coverage::quick);
  }
};

TEST_F(ProductTest, EveryCombinationIsInsideItsBounds) {
  verify(context(), 1);
}

TEST_F(ProductTest, WithoutFeatures) {
  vulkan::DeviceDescription description = device().description();
  description.enabledFeatures = nullptr;
  Result<vulkan::Context> words = vulkan::Context::create(description);
  ASSERT_TRUE(words.ok()) << words.error().message;
  ASSERT_FALSE(words->limits().texelBuffers);
  verify(*words, 4);
}

TEST_F(ProductTest, WithTheFourStorageBuffersThatEveryDeviceHas) {
  InterceptedDevice few(device().description());
  few.changeLimits(
      [](VkPhysicalDeviceLimits& limits) { limits.maxPerStageDescriptorStorageBuffers = 4; });
  Result<vulkan::Context> four = vulkan::Context::create(few.description());
  ASSERT_TRUE(four.ok()) << four.error().message;
  ASSERT_EQ(four->limits().maxStorageBuffersPerStage, 4u);
  verify(*four, 4);
}

#ifdef DERMIS_EXHAUSTIVE

TEST_F(ProductTest, WithoutPushDescriptors) {
  useDevice(false);
  verify(context(), 4);
}

// As on discrete GPUs, of which vertices of every day go through workgroup memory.
TEST_F(ProductTest, WithStagedStores) {
  vulkan::DeviceDescription description = device().description();
  description.texelBuffers = false;
  description.stagedStores = true;
  Result<vulkan::Context> staged = vulkan::Context::create(description);
  ASSERT_TRUE(staged.ok()) << staged.error().message;
  verify(*staged, 4);
}

#endif

}  // namespace
}  // namespace dermis::test
