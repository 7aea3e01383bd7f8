#include "dermis/reference.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>

#include "decompose.h"
#include "dermis/validate.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dvec3;
using glm::dvec4;

// Quaternions here are x y z w.

dvec4 multiply(const dvec4& a, const dvec4& b) {
  const dvec3 u(a), v(b);
  return dvec4(a.w * v + b.w * u + glm::cross(u, v), a.w * b.w - glm::dot(u, v));
}

/// The unit quaternion of a rotation matrix, by the largest of its four squared components
/// (Shepperd 1978).
dvec4 quaternionOf(const dmat3& r) {
  // r[column][row]
  const double x = 1 + r[0][0] - r[1][1] - r[2][2];
  const double y = 1 - r[0][0] + r[1][1] - r[2][2];
  const double z = 1 - r[0][0] - r[1][1] + r[2][2];
  const double w = 1 + r[0][0] + r[1][1] + r[2][2];
  dvec4 q;
  if (w >= x && w >= y && w >= z) {
    q = dvec4(r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0], w);
  } else if (x >= y && x >= z) {
    q = dvec4(x, r[0][1] + r[1][0], r[2][0] + r[0][2], r[1][2] - r[2][1]);
  } else if (y >= z) {
    q = dvec4(r[0][1] + r[1][0], y, r[1][2] + r[2][1], r[2][0] - r[0][2]);
  } else {
    q = dvec4(r[2][0] + r[0][2], r[1][2] + r[2][1], z, r[0][1] - r[1][0]);
  }
  return glm::normalize(q);
}

/// A joint matrix taken apart.
struct Joint {
  dmat3 linear;
  dvec3 translation;
  dvec4 real, dual;  ///< the rigid part
  dmat3 scaleShear;
  double largest = 1;
  bool degenerate = false;
  bool rigidForKernels = false;
  double distanceFromRotation = 0;
};

Joint takeApart(const JointMatrix& matrix) {
  Joint joint;
  bool finite = true;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 4; ++column) {
      const double value = static_cast<double>(matrix.m[row][column]);
      finite &= std::isfinite(value);
      if (column < 3) {
        joint.linear[column][row] = value;
      } else {
        joint.translation[row] = value;
      }
    }
  }
  if (!finite) {
    const double nan = std::nan("");
    joint.real = joint.dual = dvec4(nan);
    joint.scaleShear = dmat3(nan);
    joint.largest = 0;
    joint.degenerate = true;
    return joint;
  }
  const PolarParts parts = polarParts(joint.linear);
  joint.scaleShear = parts.scaleShear;
  joint.largest = parts.largest;
  joint.degenerate = parts.degenerate;
  joint.real = quaternionOf(parts.rotation);
  joint.dual = 0.5 * multiply(dvec4(joint.translation, 0), joint.real);

  const dmat3 gram = glm::transpose(joint.linear) * joint.linear - dmat3(1.0);
  double deviation = 0;  // the largest sum of a row's absolute values
  for (int row = 0; row < 3; ++row) {
    deviation = std::max(deviation,
                         std::abs(gram[0][row]) + std::abs(gram[1][row]) + std::abs(gram[2][row]));
  }
  // The kernels decide on float sums, so that a joint near the threshold of 8e-6 may go either way.
  joint.rigidForKernels = glm::determinant(joint.linear) > 0 && deviation <= 1e-5;
  joint.distanceFromRotation = parts.distanceFromRotation;
  return joint;
}

struct Influence {
  std::uint32_t joint;
  double stored;      ///< the weight as stored, times 65535, duplicates added up: what the pivot is
                      ///< chosen by
  double weight = 0;  ///< normalised
};

/// A weight times 65535: sums of what is stored as integers then are exact, and a tie is a tie.
double readWeight(const AttributeView& view, std::size_t vertex, std::uint32_t slot) {
  const auto* element = static_cast<const unsigned char*>(view.data) + vertex * view.stride;
  switch (view.type) {
    case ComponentType::unorm8:
      return element[slot] * 257.0;
    case ComponentType::unorm16: {
      std::uint16_t value;
      std::memcpy(&value, element + slot * sizeof(value), sizeof(value));
      return value;
    }
    default: {
      float value;
      std::memcpy(&value, element + slot * sizeof(value), sizeof(value));
      return static_cast<double>(value) * 65535.0;
    }
  }
}

