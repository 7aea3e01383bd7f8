// Rigs in double precision, and how far from them float32 may be.
//
// The values follow from rotation matrices: a distance of rotations is that of their matrices, a
// twist an arc tangent, a mean rotation comes from the one between both. The bounds follow the
// operations that docs/accuracy.md lists, with the error that each number has so far (Wilkinson
// 1963, "Rounding Errors in Algebraic Processes"): nothing of second order is left out.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "dermis/rig.h"
#include "dermis/verify.h"
#include "strict_floating_point.h"
#include "verify/rigid.h"

namespace dermis::reference {
namespace {

using glm::dmat3;
using glm::dvec3;
using glm::dvec4;

constexpr std::uint32_t noParent = 0xffffffffu;
/// A rounding, with room for those of double precision and for products of roundings.
constexpr double rounded = 1.001 * floatRounding;
constexpr double leastNormal = 0x1p-126;  ///< a GPU may flush smaller numbers to 0
constexpr double overflowing = 0x1p126;   ///< larger numbers may overflow
/// Of a computation in double precision that packing does, too, relative to its largest number.
constexpr double doubleRounding = 0x1p-49;

/// A number, and how far from it the one in float32 may be.
struct Number {
  double value = 0, error = 0;

  double size() const { return std::abs(value) + error; }
};
/// What packing rounds to float32.
Number stored(double value, double size = 0) {
  return {value, rounded * std::abs(value) + doubleRounding * size + leastNormal};
}
Number operator-(const Number& a) {
  return {-a.value, a.error};
}
/// The sum of products, in any order, with `fma` or without it.
Number sumOf(std::span<const std::pair<Number, Number>> products) {
  Number sum;
  double size = 0;
  for (const auto& [a, b] : products) {
    sum.value += a.value * b.value;
    sum.error +=
        std::abs(a.value) * b.error + a.error * b.size() + leastNormal * (1 + a.size() + b.size());
    size += a.size() * b.size();
  }
  sum.error += static_cast<double>(products.size()) * rounded * size;
  if (!(size <= overflowing)) sum.error = unbounded;
  return sum;
}
Number sumOf(std::initializer_list<std::pair<Number, Number>> products) {
  return sumOf(std::span(products.begin(), products.size()));
}
Number operator*(const Number& a, const Number& b) {
  return sumOf({{a, b}});
}
Number operator+(const Number& a, const Number& b) {
  const double value = a.value + b.value, error = a.error + b.error;
  return {value, error + rounded * (std::abs(value) + error) + leastNormal};
}
Number operator-(const Number& a, const Number& b) {
  return a + -b;
}

using Numbers3 = std::array<Number, 3>;
using Numbers3x3 = std::array<Numbers3, 3>;               ///< [row][column]
using Numbers3x4 = std::array<std::array<Number, 4>, 3>;  ///< column 3 is the translation

/// The first three columns of left × right.
template <typename Left, typename Right>
Numbers3x3 linearProduct(const Left& left, const Right& right) {
  Numbers3x3 product;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      product[row][column] = sumOf({{left[row][0], right[0][column]},
                                    {left[row][1], right[1][column]},
                                    {left[row][2], right[2][column]}});
    }
  }
  return product;
}
/// Without translation.
template <typename Matrix>
Number rowTimes(const Matrix& matrix, std::size_t row, const Numbers3& v) {
  return sumOf({{matrix[row][0], v[0]}, {matrix[row][1], v[1]}, {matrix[row][2], v[2]}});
}
Numbers3x4 joined(const Numbers3x3& linear, const Numbers3& shift) {
  Numbers3x4 matrix;
  for (std::size_t row = 0; row < 3; ++row)
    matrix[row] = {linear[row][0], linear[row][1], linear[row][2], shift[row]};
  return matrix;
}
Numbers3x4 product(const Numbers3x4& left, const Numbers3x4& right) {
  Numbers3 shift;
  for (std::size_t row = 0; row < 3; ++row) {
    shift[row] = sumOf({{left[row][0], right[0][3]},
                        {left[row][1], right[1][3]},
                        {left[row][2], right[2][3]},
                        {left[row][3], {1, 0}}});
  }
  return joined(linearProduct(left, right), shift);
}

