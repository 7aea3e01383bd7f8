#include "mesh_centers.h"

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>

#include "dermis/centers_of_rotation.h"
#include "dermis/validate.h"
#include "progress.h"

namespace dermis::cli {
namespace {

/// Primitives one behind the other.
struct JoinedMesh {
  std::uint32_t slots = 0;
  std::vector<float> positions, weights;
  std::vector<std::uint32_t> joints, triangles;

  void add(const MeshView& mesh, std::span<const std::uint32_t> indices) {
    const auto first = static_cast<std::uint32_t>(positions.size() / 3);
    const InfluenceSet& set = mesh.influenceSets.front();
    // `repair` packs them tightly.
    const auto* position = static_cast<const float*>(mesh.positions.data);
    const auto* joint = static_cast<const std::uint32_t*>(set.joints.data);
    const auto* weight = static_cast<const float*>(set.weights.data);
    positions.insert(positions.end(), position, position + std::size_t{mesh.vertexCount} * 3);
    for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
      for (std::uint32_t slot = 0; slot < slots; ++slot) {
        const bool has = slot < set.joints.components;
        joints.push_back(has ? *joint++ : 0);
        weights.push_back(has ? *weight++ : 0.0f);
      }
    }
    for (const std::uint32_t index : indices) triangles.push_back(first + index);
  }
};

Result<std::vector<float>> centersOf(const JoinedMesh& joined, const std::string& name,
                                     std::uint32_t jointCount) {
  const auto vertexCount = static_cast<std::uint32_t>(joined.positions.size() / 3);
  InfluenceSet set;
  set.joints = {joined.joints.data(), vertexCount, joined.slots * 4, ComponentType::uint32,
                joined.slots};
  set.weights = floatAttribute(joined.weights.data(), vertexCount, joined.slots);
  MeshView mesh;
  mesh.name = name;
  mesh.vertexCount = vertexCount;
  mesh.positions = floatAttribute(joined.positions.data(), vertexCount, 3);
  mesh.influenceSets = {&set, 1};

  constexpr std::uint32_t steps = 100;
  struct Shown {
    Progress bar{"centres of rotation", steps};
    std::uint32_t done = 0;
  } shown;
  CentersOfRotationOptions options;
  options.user = &shown;
  options.progress = [](void* user, float fraction) {
    auto& [bar, done] = *static_cast<Shown*>(user);
    for (; done < static_cast<std::uint32_t>(fraction * steps); ++done) bar.step();
    return true;
  };
  return centersOfRotation(mesh, jointCount, joined.triangles, options);
}

}  // namespace

Result<std::vector<std::vector<float>>> centersOfMesh(const gltf::Mesh& mesh,
                                                      std::uint32_t jointCount) {
  JoinedMesh joined;
  for (const gltf::Primitive& primitive : mesh.primitives)
    joined.slots = std::max(joined.slots, primitive.influencesPerVertex());
  for (const gltf::Primitive& primitive : mesh.primitives) {
    if (primitive.influences.empty()) continue;
    const gltf::PrimitiveView view(primitive);
    const Result<RepairedMesh> repaired = repair(view.mesh(), jointCount);
    if (!repaired) return repaired.error();
    joined.add(repaired->view(), primitive.triangles);
  }
  std::vector<std::vector<float>> centers(mesh.primitives.size());
  if (joined.positions.empty()) return centers;
  const Result<std::vector<float>> all = centersOf(joined, mesh.name, jointCount);
  if (!all) return all.error();
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

}  // namespace dermis::cli