std::uint32_t readJoint(const AttributeView& view, std::size_t vertex, std::uint32_t slot) {
  const auto* element = static_cast<const unsigned char*>(view.data) + vertex * view.stride;
  switch (view.type) {
    case ComponentType::uint8:
      return element[slot];
    case ComponentType::uint16: {
      std::uint16_t value;
      std::memcpy(&value, element + slot * sizeof(value), sizeof(value));
      return value;
    }
    default: {
      std::uint32_t value;
      std::memcpy(&value, element + slot * sizeof(value), sizeof(value));
      return value;
    }
  }
}

dvec3 readVector(const AttributeView& view, std::size_t vertex) {
  float value[3];
  std::memcpy(value, static_cast<const unsigned char*>(view.data) + vertex * view.stride,
              sizeof(value));
  return dvec3(value[0], value[1], value[2]);
}

/// All sets together, one entry a joint, in the order of joints; the weights sum to 1. Empty: no
/// weight.
void readInfluences(const MeshView& mesh, std::size_t vertex, std::vector<Influence>& influences) {
  influences.clear();
  for (const InfluenceSet& set : mesh.influenceSets) {
    for (std::uint32_t slot = 0; slot < set.joints.components; ++slot) {
      const double weight = readWeight(set.weights, vertex, slot);
      if (weight != 0) influences.push_back({readJoint(set.joints, vertex, slot), weight});
    }
  }
  std::stable_sort(influences.begin(), influences.end(),
                   [](const Influence& a, const Influence& b) { return a.joint < b.joint; });
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

/// The strongest influence, the lowest joint on a tie: the order is that of joints.
std::size_t pivotOf(std::span<const Influence> influences) {
  std::size_t pivot = 0;
  for (std::size_t i = 1; i < influences.size(); ++i) {
    if (influences[i].stored > influences[pivot].stored) pivot = i;
  }
  return pivot;
}

dmat3 adjugateTranspose(const dmat3& m) {
  // The cofactor matrix: its columns are the cross products of the other two.
  return dmat3(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
}

/// A normal by the inverse transpose of m, but for its length; finite also where m is singular.
dvec3 transformNormal(const dmat3& m, const dvec3& normal, Conditioning& conditioning) {
  const dvec3 result = adjugateTranspose(m) * normal;
  const double determinant = glm::determinant(m);
  const double largest = singularValues(m).values[0];
  const double inputLength = glm::length(normal);
  conditioning.normalRotatedOnly = false;
  if (inputLength == 0) return result;  // stays zero, exactly
  conditioning.normalAlignment =
      largest > 0 ? glm::length(result) / (largest * largest * inputLength) : 0;
  // Where the determinant is a matter of rounding, so is the side that the normal points to.
  if (std::abs(determinant) <= 1e-5 * largest * largest * largest) conditioning.normalAlignment = 0;
  if (glm::length(result) == 0) return normal;  // of rank 1 or 0: any direction will do
  return determinant < 0 ? -result : result;
}

dvec3 unitOrZero(const dvec3& v) {
  const double length = glm::length(v);
  return length > 0 ? v / length : dvec3(0.0);
}

struct Vertex {
  dvec3 position, normal;
};

Vertex skinLinear(std::span<const Joint> joints, std::span<const Influence> influences,
                  const Vertex& vertex, Conditioning& conditioning) {
  dmat3 linear(0.0);
  dvec3 translation(0.0);
  for (const Influence& influence : influences) {
    linear += influence.weight * joints[influence.joint].linear;
    translation += influence.weight * joints[influence.joint].translation;
  }
  return {linear * vertex.position + translation,
          unitOrZero(transformNormal(linear, vertex.normal, conditioning))};
}

/// Kavan et al. 2007, algorithm 1, with the pivot of greatest weight; two-phase scale and shear.
Vertex skinDualQuaternion(std::span<const Joint> joints, std::span<const Influence> influences,
                          const Vertex& vertex, Conditioning& conditioning) {
  const dvec4 pivot = joints[influences[pivotOf(influences)].joint].real;
  dvec4 real(0.0), dual(0.0);
  dmat3 scaleShear(0.0);
  bool kernelsScale = false;
  for (const Influence& influence : influences) {
    const Joint& joint = joints[influence.joint];
    const double dot = glm::dot(joint.real, pivot);
    conditioning.signAmbiguous |= std::abs(dot) < 1e-5;
    const double weight = dot < 0 ? -influence.weight : influence.weight;
    real += weight * joint.real;
    dual += weight * joint.dual;
    scaleShear += influence.weight * joint.scaleShear;
    kernelsScale |= !joint.rigidForKernels;
  }
  const double norm = glm::length(real);
  real /= norm;
  dual /= norm;

  const dvec3 r(real), d(dual);
  const auto rotate = [&](const dvec3& v) {
    return v + 2.0 * glm::cross(r, glm::cross(r, v) + real.w * v);
  };
  const dvec3 translation = 2.0 * (real.w * d - dual.w * r + glm::cross(r, d));
  const dvec3 scaledNormal = transformNormal(scaleShear, vertex.normal, conditioning);
  conditioning.normalRotatedOnly = !kernelsScale;
  return {rotate(scaleShear * vertex.position) + translation,
          unitOrZero(rotate(unitOrZero(scaledNormal)))};
}

void conditionOf(std::span<const Joint> joints, std::span<const Influence> influences,
                 const dvec3& position, Conditioning& conditioning) {
  double translation = 0, largest = 0;
  const double length = glm::length(position);
  for (const Influence& influence : influences) {
    const Joint& joint = joints[influence.joint];
    translation = std::max(translation, glm::length(joint.translation));
    largest = std::max(largest, joint.largest);
    conditioning.degenerate |= joint.degenerate;
    if (joint.rigidForKernels) {
      conditioning.rigidShortcut = std::max(conditioning.rigidShortcut, joint.distanceFromRotation);
    }
  }
  conditioning.scale = translation + largest * length;
  conditioning.distance = length;
}

Double3 toArray(const dvec3& v) {
  return {v.x, v.y, v.z};
}

}  // namespace

Result<SkinnedMesh> skin(const MeshView& mesh, std::span<const JointMatrix> palette,
                         Method method, std::span<const MorphWeight>) {
  const MeshReport report = validate(
      mesh, static_cast<std::uint32_t>(std::min<std::size_t>(palette.size(), maxPaletteJoints)));
  if (!report.packable()) {
    for (const Finding& finding : report.findings) {
      if (refusedByPack(finding.problem)) return Error{ErrorCode::invalidMesh, finding.message};
    }
  }

  std::vector<Joint> joints;
  joints.reserve(palette.size());
  for (const JointMatrix& matrix : palette) joints.push_back(takeApart(matrix));

  SkinnedMesh skinned;
  skinned.positions.resize(mesh.vertexCount);
  skinned.conditioning.resize(mesh.vertexCount);
  if (mesh.normals) skinned.normals.resize(mesh.vertexCount);

  std::vector<Influence> influences;
  for (std::size_t index = 0; index < mesh.vertexCount; ++index) {
    readInfluences(mesh, index, influences);
    Conditioning& conditioning = skinned.conditioning[index];
    const dvec3 position = readVector(mesh.positions, index);
    const Vertex bind{position, mesh.normals ? readVector(mesh.normals, index) : dvec3(0.0)};
    Vertex result = bind;
    if (influences.empty()) {
      conditioning.scale = glm::length(position);
      result.normal = unitOrZero(bind.normal);
    } else {
      conditionOf(joints, influences, position, conditioning);
      result = method == Method::linear
                   ? skinLinear(joints, influences, bind, conditioning)
                   : skinDualQuaternion(joints, influences, bind, conditioning);
    }
    skinned.positions[index] = toArray(result.position);
    if (mesh.normals) skinned.normals[index] = toArray(result.normal);
  }
  return skinned;
}

}  // namespace dermis::reference