Numbers3x4 numbersOf(const JointMatrix& matrix) {
  Numbers3x4 numbers;
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 4; ++column)
      numbers[row][column] = {double{matrix.m[row][column]}, 0};
  return numbers;
}
template <typename Matrix>
dvec3 columnOf(const Matrix& m, std::size_t column) {
  return {m[0][column].value, m[1][column].value, m[2][column].value};
}
template <typename Matrix>
dmat3 linearOf(const Matrix& m) {
  return {columnOf(m, 0), columnOf(m, 1), columnOf(m, 2)};
}
double entryOf(const dmat3& m, std::size_t row, std::size_t column) {
  return m[static_cast<glm::length_t>(column)][static_cast<glm::length_t>(row)];
}

double sizeOf(const dmat3& m) {
  return std::sqrt(glm::dot(m[0], m[0]) + glm::dot(m[1], m[1]) + glm::dot(m[2], m[2]));
}
/// How much an inverse or orthonormal columns amplify relative errors, at most.
double conditionOf(const dmat3& m) {
  return std::pow(sizeOf(m), 3) / std::abs(glm::determinant(m));
}

// ---- Rotations. Their error is that of the unit quaternion, in the norm of its numbers.

/// Of v with length 1, if v is off by `error` and has this length: the sum of up to four squares,
/// the square root and the quotient round. Below 1e-37 a kernel takes the square for 0.
double unitError(double length, double error) {
  const double square = length * length, least = (length - error) * (length - error);
  if (!(error < length / 2) || !(least > 2e-37) || !(square < overflowing / 4)) return unbounded;
  return error / (length - error) + 6 * rounded + 4 * leastNormal / least;
}

/// Orthonormal columns by the method of Gram and Schmidt; the third is the cross product.
dmat3 orthonormal(const dmat3& m) {
  const dvec3 x = glm::normalize(m[0]);
  const dvec3 y = glm::normalize(m[1] - glm::dot(x, m[1]) * x);
  return {x, y, glm::cross(x, y)};
}

/// Of each column.
template <typename Matrix>
std::array<double, 3> orthonormalErrors(const Matrix& m) {
  const auto errorOf = [&](std::size_t column) {
    return std::hypot(m[0][column].error, m[1][column].error, m[2][column].error);
  };
  const dvec3 first = columnOf(m, 0), second = columnOf(m, 1);
  const double x = unitError(glm::length(first), errorOf(0));
  // The second column minus its part along x.
  const dvec3 unit = glm::normalize(first);
  const double along = std::abs(glm::dot(unit, second));
  const double size = glm::length(second) + errorOf(1);
  const double rest = errorOf(1) + x * (along + size + errorOf(1) + x * size) + 5 * rounded * size +
                      8 * leastNormal * (1 + size);
  const double y = unitError(glm::length(second - glm::dot(unit, second) * unit), rest);
  return {x, y, x + y + x * y + 3 * rounded};
}

/// Of the quaternion of a rotation, from the largest of its components, if the columns are off by
/// these: they are multiplied by four times that component.
double quaternionError(const dmat3& rotation, const std::array<double, 3>& columns) {
  const double error =
      std::sqrt(3.0) * std::hypot(columns[0], columns[1], columns[2]) + 9 * rounded;
  const double trace = rotation[0][0] + rotation[1][1] + rotation[2][2];
  double largest = 1 + trace;
  for (glm::length_t i = 0; i < 3; ++i) largest = std::max(largest, 1 + 2 * rotation[i][i] - trace);
  if (!(error < 0.1)) return unbounded;
  return unitError(2 * std::sqrt(largest - 2 * error), error);
}

/// The matrix of a quaternion that is off by `error`: 1 - 2 (yy + zz), 2 (xy - wz) and the like.
Numbers3x3 rotationNumbers(const dmat3& rotation, double error) {
  Numbers3x3 matrix;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      const double value = entryOf(rotation, row, column);
      const double squares = std::max(0.0, (1 - value) / 2);  // of a diagonal: yy + zz
      matrix[row][column] = {value, row == column
                                        ? 4 * std::sqrt(squares) * error + 2 * error * error +
                                              (1 + 4 * squares) * rounded
                                        : 2 * error + error * error + 2 * rounded};
      matrix[row][column].error += 8 * leastNormal;
    }
  }
  return matrix;
}

/// 4 w × the vector of the unit quaternion x, y, z, w of a rotation.
dvec3 vectorOf(const dmat3& r) {
  return {r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0]};
}
/// w ≥ 0
double scalarOf(const dmat3& r) {
  return std::sqrt(std::max(0.0, 1 + r[0][0] + r[1][1] + r[2][2])) / 2;
}
dvec4 unitQuaternion(const std::array<float, 4>& q) {
  return glm::normalize(dvec4(q[0], q[1], q[2], q[3]));
}

