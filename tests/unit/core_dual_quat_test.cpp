// dual_quat.h: the mathematics, held against matrices, against screws written down by their axis,
// and against the numbers of TRUTHS.md.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "dual_quat.h"

namespace dermis::test {
namespace {

constexpr double pi = std::numbers::pi;

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  glm::dvec3 vector(double reach) {
    return {between(-reach, reach), between(-reach, reach), between(-reach, reach)};
  }
  glm::dvec3 direction() {
    glm::dvec3 v(0.0);
    while (glm::length(v) < 0.1 || glm::length(v) > 1) v = vector(1);
    return v / glm::length(v);
  }
  /// A rotation by up to a full turn, in either sign of the quaternion.
  glm::dquat rotation() {
    const glm::dvec3 v = direction() * between(-1, 1);
    const double w = std::sqrt(1 - glm::dot(v, v)) * (between(-1, 1) < 0 ? -1 : 1);
    return {w, v.x, v.y, v.z};
  }
  DualQuatd rigid(double reach = 1);
  std::vector<double> weights(std::size_t count) {
    std::vector<double> result(count);
    double sum = 0;
    for (double& weight : result) sum += weight = between(0.05, 1);
    for (double& weight : result) weight /= sum;
    return result;
  }

 private:
  std::mt19937_64 engine_;
};

/// ½ (0, t) q by its components: d_w = −½ t·q_v, d_v = ½ (q_w t + t × q_v).
DualQuatd rigidOf(const glm::dquat& q, const glm::dvec3& t) {
  const glm::dvec3 v(q.x, q.y, q.z);
  const glm::dvec3 d = 0.5 * (q.w * t + glm::cross(t, v));
  return {q, glm::dquat(-0.5 * glm::dot(t, v), d.x, d.y, d.z)};
}

DualQuatd Random::rigid(double reach) {
  const glm::dquat q = rotation();
  return rigidOf(q, vector(reach));
}

glm::dquat turn(const glm::dvec3& axis, double angle) {
  const glm::dvec3 v = std::sin(angle / 2) * axis;
  return {std::cos(angle / 2), v.x, v.y, v.z};
}

/// Rodrigues' formula.
glm::dvec3 rotated(const glm::dvec3& n, double angle, const glm::dvec3& v) {
  return std::cos(angle) * v + std::sin(angle) * glm::cross(n, v) +
         (1 - std::cos(angle)) * glm::dot(n, v) * n;
}

/// A turn about the axis through `center` and a shift along it.
struct Screw {
  glm::dvec3 axis{0, 0, 1};
  glm::dvec3 center{0, 0, 0};
  double angle = 0;
  double shift = 0;

  glm::dvec3 apply(const glm::dvec3& p) const {
    return center + rotated(axis, angle, p - center) + shift * axis;
  }
  glm::dvec3 translation() const { return apply({0, 0, 0}); }
  DualQuatd dualQuat() const { return rigidOf(turn(axis, angle), translation()); }
  /// Half the angle and half the shift on the axis as a Plücker line: ½ (θ n + ε (s n + θ c × n)).
  DualQuatd logarithm() const {
    const glm::dvec3 r = 0.5 * angle * axis;
    const glm::dvec3 d = 0.5 * (shift * axis + angle * glm::cross(center, axis));
    return {glm::dquat(0, r.x, r.y, r.z), glm::dquat(0, d.x, d.y, d.z)};
  }
};

double distance(const glm::dquat& a, const glm::dquat& b) {
  return std::sqrt(glm::dot(a - b, a - b));
}
double distance(const DualQuatd& a, const DualQuatd& b) {
  return std::max(distance(a.real, b.real), distance(a.dual, b.dual));
}
/// Of the transforms: q and −q are the same.
double transformDistance(const DualQuatd& a, const DualQuatd& b) {
  return std::min(distance(a, b), distance(a, -b));
}

DualQuatf toFloat(const DualQuatd& q) {
  return {glm::quat(q.real), glm::quat(q.dual)};
}

DualQuatd blendOf(const std::vector<DualQuatd>& transforms, const std::vector<double>& weights) {
  return blend<double>(transforms, weights);
}

glm::dvec3 column(const glm::dmat4x3& matrix, int index) {
  return matrix[index];
}

// ---- Conversions

TEST(DualQuat, DefaultIsTheIdentity) {
  const glm::dvec3 p(1, -2, 3);
  EXPECT_EQ(transformPoint(DualQuatd{}, p), p);
  EXPECT_EQ(toMatrix(DualQuatd{}), glm::dmat4x3(1.0));
}

TEST(DualQuat, TheDualPartIsHalfTranslationTimesRotation) {
  Random random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dquat q = random.rotation();
    const glm::dvec3 t = random.vector(10);
    EXPECT_LE(distance(fromRotationTranslation(q, t), rigidOf(q, t)), 1e-14);
  }
}

