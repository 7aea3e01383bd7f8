#include "kit/timestamps.h"

#include <array>
#include <utility>
#include <vector>

namespace dermis::samples {
namespace {

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
  const std::uint32_t bits = timestampBits(device);
  if (bits == 0) return timestamps;
  VkPhysicalDeviceProperties properties{};
  device.functions().GetPhysicalDeviceProperties(device.description().physicalDevice, &properties);
  timestamps.device_ = &device;
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

}  // namespace dermis::samples