/// A⁻¹ of a symmetric matrix by rows, by Gauss and Jordan's elimination with pivots. Not finite if
/// it is singular.
std::vector<double> inverted(std::vector<double> a, std::size_t size) {
  std::vector<double> inverse(size * size);
  for (std::size_t i = 0; i < size; ++i) inverse[i * size + i] = 1;
  for (std::size_t step = 0; step < size; ++step) {
    std::size_t pivot = step;
    for (std::size_t row = step; row < size; ++row)
      if (std::abs(a[row * size + step]) > std::abs(a[pivot * size + step])) pivot = row;
    const double divisor = a[pivot * size + step];
    for (std::vector<double>* matrix : {&a, &inverse}) {
      for (std::size_t column = 0; column < size; ++column) {
        std::swap((*matrix)[pivot * size + column], (*matrix)[step * size + column]);
        (*matrix)[step * size + column] /= divisor;
      }
    }
    for (std::size_t row = 0; row < size; ++row) {
      if (row == step) continue;
      const double factor = a[row * size + step];
      for (std::vector<double>* matrix : {&a, &inverse})
        for (std::size_t column = 0; column < size; ++column)
          (*matrix)[row * size + column] -= factor * (*matrix)[step * size + column];
    }
  }
  return inverse;
}

// ---- Drivers.

/// The rotation of a joint relative to its parent and its bind pose.
struct Sensed {
  dmat3 localBind{1.0};  ///< relative to the parent
  dmat3 axes{1.0};       ///< its orthonormal columns
  dmat3 rotation{1.0};   ///< in these axes
  double error = 0;
  bool isMirrored = false;  ///< the parent is, in bind pose
  double condition = 0;     ///< of the matrices in bind pose
};

class RigReference {
 public:
  RigReference(const RigView& rig, std::span<const JointMatrix> written,
               std::span<const float> givenWeights)
      : rig_(rig), joints_(rig.joints.size()), isKnown_(rig.joints.size()) {
    for (std::size_t joint = 0; joint < written.size(); ++joint)
      set(static_cast<std::uint32_t>(joint), numbersOf(written[joint]));
    weights_.resize(givenWeights.size() + rig.drivenWeights);
    isWeighed_.resize(weights_.size());
    for (std::size_t weight = 0; weight < givenWeights.size(); ++weight)
      setWeight(weight, {double{givenWeights[weight]}, 0});
  }

  EvaluatedRig run() {
    std::array<std::vector<bool>, 4> done;
    for (bool anyone = true; anyone;) {  // drivers that read others follow in a later round
      anyone = runSome(rig_.twists, done[0]);
      anyone |= runSome(rig_.correctives, done[1]);
      anyone |= runSome(rig_.chains, done[2]);
      anyone |= runSome(rig_.linears, done[3]);
    }
    EvaluatedRig result;
    for (std::size_t joint = rig_.writtenJoints; joint < joints_.size(); ++joint) {
      Transform& values = result.joints.emplace_back();
      Transform& bounds = result.jointBounds.emplace_back();
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 4; ++column) {
          values[row][column] = joints_[joint][row][column].value;
          bounds[row][column] = joints_[joint][row][column].error;
        }
      }
    }
    for (const Number& weight : weights_) {
      result.weights.push_back(weight.value);
      result.weightBounds.push_back(weight.error);
    }
    return result;
  }

 private:
  /// Whether any was computed.
  template <typename Driver>
  bool runSome(std::span<const Driver> drivers, std::vector<bool>& done) {
    done.resize(drivers.size());
    bool anyone = false;
    for (std::size_t i = 0; i < drivers.size(); ++i) {
      if (done[i] || !canRead(drivers[i])) continue;
      evaluate(drivers[i]);
      done[i] = anyone = true;
    }
    return anyone;
  }

  bool isKnown(std::uint32_t joint) const { return joint == noParent || isKnown_[joint]; }
  bool isParentKnown(std::uint32_t joint) const { return isKnown(rig_.joints[joint].parent); }
  bool canRead(const TwistDriver& twist) const {
    return isKnown(twist.source) && isParentKnown(twist.source) && isParentKnown(twist.joint);
  }
  bool canRead(const CorrectiveDriver& corrective) const {
    const auto isParent = [&](std::uint32_t joint) { return isParentKnown(joint); };
    return std::ranges::all_of(corrective.inputs,
                               [&](std::uint32_t joint) { return isKnown(joint); }) &&
           std::ranges::all_of(corrective.inputs, isParent) &&
           std::ranges::all_of(corrective.joints, isParent);
  }
  bool canRead(const ChainDriver& chain) const {
    return std::ranges::all_of(chain.joints, [&](std::uint32_t joint) { return isKnown(joint); });
  }
  bool canRead(const LinearDriver& linear) const {
    return isParentKnown(linear.joint) && std::ranges::all_of(linear.weights, [&](auto weight) {
             return bool{isWeighed_[weight]};
           });
  }

  void set(std::uint32_t joint, const Numbers3x4& matrix) {
    joints_[joint] = matrix;
    isKnown_[joint] = true;
    for (auto& row : joints_[joint])
      for (Number& number : row)
        if (!(number.size() <= overflowing)) number.error = unbounded;
  }
  void setRelative(std::uint32_t joint, const Numbers3x4& matrix) {
    const std::uint32_t parent = rig_.joints[joint].parent;
    set(joint, parent == noParent ? matrix : product(joints_[parent], matrix));
  }
  void setWeight(std::size_t weight, const Number& value) {
    weights_[weight] = value;
    isWeighed_[weight] = true;
  }

  Sensed rotationAt(std::uint32_t joint) const;
  void evaluate(const TwistDriver& twist);
  void evaluate(const CorrectiveDriver& corrective);
  void evaluate(const ChainDriver& chain);
  void evaluate(const LinearDriver& linear);

  const RigView& rig_;
  std::vector<Numbers3x4> joints_;
  std::vector<Number> weights_;
  std::vector<bool> isKnown_, isWeighed_;
};