TEST(DualQuat, MatricesComeBackAsTheyWere) {
  Random random(2);
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dvec3 axis = random.direction(), t = random.vector(5);
    const double angle = random.between(-2 * pi, 2 * pi);
    glm::dmat4x3 matrix;
    for (int i = 0; i < 3; ++i) {
      glm::dvec3 e(0.0);
      e[i] = 1;
      matrix[i] = rotated(axis, angle, e);
    }
    matrix[3] = t;
    const DualQuatd q = fromRigidMatrix(matrix);
    EXPECT_LE(transformDistance(q, rigidOf(turn(axis, angle), t)), 1e-14);
    const glm::dmat4x3 back = toMatrix(q);
    for (int i = 0; i < 4; ++i) {
      EXPECT_LE(glm::length(column(back, i) - column(matrix, i)), 1e-14);
    }
    const glm::mat4x3 backFloat = toMatrix(fromRigidMatrix(glm::mat4x3(matrix)));
    for (int i = 0; i < 4; ++i) {
      EXPECT_LE(glm::length(backFloat[i] - glm::mat4x3(matrix)[i]), 6e-6f);
    }
  }
}

TEST(DualQuat, HalfTurnsHaveAScalarOfZero) {
  Random random(3);
  std::vector<glm::dvec3> axes{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  for (int trial = 0; trial < 100; ++trial) axes.push_back(random.direction());
  for (const glm::dvec3& n : axes) {
    const glm::dvec3 t = random.vector(5);
    glm::dmat4x3 matrix;  // 2 n nᵀ − 1
    for (int i = 0; i < 3; ++i) {
      matrix[i] = 2 * n[i] * n;
      matrix[i][i] -= 1;
    }
    matrix[3] = t;
    const DualQuatd q = fromRigidMatrix(matrix);
    EXPECT_NEAR(q.real.w, 0, 1e-15);
    EXPECT_NEAR(std::abs(glm::dot(glm::dvec3(q.real.x, q.real.y, q.real.z), n)), 1, 1e-14);
    const glm::dvec3 p = random.vector(2);
    EXPECT_LE(glm::length(transformPoint(q, p) - (2 * glm::dot(n, p) * n - p + t)), 1e-13);
  }
}

TEST(DualQuat, TheIdentityMatrixIsTheIdentity) {
  const DualQuatd q = fromRigidMatrix(glm::dmat4x3(1.0));
  EXPECT_EQ(distance(q, DualQuatd{}), 0);
}

// t = 2 vec(d q*) / |q|², not / |q|: the slip is 19 % short at |q| = 0.811.
TEST(DualQuat, TranslationOfAnyLengthOfTheRealPart) {
  Random random(4);
  for (const double length : {0.811, 1.0, 0.5, 2.0, 1e-3, 1e3}) {
    const glm::dquat q = random.rotation();
    const glm::dvec3 t = random.vector(5);
    const DualQuatd scaled = rigidOf(q, t) * length;
    EXPECT_LE(glm::length(translationOf(scaled) - t), 1e-14 * 10) << length;
    const glm::dmat4x3 matrix = toMatrix(scaled), expected = toMatrix(rigidOf(q, t));
    for (int i = 0; i < 4; ++i) {
      EXPECT_LE(glm::length(column(matrix, i) - column(expected, i)), 1e-13) << length;
    }
  }
}

// ---- Algebra

TEST(DualQuat, ProductsComposeAndConjugatesInvert) {
  Random random(5);
  for (int trial = 0; trial < 500; ++trial) {
    const DualQuatd a = random.rigid(), b = random.rigid();
    const glm::dvec3 p = random.vector(2);
    EXPECT_LE(glm::length(transformPoint(a * b, p) - transformPoint(a, transformPoint(b, p))),
              2e-14);
    EXPECT_LE(glm::length(transformPoint(conjugate(a), transformPoint(a, p)) - p), 2e-14);
    EXPECT_LE(distance(a * conjugate(a), DualQuatd{}), 2e-15);
    EXPECT_EQ(transformPoint(-a, p), transformPoint(a, p));
  }
}

TEST(DualQuat, NormalizeMakesItTrulyUnit) {
  Random random(6);
  for (int trial = 0; trial < 500; ++trial) {
    const DualQuatd rigid = random.rigid();
    // Another length, and a component of the dual part along the real one: neither moves a point.
    DualQuatd spoiled = rigid * random.between(0.1, 10);
    spoiled.dual = spoiled.dual + spoiled.real * random.between(-3, 3);
    const DualQuatd mended = normalize(spoiled);
    EXPECT_NEAR(glm::dot(mended.real, mended.real), 1, 1e-15);
    EXPECT_NEAR(glm::dot(mended.real, mended.dual), 0, 1e-14);
    EXPECT_LE(distance(mended, rigid), 2e-14);
  }
}

TEST(DualQuat, SumsAndMultiplesWorkOnBothParts) {
  const DualQuatd a{glm::dquat(1, 2, 3, 4), glm::dquat(5, 6, 7, 8)};
  const DualQuatd b{glm::dquat(8, 7, 6, 5), glm::dquat(4, 3, 2, 1)};
  const DualQuatd sum = a + b * 2.0;
  EXPECT_EQ(sum.real, glm::dquat(17, 16, 15, 14));
  EXPECT_EQ(sum.dual, glm::dquat(13, 12, 11, 10));
}

TEST(DualQuat, MovesPointsAndTurnsVectorsAsTheMatrixDoes) {
  Random random(7);
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dvec3 n = random.direction(), t = random.vector(5), p = random.vector(2);
    const double angle = random.between(-2 * pi, 2 * pi);
    const DualQuatd q = rigidOf(turn(n, angle), t);
    EXPECT_LE(glm::length(transformPoint(q, p) - (rotated(n, angle, p) + t)), 2e-14);
    EXPECT_LE(glm::length(transformVector(q, p) - rotated(n, angle, p)), 1e-14);
    DualQuatd along = q;
    along.dual = along.dual + along.real * random.between(-1, 1);
    EXPECT_LE(glm::length(transformPoint(along, p) - transformPoint(q, p)), 2e-14);
  }
}

