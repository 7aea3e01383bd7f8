#include "kit/timestamps.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <utility>
#include <vector>

namespace dermis::samples {
namespace {

/// How long a measurement keeps a GPU busy.
constexpr double busySeconds = 20e-3;

std::uint32_t timestampBits(const Device& device) {
  const VkPhysicalDevice physicalDevice = device.description().physicalDevice;
  std::uint32_t count = 0;
  device.functions().GetPhysicalDeviceQueueFamilyProperties(physicalDevice, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  device.functions().GetPhysicalDeviceQueueFamilyProperties(physicalDevice, &count,
                                                            families.data());
  return families[device.queueFamily()].timestampValidBits;
}

}  // namespace

Result<Timestamps> Timestamps::create(Device& device) {
  Timestamps timestamps;
  timestamps.device_ = &device;
  const std::uint32_t bits = timestampBits(device);
  if (bits == 0) return timestamps;
  VkPhysicalDeviceProperties properties{};
  device.functions().GetPhysicalDeviceProperties(device.description().physicalDevice, &properties);
  timestamps.validBits_ = bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
  timestamps.period_ = static_cast<double>(properties.limits.timestampPeriod) * 1e-9;
  VkQueryPoolCreateInfo info{};
  info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
  info.queryType = VK_QUERY_TYPE_TIMESTAMP;
  info.queryCount = 2;
  if (const VkResult result =
          device.functions().CreateQueryPool(device.handle(), &info, nullptr, &timestamps.pool_);
      result != VK_SUCCESS) {
    timestamps.pool_ = VK_NULL_HANDLE;
    return vulkanError("vkCreateQueryPool", result);
  }
  return timestamps;
}

Timestamps::~Timestamps() {
  if (has()) device_->functions().DestroyQueryPool(device_->handle(), pool_, nullptr);
}

Timestamps& Timestamps::operator=(Timestamps&& other) noexcept {
  std::swap(device_, other.device_);
  std::swap(pool_, other.pool_);
  std::swap(validBits_, other.validBits_);
  std::swap(period_, other.period_);
  return *this;
}

void Timestamps::recordBegin(VkCommandBuffer commandBuffer) const {
  if (!has()) return;
  device_->functions().CmdResetQueryPool(commandBuffer, pool_, 0, 2);
  // After all earlier commands are complete; otherwise they would be timed, too.
  device_->functions().CmdWriteTimestamp(commandBuffer, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool_,
                                         0);
}

void Timestamps::recordEnd(VkCommandBuffer commandBuffer) const {
  if (!has()) return;
  device_->functions().CmdWriteTimestamp(commandBuffer, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, pool_,
                                         1);
}

Result<double> Timestamps::seconds() const {
  std::array<std::uint64_t, 2> ticks{};
  if (const VkResult result = device_->functions().GetQueryPoolResults(
          device_->handle(), pool_, 0, 2, sizeof(ticks), ticks.data(), sizeof(ticks[0]),
          VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT);
      result != VK_SUCCESS) {
    return vulkanError("vkGetQueryPoolResults", result);
  }
  // The counter may have wrapped around.
  return static_cast<double>((ticks[1] - ticks[0]) & validBits_) * period_;
}

Result<double> Timestamps::measure(VkCommandBuffer commandBuffer) const {
  const auto execute = [this, commandBuffer](std::uint32_t times) -> Result<double> {
    const auto begin = std::chrono::steady_clock::now();
    if (Result<void> done = device_->submitAndWait(commandBuffer, times); !done)
      return done.error();
    if (has()) return seconds();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count() / times;
  };
  const Result<double> once = execute(1);
  if (!once || device_->info().type == "CPU") return once;
  const double times = std::ceil(busySeconds / std::max(*once, 1e-9));
  return execute(static_cast<std::uint32_t>(std::clamp(times, 1.0, 1000.0)));
}

}  // namespace dermis::samples
