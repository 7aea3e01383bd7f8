#include "kit/open_device.h"

#include <utility>

namespace dermis::samples {

Result<OpenDevice> openDevice(const DeviceOptions& options) {
  Result<std::unique_ptr<Device>> device = Device::create(options);
  if (!device) return device.error();
  vulkan::DeviceDescription description = (*device)->description();
  description.kernelSource = options.kernels;
  Result<vulkan::Context> context = vulkan::Context::create(description);
  if (!context) return context.error();
  return OpenDevice{std::move(*device), std::move(*context)};
}

}  // namespace dermis::samples