// R is the rotation of (axes of the local bind matrix)ᵀ × those of the local matrix in the pose.
// float32: those of left × adjugate of the parent × joint × bind matrix, where left is stored.
Sensed RigReference::rotationAt(std::uint32_t joint) const {
  const std::uint32_t parent = rig_.joints[joint].parent;
  const Numbers3x4 bind = numbersOf(rig_.joints[joint].bind);
  Numbers3x3 relative = rotationNumbers(dmat3(1.0), 0);
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column)
      relative[row][column] = joints_[joint][row][column];
  Sensed sensed;
  dmat3 aboveBind(1.0);
  bool isSignKnown = true;
  double sign = 1;
  if (parent != noParent) {
    aboveBind = linearOf(numbersOf(rig_.joints[parent].bind));
    const Numbers3x4& m = joints_[parent];
    Numbers3x3 adjugate;
    for (std::size_t row = 0; row < 3; ++row) {
      const std::size_t i = (row + 1) % 3, j = (row + 2) % 3;
      for (std::size_t column = 0; column < 3; ++column) {
        const std::size_t k = (column + 1) % 3, l = (column + 2) % 3;
        adjugate[row][column] = sumOf({{m[k][i], m[l][j]}, {-m[k][j], m[l][i]}});
      }
    }
    const Number determinant =
        sumOf({{m[0][0], adjugate[0][0]}, {m[0][1], adjugate[1][0]}, {m[0][2], adjugate[2][0]}});
    isSignKnown = std::abs(determinant.value) > determinant.error;
    sign = determinant.value < 0 ? -1 : 1;
    relative = linearProduct(adjugate, relative);
  }
  const dmat3 bindLinear = linearOf(bind);
  sensed.localBind = glm::inverse(aboveBind) * bindLinear;
  sensed.axes = orthonormal(sensed.localBind);
  sensed.isMirrored = glm::determinant(aboveBind) < 0;
  sensed.condition = conditionOf(aboveBind) * conditionOf(sensed.localBind);

  const dmat3 inverse = glm::inverse(aboveBind), left = glm::transpose(sensed.axes) * inverse;
  Numbers3x3 storedLeft;
  for (std::size_t row = 0; row < 3; ++row)
    for (std::size_t column = 0; column < 3; ++column)
      storedLeft[row][column] =
          stored(entryOf(left, row, column), sensed.condition * sizeOf(inverse));
  relative = linearProduct(linearProduct(storedLeft, relative), bind);
  // By the adjugate, since an inverse loses all digits where entries differ much in size.
  sensed.rotation = orthonormal(sign * linearOf(relative));
  sensed.error =
      isSignKnown ? quaternionError(sensed.rotation, orthonormalErrors(relative)) : unbounded;
  return sensed;
}

