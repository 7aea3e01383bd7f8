// Random meshes and poses for tests: the same for the same seed.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/types.h"

namespace dermis::test {

/// A mesh that owns its arrays.
struct OwnedMesh {
  std::string name = "random";
  std::uint32_t influencesPerVertex = 4;
  std::vector<float> positions, normals, weights;
  std::vector<std::uint32_t> joints;
  InfluenceSet set;

  std::uint32_t vertexCount() const { return static_cast<std::uint32_t>(positions.size() / 3); }

  MeshView view() {
    MeshView mesh;
    mesh.name = name;
    mesh.vertexCount = vertexCount();
    mesh.positions = floatAttribute(positions.data(), vertexCount(), 3);
    if (!normals.empty()) mesh.normals = floatAttribute(normals.data(), vertexCount(), 3);
    set.joints = {joints.data(), vertexCount(), influencesPerVertex * 4, ComponentType::uint32,
                  influencesPerVertex};
    set.weights = floatAttribute(weights.data(), vertexCount(), influencesPerVertex);
    mesh.influenceSets = {&set, 1};
    return mesh;
  }
};

enum class Rigidity { rigid, uniformScale, shear, mirrored, mirroredAlongOneAxis };

/// `influences` slots a vertex, of which a random number carry weight; one vertex in 50 carries
/// none at all.
OwnedMesh randomMesh(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t jointCount,
                     std::uint32_t influences, bool normals = true);

/// Joint matrices of random rotations and translations within `reach`, and what `rigidity` asks
/// for; in a mirrored pose every joint is mirrored.
std::vector<JointMatrix> randomPose(std::uint32_t seed, std::uint32_t jointCount, Rigidity rigidity,
                                    double reach = 1);

}  // namespace dermis::test
