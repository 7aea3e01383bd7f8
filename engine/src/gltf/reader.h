// The steps that make a `Model` from a checked source. Each may throw `Failure`.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "core/clips/interpolate.h"
#include "dermis/gltf.h"
#include "gltf/accessor.h"

namespace dermis::gltf {

/// An index from tinygltf; its −1 becomes `none`.
inline std::uint32_t indexOf(int index) {
  return index < 0 ? noIndex : static_cast<std::uint32_t>(index);
}

/// Reads nodes and nodeOrder: names, transforms, parents. Refuses cycles and nodes with two
/// parents.
void readNodes(const Source& source, Model& model);

/// Reads skins: joints and inverse bind matrices.
void readSkins(Source& source, Model& model);

/// Reads materials: their factors.
void readMaterials(const Source& source, Model& model);

/// Reads clips: channels with their keys. May decompose a node's matrix.
void readAnimations(Source& source, Model& model);

/// Checks the accessors of every primitive of every mesh, but not their bytes. Removes faulty
/// attributes that skinning does not need. Returns which meshes must not be read; nothing skinned
/// uses them.
std::vector<bool> checkPrimitives(Source& source);

/// Reads meshes, and skinnedPrimitives: what the default scene skins. Reads only the primitives of
/// those meshes. With `LoadOptions::rigidMeshes`, adds rigid meshes and their skins.
void readScene(Source& source, const std::vector<bool>& faultyMeshes, const LoadOptions& options,
               Model& model);

/// Computes the normals of a primitive that has none. Its vertices may become others.
void addNormals(Source& source, MissingNormals kind, const std::string& where,
                Primitive& primitive);

/// Reads primitives with all their data. Decodes each accessor once, however many use it.
class PrimitiveReader {
 public:
  PrimitiveReader(Source& source, MissingNormals missingNormals)
      : source_(source), missingNormals_(missingNormals) {}

  Primitive read(std::uint32_t mesh, std::uint32_t primitive);

  /// One influence per vertex: joint 0.
  Influences rigidInfluences(std::uint32_t vertexCount);

 private:
  /// The element of `known` with this key; `decode` makes it if there is none.
  template <typename Key, typename Value, typename Decode>
  static const Value& once(std::map<Key, Value>& known, const Key& key, Decode decode) {
    const auto found = known.find(key);
    return found != known.end() ? found->second : known.emplace(key, decode()).first->second;
  }
  SharedArray<float> floats(int accessor);
  std::vector<SharedArray<float>> texcoords(const std::map<std::string, int>& attributes);
  std::vector<Influences> influences(const std::map<std::string, int>& attributes,
                                     const std::string& where);
  MorphTarget target(const std::map<std::string, int>& attributes);

  Source& source_;
  MissingNormals missingNormals_;
  // By accessor. Joints, weights and colors may be converted.
  std::map<int, SharedArray<float>> floats_, colors_;
  std::map<int, SharedArray<std::byte>> joints_, weights_;
  /// By the accessor of the indices, mode, and number of vertices.
  std::map<std::tuple<int, int, std::uint32_t>, SharedArray<std::uint32_t>> triangles_;
  std::map<std::array<int, 3>, MorphTarget> targets_;  ///< sparse ones
  std::map<std::uint32_t, Influences> rigid_;          ///< by number of vertices
};

/// Number of morph targets of the primitive that has the most.
std::uint32_t morphTargetCount(const tinygltf::Mesh& mesh);

/// Names a primitive in messages: "mesh 3 primitive 0".
std::string primitivePlace(std::size_t mesh, std::size_t primitive);

/// Whether the length of a rotation counts as 1. The tolerance is that of the official validator:
/// the length may differ by so much if the components are rounded to bytes.
inline bool isUnitLength(double length) {
  return std::abs(length - 1) <= 0.00769;
}

/// Replaces the node's matrix by a translation, a rotation and a scale. If it is mirrored, the x
/// scale is negative, as in three.js. Shear is lost.
void decompose(Node& node);

/// The same channel for core.
ChannelView viewOf(const Channel& channel);

/// The local transform of a node in the rest pose.
Transform localTransform(const Node& node);

}  // namespace dermis::gltf
