#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "attribute.h"
#include "dermis/mesh.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

/// Tightly packed vectors in which one with a NaN or an infinity is 0. `load(element, component)`
/// gives a float.
template <typename Load>
std::vector<float> copyFinite(std::uint32_t count, std::uint32_t components, Load load) {
  std::vector<float> copy;
  copy.reserve(std::size_t{count} * components);
  for (std::uint32_t element = 0; element < count; ++element) {
    bool finite = true;
    for (std::uint32_t component = 0; component < components; ++component)
      finite &= std::isfinite(load(element, component));
    for (std::uint32_t component = 0; component < components; ++component)
      copy.push_back(finite ? load(element, component) : 0.0f);
  }
  return copy;
}

std::vector<float> copyFinite(const AttributeView& view, std::uint32_t components) {
  if (!view) return {};
  return copyFinite(view.count, components, [&](std::uint32_t element, std::uint32_t component) {
    return loadFloat(view, element, component);
  });
}

std::vector<float> copyFinitePositions(const MeshView& mesh) {
  return copyFinite(mesh.vertexCount, 3, [&](std::uint32_t vertex, std::uint32_t component) {
    return loadPosition(mesh, vertex, component);
  });
}

std::vector<float> copyFiniteDisplacements(const MorphTargetView& target) {
  if (!target.positions) return {};
  return copyFinite(target.positions.count, 3, [&](std::uint32_t element, std::uint32_t component) {
    return loadMorphPosition(target, element, component);
  });
}

AttributeView viewOf(const std::vector<float>& values, std::uint32_t components) {
  if (values.empty()) return {};
  return attributeView(values.data(), static_cast<std::uint32_t>(values.size() / components),
                       components);
}

float clampedShare(float share) {
  return share >= 0 ? std::min(share, 1.0f) : 0.0f;  // a NaN, too, becomes 0
}

std::vector<float> copyShares(const AttributeView& view) {
  std::vector<float> copy;
  for (std::uint32_t vertex = 0; view && vertex < view.count; ++vertex)
    copy.push_back(clampedShare(loadFloat(view, vertex, 0)));
  return copy;
}

bool isGoodInfluence(double weight, std::uint32_t joint, std::uint32_t jointCount) {
  return std::isfinite(weight) && weight > 0 && joint < jointCount && joint < maxPoseJoints;
}

}  // namespace

struct RepairedMesh::State {
  struct Morph {
    std::vector<std::uint32_t> vertices;
    std::vector<float> positions, normals, tangents;
  };

  std::string name;
  std::vector<float> positions, normals, tangents, weights;
  std::vector<std::uint32_t> joints;
  std::vector<float> dualQuaternionWeights, bulgeStrengths, centersOfRotation;
  std::vector<Morph> morphs;
  InfluenceSet set;
  std::vector<MorphTargetView> morphViews;
  MeshView view;
  MeshReport report;
};

RepairedMesh::RepairedMesh() : state_(std::make_unique<State>()) {}
RepairedMesh::~RepairedMesh() = default;
RepairedMesh::RepairedMesh(RepairedMesh&&) noexcept = default;
RepairedMesh& RepairedMesh::operator=(RepairedMesh&&) noexcept = default;

const MeshView& RepairedMesh::view() const {
  return state_->view;
}
const MeshReport& RepairedMesh::report() const {
  return state_->report;
}

Result<RepairedMesh> repair(const MeshView& mesh, std::uint32_t jointCount) {
  MeshReport report = validate(mesh, jointCount);
  if (!report.repairable()) return Error{ErrorCode::invalidMesh, report.findings.front().message};

  RepairedMesh result;
  RepairedMesh::State& repaired = *result.state_;
  repaired.name = mesh.name;
  repaired.positions = copyFinitePositions(mesh);
  repaired.normals = copyFinite(mesh.normals, 3);
  repaired.tangents = copyFinite(mesh.tangents, 4);
  repaired.dualQuaternionWeights = copyShares(mesh.dualQuaternionWeights);
  repaired.bulgeStrengths = copyShares(mesh.bulgeStrengths);
  repaired.centersOfRotation = copyFinite(mesh.centersOfRotation, 3);
  for (const MorphTargetView& target : mesh.morphTargets) {
    repaired.morphs.push_back({{target.vertices.begin(), target.vertices.end()},
                               copyFiniteDisplacements(target),
                               copyFinite(target.normals, 3),
                               copyFinite(target.tangents, 3)});
  }
  for (const RepairedMesh::State::Morph& morph : repaired.morphs) {
    MorphTargetView& view = repaired.morphViews.emplace_back();
    view.vertices = morph.vertices;
    view.positions = viewOf(morph.positions, 3);
    view.normals = viewOf(morph.normals, 3);
    view.tangents = viewOf(morph.tangents, 3);
  }

  std::uint32_t slots = 0;
  for (const InfluenceSet& set : mesh.influenceSets) slots += set.weights.components;
  const std::size_t total = std::size_t{mesh.vertexCount} * slots;
  repaired.joints.reserve(total);
  repaired.weights.reserve(total);
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    for (const InfluenceSet& set : mesh.influenceSets) {
      for (std::uint32_t slot = 0; slot < set.weights.components; ++slot) {
        const double weight = loadWeight(set.weights, vertex, slot);
        const std::uint32_t joint = loadJoint(set.joints, vertex, slot);
        const bool good = isGoodInfluence(weight, joint, jointCount);
        repaired.joints.push_back(good ? joint : 0);
        repaired.weights.push_back(good ? static_cast<float>(weight / wholeWeight) : 0.0f);
      }
    }
  }

  InfluenceSet& set = repaired.set;
  set.joints = {repaired.joints.data(), mesh.vertexCount, slots * 4, ComponentType::uint32, slots};
  set.weights = attributeView(repaired.weights.data(), mesh.vertexCount, slots);

  MeshView& view = repaired.view;
  view.name = repaired.name;
  view.vertexCount = mesh.vertexCount;
  view.positions = viewOf(repaired.positions, 3);
  view.normals = viewOf(repaired.normals, 3);
  view.tangents = viewOf(repaired.tangents, 4);
  view.influenceSets = {&set, 1};
  view.morphTargets = repaired.morphViews;
  view.dualQuaternionWeights = viewOf(repaired.dualQuaternionWeights, 1);
  view.dualQuaternionWeight = clampedShare(mesh.dualQuaternionWeight);
  view.bulgeStrengths = viewOf(repaired.bulgeStrengths, 1);
  view.bulgeStrength = clampedShare(mesh.bulgeStrength);
  view.centersOfRotation = viewOf(repaired.centersOfRotation, 3);
  repaired.report = std::move(report);
  return result;
}

}  // namespace dermis
