// The range of the accuracy contract on the CPU.

#include <gtest/gtest.h>

#include "verify_range.h"

namespace dermis::test {
namespace {

class CpuRangeTest : public ::testing::Test {
 protected:
  samples::CpuTarget target_;
};

TEST_F(CpuRangeTest, ThinMirrors) {
  verifyThinMirrors(target_);
}

TEST_F(CpuRangeTest, TinyJoints) {
  verifyTinyJoints(target_);
}

TEST_F(CpuRangeTest, LargeNumbers) {
  verifyLargeNumbers(target_);
}

TEST_F(CpuRangeTest, EntriesOfAnySize) {
  verifyEntriesOfAnySize(target_);
}

TEST_F(CpuRangeTest, HostilePoses) {
  verifyHostilePoses(target_, 4, 12);
  verifyHostilePoses(target_, 8, 12);
}

}  // namespace
}  // namespace dermis::test
