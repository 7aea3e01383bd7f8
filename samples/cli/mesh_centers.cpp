#include "mesh_centers.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <cstring>
#include <span>

#include "dermis/centers_of_rotation.h"
#include "dermis/validate.h"
#include "progress.h"

namespace dermis::cli {
namespace {

/// More influences than this, the weakest, have no say in where a centre is: one vertex of very
/// many must not make all others as wide.
constexpr std::uint32_t mostSlots = 32;

struct JointWeight {
  float weight;
  std::uint32_t joint;
};

/// Primitives one behind the other, with as many slots as the widest vertex needs.
class JoinedMesh {
 public:
  /// `mesh` is a repaired one: tightly packed.
  void add(const MeshView& mesh, std::span<const std::uint32_t> indices) {
    const auto first = static_cast<std::uint32_t>(positions_.size() / 3);
    const auto* position = static_cast<const float*>(mesh.positions.data);
    positions_.insert(positions_.end(), position, position + std::size_t{mesh.vertexCount} * 3);
    for (const std::uint32_t index : indices) triangles_.push_back(first + index);

    const InfluenceSet& set = mesh.influenceSets.front();
    const auto* joint = static_cast<const std::uint32_t*>(set.joints.data);
    const auto* weight = static_cast<const float*>(set.weights.data);
    std::vector<JointWeight> used;
    for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
      used.clear();
      for (std::uint32_t slot = 0; slot < set.joints.components; ++slot, ++joint, ++weight) {
        if (*weight > 0) used.push_back({*weight, *joint});
      }
      std::ranges::sort(used, [](const JointWeight& a, const JointWeight& b) {
        return a.weight != b.weight ? a.weight > b.weight : a.joint < b.joint;
      });
      used.resize(std::min<std::size_t>(used.size(), mostSlots));
      slots_ = std::max(slots_, static_cast<std::uint32_t>(used.size()));
      influences_.insert(influences_.end(), used.begin(), used.end());
      ends_.push_back(influences_.size());
    }
  }

  std::span<const std::uint32_t> triangles() const { return triangles_; }

  /// Valid while this object lives and nothing is added.
  MeshView view(const std::string& name) {
    const auto vertexCount = static_cast<std::uint32_t>(ends_.size());
    joints_.assign(std::size_t{vertexCount} * slots_, 0);
    weights_.assign(joints_.size(), 0);
    std::size_t influence = 0;
    for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
      for (std::size_t slot = std::size_t{vertex} * slots_; influence < ends_[vertex]; ++slot) {
        joints_[slot] = influences_[influence].joint;
        weights_[slot] = influences_[influence++].weight;
      }
    }
    set_.joints = {joints_.data(), vertexCount, slots_ * 4, ComponentType::uint32, slots_};
    set_.weights = floatAttribute(weights_.data(), vertexCount, slots_);
    MeshView mesh;
    mesh.name = name;
    mesh.vertexCount = vertexCount;
    mesh.positions = floatAttribute(positions_.data(), vertexCount, 3);
    mesh.influenceSets = {&set_, 1};
    return mesh;
  }

 private:
  std::uint32_t slots_ = 1;
  std::vector<float> positions_, weights_;
  std::vector<std::uint32_t> joints_, triangles_;
  std::vector<JointWeight> influences_;
  std::vector<std::size_t> ends_;  ///< of each vertex' influences
  InfluenceSet set_;
};

Result<std::vector<float>> solve(const MeshView& mesh, std::uint32_t jointCount,
                                 std::span<const std::uint32_t> triangles) {
  constexpr std::uint32_t steps = 100;
  struct Shown {
    samples::Progress bar{"centres of rotation", steps};
    std::uint32_t done = 0;
  } shown;
  CentersOfRotationOptions options;
  options.user = &shown;
  options.progress = [](void* user, float fraction) {
    auto& [bar, done] = *static_cast<Shown*>(user);
    for (; done < static_cast<std::uint32_t>(fraction * steps); ++done) bar.step();
    return true;
  };
  return centersOfRotation(mesh, jointCount, triangles, options);
}

template <typename Joint>
std::uint32_t largestOf(std::span<const std::byte> joints) {
  Joint largest = 0;
  for (std::size_t at = 0; at + sizeof(Joint) <= joints.size(); at += sizeof(Joint)) {
    Joint joint;
    std::memcpy(&joint, joints.data() + at, sizeof(Joint));
    largest = std::max(largest, joint);
  }
  return largest;
}

/// How many joints a mesh may tell apart.
std::uint32_t namedJoints(const gltf::Mesh& mesh) {
  std::uint32_t named = 1;
  for (const gltf::Primitive& primitive : mesh.primitives) {
    for (const gltf::Influences& set : primitive.influences) {
      named = std::max(named, 1 + (set.jointType == ComponentType::uint8
                                       ? largestOf<std::uint8_t>(set.joints)
                                       : largestOf<std::uint16_t>(set.joints)));
    }
  }
  return named;
}

}  // namespace

Result<MeshCenters::Centers> MeshCenters::find(const gltf::Mesh& mesh, std::uint32_t jointCount) {
  JoinedMesh joined;
  for (const gltf::Primitive& primitive : mesh.primitives) {
    if (primitive.influences.empty()) continue;
    const gltf::PrimitiveView view(primitive);
    const Result<RepairedMesh> repaired = repair(view.mesh(), jointCount);
    if (!repaired) return repaired.error();
    joined.add(repaired->view(), primitive.triangles);
  }
  const MeshView view = joined.view(mesh.name);
  const Result<CenterOfRotationSolver> solver =
      CenterOfRotationSolver::make(view, jointCount, joined.triangles());
  if (!solver) return solver.error();
  const std::uint64_t terms = solver->termCount();
  if (terms > termsLeft_) {
    return Error{ErrorCode::limitExceeded,
                 fmt::format("mesh '{}': its centres of rotation are sums of {} terms together, "
                             "more than this command takes",
                             mesh.name, terms)};
  }
  termsLeft_ -= terms;
  const Result<std::vector<float>> all = solve(view, jointCount, joined.triangles());
  if (!all) return all.error();

  Centers centers(mesh.primitives.size());
  auto next = all->begin();
  for (std::size_t index = 0; index < centers.size(); ++index) {
    const gltf::Primitive& primitive = mesh.primitives[index];
    if (primitive.influences.empty()) continue;
    const auto end = next + std::ptrdiff_t{primitive.vertexCount} * 3;
    centers[index].assign(next, end);
    next = end;
  }
  return centers;
}

Result<std::vector<float>> MeshCenters::of(const gltf::Model& model,
                                           const gltf::SkinnedPrimitive& source,
                                           std::uint32_t jointCount) {
  const gltf::Mesh& mesh = model.meshes[source.mesh];
  // Joints that the mesh does not name make no difference.
  jointCount = std::min(jointCount, namedJoints(mesh));
  Centers& centers = found_[{source.mesh, jointCount}];
  if (centers.empty()) {
    Result<Centers> found = find(mesh, jointCount);
    if (!found) return found.error();
    centers = std::move(*found);
  }
  return centers[source.primitive];
}

}  // namespace dermis::cli
