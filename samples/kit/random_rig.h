// Random meshes and poses, for verification and tests. The same seed gives the same result.
#pragma once

#include <cstddef>
#include <cstdint>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "dermis/mesh.h"

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
/// or mirroring of `rigidity`. In a mirrored pose every joint is mirrored; about half of the joints
/// of `mirrored` have no scale besides.
std::vector<JointMatrix> randomPose(std::uint32_t seed, std::uint32_t jointCount, Rigidity rigidity,
                                    double reach = 1);

struct InputFormats {
  ComponentType positions = ComponentType::float32;
  ComponentType directions = ComponentType::float32;  ///< normals, tangents and their displacements
  ComponentType joints = ComponentType::uint32;
  ComponentType weights = ComponentType::float32;
  std::uint32_t setSize = 4;  ///< influences per set; there are as many sets as needed
  std::uint32_t gap = 0;      ///< bytes after each element
};

/// A mesh in the formats that assets use: float16, normalized integers, any stride. Owns the bytes.
/// Can be moved, because views point to the elements of vectors.
class StoredMesh {
 public:
  /// Coordinates of positions must be from −2 to 2 if they are stored as integers.
  StoredMesh(const OwnedMesh& mesh, const InputFormats& formats);

  /// Valid while this object lives and is not assigned to.
  MeshView view() const;

 private:
  AttributeView store(const std::vector<float>& values, std::uint32_t components,
                      ComponentType type, double scale);

  AttributeView storeShares(const std::vector<float>& values);

  std::uint32_t vertexCount_ = 0;
  InputFormats formats_;
  std::vector<std::vector<std::byte>> arrays_;
  std::vector<std::vector<std::uint32_t>> morphVertices_;
  AttributeView positions_, normals_, tangents_, dualQuaternionWeights_, bulgeStrengths_,
      centersOfRotation_;
  std::vector<InfluenceSet> sets_;
  std::vector<MorphTargetView> morphs_;
};

}  // namespace dermis::samples
