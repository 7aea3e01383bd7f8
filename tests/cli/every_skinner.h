// Everything that skins a scene: the reference, the device, and the CPU path by each instruction
// set.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <vector>

#include "dermis/cpu.h"
#include "scene_skinner.h"
#include "test_device.h"

namespace dermis::test {

/// "reference", "device", and names of `cpu::targetNames`.
inline std::vector<std::string> skinnerNames() {
  std::vector<std::string> names{"reference", "device"};
  for (const std::string_view instructions : cpu::targetNames()) names.emplace_back(instructions);
  return names;
}

class SkinnerTest : public ::testing::TestWithParam<std::string> {
 protected:
  void SetUp() override {
    if (isReference()) return;
    if (!onDevice()) {
      target_ = std::make_unique<samples::CpuTarget>(GetParam());
      return;
    }
    std::string reason;
    device_ = testDevice(true, reason);
    if (device_ != nullptr) {
      target_ = std::make_unique<samples::VulkanTarget>(*device_->device, device_->context);
      return;
    }
    ASSERT_FALSE(isContinuousIntegration()) << reason;
    GTEST_SKIP() << reason;
  }

  static bool isReference() { return GetParam() == "reference"; }
  static bool onDevice() { return GetParam() == "device"; }

  /// All positions of a scene in a pose, 3 a vertex.
  std::vector<float> skinScene(const cli::Scene& scene, const cli::ScenePose& pose,
                               Method method) const {
    const cli::SkinParts skinner = isReference()
                                       ? cli::referenceSkinner(scene, method)
                                       : cli::targetSkinner(scene, method, false, *target_);
    const Result<std::vector<cli::SkinnedPart>> parts = skinner(pose);
    EXPECT_TRUE(parts.ok()) << (parts ? "" : parts.error().message);
    std::vector<float> positions;
    for (const cli::SkinnedPart& part : parts ? *parts : std::vector<cli::SkinnedPart>{})
      positions.insert(positions.end(), part.positions.begin(), part.positions.end());
    return positions;
  }

  samples::OpenDevice* device_ = nullptr;

 private:
  std::unique_ptr<samples::BatchTarget> target_;
};

}  // namespace dermis::test
