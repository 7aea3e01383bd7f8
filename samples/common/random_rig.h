// Random meshes and poses, for verification and tests. The same seed gives the same result.
#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/types.h"

namespace dermis::samples {

/// Displacements of some vertices, 3 floats each.
struct OwnedMorph {
  std::vector<std::uint32_t> vertices;
  std::vector<float> positions, normals, tangents;
};

/// A mesh that owns its arrays. Views are valid until it is destroyed, moved or changed.
struct OwnedMesh {
  std::string name = "random";
  std::uint32_t influencesPerVertex = 4;
  std::vector<float> positions, normals, tangents, weights;
  std::vector<std::uint32_t> joints;
  std::vector<float> dualQuaternionWeights, bulgeStrengths, centersOfRotation;
  std::vector<OwnedMorph> morphs;
  InfluenceSet set;
  std::vector<MorphTargetView> morphViews;

  std::uint32_t vertexCount() const { return static_cast<std::uint32_t>(positions.size() / 3); }
  MeshView view();
};

enum class Rigidity { rigid, uniformScale, shear, mirrored, mirroredAlongOneAxis };

/// `influences` slots a vertex, of which a random number carry weight; one vertex in 50 carries
/// none at all. What only some methods want is there too: dual-quaternion weights and bulge
/// strengths, nothing and all among them, and random centers of rotation.
OwnedMesh randomMesh(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t jointCount,
                     std::uint32_t influences, bool normals = true);

/// Adds random unit tangents, of either hand, and `count` morph targets that displace every
/// attribute of about one vertex in three.
void addTangents(OwnedMesh& mesh, std::uint32_t seed);
void addMorphs(OwnedMesh& mesh, std::uint32_t seed, std::uint32_t count);

/// Joint matrices of random rotations and translations within `reach`, and what `rigidity` asks
/// for; in a mirrored pose every joint is mirrored.
std::vector<JointMatrix> randomPose(std::uint32_t seed, std::uint32_t jointCount, Rigidity rigidity,
                                    double reach = 1);

}  // namespace dermis::samples