// ---- Exponential and logarithm

class ScrewAngle : public ::testing::TestWithParam<double> {};

TEST_P(ScrewAngle, LogarithmAndExponentialOfAKnownScrew) {
  Random random(8);
  for (int trial = 0; trial < 200; ++trial) {
    Screw screw{random.direction(), random.vector(1), GetParam(), random.between(-2, 2)};
    const DualQuatd q = screw.dualQuat(), logarithm = screw.logarithm();
    // Towards a full turn the axis fades in rounding.
    const double allowed = screw.angle < pi ? 1e-14 : 1e-14 / std::sin(screw.angle / 2);
    EXPECT_LE(distance(log(q), logarithm), allowed) << GetParam();
    EXPECT_LE(distance(exp(logarithm), q), 5e-15) << GetParam();
    EXPECT_LE(distance(exp(log(q)), q), allowed) << GetParam();
    EXPECT_EQ(log(q).real.w, 0);
    EXPECT_EQ(log(q).dual.w, 0);
  }
}

// On both sides of where the series change to the closed forms (half angle 0.1), near 0, near a
// half turn, beyond it.
INSTANTIATE_TEST_SUITE_P(DualQuat, ScrewAngle,
                         ::testing::Values(1e-12, 1e-8, 1e-5, 1e-3, 0.05, 0.1, 0.19, 0.1999999,
                                           0.2000001, 0.3, 1.0, 2.0, 3.0, pi - 1e-6, pi - 1e-12, pi,
                                           pi + 1e-6, 4.0, 5.0, 6.0));

