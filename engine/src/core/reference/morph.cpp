#include "morph.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>

#include <glm/geometric.hpp>

#include "dermis/text.h"
#include "read.h"

namespace dermis::reference {
namespace {

using glm::dvec3;

bool isFloat32(const dvec3& v) {
  for (int i = 0; i < 3; ++i) {
    if (static_cast<double>(static_cast<float>(v[i])) != v[i]) return false;
  }
  return true;
}

/// One attribute, and the roundings that the same sum has in float32.
struct Sum {
  dvec3 value{0.0};
  double magnitude = 0;  ///< the lengths of all that was added
  std::uint32_t roundings = 0;

  void start(const dvec3& stored) {
    value = stored;
    magnitude = glm::length(stored);
    roundings = isFloat32(stored) ? 0u : 1u;
  }
  void add(double weight, const dvec3& displacement) {
    if (displacement == dvec3(0.0)) return;
    value += weight * displacement;
    magnitude += std::abs(weight) * glm::length(displacement);
    roundings += isFloat32(displacement) ? 2u : 3u;  // the product and the sum
  }
  double rounding() const { return roundings * magnitude; }
  double relativeRounding() const { return rounding() == 0 ? 0 : rounding() / glm::length(value); }
};

/// Where a target's attributes have this vertex, if they do.
std::optional<std::size_t> elementOf(const MorphTargetView& target, std::size_t vertex) {
  if (target.vertices.empty()) return vertex;
  const auto found = std::lower_bound(target.vertices.begin(), target.vertices.end(), vertex);
  if (found == target.vertices.end() || *found != vertex) return std::nullopt;
  return static_cast<std::size_t>(found - target.vertices.begin());
}

Error morphError(const MeshView& mesh, std::uint32_t target, const std::string& what) {
  return {ErrorCode::invalidArgument,
          "mesh " + inQuotes(mesh.name) + ": morph target " + std::to_string(target) + what};
}

}  // namespace

Result<std::vector<ActiveMorph>> activeMorphs(const MeshView& mesh,
                                              std::span<const MorphWeight> weights) {
  std::vector<double> weightOf(mesh.morphTargets.size(), 0.0);
  for (const MorphWeight& morph : weights) {
    if (morph.weight == 0) continue;
    if (morph.target >= weightOf.size()) {
      return morphError(mesh, morph.target,
                        " is outside the mesh's " + std::to_string(weightOf.size()));
    }
    if (!std::isfinite(morph.weight)) {
      return morphError(mesh, morph.target, " has a weight that is not finite");
    }
    if (weightOf[morph.target] != 0) return morphError(mesh, morph.target, " has a weight twice");
    weightOf[morph.target] = static_cast<double>(morph.weight);
  }
  std::vector<ActiveMorph> active;
  for (std::size_t target = 0; target < weightOf.size(); ++target) {
    if (weightOf[target] != 0) active.push_back({&mesh.morphTargets[target], weightOf[target]});
  }
  return active;
}

BindVertex bindVertex(const MeshView& mesh, std::size_t vertex, std::span<const ActiveMorph> morphs,
                      Conditioning& conditioning) {
  BindVertex bind;
  Sum position, normal, tangent;
  position.start(readPosition(mesh, vertex));
  if (mesh.normals) normal.start(readVector(mesh.normals, vertex));
  if (mesh.tangents) {
    tangent.start(readVector(mesh.tangents, vertex));
    bind.handedness = readComponent(mesh.tangents, vertex, 3) < 0 ? -1 : 1;
  }
  for (const auto& [target, weight] : morphs) {
    const std::optional<std::size_t> element = elementOf(*target, vertex);
    if (!element) continue;
    if (target->positions) {
      const auto& scale = target->positionScale;
      position.add(weight,
                   readVector(target->positions, *element) * dvec3(scale[0], scale[1], scale[2]));
    }
    if (mesh.normals && target->normals) {
      normal.add(weight, readVector(target->normals, *element));
    }
    if (mesh.tangents && target->tangents) {
      tangent.add(weight, readVector(target->tangents, *element));
    }
  }
  bind.position = position.value;
  bind.normal = normal.value;
  bind.tangent = tangent.value;
  conditioning.positionRounding = position.rounding();
  conditioning.normalRounding = normal.relativeRounding();
  conditioning.tangentRounding = tangent.relativeRounding();
  return bind;
}

}  // namespace dermis::reference