// The twist is 2 atan2(s, w), where s is the part of the unit quaternion along the axis. float32:
// 4 arctan(s / (√(ss + ww) + w)), with about 5.5 roundings of a quotient up to 1, and 4 of the
// polynomial with its own error; 14 in all. It is unknown if the signs of s and w are, at 180
// degrees, or both are 0.
void RigReference::evaluate(const TwistDriver& twist) {
  const Sensed sensed = rotationAt(twist.source);
  const dvec3 given(twist.axis[0], twist.axis[1], twist.axis[2]);
  const dvec3 axis = glm::normalize(sensed.localBind * given);  // in the space of the parent
  const dmat3 turned = sensed.axes * sensed.rotation * glm::transpose(sensed.axes);
  const double w = scalarOf(turned), ws = glm::dot(axis, vectorOf(turned)) / 4;
  const double half = std::atan2(ws, w * w), size = std::hypot(ws / w, w);
  const double error = sensed.error + 4 * rounded + doubleRounding * sensed.condition;
  const double halfError =
      w > error && size > 2 * error ? std::asin(error / size) + 14 * rounded : unbounded;

  const double share = double{twist.share}, angle = share * half;
  dvec3 direction = glm::normalize(linearOf(numbersOf(rig_.joints[twist.source].bind)) * given);
  if (sensed.isMirrored) direction = -direction;  // a rotation seen in a mirror
  // Polynomials of sine and cosine: 5 roundings each. The direction is stored.
  const Numbers3x3 rotation =
      rotationNumbers(matrixOf(dvec4(direction * std::sin(angle), std::cos(angle))),
                      std::abs(share) * halfError + rounded * std::abs(angle) + 10 * rounded);
  const Numbers3x4 bind = numbersOf(rig_.joints[twist.joint].bind);
  const Numbers3 origin{bind[0][3], bind[1][3], bind[2][3]};
  Numbers3 shift;
  for (std::size_t row = 0; row < 3; ++row)
    shift[row] = origin[row] - rowTimes(rotation, row, origin);
  setRelative(twist.joint, joined(rotation, shift));
}

/// The inverse of a bind matrix, as it is stored.
Numbers3x4 storedInverse(const JointMatrix& bind) {
  const Numbers3x4 m = numbersOf(bind);
  const dmat3 linear = linearOf(m), inverse = glm::inverse(linear);
  const dvec3 shift = columnOf(m, 3);
  const double size = conditionOf(linear) * sizeOf(inverse);
  Numbers3x4 result;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column)
      result[row][column] = stored(entryOf(inverse, row, column), size);
    result[row][3] =
        stored(-(inverse * shift)[static_cast<glm::length_t>(row)], size * glm::length(shift));
  }
  return result;
}