TEST(DualQuat, LogarithmOfAPureTranslationIsHalfOfIt) {
  const DualQuatd q = rigidOf(glm::dquat(1, 0, 0, 0), {2, -4, 6});
  for (const DualQuatd& same : {q, -q}) {
    const DualQuatd logarithm = log(same);
    EXPECT_EQ(logarithm.real, glm::dquat(0, 0, 0, 0));
    EXPECT_EQ(logarithm.dual, glm::dquat(0, 1, -2, 3));
    EXPECT_EQ(distance(exp(logarithm), q), 0);
  }
}

TEST(DualQuat, ExponentialOfZeroIsTheIdentityAndBack) {
  const DualQuatd zero{glm::dquat(0, 0, 0, 0), glm::dquat(0, 0, 0, 0)};
  EXPECT_EQ(distance(exp(zero), DualQuatd{}), 0);
  EXPECT_EQ(distance(log(DualQuatd{}), zero), 0);
}

TEST(DualQuat, FloatLogarithmAndExponentialAreAsExactAsFloatAllows) {
  Random random(9);
  for (int trial = 0; trial < 3000; ++trial) {
    Screw screw{random.direction(), random.vector(1), std::exp(random.between(-12, 1.1)),
                random.between(-2, 2)};
    const DualQuatf logarithm = toFloat(screw.logarithm());
    const DualQuatf q = toFloat(screw.dualQuat());
    const DualQuatf there = exp(logarithm), back = log(q);
    const auto gap = [](const DualQuatf& a, const DualQuatf& b) {
      const glm::quat real = a.real - b.real, dual = a.dual - b.dual;
      return std::sqrt(std::max(glm::dot(real, real), glm::dot(dual, dual)));
    };
    EXPECT_LE(gap(there, q), 1.5e-6f) << screw.angle;
    EXPECT_LE(gap(back, logarithm), 4e-6f) << screw.angle;
  }
}

// ---- Screw interpolation

TEST(DualQuat, ScrewInterpolationFollowsTheScrew) {
  Random random(10);
  for (int trial = 0; trial < 500; ++trial) {
    const Screw screw{random.direction(), random.vector(1), random.between(0, pi - 0.01),
                      random.between(-2, 2)};
    const DualQuatd a = random.rigid(), b = a * screw.dualQuat();
    const glm::dvec3 p = random.vector(1);
    for (const double t : {0.0, 0.1, 0.5, 0.77, 1.0}) {
      Screw part = screw;
      part.angle *= t;
      part.shift *= t;
      const glm::dvec3 expected = transformPoint(a, part.apply(p));
      for (const DualQuatd& end : {b, -b}) {
        EXPECT_LE(glm::length(transformPoint(screwInterpolate(a, end, t), p) - expected), 1e-13);
      }
    }
    EXPECT_LE(transformDistance(screwInterpolate(a, b, 0.3), screwInterpolate(b, a, 0.7)), 1e-13);
  }
}

TEST(DualQuat, ScrewInterpolationDoesNotDependOnTheFrame) {
  Random random(11);
  for (int trial = 0; trial < 500; ++trial) {
    const DualQuatd a = random.rigid(), b = random.rigid(), g = random.rigid();
    const double t = random.between(0, 1);
    if (std::abs((conjugate(a) * b).real.w) < 0.01) continue;  // either way round is as short
    const DualQuatd between = screwInterpolate(a, b, t);
    EXPECT_LE(transformDistance(screwInterpolate(g * a, g * b, t), g * between), 3e-14);
    EXPECT_LE(transformDistance(screwInterpolate(a * g, b * g, t), between * g), 3e-14);
  }
}

// ---- Blending

TEST(DualQuat, PivotIsTheGreatestWeightTheFirstOnATie) {
  const auto pivot = [](std::vector<float> weights) {
    return pivotOf(std::span<const float>(weights));
  };
  EXPECT_EQ(pivot({}), 0u);
  EXPECT_EQ(pivot({0.2f, 0.5f, 0.3f}), 1u);
  EXPECT_EQ(pivot({0.1f, 0.45f, 0.45f}), 1u);
  EXPECT_EQ(pivot({0.25f, 0.25f, 0.25f, 0.25f}), 0u);
  EXPECT_EQ(pivot({0.1f, 0.2f, 0.7f}), 2u);
}

