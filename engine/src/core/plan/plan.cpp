#include "dermis/plan.h"

#include <bit>
#include <cstring>
#include <string>

#include "plan/builder.h"

namespace dermis {
namespace {

constexpr std::uint32_t storageBufferUsage = 0x20;   // VK_BUFFER_USAGE_STORAGE_BUFFER_BIT
constexpr std::uint32_t texelBufferUsage = 0x04;     // VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT
constexpr std::uint32_t transferTargetUsage = 0x02;  // VK_BUFFER_USAGE_TRANSFER_DST_BIT

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

std::span<const Dispatch> Plan::dispatches() const {
  return data_->dispatches;
}
std::span<const Variant> Plan::variants() const {
  return data_->variants;
}
const DeviceLimits& Plan::limits() const {
  return data_->limits;
}
std::uint32_t Plan::instanceCount() const {
  return data_->instanceCount;
}
std::uint64_t Plan::vertexCount() const {
  return data_->vertexCount;
}

std::uint64_t Plan::statusOffset(std::uint32_t palette) const {
  // Each form has a status of its own, which says the same.
  for (const std::vector<std::uint32_t>& units : data_->paletteUnits) {
    if (palette < units.size() && units[palette] != notUsed) return units[palette] * unitBytes;
  }
  return noStatus;
}

std::uint64_t Plan::resultOffset(std::uint32_t job) const {
  if (job >= data_->results.size() || data_->results[job] == notUsed) return noResult;
  return data_->results[job] * std::uint64_t{sizeof(InstanceResult)};
}

BufferRequirement Plan::buffer(BufferRole role) const {
  // What the host fills may be staged: written to another buffer, and copied.
  constexpr std::uint32_t filled = storageBufferUsage | transferTargetUsage;
  // Whether or not this plan reads texels: a later one that does may use the same buffers.
  const std::uint32_t texels = data_->limits.texelBuffers ? texelBufferUsage : 0;
  const std::uint32_t alignment = data_->limits.minStorageBufferOffsetAlignment;
  switch (role) {
    case BufferRole::meshes:
      return {data_->meshesSize, alignment, filled | texels, false, true};
    case BufferRole::matrices:
      return {data_->matricesSize, alignment, filled | texels, true, true};
    case BufferRole::tables:
      return {data_->tables.size() * 4, alignment, filled | texels, true, true};
    case BufferRole::palettes:
      return {data_->palettesSize, alignment, storageBufferUsage | texels, true, false};
    case BufferRole::results:
      return {data_->resultCount * std::uint64_t{sizeof(InstanceResult)}, alignment,
              storageBufferUsage, true, false};
    case BufferRole::positions:
      return {data_->outputs.positions, alignment, storageBufferUsage, false, false};
    case BufferRole::normals:
      return {data_->outputs.normals, alignment, storageBufferUsage, false, false};
    case BufferRole::tangents:
      return {data_->outputs.tangents, alignment, storageBufferUsage, false, false};
    case BufferRole::previousPositions:
      return {data_->outputs.previousPositions, alignment, storageBufferUsage, false, false};
  }
  return {};
}

Result<void> writeTables(const Plan& plan, std::span<std::byte> bytes) {
  const std::vector<std::uint32_t>& tables = PlanData::of(plan).tables;
  if (bytes.size() < tables.size() * 4) {
    return invalid("the tables of the plan need " + std::to_string(tables.size() * 4) +
                   " bytes, there are " + std::to_string(bytes.size()));
  }
  if (!tables.empty()) std::memcpy(bytes.data(), tables.data(), tables.size() * 4);
  return {};
}

}  // namespace dermis