// The distance of two rotations A, B is ‖A - B‖ / √2, in the norm of Frobenius. float32: twice the
// length of the vector of conjugate(a) b, whose numbers are sums of four products: 4 √3 roundings,
// and one of a, which is stored. Then squares are summed. exp rounds 4 times with its polynomial;
// it is at least exp(-87), 1.7e-38. √ of less than 1e-37 may be 0.
void RigReference::evaluate(const CorrectiveDriver& corrective) {
  const std::size_t inputs = corrective.inputs.size();
  const std::size_t examples = corrective.examples.size() / inputs;
  const double radius = double{corrective.radius};
  const auto basisOf = [&](double square) {
    return radius == 0 ? std::sqrt(square) : std::exp(-square / (2 * radius * radius));
  };
  const auto rotationOf = [&](std::size_t example, std::size_t input) {
    return matrixOf(unitQuaternion(corrective.examples[example * inputs + input]));
  };
  const auto squareBetween = [](const dmat3& a, const dmat3& b) {
    return std::pow(sizeOf(a - b), 2) / 2;
  };
  std::vector<Sensed> sensed;
  for (const std::uint32_t joint : corrective.inputs) sensed.push_back(rotationAt(joint));
  std::vector<Number> basis;
  std::vector<double> matrix;
  for (std::size_t example = 0; example < examples; ++example) {
    for (std::size_t other = 0; other < examples; ++other) {
      double square = 0;
      for (std::size_t input = 0; input < inputs; ++input)
        square += squareBetween(rotationOf(example, input), rotationOf(other, input));
      matrix.push_back(basisOf(square));
    }
    double square = 0, errors = 0;
    for (std::size_t input = 0; input < inputs; ++input) {
      square += squareBetween(rotationOf(example, input), sensed[input].rotation);
      errors += std::pow(2 * (sensed[input].error + 8 * rounded), 2);
    }
    const double distance = std::sqrt(square), error = std::sqrt(errors);
    const double roundings = static_cast<double>(3 + inputs) * rounded;
    const double farthest = (distance + error) * (distance + error) * (1 + roundings) +
                            static_cast<double>(4 * inputs) * leastNormal;
    double basisError = std::sqrt(farthest) * (1 + 2 * rounded) - distance + 4e-19;
    if (radius > 0) {
      const double factor = 0.5 / (radius * radius);
      const double exponentError =
          factor * ((farthest - square) + farthest * (3 * rounded)) + leastNormal * (1 + factor);
      basisError =
          basisOf(square) * (std::expm1(exponentError) + 4 * rounded * std::exp(exponentError)) +
          2e-38;
    }
    basis.push_back({basisOf(square), basisError});
  }

  const std::vector<double> inverse = inverted(matrix, examples);
  double largest = 0;
  for (const double entry : matrix) largest = std::max(largest, std::abs(entry));
  // The sum of the functions times the coefficients that give the examples these values. They are
  // stored. Solving for them leaves a residual, which the inverse amplifies.
  const auto interpolated = [&](const auto& valueOf, double first) {
    std::vector<double> coefficients(examples), amplified(examples);
    double size = 0;
    for (std::size_t row = 0; row < examples; ++row) {
      for (std::size_t column = 0; column < examples; ++column) {
        coefficients[row] += inverse[row * examples + column] * valueOf(column);
        amplified[row] += std::abs(inverse[row * examples + column]);
      }
      size += std::abs(coefficients[row]);
    }
    std::vector<std::pair<Number, Number>> products{{{first, 0}, {1, 0}}};
    for (std::size_t row = 0; row < examples; ++row) {
      products.push_back(
          {basis[row], stored(coefficients[row],
                              static_cast<double>(examples) * largest * size * amplified[row])});
    }
    return sumOf(products);
  };
  for (std::size_t weight = 0; weight < corrective.weightCount; ++weight) {
    const auto valueOf = [&](std::size_t example) {
      return double{corrective.weights[example * corrective.weightCount + weight]};
    };
    setWeight(corrective.firstWeight + weight, interpolated(valueOf, 0));
  }
  for (std::size_t joint = 0; joint < corrective.joints.size(); ++joint) {
    const auto offsetOf = [&](std::size_t example) -> const JointOffset& {
      return corrective.offsets[example * corrective.joints.size() + joint];
    };
    Numbers3 shift, scale;
    std::array<Number, 4> turn;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto shiftOf = [&](std::size_t example) {
        return double{offsetOf(example).translation[i]};
      };
      const auto scaleOf = [&](std::size_t example) {
        return double{offsetOf(example).scale[i]} - 1;
      };
      shift[i] = interpolated(shiftOf, 0);
      scale[i] = interpolated(scaleOf, 1);
    }
    for (std::size_t i = 0; i < 4; ++i) {
      const auto turnOf = [&](std::size_t example) {
        const dvec4 q = unitQuaternion(offsetOf(example).rotation);
        return q[static_cast<glm::length_t>(i)] * (q.w < 0 ? -1 : 1) - (i == 3 ? 1 : 0);
      };
      turn[i] = interpolated(turnOf, i == 3 ? 1 : 0);
    }
    const dvec4 mean(turn[0].value, turn[1].value, turn[2].value, turn[3].value);
    const double error = std::hypot(std::hypot(turn[0].error, turn[1].error),
                                    std::hypot(turn[2].error, turn[3].error));
    Numbers3x3 linear =
        rotationNumbers(matrixOf(glm::normalize(mean)), unitError(glm::length(mean), error));
    for (Numbers3& row : linear)
      for (std::size_t column = 0; column < 3; ++column) row[column] = row[column] * scale[column];
    const JointMatrix& bind = rig_.joints[corrective.joints[joint]].bind;
    setRelative(corrective.joints[joint],
                product(product(numbersOf(bind), joined(linear, shift)), storedInverse(bind)));
  }
}

/// A linear map as a rotation times what is on and above the diagonal.
struct Frame {
  dmat3 rotation{1.0};
  double error = 0;  ///< of the rotation
  Numbers3x3 stretch{};
};

Frame frameOf(const Numbers3x4& matrix) {
  Frame frame;
  frame.rotation = orthonormal(linearOf(matrix));
  const std::array<double, 3> errors = orthonormalErrors(matrix);
  frame.error = quaternionError(frame.rotation, errors);
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = row; column < 3; ++column) {
      const dvec3 v = columnOf(matrix, column);
      const double error =
          std::hypot(matrix[0][column].error, matrix[1][column].error, matrix[2][column].error);
      frame.stretch[row][column] = {glm::dot(frame.rotation[static_cast<glm::length_t>(row)], v),
                                    error + (glm::length(v) + error) * (errors[row] + 3 * rounded) +
                                        4 * leastNormal * (1 + glm::length(v))};
    }
  }
  return frame;
}

