// A device and Dermis' context on it.
#pragma once

#include <memory>

#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "kit/device.h"

namespace dermis::samples {

/// The context is declared last, so that it is destroyed before the device.
struct OpenDevice {
  std::unique_ptr<Device> device;
  vulkan::Context context;
};

Result<OpenDevice> openDevice(const DeviceOptions& options);

}  // namespace dermis::samples
