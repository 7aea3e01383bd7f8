// The steps that make a `Model` of a checked source. Each throws `Failure`.
#pragma once

#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "gltf/accessor.h"

namespace dermis::gltf {

/// tinygltf's −1 for "none".
inline std::uint32_t indexOf(int index) {
  return index < 0 ? none : static_cast<std::uint32_t>(index);
}

/// nodes, nodeOrder: names, transforms, parents. Refuses cycles and nodes with two parents.
void readNodes(const Source& source, Model& model);

/// skins: joints and inverse bind matrices.
void readSkins(Source& source, Model& model);

/// materials: their factors.
void readMaterials(const Source& source, Model& model);

/// clips: channels with their keys. May take a node's matrix apart.
void readAnimations(Source& source, Model& model);

/// Looks at the accessors of every primitive of every mesh, not at their bytes. Attributes that do
/// not concern skinning are taken out where they are wrong.
void checkPrimitives(Source& source);

/// meshes, and skinnedPrimitives: what the default scene skins. Reads the primitives of those
/// meshes alone.
void readScene(Source& source, Model& model);

/// One primitive with all its bytes.
Primitive readPrimitive(Source& source, std::uint32_t mesh, std::uint32_t primitive);

/// Of the primitive that has the most.
std::uint32_t morphTargetCount(const tinygltf::Mesh& mesh);

/// "mesh 3 primitive 0", for the sentence about what is wrong with it.
std::string primitivePlace(std::size_t mesh, std::size_t primitive);

/// Divides a quaternion by its length; one without length or direction becomes the identity, as in
/// three.js. Returns how far from 1 the length was.
double normalizeQuaternion(std::array<double, 4>& quaternion);

}  // namespace dermis::gltf