/// The mean of both, of the rotations by their quaternions: seen from the first, 1 and (x, y, z, w)
/// with w >= 0. Near 180 degrees rounding decides the sign.
Frame mixed(const Frame& a, const Frame& b, const Number& share) {
  const double other = share.value, rest = 1 - other;
  const dmat3 between = glm::transpose(a.rotation) * b.rotation;
  const double w = scalarOf(between);
  const dvec4 mean(other * vectorOf(between) / (4 * w), rest + other * w);
  Frame frame;
  frame.rotation = a.rotation * matrixOf(glm::normalize(mean));
  frame.error = w > a.error + b.error + 5 * rounded
                    ? unitError(glm::length(mean), rest * a.error + other * b.error + 5 * rounded)
                    : unbounded;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = row; column < 3; ++column) {
      frame.stretch[row][column] =
          sumOf({{a.stretch[row][column], Number{1, 0} - share}, {b.stretch[row][column], share}});
    }
  }
  return frame;
}

/// Of a frame with this rotation.
Numbers3x3 linearOf(const dmat3& rotation, double error, const Frame& frame) {
  const Numbers3x3 r = rotationNumbers(rotation, error);
  Numbers3x3 linear;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 3; ++column) {
      std::vector<std::pair<Number, Number>> products;
      for (std::size_t i = 0; i <= column; ++i)
        products.push_back({r[row][i], frame.stretch[i][column]});
      linear[row][column] = sumOf(products);
    }
  }
  return linear;
}

Numbers3 storedVector(const dvec3& v, double size) {
  return {stored(v.x, size), stored(v.y, size), stored(v.z, size)};
}
dvec3 valuesOf(const Numbers3& v) {
  return {v[0].value, v[1].value, v[2].value};
}
double errorOf(const Numbers3& v) {
  return std::hypot(v[0].error, v[1].error, v[2].error);
}

/// The curve at a joint of the chain.
struct CurveNode {
  Frame frame;
  Numbers3 place, direction;
};

/// A factor of both places, and of both directions.
struct CurveFactors {
  double first, second, firstDirection, secondDirection;
};

/// A driven joint of a chain in bind pose.
struct CurveJoint {
  double share = 0;  ///< from one node to the next
  CurveFactors point, slope;
  Numbers3 place, direction;
};

/// The quaternion of the shortest turn from one unit vector to another is (axis, 1 + cosine), with
/// its length made 1. There is none if its square is at most 1e-8.
Numbers3x4 onCurve(const CurveJoint& joint, const CurveNode& begin, const CurveNode& end) {
  const Number first = stored(joint.point.first), second = Number{1, 0} - first;
  Numbers3 place, way;
  for (std::size_t i = 0; i < 3; ++i) {
    place[i] = sumOf({{begin.place[i], first},
                      {end.place[i], second},
                      {begin.direction[i], stored(joint.point.firstDirection)},
                      {end.direction[i], stored(joint.point.secondDirection)}});
    way[i] = sumOf({{begin.place[i] - end.place[i], stored(joint.slope.first)},
                    {begin.direction[i], stored(joint.slope.firstDirection)},
                    {end.direction[i], stored(joint.slope.secondDirection)}});
  }
  const Frame frame = mixed(begin.frame, end.frame, stored(joint.share));
  const Numbers3x3 rotation = rotationNumbers(frame.rotation, frame.error);
  Numbers3 from;
  for (std::size_t i = 0; i < 3; ++i) from[i] = rowTimes(rotation, i, joint.direction);
  const dvec3 f = glm::normalize(valuesOf(from)), t = glm::normalize(valuesOf(way));
  const double toError = unitError(glm::length(valuesOf(way)), errorOf(way));
  const dvec3 axis = glm::cross(f, t);
  const double cosine = glm::dot(f, t);
  const dmat3 skew(dvec3(0, axis.z, -axis.y), dvec3(-axis.z, 0, axis.x), dvec3(axis.y, -axis.x, 0));
  const dmat3 swing = dmat3(1.0) + skew + skew * skew / (1 + cosine);
  const double length = std::sqrt(std::max(0.0, 2 + 2 * cosine));
  const double error =
      std::sqrt(2.0) * (errorOf(from) + toError + errorOf(from) * toError) + 8 * rounded;
  const double swingError = length - error > 1.01e-4 ? unitError(length, error) : unbounded;

  const double turnError =
      frame.error + swingError + frame.error * swingError + 7 * rounded;  // of a product
  const Numbers3x3 linear = linearOf(swing * frame.rotation, turnError, frame);
  Numbers3 shift;
  for (std::size_t row = 0; row < 3; ++row)
    shift[row] = place[row] - rowTimes(linear, row, joint.place);
  return joined(linear, shift);
}

