#include <cmath>

#include "attribute.h"
#include "dermis/types.h"
#include "dermis/validate.h"

namespace dermis {
namespace {

/// A tightly packed copy in which an element with a NaN or an infinity is 0.
std::vector<float> copyFinite(const AttributeView& view) {
  std::vector<float> copy;
  if (!view) return copy;
  copy.reserve(std::size_t{view.count} * view.components);
  for (std::uint32_t vertex = 0; vertex < view.count; ++vertex) {
    bool finite = true;
    for (std::uint32_t component = 0; component < view.components; ++component) {
      finite &= std::isfinite(loadComponent<float>(view, vertex, component));
    }
    for (std::uint32_t component = 0; component < view.components; ++component) {
      copy.push_back(finite ? loadComponent<float>(view, vertex, component) : 0.0f);
    }
  }
  return copy;
}

bool isGoodInfluence(double weight, std::uint32_t joint, std::uint32_t jointCount) {
  return std::isfinite(weight) && weight > 0 && joint < jointCount && joint < maxPaletteJoints;
}

}  // namespace

MeshView RepairedMesh::view() const {
  MeshView mesh;
  mesh.name = name_;
  mesh.vertexCount = vertexCount_;
  mesh.positions = floatAttribute(positions_.data(), vertexCount_, 3);
  if (!normals_.empty()) mesh.normals = floatAttribute(normals_.data(), vertexCount_, 3);
  if (!tangents_.empty()) mesh.tangents = floatAttribute(tangents_.data(), vertexCount_, 4);
  mesh.influenceSets = sets_;
  return mesh;
}

Result<RepairedMesh> repair(const MeshView& mesh, std::uint32_t jointCount) {
  MeshReport report = validate(mesh, jointCount);
  if (!report.repairable()) return Error{ErrorCode::invalidMesh, report.findings.front().message};

  RepairedMesh repaired;
  repaired.name_ = mesh.name;
  repaired.vertexCount_ = mesh.vertexCount;
  repaired.positions_ = copyFinite(mesh.positions);
  repaired.normals_ = copyFinite(mesh.normals);
  repaired.tangents_ = copyFinite(mesh.tangents);

  std::uint32_t slots = 0;
  for (const InfluenceSet& set : mesh.influenceSets) slots += set.weights.components;
  const std::size_t total = std::size_t{mesh.vertexCount} * slots;
  repaired.joints_.reserve(total);
  repaired.weights_.reserve(total);
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount; ++vertex) {
    for (const InfluenceSet& set : mesh.influenceSets) {
      for (std::uint32_t slot = 0; slot < set.weights.components; ++slot) {
        const double weight = loadWeight(set.weights, vertex, slot);
        const std::uint32_t joint = loadUnsigned(set.joints, vertex, slot);
        const bool good = isGoodInfluence(weight, joint, jointCount);
        repaired.joints_.push_back(good ? joint : 0);
        repaired.weights_.push_back(good ? static_cast<float>(weight / wholeWeight) : 0.0f);
      }
    }
  }

  InfluenceSet set;
  set.joints = {repaired.joints_.data(), mesh.vertexCount, slots * 4, ComponentType::uint32, slots};
  set.weights = floatAttribute(repaired.weights_.data(), mesh.vertexCount, slots);
  repaired.sets_.push_back(set);
  repaired.report_ = std::move(report);
  return repaired;
}

}  // namespace dermis
