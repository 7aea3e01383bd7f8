// Views of a mesh in the caller's memory: bind-pose vertices and their influences. Nothing is
// copied, nothing is owned; the memory must stay as it is for the call that takes the view, no
// longer.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

namespace dermis {

/// How one component of an attribute is stored. `unorm` types stand for the value divided by the
/// type's largest.
enum class ComponentType : std::uint8_t { float32, unorm8, unorm16, uint8, uint16, uint32 };

/// Bytes of one component.
constexpr std::uint32_t componentSize(ComponentType type) {
  switch (type) {
    case ComponentType::unorm8:
    case ComponentType::uint8:
      return 1;
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

/// A mesh in bind pose. The influences of a vertex are those of all sets together, in any order;
/// they need not sum to 1 (they are normalised) and a joint may stand twice (its weights are added
/// up).
struct MeshView {
  std::string_view name;  ///< For messages only.
  std::uint32_t vertexCount = 0;
  AttributeView positions;  ///< float32 × 3
  AttributeView normals;    ///< float32 × 3, or absent. A zero normal stays zero.
  AttributeView tangents;   ///< float32 × 4 (w the handedness, ±1), or absent. Not skinned yet.
  std::span<const InfluenceSet> influenceSets;
};

/// A float32 attribute; `stride` in bytes, 0 for tightly packed.
inline AttributeView floatAttribute(const float* data, std::uint32_t count,
                                    std::uint32_t components, std::uint32_t stride = 0) {
  return {data, count, stride != 0 ? stride : components * 4, ComponentType::float32, components};
}

}  // namespace dermis
