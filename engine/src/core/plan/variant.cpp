#include "plan/variant.h"

namespace dermis {
namespace {

/// Calls `field` with each member and its width in bits, from the lowest bits of an ID on.
template <typename AnyVariant, typename Field>
void visitFields(AnyVariant& variant, const Field& field) {
  field(variant.oneOutput, 1);
  field(variant.workgroupSize, 8);
  field(variant.instancesPerInvocation, 6);
  field(variant.fullInfluences, 1);
  field(variant.influences, 3);
  field(variant.staged, 1);
  field(variant.recordBytes, 6);
  field(variant.pairs, 1);
  field(variant.texels, 1);
  field(variant.scales, 1);
  field(variant.rigid, 1);
  field(variant.rigged, 1);
  field(variant.bounds, 1);
  field(variant.morphs, 1);
  field(variant.motion, 1);
  for (auto& isWide : variant.wide) field(isWide, 1);
  field(variant.tangents, 4);
  field(variant.normals, 4);
  field(variant.positions, 4);
  field(variant.method, 4);
  field(variant.kernel, 3);
}

}  // namespace

PipelineId Variant::id() const {
  std::uint64_t id = 0;
  unsigned shift = 0;
  visitFields(*this, [&](auto value, unsigned bits) {
    id |= static_cast<std::uint64_t>(value) << shift;
    shift += bits;
  });
  return PipelineId{id};
}

Variant variantOf(PipelineId id) {
  Variant variant;
  auto rest = static_cast<std::uint64_t>(id);
  visitFields(variant, [&]<typename Value>(Value& value, unsigned bits) {
    value = static_cast<Value>(rest & ((1u << bits) - 1));
    rest >>= bits;
  });
  return variant;
}

bool hasResults(const Variant& variant) {
  return variant.bounds || isSnormPosition(variant.positions);
}

}  // namespace dermis
