#include "test_device.h"

#include <array>
#include <cstdlib>
#include <optional>
#include <utility>

namespace dermis::test {
namespace {

struct Attempt {
  bool tried = false;
  std::string reason;
  std::optional<samples::OpenDevice> device;
};

std::array<Attempt, 2> attempts;

/// Devices go before the process's static objects do: those of the loader and its layers among
/// them.
class DestroyDevices : public ::testing::Environment {
 public:
  void TearDown() override {
    for (Attempt& attempt : attempts) attempt.device.reset();
  }
};
[[maybe_unused]] const ::testing::Environment* const destroyDevices =
    ::testing::AddGlobalTestEnvironment(new DestroyDevices);

void tryToCreate(bool pushDescriptors, Attempt& attempt) {
  samples::DeviceOptions options = testDeviceOptions();
  options.pushDescriptors = pushDescriptors;
  Result<samples::OpenDevice> device = samples::openDevice(options);
  if (device) {
    attempt.device.emplace(std::move(*device));
  } else {
    attempt.reason = device.error().message;
  }
}

}  // namespace

samples::DeviceOptions testDeviceOptions() {
  samples::DeviceOptions options;
  options.validation = true;
  const char* wanted = std::getenv("DERMIS_TEST_DEVICE");
  if (wanted != nullptr) options.device = wanted;
  return options;
}

samples::OpenDevice* testDevice(bool pushDescriptors, std::string& reason) {
  Attempt& attempt = attempts[pushDescriptors ? 1 : 0];
  if (!attempt.tried) {
    attempt.tried = true;
    tryToCreate(pushDescriptors, attempt);
  }
  reason = attempt.reason;
  return attempt.device ? &*attempt.device : nullptr;
}

bool isContinuousIntegration() {
  return std::getenv("CI") != nullptr;
}

void DeviceTest::useDevice(bool pushDescriptors) {
  std::string reason;
  device_ = testDevice(pushDescriptors, reason);
  if (device_ != nullptr) return;
  if (isContinuousIntegration())
    FAIL() << "CI needs a Vulkan device and the validation layer: " << reason;
  GTEST_SKIP() << reason;
}

void DeviceTest::TearDown() {
  if (device_ == nullptr) return;
  for (const std::string& message : device().takeValidationMessages()) ADD_FAILURE() << message;
}

}  // namespace dermis::test
