// Views of a mesh in the caller's memory: bind-pose vertices and their influences. Nothing is
// copied, nothing is owned; the memory must stay as it is for the call that takes the view, no
// longer.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace dermis {

/// How one component of an attribute is stored. `unorm` types stand for the value divided by the
/// type's largest, `snorm` types likewise and no less than -1 (as in Vulkan and glTF). float16 is
/// IEEE 754 binary16.
enum class ComponentType : std::uint8_t {
  float32,
  float16,
  snorm8,
  snorm16,
  unorm8,
  unorm16,
  uint8,
  uint16,
  uint32
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

/// `count` elements of `components` components each, `stride` bytes apart: any interleaving.
/// Alignment is not needed.
struct AttributeView {
  const void* data = nullptr;  ///< The first element; null where the mesh lacks the attribute.
  std::uint32_t count = 0;     ///< Elements: the mesh's vertex count.
  std::uint32_t stride =
      0;  ///< Bytes from one element to the next, at least the size of an element.
  ComponentType type = ComponentType::float32;
  std::uint32_t components = 0;

  explicit operator bool() const { return data != nullptr; }
};

/// Joints and their weights for every vertex: `components` influences a vertex (4 in a glTF set;
/// any number here). A slot of weight 0 is no influence, whatever its joint.
struct InfluenceSet {
  AttributeView joints;   ///< uint8, uint16 or uint32
  AttributeView weights;  ///< float32, unorm8 or unorm16
};

/// One morph target (blend shape): displacements that are added, times a weight, to the attributes
/// in bind pose, before skinning. An absent attribute is not displaced; one that the mesh lacks is
/// ignored. What is zero costs nothing: `pack` stores the displaced vertices only.
struct MorphTargetView {
  /// The vertices that the elements below belong to, strictly rising. Empty: all, in their order.
  std::span<const std::uint32_t> vertices;
  AttributeView positions;  ///< float32, float16 or snorm16 × 3, times `positionScale`
  AttributeView normals;    ///< float32, float16, snorm8 or snorm16 × 3
  AttributeView tangents;   ///< likewise; the handedness is not displaced
  std::array<float, 3> positionScale{1, 1, 1};
};

/// One morph target at work on an instance.
struct MorphWeight {
  std::uint32_t target = 0;  ///< index into `MeshView::morphTargets`
  float weight = 0;          ///< any finite number; 0 is as if it were not there
};

/// A mesh in bind pose. The influences of a vertex are those of all sets together, in any order and
/// any number; they need not sum to 1 (they are normalised) and a joint may stand twice (its
/// weights are added up).
struct MeshView {
  std::string_view name;  ///< For messages only.
  std::uint32_t vertexCount = 0;
  /// float32, float16, snorm16 or unorm16, × 3 (a fourth component is not read), each component
  /// times `positionScale` plus `positionOffset`.
  AttributeView positions;
  std::array<float, 3> positionScale{1, 1, 1};
  std::array<float, 3> positionOffset{0, 0, 0};
  /// float32, float16, snorm8 or snorm16, × 3 (a fourth is not read), or absent. A zero normal
  /// stays zero.
  AttributeView normals;
  /// The same types × 4, or absent; the fourth is the handedness: negative, or not.
  AttributeView tangents;
  std::span<const InfluenceSet> influenceSets;
  std::span<const MorphTargetView> morphTargets;

  // Inputs of some methods. Morph targets do not change them.
  /// `Method::blended`, float32, unorm8 or unorm16 × 1: from 0, linear, to 1, dual quaternions.
  AttributeView dualQuaternionWeights;
  float dualQuaternionWeight = 0.5f;  ///< of every vertex, where those are absent
  /// `Method::bulgeControlled`, the same types: from 0, as much as dual quaternions bulge, to 1, as
  /// little as `Method::centerOfRotation`.
  AttributeView bulgeStrengths;
  float bulgeStrength = 1;  ///< of every vertex, where those are absent
  /// Points in bind space, float32 × 3, that `CenterOfRotationSolver` finds
  /// (centers_of_rotation.h).
  AttributeView centersOfRotation;
};

/// A float32 attribute; `stride` in bytes, 0 for tightly packed.
inline AttributeView floatAttribute(const float* data, std::uint32_t count,
                                    std::uint32_t components, std::uint32_t stride = 0) {
  return {data, count, stride != 0 ? stride : components * 4, ComponentType::float32, components};
}

}  // namespace dermis
