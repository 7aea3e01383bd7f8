// A crowd of one model: what both Dermis and the plain kernel are given to skin.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "batch_layout.h"
#include "dermis/pack.h"
#include "dermis/result.h"

namespace dermis::samples {

/// A vertex as the plain kernel reads it, with four influences whether it needs them or not.
struct PlainVertex {
  std::array<float, 3> position;
  std::array<float, 3> normal;
  std::array<std::uint16_t, 4> joints;
  std::array<float, 4> weights;
};
static_assert(sizeof(PlainVertex) == 48);

struct Crowd {
  std::string name;
  std::vector<PlainVertex> vertices;
  std::optional<PackedMesh> mesh;               ///< of the same vertices
  std::vector<std::vector<JointMatrix>> poses;  ///< one an instance

  std::uint32_t vertexCount() const { return static_cast<std::uint32_t>(vertices.size()); }
  std::uint32_t jointCount() const { return static_cast<std::uint32_t>(poses.front().size()); }
  std::uint32_t instanceCount() const { return static_cast<std::uint32_t>(poses.size()); }
  /// Whether no joint scales or shears, by a thousandth. The plain kernels know of neither.
  bool isRigid() const;
  /// The first instances. Scale is ignored, as the plain kernels do.
  std::vector<SkinRequest> requests(Method method, std::uint32_t count) const;
};

/// All primitives of a file that the first one's skin moves, as one mesh, so many times, each
/// instance at another time of the file's first clip. Fails if the file has no skinned
/// primitive, or one without normals or four influences a vertex.
Result<Crowd> loadCrowd(const std::filesystem::path& path, std::uint32_t instanceCount);

/// A long figure of 60 joints, four influences everywhere: the joints of a vertex are neighbors.
Result<Crowd> longFigure(std::uint32_t vertexCount, std::uint32_t instanceCount);

}  // namespace dermis::samples