void RigReference::evaluate(const ChainDriver& chain) {
  const std::size_t count = chain.joints.size();
  std::vector<dvec3> origins, directions;
  std::vector<double> lengths;
  for (const std::uint32_t joint : chain.joints)
    origins.push_back(columnOf(numbersOf(rig_.joints[joint].bind), 3));
  double total = 0;
  for (std::size_t i = 0; i + 1 < count; ++i) {
    lengths.push_back(glm::distance(origins[i], origins[i + 1]));
    total += lengths.back();
  }
  std::vector<CurveNode> nodes;
  Frame before;
  for (std::size_t i = 0; i < count; ++i) {
    const dvec3 line = origins[std::min(i + 1, count - 1)] - origins[i == 0 ? 0 : i - 1];
    directions.push_back(glm::normalize(line));
    const Numbers3x4& matrix = joints_[chain.joints[i]];
    const Frame own = frameOf(matrix);
    CurveNode& node = nodes.emplace_back();
    node.frame = i == 0 || i + 1 == count ? own : mixed(before, own, {0.5, 0});
    before = own;
    const Numbers3x3 linear = linearOf(node.frame.rotation, node.frame.error, node.frame);
    const Numbers3 direction =
        storedVector(directions[i], glm::length(origins[i]) / glm::length(line));
    for (std::size_t row = 0; row < 3; ++row) {
      node.place[row] = sumOf({{matrix[row][0], {origins[i].x, 0}},
                               {matrix[row][1], {origins[i].y, 0}},
                               {matrix[row][2], {origins[i].z, 0}},
                               {matrix[row][3], {1, 0}}});
      node.direction[row] = rowTimes(linear, row, direction);
    }
  }
  std::size_t piece = 0;
  double begin = 0;
  for (std::uint32_t end = 1; end < chain.segments; ++end) {
    const double parameter = total * end / chain.segments;
    while (piece + 2 < count && parameter >= begin + lengths[piece]) begin += lengths[piece++];
    const double length = lengths[piece];
    CurveJoint joint;
    const double t = joint.share = std::min(1.0, (parameter - begin) / length);
    joint.point = {1 - t * t * (3 - 2 * t), t * t * (3 - 2 * t),
                   (t - 2 * t * t + t * t * t) * length, (t * t * t - t * t) * length};
    joint.slope = {6 * t * t - 6 * t, 6 * t - 6 * t * t, (1 - 4 * t + 3 * t * t) * length,
                   (3 * t * t - 2 * t) * length};
    const auto inBindPose = [&](const CurveFactors& factors) {
      return factors.first * origins[piece] + factors.second * origins[piece + 1] +
             factors.firstDirection * directions[piece] +
             factors.secondDirection * directions[piece + 1];
    };
    const double size = glm::length(origins[piece]) + glm::length(origins[piece + 1]) + total;
    const dvec3 slope = inBindPose(joint.slope);
    joint.place = storedVector(inBindPose(joint.point), size);
    joint.direction = storedVector(glm::normalize(slope), size / glm::length(slope));
    set(chain.firstDriven + end - 1, onCurve(joint, nodes[piece], nodes[piece + 1]));
  }
}

void RigReference::evaluate(const LinearDriver& linear) {
  Numbers3x4 sum;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      std::vector<std::pair<Number, Number>> products{{{row == column ? 1.0 : 0.0, 0}, {1, 0}}};
      for (std::size_t i = 0; i < linear.weights.size(); ++i) {
        products.push_back(
            {weights_[linear.weights[i]], {double{linear.matrices[i].m[row][column]}, 0}});
      }
      sum[row][column] = sumOf(products);
    }
  }
  setRelative(linear.joint, sum);
}

}  // namespace

Result<EvaluatedRig> evaluateRig(const RigView& rig, std::span<const JointMatrix> written,
                                 std::span<const float> givenWeights) {
  if (const Result<PackedRig> packed = packRig(rig); !packed) return packed.error();
  if (written.size() != rig.writtenJoints || givenWeights.size() != rig.givenWeights) {
    return Error{ErrorCode::invalidArgument,
                 "there are " + std::to_string(written.size()) + " joints and " +
                     std::to_string(givenWeights.size()) + " weights, but the rig has " +
                     std::to_string(rig.writtenJoints) + " and " +
                     std::to_string(rig.givenWeights)};
  }
  return RigReference(rig, written, givenWeights).run();
}

}  // namespace dermis::reference
