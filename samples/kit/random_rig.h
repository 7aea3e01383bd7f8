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

/// Each vertex has `influences` slots. A random number of them have weight; in one vertex of 50
/// none has. The mesh also has data that only some methods use: dual-quaternion weights and bulge
/// strengths, which include 0 and 1, and random centers of rotation.
OwnedMesh randomMesh(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t jointCount,
                     std::uint32_t influences, bool normals = true);

/// `addTangents` adds random unit tangents of either handedness. `addMorphs` adds `count` morph
/// targets, which displace every attribute of about one vertex in three.
void addTangents(OwnedMesh& mesh, std::uint32_t seed);
void addMorphs(OwnedMesh& mesh, std::uint32_t seed, std::uint32_t count);

/// Returns joint matrices with random rotations, translations within `reach`, and the scale, shear
/// or mirroring of `rigidity`. In a mirrored pose every joint is mirrored.
std::vector<JointMatrix> randomPose(std::uint32_t seed, std::uint32_t jointCount, Rigidity rigidity,
                                    double reach = 1);

}  // namespace dermis::samples