/// The rotation by which DLB and ScLERP differ, in degrees, between two transforms `angle` apart.
double rotationDifference(double angle, double t) {
  const Screw screw{{0, 0, 1}, {0.3, -0.4, 0}, angle, 1};
  const DualQuatd exact = screwInterpolate(DualQuatd{}, screw.dualQuat(), t);
  const DualQuatd blended = blendOf({DualQuatd{}, screw.dualQuat()}, {1 - t, t});
  const glm::dquat between = glm::conjugate(exact.real) * blended.real;
  return 2 * std::atan2(std::abs(between.z), std::abs(between.w)) * 180 / pi;
}

TEST(DualQuat, Truth01_DlbAndScrewInterpolationDifferBy8149Thousandths) {
  const double nearHalfTurn = pi - 1e-7;
  double worst = 0, worstAt = 0;
  for (int step = 1; step < 5000; ++step) {  // the other half mirrors this one
    const double t = step * 1e-4;
    const double difference = rotationDifference(nearHalfTurn, t);
    if (difference > worst) {
      worst = difference;
      worstAt = t;
    }
  }
  EXPECT_NEAR(worst, 8.149, 0.0006);
  EXPECT_NEAR(worstAt, 0.2386, 0.00011);
  // In closed form 2 atan(t / (1 − t)) − πt, which is stationary where (1 − t)² + t² = 2 / π.
  const double t = 0.5 - 0.5 * std::sqrt(4 / pi - 1);
  EXPECT_NEAR(rotationDifference(nearHalfTurn, t), 180 * t - 360 / pi * std::atan(t / (1 - t)),
              1e-5);
}

TEST(DualQuat, Truth01_ItIsLessForSmallerAngles) {
  double before = 8.1495;
  for (const double degrees : {179.0, 150.0, 120.0, 90.0, 45.0, 10.0}) {
    double worst = 0;
    for (int step = 1; step < 500; ++step) {
      worst = std::max(worst, rotationDifference(degrees * pi / 180, step * 1e-3));
    }
    EXPECT_LT(worst, before) << degrees;
    before = worst;
  }
}

TEST(DualQuat, Truth02_TranslationAlongTheScrewDiffersBy1501Hundredths) {
  const Screw screw{{0, 0, 1}, {0.3, -0.4, 0}, pi - 1e-7, 1};
  double worst = 0, worstAt = 0;
  for (int step = 1; step < 5000; ++step) {
    const double t = step * 1e-4;
    const DualQuatd exact = screwInterpolate(DualQuatd{}, screw.dualQuat(), t);
    const DualQuatd blended = blendOf({DualQuatd{}, screw.dualQuat()}, {1 - t, t});
    const double difference = std::abs(translationOf(blended).z - translationOf(exact).z);
    EXPECT_NEAR(translationOf(exact).z, t, 1e-12);
    // In closed form t² / ((1 − t)² + t²) of the whole.
    EXPECT_NEAR(translationOf(blended).z, t * t / ((1 - t) * (1 - t) + t * t), 1e-6);
    if (difference > worst) {
      worst = difference;
      worstAt = t;
    }
  }
  EXPECT_NEAR(worst, 0.1501, 0.00006);
  EXPECT_NEAR(worstAt, 0.257, 0.00055);
}

TEST(DualQuat, Truth03_BothHaveTheSameScrewAxis) {
  Random random(12);
  for (int trial = 0; trial < 1000; ++trial) {
    const Screw screw{random.direction(), random.vector(1), random.between(0.2, pi - 0.05),
                      random.between(-2, 2)};
    const double t = random.between(0.1, 0.9);
    const DualQuatd blended = normalize(blendOf({DualQuatd{}, screw.dualQuat()}, {1 - t, t}));
    // Of the blend's own screw: axis and moment, without the shift along the axis.
    const DualQuatd logarithm = log(blended.real.w < 0 ? -blended : blended);
    const glm::dvec3 r(logarithm.real.x, logarithm.real.y, logarithm.real.z);
    const glm::dvec3 d(logarithm.dual.x, logarithm.dual.y, logarithm.dual.z);
    const glm::dvec3 axis = r / glm::length(r);
    const glm::dvec3 moment = (d - glm::dot(axis, d) * axis) / glm::length(r);
    const double side = glm::dot(axis, screw.axis) < 0 ? -1 : 1;
    EXPECT_LE(glm::length(side * axis - screw.axis), 1e-12);
    EXPECT_LE(glm::length(side * moment - glm::cross(screw.center, screw.axis)), 1e-12);
  }
}

