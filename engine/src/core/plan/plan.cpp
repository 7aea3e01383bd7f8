#include "dermis/plan.h"

#include <algorithm>
#include <bit>
#include <string>

#include "plan/check.h"
#include "plan/plan_data.h"
#include "plan/work.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

constexpr std::uint32_t copiedFrom = 0x01;   // VK_BUFFER_USAGE_TRANSFER_SRC_BIT
constexpr std::uint32_t copiedTo = 0x02;     // VK_BUFFER_USAGE_TRANSFER_DST_BIT
constexpr std::uint32_t texelBuffer = 0x04;  // VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT
constexpr std::uint32_t storage = 0x20;      // VK_BUFFER_USAGE_STORAGE_BUFFER_BIT
constexpr std::uint32_t indirect = 0x100;    // VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT

float fromOrdered(std::uint32_t bits) {
  return std::bit_cast<float>((bits & 0x80000000u) != 0 ? bits & 0x7fffffffu : ~bits);
}

}  // namespace

std::optional<Box> InstanceResult::box() const {
  Box box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (orderedMin[axis] > orderedMax[axis]) return std::nullopt;
    box.min[axis] = fromOrdered(orderedMin[axis]);
    box.max[axis] = fromOrdered(orderedMax[axis]);
  }
  return box;
}

Plan::Plan() : data_(std::make_unique<PlanData>()) {}
Plan::~Plan() = default;
Plan::Plan(Plan&&) noexcept = default;
Plan& Plan::operator=(Plan&&) noexcept = default;

std::span<const Command> Plan::commands() const {
  return data_->commands;
}
std::span<const PipelineId> Plan::pipelines() const {
  return data_->pipelines;
}
const DeviceLimits& Plan::limits() const {
  return data_->limits;
}
std::uint32_t Plan::dispatchCount() const {
  return static_cast<std::uint32_t>(std::ranges::count_if(
      data_->commands,
      [](const Command& command) { return std::holds_alternative<DispatchCommand>(command); }));
}
std::uint32_t Plan::instanceCount() const {
  return data_->instanceCount;
}
std::uint64_t Plan::vertexCount() const {
  return data_->vertexCount;
}

std::optional<std::uint64_t> Plan::statusOffset(std::uint32_t palette) const {
  // Each form has a status of its own, which says the same.
  for (const std::vector<std::uint32_t>& units : data_->paletteUnits) {
    if (palette < units.size() && units[palette] != notUsed) return units[palette] * unitBytes;
  }
  return std::nullopt;
}

std::optional<std::uint64_t> Plan::resultOffset(std::uint32_t job) const {
  if (job >= data_->results.size() || data_->results[job] == notUsed) return std::nullopt;
  return data_->results[job] * std::uint64_t{sizeof(InstanceResult)};
}

BufferRequirement Plan::buffer(BufferRole role) const {
  return data_->sizes.requirement(role, data_->tables.bytes().size(), data_->limits);
}

BufferRequirement PlanSizes::requirement(BufferRole role, std::uint64_t tables,
                                         const DeviceLimits& limits) const {
  // Whether or not this plan reads texels: a later one that does may use the same buffers.
  const std::uint32_t read = storage | (limits.texelBuffers ? texelBuffer : 0);
  const std::uint32_t written = storage | (isScene ? copiedFrom | copiedTo : 0);
  const std::uint32_t alignment = limits.minStorageBufferOffsetAlignment;
  const std::uint64_t resultBytes = results * std::uint64_t{sizeof(InstanceResult)};
  switch (role) {
    // What the host fills may be staged: written to another buffer, and copied.
    case BufferRole::meshes:
      return {meshes, alignment, read | copiedTo | (isScene ? copiedFrom : 0)};
    case BufferRole::poses:
      return {poses, alignment, read | copiedTo};
    case BufferRole::gpuPoses:
      if (isScene) return {gpuPoses, alignment, read | written};
      break;
    case BufferRole::tables:
      if (isScene) return {tables, alignment, read | copiedTo | indirect};
      return {tables, alignment, read | copiedTo};
    case BufferRole::palettes:
      return {palettes, alignment, read};
    case BufferRole::results:
      return {resultBytes, alignment, written};
    case BufferRole::positions:
      return {outputs[Stream::positions], isScene ? outputRangeAlignment(limits) : alignment,
              written};
    case BufferRole::normals:
      return {outputs[Stream::normals], alignment, written};
    case BufferRole::tangents:
      return {outputs[Stream::tangents], alignment, written};
    case BufferRole::previousPositions:
      return {outputs[Stream::previousPositions], alignment, written};
    case BufferRole::readBack:
      if (isScene) return {readBackResults + resultBytes, 4, copiedTo};
      break;
    case BufferRole::visibility:
      return {slots * std::uint64_t{4}, alignment, storage};
    case BufferRole::history:
      if (slots != 0)
        return {historyRecords + slots * std::uint64_t{sizeof(abi::HistoryRecord)}, alignment,
                written};
      break;
  }
  return {};
}

Result<void> writeTables(const Plan& plan, std::span<std::byte> bytes) {
  const std::span<const std::byte> tables = PlanData::of(plan).tables.bytes();
  if (bytes.size() < tables.size()) {
    return invalid("the tables of the plan need " + std::to_string(tables.size()) +
                   " bytes, but only " + std::to_string(bytes.size()) + " were passed");
  }
  std::ranges::copy(tables, bytes.begin());
  return {};
}

}  // namespace dermis
