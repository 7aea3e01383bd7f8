#include "dermis/gltf.h"

#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

AttributeView optionalFloats(const std::vector<float>& values, std::uint32_t components) {
  if (values.empty()) return {};
  return attributeView(values.data(), static_cast<std::uint32_t>(values.size() / components),
                       components);
}

AttributeView influenceView(const std::vector<std::byte>& bytes, std::uint32_t vertexCount,
                            ComponentType type) {
  return {bytes.data(), vertexCount, 4 * componentSize(type), type, 4};
}

}  // namespace

PrimitiveView::PrimitiveView(const Primitive& primitive) : primitive_(&primitive) {
  const std::uint32_t count = primitive.vertexCount;
  for (const Influences& set : primitive.influences) {
    influenceSets_.push_back({influenceView(set.joints, count, set.jointType),
                              influenceView(set.weights, count, set.weightType)});
  }
  for (const MorphTarget& target : primitive.morphTargets) {
    MorphTargetView& view = morphTargets_.emplace_back();
    view.vertices = target.vertices.values();
    view.positions = optionalFloats(target.positions, 3);
    view.normals = optionalFloats(target.normals, 3);
    view.tangents = optionalFloats(target.tangents, 3);
  }
}

MeshView PrimitiveView::mesh() const& {
  MeshView view;
  view.name = primitive_->name;
  view.vertexCount = primitive_->vertexCount;
  view.positions = optionalFloats(primitive_->positions, 3);
  view.normals = optionalFloats(primitive_->normals, 3);
  view.tangents = optionalFloats(primitive_->tangents, 4);
  view.influenceSets = influenceSets_;
  view.morphTargets = morphTargets_;
  return view;
}

}  // namespace dermis::gltf