TEST(DualQuat, Truth04_TransformingAllInputsTransformsTheBlend) {
  Random random(13);
  double worstComponent = 0, worstPoint = 0;
  for (int trial = 0; trial < 2000; ++trial) {
    const std::size_t count = 2 + static_cast<std::size_t>(trial % 3);
    const std::vector<double> weights = random.weights(count);
    const DualQuatd g = random.rigid();
    std::vector<DualQuatd> inputs, left, right;
    for (std::size_t i = 0; i < count; ++i) inputs.push_back(random.rigid());
    const std::size_t pivot = pivotOf(std::span<const double>(weights));
    const bool ambiguous = std::any_of(inputs.begin(), inputs.end(), [&](const DualQuatd& q) {
      return std::abs(glm::dot(q.real, inputs[pivot].real)) < 1e-5;
    });
    if (ambiguous) continue;
    for (const DualQuatd& q : inputs) {
      left.push_back(g * q);
      right.push_back(q * g);
    }
    const DualQuatd b = blendUnnormalized<double>(inputs, weights);
    const DualQuatd bLeft = blendUnnormalized<double>(left, weights);
    const DualQuatd bRight = blendUnnormalized<double>(right, weights);
    worstComponent = std::max({worstComponent, distance(bLeft, g * b), distance(bRight, b * g)});
    const glm::dvec3 p = random.vector(1);
    const glm::dvec3 moved = transformPoint(blendOf(inputs, weights), p);
    worstPoint = std::max(worstPoint, glm::length(transformPoint(blendOf(left, weights), p) -
                                                  transformPoint(g, moved)));
    worstPoint = std::max(
        worstPoint, glm::length(transformPoint(blendOf(right, weights), p) -
                                transformPoint(blendOf(inputs, weights), transformPoint(g, p))));
  }
  EXPECT_LE(worstComponent, 2e-15);
  EXPECT_LE(worstPoint, 1e-14 * 3);  // points up to three units from the origin
}

TEST(DualQuat, Truth05_AllWeightsMayBeMultiplied) {
  Random random(14);
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<DualQuatd> inputs;
    for (int i = 0; i < 4; ++i) inputs.push_back(random.rigid());
    std::vector<double> weights = random.weights(4);
    const DualQuatd b = blendOf(inputs, weights);
    for (double& weight : weights) weight *= 0.37;
    const DualQuatd same = blendOf(inputs, weights);
    EXPECT_LE(distance(same, b), 1e-15 * std::max(1.0, std::sqrt(glm::dot(b.dual, b.dual))));
    const glm::dvec3 p = random.vector(1);
    EXPECT_LE(glm::length(transformPoint(same, p) - transformPoint(b, p)), 1e-14);
  }
}

template <typename T>
void expectSameBits(const glm::vec<3, T>& a, const glm::vec<3, T>& b) {
  EXPECT_EQ(a.x, b.x);
  EXPECT_EQ(a.y, b.y);
  EXPECT_EQ(a.z, b.z);
}

TEST(DualQuat, Truth06_NegatingAnInputMovesNoPointInAnyBit) {
  Random random(15);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<DualQuatd> inputs;
    for (int i = 0; i < 4; ++i) inputs.push_back(random.rigid());
    const std::vector<double> weights = random.weights(4);
    const std::vector<float> floatWeights(weights.begin(), weights.end());
    const auto floats = [&] {
      std::vector<DualQuatf> result;
      for (const DualQuatd& q : inputs) result.push_back(toFloat(q));
      return result;
    };
    const glm::dvec3 p = random.vector(1);
    const glm::dvec3 before = transformPoint(blendOf(inputs, weights), p);
    const glm::vec3 beforeFloat =
        transformPoint(blend<float>(floats(), floatWeights), glm::vec3(p));
    const std::size_t pivot = pivotOf(std::span<const double>(weights));
    for (std::size_t negated = 0; negated < inputs.size(); ++negated) {
      const DualQuatd b = blendOf(inputs, weights);
      inputs[negated] = -inputs[negated];
      const DualQuatd c = blendOf(inputs, weights);
      EXPECT_EQ(distance(c, negated == pivot ? -b : b), 0);
      expectSameBits(transformPoint(c, p), before);
      expectSameBits(transformPoint(blend<float>(floats(), floatWeights), glm::vec3(p)),
                     beforeFloat);
    }
  }
}

