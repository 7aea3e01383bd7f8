#include "directions.h"

#include <cmath>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "decompose.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dvec3;

dmat3 adjugateTranspose(const dmat3& m) {
  // The cofactor matrix: its columns are the cross products of the other two.
  return dmat3(glm::cross(m[1], m[2]), glm::cross(m[2], m[0]), glm::cross(m[0], m[1]));
}

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

}  // namespace

BlendedMatrix::BlendedMatrix(const dmat3& matrix, double largestOfJoints)
    : m(matrix),
      determinant(glm::determinant(matrix)),
      largest(singularValues(matrix).values[0]),
      stretch(largestOfJoints) {}

bool BlendedMatrix::isFlat() const {
  return std::abs(determinant) <= 1e-5 * stretch * largest * largest;
}

BindVertex transformDirections(const BlendedMatrix& matrix, const BindVertex& vertex,
                               Conditioning& conditioning) {
  return {vertex.position, unitOrZero(transformNormal(matrix, vertex.normal, conditioning)),
          unitOrZero(transformTangent(matrix, vertex.tangent, conditioning)),
          transformHandedness(matrix, vertex.handedness, conditioning)};
}

dvec3 unitOrZero(const dvec3& v) {
  const double length = glm::length(v);
  return length > 0 ? v / length : dvec3(0.0);
}

}  // namespace dermis::reference
