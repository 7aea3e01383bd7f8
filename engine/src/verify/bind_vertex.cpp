#include "verify/bind_vertex.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <optional>
#include <string>

#include <glm/geometric.hpp>

#include "core/text.h"
#include "strict_floating_point.h"

namespace dermis::reference {
namespace {

template <typename Stored>
Stored load(const AttributeView& view, std::size_t element, std::uint32_t component) {
  Stored value;
  std::memcpy(&value,
              static_cast<const unsigned char*>(view.data) + element * view.stride +
                  component * sizeof(value),
              sizeof(value));
  return value;
}

/// The value of a binary16: (-1)^s · 2^(e - 15) · (1 + f / 1024). Without the 1 if e is 0.
double valueOfHalf(std::uint16_t bits) {
  const int exponent = bits / 1024 % 32;
  const double fraction = bits % 1024 / 1024.0;
  const double sign = bits >= 0x8000 ? -1 : 1;
  if (exponent == 31) {
    return fraction != 0 ? std::numeric_limits<double>::quiet_NaN()
                         : sign * std::numeric_limits<double>::infinity();
  }
  return exponent == 0 ? sign * fraction * std::exp2(-14)
                       : sign * (1 + fraction) * std::exp2(exponent - 15);
}

/// A weight times 65535. Sums of weights stored as integers are then exact, and so are ties.
double readWeight(const AttributeView& view, std::size_t vertex, std::uint32_t slot) {
  switch (view.type) {
    case ComponentType::unorm8:
      return load<std::uint8_t>(view, vertex, slot) * 257.0;
    case ComponentType::unorm16:
      return load<std::uint16_t>(view, vertex, slot);
    default:
      return readComponent(view, vertex, slot) * 65535.0;
  }
}

/// The influence must have been checked: a float is then a whole number.
std::uint32_t readJoint(const AttributeView& view, std::size_t vertex, std::uint32_t slot) {
  switch (view.type) {
    case ComponentType::float32:
      return static_cast<std::uint32_t>(load<float>(view, vertex, slot));
    case ComponentType::uint8:
      return load<std::uint8_t>(view, vertex, slot);
    case ComponentType::uint16:
      return load<std::uint16_t>(view, vertex, slot);
    default:
      return load<std::uint32_t>(view, vertex, slot);
  }
}

}  // namespace

double readComponent(const AttributeView& view, std::size_t element, std::uint32_t component) {
  switch (view.type) {
    case ComponentType::float32:
      return static_cast<double>(load<float>(view, element, component));
    case ComponentType::float16:
      return valueOfHalf(load<std::uint16_t>(view, element, component));
    case ComponentType::snorm8:
      return std::max(-1.0, load<std::int8_t>(view, element, component) / 127.0);
    case ComponentType::snorm16:
      return std::max(-1.0, load<std::int16_t>(view, element, component) / 32767.0);
    case ComponentType::unorm8:
      return load<std::uint8_t>(view, element, component) / 255.0;
    case ComponentType::unorm16:
      return load<std::uint16_t>(view, element, component) / 65535.0;
    case ComponentType::uint8:
    case ComponentType::uint16:
    case ComponentType::uint32:
      return readJoint(view, element, component);
  }
  return 0;
}

glm::dvec3 readVector(const AttributeView& view, std::size_t element) {
  return {readComponent(view, element, 0), readComponent(view, element, 1),
          readComponent(view, element, 2)};
}

glm::dvec3 readPosition(const MeshView& mesh, std::size_t vertex) {
  const auto& scale = mesh.positionScale;
  const auto& offset = mesh.positionOffset;
  return readVector(mesh.positions, vertex) * glm::dvec3(scale[0], scale[1], scale[2]) +
         glm::dvec3(offset[0], offset[1], offset[2]);
}

void readInfluences(const MeshView& mesh, std::size_t vertex, std::vector<Influence>& influences) {
  influences.clear();
  for (const InfluenceSet& set : mesh.influenceSets) {
    for (std::uint32_t slot = 0; slot < set.joints.components; ++slot) {
      const double weight = readWeight(set.weights, vertex, slot);
      if (weight != 0) influences.push_back({readJoint(set.joints, vertex, slot), weight});
    }
  }
  // Also sorted by weight, so that the sum of duplicates does not depend on the order of slots.
  std::sort(influences.begin(), influences.end(), [](const Influence& a, const Influence& b) {
    return a.joint != b.joint ? a.joint < b.joint : a.stored < b.stored;
  });
  double sum = 0;
  std::size_t kept = 0;
  for (const Influence& influence : influences) {
    sum += influence.stored;
    if (kept > 0 && influences[kept - 1].joint == influence.joint) {
      influences[kept - 1].stored += influence.stored;
    } else {
      influences[kept++] = influence;
    }
  }
  influences.resize(kept);
  for (Influence& influence : influences) influence.weight = influence.stored / sum;
}

namespace {

using glm::dvec3;

bool isFloat32(const dvec3& v) {
  for (int i = 0; i < 3; ++i) {
    if (static_cast<double>(static_cast<float>(v[i])) != v[i]) return false;
  }
  return true;
}

/// The value of one attribute, and the roundings of the same sum in float32.
struct Sum {
  dvec3 value{0.0};
  double magnitude = 0;  ///< sum of the lengths of all summands
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
  /// Whether, as a direction, it exceeds the range of the contract.
  bool outOfRange() const {
    const double length = glm::length(value);
    return magnitude > 0x1p100 || (length > 0 && length < 0x1p-100);
  }
  double relativeRounding() const { return rounding() == 0 ? 0 : rounding() / glm::length(value); }
};

/// The element of a target's attributes for this vertex, if there is one.
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
                        " does not exist; the mesh has " + std::to_string(weightOf.size()));
    }
    if (!std::isfinite(morph.weight)) {
      return morphError(mesh, morph.target, " has a weight that is not finite");
    }
    if (weightOf[morph.target] != 0) return morphError(mesh, morph.target, " has two weights");
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
  conditioning.directionOutOfRange = normal.outOfRange() || tangent.outOfRange();
  return bind;
}

}  // namespace dermis::reference