TEST(DualQuat, Truth08_TheBlendIsRigid) {
  Random random(16);
  double worst = 0, worstFloat = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    std::vector<DualQuatd> inputs;
    std::vector<DualQuatf> floats;
    for (int i = 0; i < 4; ++i) {
      inputs.push_back(random.rigid());
      floats.push_back(toFloat(inputs.back()));
    }
    const std::vector<double> weights = random.weights(4);
    const std::vector<float> floatWeights(weights.begin(), weights.end());
    const DualQuatd b = blendOf(inputs, weights);
    const DualQuatf f = blend<float>(floats, floatWeights);
    glm::dmat3 r, rFloat;  // by its effect on points: differences of moved points
    const glm::dvec3 origin = transformPoint(b, glm::dvec3(0.0));
    for (int i = 0; i < 3; ++i) {
      glm::dvec3 e(0.0);
      e[i] = 1;
      r[i] = transformPoint(b, e) - origin;
      rFloat[i] = glm::dvec3(transformVector(f, glm::vec3(e)));
    }
    const glm::dmat3 gram = glm::transpose(r) * r, gramFloat = glm::transpose(rFloat) * rFloat;
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        worst = std::max(worst, std::abs(gram[i][j] - (i == j ? 1 : 0)));
        worstFloat = std::max(worstFloat, std::abs(gramFloat[i][j] - (i == j ? 1 : 0)));
      }
    }
    worst = std::max(worst, std::abs(glm::determinant(r) - 1));
    worstFloat = std::max(worstFloat, std::abs(glm::determinant(rFloat) - 1));
  }
  EXPECT_LE(worst, 1e-14);
  EXPECT_LE(worstFloat, 3e-6);
}

double angleAboutZ(const DualQuatd& q) {
  const glm::dvec3 x = transformVector(q, glm::dvec3(1, 0, 0));
  const double angle = std::atan2(x.y, x.x) * 180 / pi;
  return angle < -1e-9 ? angle + 360 : angle;
}

DualQuatd aboutZ(double degrees) {
  return rigidOf(turn({0, 0, 1}, degrees * pi / 180), {0, 0, 0});
}

TEST(DualQuat, Truth12_TheStrongestInfluenceIsThePivot) {
  const std::vector<DualQuatd> inputs{aboutZ(0), aboutZ(170), aboutZ(-170)};
  EXPECT_NEAR(angleAboutZ(blendOf(inputs, {0.1, 0.45, 0.45})), 167.27, 0.005);
  // With the first as pivot it would be 0°, at norm 0.178: the two others nearly cancel.
  const DualQuatd first = inputs[0] * 0.1 + inputs[1] * 0.45 +
                          inputs[2] * (glm::dot(inputs[0].real, inputs[2].real) < 0 ? -0.45 : 0.45);
  EXPECT_NEAR(std::sqrt(glm::dot(first.real, first.real)), 0.178, 0.0005);
  EXPECT_NEAR(angleAboutZ(normalize(first)), 0, 1e-9);
}

TEST(DualQuat, Truth13_EqualWeightsTakeTheFirstAsPivot) {
  const std::vector<double> equal{1.0 / 3, 1.0 / 3, 1.0 / 3};
  EXPECT_NEAR(angleAboutZ(blendOf({aboutZ(0), aboutZ(140), aboutZ(220)}, equal)), 0, 1e-9);
  EXPECT_NEAR(angleAboutZ(blendOf({aboutZ(140), aboutZ(0), aboutZ(220)}, equal)), 123.97, 0.005);
  EXPECT_NEAR(angleAboutZ(blendOf({aboutZ(220), aboutZ(0), aboutZ(140)}, equal)), 236.03, 0.005);
}

TEST(DualQuat, Truth14_AWeightOfZeroIsSkippedNotMultiplied) {
  Random random(17);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double infinity = std::numeric_limits<double>::infinity();
  const DualQuatd bad{glm::dquat(nan, infinity, nan, 0), glm::dquat(infinity, nan, 0, nan)};
  const std::vector<DualQuatd> inputs{random.rigid(), random.rigid()};
  const DualQuatd expected = blendOf(inputs, {0.3, 0.7});
  EXPECT_EQ(
      distance(blendOf({bad, inputs[0], bad, inputs[1], bad}, {0, 0.3, 0, 0.7, -0.0}), expected),
      0);
}

