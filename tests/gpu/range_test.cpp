// The range of the accuracy contract on the GPU: with the device's arithmetic, and with denormals
// flushed to 0, as Vulkan permits.

#include <gtest/gtest.h>

#include <memory>

#include "inexact_context.h"
#include "test_device.h"
#include "verify_range.h"

namespace dermis::test {
namespace {

class RangeTest : public DeviceTest {
 protected:
  static void TearDownTestSuite() { flushing_.reset(); }

  template <typename Test>
  void run(Test test) {
    samples::VulkanTarget target(device(), context());
    test(target);
    if (!flushing_) {
      const Arithmetic arithmetic{"flushing", {.flushesDenormals = true}};
      flushing_ = std::make_unique<Inexact>(device().description(), arithmetic);
    }
    ASSERT_TRUE(flushing_->context.ok());
    samples::VulkanTarget flushing(device(), *flushing_->context);
    SCOPED_TRACE("denormals are flushed");
    test(flushing);
    EXPECT_GT(changedOperations, 0u);
  }

 private:
  inline static std::unique_ptr<Inexact> flushing_;  ///< for all tests, since it compiles kernels
};

TEST_F(RangeTest, ThinMirrors) {
  run(verifyThinMirrors);
}

TEST_F(RangeTest, TinyJoints) {
  run(verifyTinyJoints);
}

TEST_F(RangeTest, LargeNumbers) {
  run(verifyLargeNumbers);
}

TEST_F(RangeTest, EntriesOfAnySize) {
  run(verifyEntriesOfAnySize);
}

TEST_F(RangeTest, HostilePoses) {
  run([](samples::BatchTarget& target) { verifyHostilePoses(target, 4, 1); });
}

}  // namespace
}  // namespace dermis::test
