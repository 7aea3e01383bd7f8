#include "dermis/reference.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>

#include "decompose.h"
#include "dermis/validate.h"
#include "morph.h"
#include "read.h"

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

/// The 3×3 that directions go through, and what their sense depends on.
struct BlendedMatrix {
  explicit BlendedMatrix(const dmat3& matrix, double largestOfJoints)
      : m(matrix),
        determinant(glm::determinant(matrix)),
        largest(singularValues(matrix).values[0]),
        stretch(largestOfJoints) {}

  /// Whether the sign of the determinant is a matter of rounding.
  bool isFlat() const { return std::abs(determinant) <= 1e-5 * stretch * largest * largest; }

  dmat3 m;
  double determinant;
  double largest;  ///< its largest singular value
  double stretch;  ///< that of the joints: what the blended entries were rounded by
};

/// A normal by the inverse transpose of m, but for its length; finite also where m is singular.
dvec3 transformNormal(const BlendedMatrix& matrix, const dvec3& normal,
                      Conditioning& conditioning) {
  const auto& [m, determinant, largest, stretch] = matrix;
  const dvec3 result = adjugateTranspose(m) * normal;
  const double inputLength = glm::length(normal);
  if (inputLength == 0) return result;  // stays zero, exactly
  conditioning.normalAlignment =
      largest > 0 ? glm::length(result) / (largest * stretch * inputLength) : 0;
  // Where the determinant is a matter of rounding, so is the side that the normal points to.
  if (matrix.isFlat()) conditioning.normalAlignment = 0;
  if (glm::length(result) == 0) return normal;  // of rank 1 or 0: any direction will do
  return determinant < 0 ? -result : result;
}

/// A tangent by the map of positions, but for its length.
dvec3 transformTangent(const BlendedMatrix& matrix, const dvec3& tangent,
                       Conditioning& conditioning) {
  const dvec3 result = matrix.m * tangent;
  const double inputLength = glm::length(tangent);
  if (inputLength == 0) return result;  // stays zero, exactly
  conditioning.tangentAlignment =
      matrix.stretch > 0 ? glm::length(result) / (matrix.stretch * inputLength) : 0;
  return glm::length(result) == 0 ? tangent : result;
}

/// A mirror turns a tangent frame's handedness over.
double transformHandedness(const BlendedMatrix& matrix, double handedness,
                           Conditioning& conditioning) {
  conditioning.handednessAmbiguous = matrix.isFlat();
  return matrix.determinant < 0 ? -handedness : handedness;
}

dvec3 unitOrZero(const dvec3& v) {
  const double length = glm::length(v);
  return length > 0 ? v / length : dvec3(0.0);
}

/// Directions come out of unit length, or zero.
using Vertex = BindVertex;

Vertex skinLinear(std::span<const Joint> joints, std::span<const Influence> influences,
                  const Vertex& vertex, Conditioning& conditioning) {
  dmat3 linear(0.0);
  dvec3 translation(0.0);
  for (const Influence& influence : influences) {
    linear += influence.weight * joints[influence.joint].linear;
    translation += influence.weight * joints[influence.joint].translation;
  }
  const BlendedMatrix matrix(linear, conditioning.stretch);
  conditioning.normalRotatedOnly = false;
  return {linear * vertex.position + translation,
          unitOrZero(transformNormal(matrix, vertex.normal, conditioning)),
          unitOrZero(transformTangent(matrix, vertex.tangent, conditioning)),
          transformHandedness(matrix, vertex.handedness, conditioning)};
}

/// Kavan et al. 2007, algorithm 1, with the pivot of greatest weight; two-phase scale and shear.
Vertex skinDualQuaternion(std::span<const Joint> joints, std::span<const Influence> influences,
                          const Vertex& vertex, Conditioning& conditioning) {
  const Influence& strongest = influences[pivotOf(influences)];
  const dvec4 pivot = joints[strongest.joint].real;
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
  // No summand points away from the pivot: dot(real, pivot) ≥ its weight. NaN is let through.
  assert(!(norm < strongest.weight * (1 - 1e-9)));
  real /= norm;
  dual /= norm;

  const dvec3 r(real), d(dual);
  const auto rotate = [&](const dvec3& v) {
    return v + 2.0 * glm::cross(r, glm::cross(r, v) + real.w * v);
  };
  const dvec3 translation = 2.0 * (real.w * d - dual.w * r + glm::cross(r, d));
  const BlendedMatrix matrix(scaleShear, conditioning.stretch);
  const dvec3 normal = unitOrZero(transformNormal(matrix, vertex.normal, conditioning));
  const dvec3 tangent = unitOrZero(transformTangent(matrix, vertex.tangent, conditioning));
  conditioning.normalRotatedOnly = !kernelsScale;
  return {rotate(scaleShear * vertex.position) + translation, unitOrZero(rotate(normal)),
          unitOrZero(rotate(tangent)),
          transformHandedness(matrix, vertex.handedness, conditioning)};
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
  conditioning.stretch = largest;
  conditioning.scale = translation + largest * length;
  conditioning.distance = length;
}

Vertex skinVertex(std::span<const Joint> joints, std::span<const Influence> influences,
                  const Vertex& bind, Method method, Conditioning& conditioning) {
  if (influences.empty()) {
    conditioning.distance = conditioning.scale = glm::length(bind.position);
    return {bind.position, unitOrZero(bind.normal), unitOrZero(bind.tangent), bind.handedness};
  }
  conditionOf(joints, influences, bind.position, conditioning);
  return method == Method::linear ? skinLinear(joints, influences, bind, conditioning)
                                  : skinDualQuaternion(joints, influences, bind, conditioning);
}

Double3 toArray(const dvec3& v) {
  return {v.x, v.y, v.z};
}

}  // namespace

Result<SkinnedMesh> skin(const MeshView& mesh, std::span<const JointMatrix> palette, Method method,
                         std::span<const MorphWeight> morphs) {
  const MeshReport report = validate(
      mesh, static_cast<std::uint32_t>(std::min<std::size_t>(palette.size(), maxPaletteJoints)));
  if (!report.packable()) {
    for (const Finding& finding : report.findings) {
      if (refusedByPack(finding.problem)) return Error{ErrorCode::invalidMesh, finding.message};
    }
  }
  const Result<std::vector<ActiveMorph>> active = activeMorphs(mesh, morphs);
  if (!active) return active.error();

  std::vector<Joint> joints;
  joints.reserve(palette.size());
  for (const JointMatrix& matrix : palette) joints.push_back(takeApart(matrix));

  SkinnedMesh skinned;
  skinned.positions.resize(mesh.vertexCount);
  skinned.conditioning.resize(mesh.vertexCount);
  if (mesh.normals) skinned.normals.resize(mesh.vertexCount);
  if (mesh.tangents) skinned.tangents.resize(mesh.vertexCount);

  std::vector<Influence> influences;
  for (std::size_t index = 0; index < mesh.vertexCount; ++index) {
    readInfluences(mesh, index, influences);
    Conditioning& conditioning = skinned.conditioning[index];
    const Vertex bind = bindVertex(mesh, index, *active, conditioning);
    const Vertex result = skinVertex(joints, influences, bind, method, conditioning);
    skinned.positions[index] = toArray(result.position);
    if (mesh.normals) skinned.normals[index] = toArray(result.normal);
    if (mesh.tangents) {
      const dvec3& t = result.tangent;
      skinned.tangents[index] = {t.x, t.y, t.z, result.handedness};
    }
  }
  return skinned;
}

}  // namespace dermis::reference
