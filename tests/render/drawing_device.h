// A device that draws, with the validation layer on, for all tests of the program.
#pragma once

#include <gtest/gtest.h>

#include <optional>
#include <string>
#include <utility>

#include "kit/render/renderer.h"
#include "test_device.h"

namespace dermis::test {

inline std::optional<samples::OpenDevice>& drawingDevice() {
  static std::optional<samples::OpenDevice> device;
  return device;
}

class DestroyDrawingDevice : public ::testing::Environment {
 public:
  void TearDown() override { drawingDevice().reset(); }
};
[[maybe_unused]] inline const ::testing::Environment* const destroyDrawingDevice =
    ::testing::AddGlobalTestEnvironment(new DestroyDrawingDevice);

/// After each test the validation layer must have been silent.
class DrawingTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!drawingDevice()) {
      samples::DeviceOptions options = testDeviceOptions();
      options.graphics = true;
      Result<samples::OpenDevice> open = samples::openDevice(options);
      if (!open) {
        ASSERT_FALSE(isContinuousIntegration()) << open.error().message;
        GTEST_SKIP() << open.error().message;
      }
      drawingDevice().emplace(std::move(*open));
    }
    Result<samples::render::Renderer> renderer = samples::render::Renderer::create(device());
    ASSERT_TRUE(renderer) << renderer.error().message;
    renderer_.emplace(std::move(*renderer));
  }

  void TearDown() override {
    if (!drawingDevice()) return;
    for (const std::string& message : device().takeValidationMessages()) ADD_FAILURE() << message;
  }

  samples::Device& device() { return *drawingDevice()->device; }

  std::optional<samples::render::Renderer> renderer_;
};

}  // namespace dermis::test
