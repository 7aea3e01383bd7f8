// The Vulkan device of the GPU tests, with the validation layer on. Without a device or the layer a
// test skips and says why; where the environment variable CI is set it fails instead, so that no
// missing package looks green.
#pragma once

#include <gtest/gtest.h>

#include <string>

#include "kit/device.h"

namespace dermis::test {

/// With the validation layer, on the device that the environment variable DERMIS_TEST_DEVICE names.
samples::DeviceOptions testDeviceOptions();

/// The device of this process, made once for each choice; null where there is none, and then
/// `reason` says why.
samples::OpenDevice* testDevice(bool pushDescriptors, std::string& reason);

/// Call it before `AddGlobalTestEnvironment` for an environment whose `TearDown` uses a device:
/// what is registered first is torn down last.
void destroyDevicesAtTheEnd();

/// Whether a missing device must fail.
bool isContinuousIntegration();

/// A test on the device. After each test the validation layer must have been silent. Memory that
/// the context allocates is not zero.
class DeviceTest : public ::testing::Test {
 protected:
  void SetUp() override { useDevice(true); }
  void TearDown() override;
  void useDevice(bool pushDescriptors);

  samples::Device& device() { return *device_->device; }
  vulkan::Context& context() { return device_->context; }

  samples::OpenDevice* device_ = nullptr;
};

}  // namespace dermis::test
