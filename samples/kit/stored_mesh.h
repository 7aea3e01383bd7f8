// A mesh in the formats that assets use: float16, normalized integers, any stride.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "dermis/mesh.h"
#include "kit/random_rig.h"

namespace dermis::samples {

struct InputFormats {
  ComponentType positions = ComponentType::float32;
  ComponentType directions = ComponentType::float32;  ///< normals, tangents and their displacements
  ComponentType joints = ComponentType::uint32;
  ComponentType weights = ComponentType::float32;
  std::uint32_t setSize = 4;  ///< influences per set; there are as many sets as needed
  std::uint32_t gap = 0;      ///< bytes after each element
};

/// Owns the bytes. Can be moved, because views point to the elements of vectors.
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
