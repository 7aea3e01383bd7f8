#include "dermis/plan.h"

#include <bit>
#include <cstring>
#include <string>

#include "plan/check.h"
#include "plan/state.h"

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

Plan::Plan() : state_(std::make_unique<State>()) {}
Plan::~Plan() = default;
Plan::Plan(Plan&&) noexcept = default;
Plan& Plan::operator=(Plan&&) noexcept = default;

std::span<const Dispatch> Plan::dispatches() const {
  return state_->dispatches;
}
std::span<const Variant> Plan::variants() const {
  return state_->variants;
}
const DeviceLimits& Plan::limits() const {
  return state_->limits;
}
std::uint32_t Plan::instanceCount() const {
  return state_->instanceCount;
}
std::uint64_t Plan::vertexCount() const {
  return state_->vertexCount;
}

std::uint64_t Plan::statusOffset(std::uint32_t palette) const {
  // Each form has a status of its own, which says the same.
  for (const std::vector<std::uint32_t>& units : state_->paletteUnits) {
    if (palette < units.size() && units[palette] != notUsed) return units[palette] * unitBytes;
  }
  return noStatus;
}

std::uint64_t Plan::resultOffset(std::uint32_t job) const {
  if (job >= state_->results.size() || state_->results[job] == notUsed) return noResult;
  return state_->results[job] * std::uint64_t{sizeof(InstanceResult)};
}

BufferRequirement Plan::buffer(BufferRole role) const {
  // What the host fills may be staged: written to another buffer, and copied.
  constexpr std::uint32_t filled = storageBufferUsage | transferTargetUsage;
  // Whether or not this plan reads texels: a later one that does may use the same buffers.
  const std::uint32_t texels = state_->limits.maxTexelBufferElements != 0 ? texelBufferUsage : 0;
  const std::uint32_t alignment = state_->limits.minStorageBufferOffsetAlignment;
  switch (role) {
    case BufferRole::meshes:
      return {state_->meshesSize, alignment, filled | texels, false, true};
    case BufferRole::matrices:
      return {state_->matricesSize, alignment, filled | texels, true, true};
    case BufferRole::tables:
      return {state_->tables.size() * 4, alignment, filled | texels, true, true};
    case BufferRole::palettes:
      return {state_->palettesSize, alignment, storageBufferUsage | texels, true, false};
    case BufferRole::results:
      return {state_->resultCount * std::uint64_t{sizeof(InstanceResult)}, alignment,
              storageBufferUsage, true, false};
    case BufferRole::positions:
      return {state_->outputs.positions, alignment, storageBufferUsage, false, false};
    case BufferRole::normals:
      return {state_->outputs.normals, alignment, storageBufferUsage, false, false};
    case BufferRole::tangents:
      return {state_->outputs.tangents, alignment, storageBufferUsage, false, false};
    case BufferRole::previousPositions:
      return {state_->outputs.previousPositions, alignment, storageBufferUsage, false, false};
  }
  return {};
}

Result<void> makePlan(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning,
                      Plan& out) {
  if (out.state_ == nullptr) out.state_ = std::make_unique<Plan::State>();
  out.state_->clear();
  Result<void> built = out.state_->build(batch, limits, tuning);
  if (!built) out.state_->clear();
  return built;
}

Result<void> writeTables(const Plan& plan, std::span<std::byte> bytes) {
  const std::vector<std::uint32_t>& tables = plan.state_->tables;
  if (bytes.size() < tables.size() * 4) {
    return invalid("the tables of the plan need " + std::to_string(tables.size() * 4) +
                   " bytes, there are " + std::to_string(bytes.size()));
  }
  if (!tables.empty()) std::memcpy(bytes.data(), tables.data(), tables.size() * 4);
  return {};
}

}  // namespace dermis
