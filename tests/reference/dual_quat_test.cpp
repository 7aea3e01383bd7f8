// dual_quat.h, which tests of methods compare with: held against matrices, and against screws
// written down by their axis.

#include "dual_quat.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "exact_joints.h"

namespace dermis::test {
namespace {

/// A turn about the axis through `center` and a shift along it.
struct Screw {
  glm::dvec3 axis{0, 0, 1};
  glm::dvec3 center{0, 0, 0};
  double angle = 0;
  double shift = 0;

  glm::dvec3 apply(const glm::dvec3& p) const {
    return center + rotationAbout(axis, angle) * (p - center) + shift * axis;
  }
  glm::dvec3 translation() const { return apply({0, 0, 0}); }
  DualQuatd dualQuat() const { return rigidOf(turnAbout(axis, angle), translation()); }
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

/// The largest distance between the columns of two matrices.
double distance(const glm::dmat4x3& a, const glm::dmat4x3& b) {
  double largest = 0;
  for (int i = 0; i < 4; ++i) largest = std::max(largest, glm::length(a[i] - b[i]));
  return largest;
}

// ---- Conversions

TEST(DualQuat, DefaultIsTheIdentity) {
  const glm::dvec3 p(1, -2, 3);
  EXPECT_EQ(transformPoint(DualQuatd{}, p), p);
  EXPECT_EQ(toMatrix(DualQuatd{}), glm::dmat4x3(1.0));
}

TEST(DualQuat, TheDualPartIsHalfTranslationTimesRotation) {
  RigRandom random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dquat q = randomTurn(random);
    const glm::dvec3 t = random.vector(10);
    EXPECT_LE(distance(fromRotationTranslation(q, t), rigidOf(q, t)), 1e-14);
  }
}

TEST(DualQuat, MatricesComeBackAsTheyWere) {
  RigRandom random(2);
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dvec3 axis = random.direction(), t = random.vector(5);
    const double angle = random.between(-2 * pi, 2 * pi);
    const glm::dmat3 rotation = rotationAbout(axis, angle);
    const glm::dmat4x3 matrix(rotation[0], rotation[1], rotation[2], t);
    const DualQuatd q = fromRigidMatrix(matrix);
    EXPECT_LE(transformDistance(q, rigidOf(turnAbout(axis, angle), t)), 1e-14);
    EXPECT_LE(distance(toMatrix(q), matrix), 1e-14);
  }
}

TEST(DualQuat, HalfTurnsHaveAScalarOfZero) {
  RigRandom random(3);
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
  RigRandom random(4);
  for (const double length : {0.811, 1.0, 0.5, 2.0, 1e-3, 1e3}) {
    const glm::dquat q = randomTurn(random);
    const glm::dvec3 t = random.vector(5);
    const DualQuatd scaled = rigidOf(q, t) * length;
    EXPECT_LE(glm::length(translationOf(scaled) - t), 1e-14 * 10) << length;
    EXPECT_LE(distance(toMatrix(scaled), toMatrix(rigidOf(q, t))), 1e-13) << length;
  }
}

// ---- Algebra

TEST(DualQuat, ProductsComposeAndConjugatesInvert) {
  RigRandom random(5);
  for (int trial = 0; trial < 500; ++trial) {
    const DualQuatd a = randomRigid(random), b = randomRigid(random);
    const glm::dvec3 p = random.vector(2);
    EXPECT_LE(glm::length(transformPoint(a * b, p) - transformPoint(a, transformPoint(b, p))),
              2e-14);
    EXPECT_LE(glm::length(transformPoint(conjugate(a), transformPoint(a, p)) - p), 2e-14);
    EXPECT_LE(distance(a * conjugate(a), DualQuatd{}), 2e-15);
    EXPECT_EQ(transformPoint(-a, p), transformPoint(a, p));
  }
}

TEST(DualQuat, NormalizeMakesItTrulyUnit) {
  RigRandom random(6);
  for (int trial = 0; trial < 500; ++trial) {
    const DualQuatd rigid = randomRigid(random);
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

TEST(DualQuat, MovesPointsAsTheMatrixDoes) {
  RigRandom random(7);
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dvec3 n = random.direction(), t = random.vector(5), p = random.vector(2);
    const double angle = random.between(-2 * pi, 2 * pi);
    const DualQuatd q = rigidOf(turnAbout(n, angle), t);
    EXPECT_LE(glm::length(transformPoint(q, p) - (rotationAbout(n, angle) * p + t)), 2e-14);
    DualQuatd along = q;
    along.dual = along.dual + along.real * random.between(-1, 1);
    EXPECT_LE(glm::length(transformPoint(along, p) - transformPoint(q, p)), 2e-14);
  }
}

// ---- Exponential and logarithm

class ScrewAngle : public ::testing::TestWithParam<double> {};

TEST_P(ScrewAngle, LogarithmAndExponentialOfAKnownScrew) {
  RigRandom random(8);
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

// ---- Screw interpolation

TEST(DualQuat, ScrewInterpolationFollowsTheScrew) {
  RigRandom random(10);
  for (int trial = 0; trial < 500; ++trial) {
    const Screw screw{random.direction(), random.vector(1), random.between(0, pi - 0.01),
                      random.between(-2, 2)};
    const DualQuatd a = randomRigid(random), b = a * screw.dualQuat();
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
  RigRandom random(11);
  for (int trial = 0; trial < 500; ++trial) {
    const DualQuatd a = randomRigid(random), b = randomRigid(random), g = randomRigid(random);
    const double t = random.between(0, 1);
    if (std::abs((conjugate(a) * b).real.w) < 0.01) continue;  // either way round is as short
    const DualQuatd between = screwInterpolate(a, b, t);
    EXPECT_LE(transformDistance(screwInterpolate(g * a, g * b, t), g * between), 3e-14);
    EXPECT_LE(transformDistance(screwInterpolate(a * g, b * g, t), between * g), 3e-14);
  }
}

}  // namespace
}  // namespace dermis::test
