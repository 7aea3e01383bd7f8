// A crowd of one model: the input of both Dermis and the plain kernels.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dermis/clips.h"
#include "dermis/mesh.h"
#include "dermis/result.h"
#include "kit/batch_runner.h"

namespace dermis::samples {

/// A vertex as the plain kernel reads it, always with four influences.
struct PlainVertex {
  std::array<float, 3> position;
  std::array<float, 3> normal;
  std::array<std::uint16_t, 4> joints;
  std::array<float, 4> weights;
};
static_assert(sizeof(PlainVertex) == 48);

/// Such vertices as a mesh. They must outlive it.
class PlainMesh {
 public:
  explicit PlainMesh(std::span<const PlainVertex> vertices);
  PlainMesh(const PlainMesh&) = delete;
  PlainMesh& operator=(const PlainMesh&) = delete;

  /// Valid while this object exists.
  MeshView view() const;

 private:
  std::span<const PlainVertex> vertices_;
  InfluenceSet influences_;
};

struct Crowd {
  std::string name;
  std::vector<PlainVertex> vertices;
  std::optional<PackedMesh> mesh;               ///< the same vertices
  std::vector<std::vector<JointMatrix>> poses;  ///< one per instance
  /// A bank with one skin, that of the poses; or why there is none.
  Result<PackedClips> clips = Error{ErrorCode::invalidData, "there are no clips"};

  std::uint32_t vertexCount() const { return static_cast<std::uint32_t>(vertices.size()); }
  std::uint32_t jointCount() const { return static_cast<std::uint32_t>(poses.front().size()); }
  std::uint32_t instanceCount() const { return static_cast<std::uint32_t>(poses.size()); }
  /// Whether no joint scales or shears by more than a thousandth. The plain kernels support
  /// neither.
  bool isRigid() const;
  /// Requests for the first `count` instances. Scale is ignored, as in the plain kernels.
  std::vector<SkinRequest> requests(Method method, std::uint32_t count) const;
};

/// Joins all primitives that use the skin of the first one into one mesh. Makes `instanceCount`
/// instances, each at a different time of the file's first clip, and packs all of its clips. Fails
/// if the file has no skinned primitive, or if one of the joined primitives has no normals, or does
/// not have four influences per vertex.
Result<Crowd> loadCrowd(const std::filesystem::path& path, std::uint32_t instanceCount);

/// A long figure of 60 joints with four influences per vertex. The joints of a vertex are
/// neighbors. The poses are random. Its two clips turn all joints.
Result<Crowd> longFigure(std::uint32_t vertexCount, std::uint32_t instanceCount);

}  // namespace dermis::samples
