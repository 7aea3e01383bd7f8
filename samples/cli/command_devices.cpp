#include <fmt/format.h>

#include "commands.h"
#include "kit/device.h"

namespace dermis::cli {
namespace {

ExitStatus listDevices() {
  const Result<std::vector<samples::DeviceInfo>> devices = samples::listDevices();
  if (!devices) return reportDeviceError(devices.error());
  if (devices->empty())
    return reportError(ExitStatus::noDevice, "there is no Vulkan device on this machine");
  for (std::size_t index = 0; index < devices->size(); ++index) {
    const samples::DeviceInfo& info = (*devices)[index];
    fmt::print("{}  {}\n", index, info.name);
    fmt::print("   {}, Vulkan {}.{}.{}, {}\n", info.type, VK_API_VERSION_MAJOR(info.apiVersion),
               VK_API_VERSION_MINOR(info.apiVersion), VK_API_VERSION_PATCH(info.apiVersion),
               info.unusable.empty() ? "usable" : "not usable: " + info.unusable);
    fmt::print(
        "   maximum storage buffer range {} MiB; {} storage buffers per stage; {} workgroups per "
        "dimension; push descriptors: {}\n",
        info.maxStorageBufferRange >> 20, info.storageBuffersPerStage, info.maxWorkgroupCount,
        info.pushDescriptors ? "yes" : "no");
  }
  return ExitStatus::done;
}

}  // namespace

Run addDevices(CLI::App& app) {
  app.add_subcommand("devices", "List the Vulkan devices, and what each can do");
  return listDevices;
}

}  // namespace dermis::cli
