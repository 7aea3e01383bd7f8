// Meshes for the tests of `pack`.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <random>
#include <utility>
#include <vector>

#include "core_blob.h"
#include "dermis/mesh.h"
#include "random_rig.h"

namespace dermis::test {

/// `influences` slots a vertex, some empty, joints possibly twice.
inline OwnedMesh slottedMesh(std::uint32_t seed, std::uint32_t vertices, std::uint32_t influences,
                             std::uint32_t joints) {
  std::mt19937 engine(seed);
  const auto below = [&](std::uint32_t count) {
    return std::uniform_int_distribution<std::uint32_t>(0, count - 1)(engine);
  };
  OwnedMesh mesh;
  mesh.name = "slotted";
  mesh.influencesPerVertex = influences;
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    for (int i = 0; i < 3; ++i) {
      mesh.positions.push_back(static_cast<float>(below(1000)));
      mesh.normals.push_back(static_cast<float>(below(1000)));
    }
    const std::uint32_t used = below(influences + 1);
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      mesh.joints.push_back(below(joints));
      mesh.weights.push_back(below(influences) < used ? static_cast<float>(1 + below(8)) / 7.0f
                                                      : 0.0f);
    }
  }
  return mesh;
}

inline OwnedMesh oneVertex(std::vector<std::uint32_t> joints, std::vector<float> weights) {
  OwnedMesh mesh;
  mesh.name = "one";
  mesh.positions = {1, 2, 3};
  mesh.influencesPerVertex = static_cast<std::uint32_t>(joints.size());
  mesh.joints = std::move(joints);
  mesh.weights = std::move(weights);
  return mesh;
}

inline PackedMesh packed(const MeshView& mesh, std::uint32_t jointCount) {
  Result<PackedMesh> result = pack(mesh, jointCount);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  return std::move(*result);
}

inline std::vector<BlobInfluence> packedInfluences(std::vector<std::uint32_t> joints,
                                                   std::vector<float> weights) {
  OwnedMesh mesh = oneVertex(std::move(joints), std::move(weights));
  return Blob(packed(mesh.view(), maxPoseJoints).bytes()).influences(0);
}

inline bool sameBytes(const PackedMesh& a, const PackedMesh& b) {
  return std::ranges::equal(a.bytes(), b.bytes());
}

/// A view of tightly packed elements in a vector.
template <typename T>
AttributeView viewOf(const std::vector<T>& values, ComponentType type, std::uint32_t components) {
  return {values.data(), static_cast<std::uint32_t>(values.size() / components),
          static_cast<std::uint32_t>(components * sizeof(T)), type, components};
}

/// The displacements of a target, dense: 3 floats a vertex, some of them zero.
struct OwnedTarget {
  std::vector<std::uint32_t> vertices;
  std::vector<float> positions, normals, tangents;

  MorphTargetView view() const {
    MorphTargetView target;
    target.vertices = vertices;
    for (const auto& [values, attribute] : {std::pair{&positions, &target.positions},
                                            {&normals, &target.normals},
                                            {&tangents, &target.tangents}}) {
      if (!values->empty()) *attribute = viewOf(*values, ComponentType::float32, 3);
    }
    return target;
  }
  /// The same with the vertices named and the others left out.
  OwnedTarget sparse(const std::vector<std::uint32_t>& kept) const {
    OwnedTarget result;
    result.vertices = kept;
    for (const std::uint32_t vertex : kept) {
      for (std::uint32_t i = 0; i < 3; ++i) {
        if (!positions.empty()) result.positions.push_back(positions[vertex * 3 + i]);
        if (!normals.empty()) result.normals.push_back(normals[vertex * 3 + i]);
        if (!tangents.empty()) result.tangents.push_back(tangents[vertex * 3 + i]);
      }
    }
    return result;
  }
};

/// Displaces about one vertex in `sparsity`.
inline OwnedTarget randomTarget(std::uint32_t seed, std::uint32_t vertices, std::uint32_t sparsity,
                                bool normals = true, bool tangents = false) {
  std::mt19937 engine(seed);
  OwnedTarget target;
  target.positions.assign(std::size_t{vertices} * 3, 0.0f);
  if (normals) target.normals = target.positions;
  if (tangents) target.tangents = target.positions;
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    if (engine() % sparsity != 0) continue;
    for (std::vector<float>* values : {&target.positions, &target.normals, &target.tangents}) {
      if (values->empty()) continue;
      for (std::uint32_t i = 0; i < 3; ++i)
        (*values)[vertex * 3 + i] = static_cast<float>(engine() % 9) - 4.0f;
    }
  }
  return target;
}

}  // namespace dermis::test
