// Views of a mesh in the caller's memory: vertices in bind pose and their influences. A view copies
// nothing and owns nothing. The memory must stay valid and unchanged during the call that takes the
// view.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace dermis {

/// How one component of an attribute is stored. As in Vulkan and glTF, the value of a `unorm` type
/// is the integer divided by its maximum, and the value of a `snorm` type is the same, but at least
/// -1. float16 is IEEE 754 binary16.
enum class ComponentType : std::uint8_t {
  float32 = 0,
  float16 = 1,
  snorm8 = 2,
  snorm16 = 3,
  unorm8 = 4,
  unorm16 = 5,
  uint8 = 6,
  uint16 = 7,
  uint32 = 8,
};

/// Bytes of one component.
constexpr std::uint32_t componentSize(ComponentType type) {
  switch (type) {
    case ComponentType::snorm8:
    case ComponentType::unorm8:
    case ComponentType::uint8:
      return 1;
    case ComponentType::float16:
    case ComponentType::snorm16:
    case ComponentType::unorm16:
    case ComponentType::uint16:
      return 2;
    case ComponentType::float32:
    case ComponentType::uint32:
      return 4;
  }
  return 0;
}

/// One attribute: `count` elements of `components` components each, `stride` bytes apart. So it can
/// be part of interleaved vertices. Needs no alignment.
struct AttributeView {
  const void* data = nullptr;  ///< the first element; null if the mesh does not have the attribute
  /// Number of elements: `MeshView::vertexCount`, or the size of `MorphTargetView::vertices` if
  /// that is not empty.
  std::uint32_t count = 0;
  /// Bytes from one element to the next; at least the size of an element.
  std::uint32_t stride = 0;
  ComponentType type = ComponentType::float32;
  std::uint32_t components = 0;  ///< per element

  /// Whether the mesh has the attribute.
  explicit operator bool() const { return data != nullptr; }
};

/// Joints and weights of every vertex. `components` is the number of influences per vertex: 4 in a
/// set of glTF, any number here, the same for joints and weights. An influence of weight 0 is
/// ignored, whatever its joint is.
struct InfluenceSet {
  AttributeView joints;   ///< uint8, uint16, uint32, or float32 with whole numbers
  AttributeView weights;  ///< float32, unorm8 or unorm16
};

/// One morph target (blend shape): displacements that are multiplied by a weight and added to the
/// attributes in bind pose, before skinning. If an attribute is absent here, it is not displaced.
/// If the mesh does not have the attribute, its displacements are ignored. `pack` stores only
/// vertices with a displacement other than zero.
struct MorphTargetView {
  /// The vertices that the elements below belong to, strictly ascending. If empty, there is an
  /// element for each vertex of the mesh.
  std::span<const std::uint32_t> vertices;
  /// float32, float16 or snorm16, 3 components (a fourth is ignored), multiplied by
  /// `positionScale`.
  AttributeView positions;
  AttributeView normals;   ///< float32, float16, snorm8 or snorm16, 3 components or 4
  AttributeView tangents;  ///< the same; the handedness is not displaced
  std::array<float, 3> positionScale{1, 1, 1};
};

/// A morph target that is active on an instance, and its weight.
struct MorphWeight {
  std::uint32_t target = 0;  ///< index into `MeshView::morphTargets`
  float weight = 0;          ///< any finite number; a target with weight 0 is not active
};

/// A mesh in bind pose. The influences of a vertex are those of all sets together, in any order and
/// any number. Weights need not sum to 1: they are normalized. If a joint occurs twice in a vertex,
/// its weights are added.
struct MeshView {
  std::string_view name;  ///< for messages only
  std::uint32_t vertexCount = 0;
  /// Required. float32, float16, snorm16 or unorm16, 3 components (a fourth is ignored). Each
  /// component is multiplied by `positionScale`; then `positionOffset` is added.
  AttributeView positions;
  std::array<float, 3> positionScale{1, 1, 1};
  std::array<float, 3> positionOffset{0, 0, 0};
  /// Optional. float32, float16, snorm8 or snorm16, 3 components (a fourth is ignored). A zero
  /// normal stays zero.
  AttributeView normals;
  /// Optional. The same types, 4 components. The fourth is the handedness: -1 if it is negative,
  /// otherwise 1.
  AttributeView tangents;
  std::span<const InfluenceSet> influenceSets;    ///< at least one
  std::span<const MorphTargetView> morphTargets;  ///< may be empty

  // -- Inputs of some methods. Morph targets do not change them.

  /// For `Method::blended`: from 0 (linear) to 1 (dual quaternions). Optional; float32, unorm8 or
  /// unorm16, 1 component.
  AttributeView dualQuaternionWeights;
  float dualQuaternionWeight = 0.5f;  ///< of every vertex, if `dualQuaternionWeights` is absent
  /// For `Method::bulgeControlled`: from 0 (bulges like dual quaternions) to 1 (bulges as little as
  /// `Method::centerOfRotation`). Optional; the same types.
  AttributeView bulgeStrengths;
  float bulgeStrength = 1;  ///< of every vertex, if `bulgeStrengths` is absent
  /// For methods that `needsCentersOfRotation`: points in bind space, float32, 3 components.
  /// `CenterOfRotationSolver` computes them (centers_of_rotation.h).
  AttributeView centersOfRotation;
};

/// A view of float32 values. `stride` is in bytes; 0 if elements are tightly packed.
inline AttributeView floatAttribute(const float* data, std::uint32_t count,
                                    std::uint32_t components, std::uint32_t stride = 0) {
  return {data, count, stride != 0 ? stride : components * 4, ComponentType::float32, components};
}

}  // namespace dermis