TEST(DualQuat, TheBlendIsNeverShorterThanTheLargestWeight) {
  Random random(18);
  for (int trial = 0; trial < 2000; ++trial) {
    const std::size_t count = 1 + static_cast<std::size_t>(trial % 8);
    std::vector<DualQuatd> inputs;
    for (std::size_t i = 0; i < count; ++i) inputs.push_back(random.rigid());
    const std::vector<double> weights = random.weights(count);
    const DualQuatd b = blendUnnormalized<double>(inputs, weights);
    EXPECT_GE(std::sqrt(glm::dot(b.real, b.real)),
              *std::max_element(weights.begin(), weights.end()) - 1e-15);
  }
  // Attained where the others cancel and are at right angles to the pivot, whose dot products of 0
  // count as the same hemisphere.
  const std::vector<DualQuatd> cancelling{rigidOf(glm::dquat(1, 0, 0, 0), {1, 2, 3}),
                                          rigidOf(glm::dquat(0, 1, 0, 0), {0, 0, 0}),
                                          rigidOf(glm::dquat(0, -1, 0, 0), {0, 0, 0})};
  const std::vector<double> weights{0.4, 0.3, 0.3};
  const DualQuatd b = blendUnnormalized<double>(cancelling, weights);
  EXPECT_NEAR(std::sqrt(glm::dot(b.real, b.real)), 0.4, 1e-16);
  EXPECT_LE(
      glm::length(transformPoint(blendOf(cancelling, weights), {0, 0, 0}) - glm::dvec3(1, 2, 3)),
      1e-15);
}

TEST(DualQuat, ADotProductOfZeroKeepsTheSign) {
  const std::vector<DualQuatd> inputs{aboutZ(0), {glm::dquat(0, 0, 0, 1), glm::dquat(0, 0, 0, 0)}};
  EXPECT_NEAR(angleAboutZ(blendOf(inputs, {0.5, 0.5})), 90, 1e-12);
}

TEST(DualQuat, OneTransformBlendsToItself) {
  Random random(19);
  const DualQuatd q = random.rigid();
  EXPECT_LE(distance(blendOf({q}, {0.25}), q), 1e-15);
  EXPECT_LE(distance(blendOf({}, {}), DualQuatd{}), 0);
}

// Float32 against the same formula in double: 24 u · scale, scale = max |t| + |p|.
TEST(DualQuat, Truth16_FloatBlendsAreWithin24UnitsOfRounding) {
  Random random(20);
  const double unit = std::ldexp(1.0, -24);
  for (int trial = 0; trial < 20000; ++trial) {
    const std::size_t count = 1 + static_cast<std::size_t>(trial % 4);
    std::vector<DualQuatf> floats;
    std::vector<DualQuatd> doubles;
    double largest = 0;
    bool ambiguous = false;
    for (std::size_t i = 0; i < count; ++i) {
      const glm::dquat q = random.rotation();
      const glm::dvec3 t(glm::vec3(random.vector(1)));
      largest = std::max(largest, glm::length(t));
      floats.push_back(toFloat(rigidOf(q, t)));
      doubles.push_back(rigidOf(q, t));
    }
    const std::vector<double> weights = random.weights(count);
    const std::vector<float> floatWeights(weights.begin(), weights.end());
    const std::size_t pivot = pivotOf(std::span<const double>(weights));
    for (const DualQuatd& q : doubles) {
      ambiguous |= std::abs(glm::dot(q.real, doubles[pivot].real)) < 1e-5;
    }
    if (ambiguous) continue;
    const glm::vec3 p(random.vector(1));
    const glm::dvec3 exact = transformPoint(blendOf(doubles, weights), glm::dvec3(p));
    const glm::vec3 rounded = transformPoint(blend<float>(floats, floatWeights), p);
    EXPECT_LE(glm::length(glm::dvec3(rounded) - exact),
              24 * unit * (largest + glm::length(glm::dvec3(p))));
  }
}

}  // namespace
}  // namespace dermis::test
