// Singular values and the polar decomposition that the reference rests on.

#include "verify/joint.h"

#include <algorithm>

#include "by_hand.h"
#include "reference_rig.h"

namespace dermis::test {
namespace {

using reference::PolarParts;
using reference::polarParts;
using reference::SingularValues;
using reference::singularValues;

void expectOrthonormal(const glm::dmat3& m) {
  EXPECT_LE(largestEntry(glm::transpose(m) * m - glm::dmat3(1.0)), 1e-14);
}

TEST(Decompose, SingularValuesOfKnownProducts) {
  RigRandom random(1);
  for (int trial = 0; trial < 1000; ++trial) {
    glm::dvec3 values(random.between(0, 3), random.between(0, 3), random.between(0, 3));
    if (trial % 4 == 1) values.y = values.x;
    if (trial % 4 == 2) values = glm::dvec3(values.x);
    const glm::dmat3 matrix = randomRotation(random) *
                              diagonalMatrix(values.x, values.y, values.z) *
                              randomRotation(random) * (trial % 2 == 0 ? 1.0 : -1.0);
    std::array<double, 3> sorted{values.x, values.y, values.z};
    std::sort(sorted.begin(), sorted.end(), std::greater<>());
    const SingularValues svd = singularValues(matrix);
    for (int i = 0; i < 3; ++i) {
      EXPECT_NEAR(svd.values[i], sorted[static_cast<std::size_t>(i)], 1e-14);
    }
    expectOrthonormal(svd.left);
    expectOrthonormal(svd.right);
    EXPECT_LE(largestEntry(svd.left * diagonalMatrix(svd.values[0], svd.values[1], svd.values[2]) *
                               glm::transpose(svd.right) -
                           matrix),
              3e-14);
  }
}

// Columns of very different lengths: one-sided Jacobi finds the small values to the last digits.
TEST(Decompose, SmallSingularValuesAreAsExactAsLargeOnes) {
  RigRandom random(2);
  for (int trial = 0; trial < 200; ++trial) {
    const SingularValues svd =
        singularValues(randomRotation(random) * diagonalMatrix(1e-10, 1, 1e-20));
    EXPECT_NEAR(svd.values[0], 1, 1e-14);
    EXPECT_NEAR(svd.values[1], 1e-10, 1e-24);
    EXPECT_NEAR(svd.values[2], 1e-20, 1e-33);
  }
}

TEST(Decompose, SingularValuesOfSingularMatrices) {
  RigRandom random(3);
  const glm::dvec3 u = random.direction(), v = random.direction();
  for (const glm::dmat3& matrix :
       {glm::dmat3(0.0), glm::outerProduct(u, v), glm::outerProduct(u, u) * -2.0,
        diagonalMatrix(0, 3, 0), diagonalMatrix(0, 3, 2),
        glm::dmat3(glm::dvec3(1), glm::dvec3(1), glm::dvec3(1))}) {
    const SingularValues svd = singularValues(matrix);
    expectOrthonormal(svd.left);
    expectOrthonormal(svd.right);
    EXPECT_GE(svd.values[0], svd.values[1]);
    EXPECT_GE(svd.values[1], svd.values[2]);
    EXPECT_NEAR(svd.values[2], 0, 1e-15);
    EXPECT_LE(largestEntry(svd.left * diagonalMatrix(svd.values[0], svd.values[1], svd.values[2]) *
                               glm::transpose(svd.right) -
                           matrix),
              1e-15 * 4);
  }
}

void expectPolar(const PolarParts& parts, const glm::dmat3& matrix, double scale) {
  expectOrthonormal(parts.rotation);
  EXPECT_NEAR(glm::determinant(parts.rotation), 1, 1e-14);
  EXPECT_LE(largestEntry(parts.rotation * parts.scaleShear - matrix), 2e-14 * scale);
  EXPECT_LE(largestEntry(parts.scaleShear - glm::transpose(parts.scaleShear)), 2e-14 * scale);
}

/// A symmetric matrix with these eigenvalues.
glm::dmat3 symmetric(RigRandom& random, const glm::dvec3& values) {
  const glm::dmat3 frame = randomRotation(random);
  return frame * diagonalMatrix(values.x, values.y, values.z) * glm::transpose(frame);
}

TEST(Decompose, PolarPartsOfKnownProductsAtAnyScale) {
  RigRandom random(4);
  for (const double scale : {1.0, 1e-20, 1e-38, 1e-6, 1e6, 1e20, 1e38}) {
    for (int trial = 0; trial < 200; ++trial) {
      const glm::dmat3 rotation = randomRotation(random);
      const glm::dvec3 values(random.between(0.2, 4), random.between(0.2, 4),
                              random.between(0.2, 4));
      const double sign = trial % 2 == 0 ? 1 : -1;  // with a mirror the sign goes into S
      const glm::dmat3 scaleShear = symmetric(random, values) * (sign * scale);
      const PolarParts parts = polarParts(rotation * scaleShear);
      expectPolar(parts, rotation * scaleShear, scale);
      EXPECT_LE(largestEntry(parts.rotation - rotation), 2e-14);
      EXPECT_LE(largestEntry(parts.scaleShear - scaleShear), 4e-14 * scale);
      EXPECT_NEAR(parts.largest / scale, std::max({values.x, values.y, values.z}), 2e-14);
      // Where a GPU may take what is stored for 0, nobody can say how it turns.
      EXPECT_EQ(parts.degenerate, scale < 0x1p-100);
    }
  }
}

TEST(Decompose, PolarPartsOfAnyMatrix) {
  RigRandom random(5);
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dmat3 matrix(random.vector(1), random.vector(1), random.vector(1));
    const PolarParts parts = polarParts(matrix);
    expectPolar(parts, matrix, 1);
    // S is definite, of the determinant's sign.
    const double sign = glm::determinant(matrix) < 0 ? -1 : 1;
    for (int probe = 0; probe < 10; ++probe) {
      const glm::dvec3 v = random.direction();
      EXPECT_GE(sign * glm::dot(v, parts.scaleShear * v), -1e-15);
    }
  }
}

TEST(Decompose, ReflectionsInOneAxis) {
  // −C is a half turn about x: R is it, S = −1.
  const PolarParts parts = polarParts(diagonalMatrix(-1, 1, 1));
  EXPECT_LE(largestEntry(parts.rotation - diagonalMatrix(1, -1, -1)), 1e-15);
  EXPECT_LE(largestEntry(parts.scaleShear - diagonalMatrix(-1, -1, -1)), 1e-15);
}

TEST(Decompose, RankTwoHasTheRotationOfItsTwoAxes) {
  RigRandom random(6);
  for (const double scale : {1.0, 1e-20, 1e20}) {
    for (int trial = 0; trial < 300; ++trial) {
      const glm::dmat3 rotation = randomRotation(random);
      const glm::dmat3 flat =
          symmetric(random, {random.between(0.5, 2), random.between(0.5, 2), 0}) * scale;
      const PolarParts parts = polarParts(rotation * flat);
      expectPolar(parts, rotation * flat, scale);
      EXPECT_LE(largestEntry(parts.rotation - rotation), 1e-14 * 2);
    }
  }
}

// Rank 2 has one right answer, so that a comparison may not pass over it; only rank 1 has none.
TEST(Decompose, RankTwoIsNotDegenerate) {
  RigRandom random(10);
  int exactly = 0, inFloat = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const glm::dmat3 flat = symmetric(random, {random.between(0.5, 2), random.between(0.5, 2), 0});
    const glm::dmat3 matrix = randomRotation(random) * flat;
    exactly += polarParts(matrix).degenerate ? 1 : 0;
    inFloat += polarParts(linearOf(jointOf(matrix))).degenerate ? 1 : 0;
  }
  EXPECT_EQ(exactly, 0) << "of 1000";
  EXPECT_EQ(inFloat, 0) << "of 1000, as stored in float32";
}

// Float32 rounding leaves a rank of 2 with a little of either sign in the third axis.
TEST(Decompose, NearlyRankTwoOfEitherSideHasTheSameRotation) {
  RigRandom random(7);
  int negative = 0;
  for (int trial = 0; trial < 300; ++trial) {
    const glm::dmat3 rotation = randomRotation(random);
    const glm::dmat3 flat = symmetric(random, {random.between(0.5, 2), random.between(0.5, 2), 0});
    const glm::dmat3 stored = linearOf(jointOf(rotation * flat));
    negative += glm::determinant(stored) < 0 ? 1 : 0;
    const PolarParts parts = polarParts(stored);
    expectPolar(parts, stored, 1);
    EXPECT_LE(largestEntry(parts.rotation - rotation), 2e-6);
  }
  EXPECT_GT(negative, 50);
  EXPECT_LT(negative, 250);
}

TEST(Decompose, RankOneAndZeroAreFiniteAndDegenerate) {
  RigRandom random(8);
  for (const glm::dmat3& matrix :
       {glm::dmat3(0.0), glm::outerProduct(random.direction(), random.direction()),
        diagonalMatrix(0, -5, 0), diagonalMatrix(1, 1e-7, 0), diagonalMatrix(1e-44, 0, 0)}) {
    const PolarParts parts = polarParts(matrix);
    expectOrthonormal(parts.rotation);
    EXPECT_NEAR(glm::determinant(parts.rotation), 1, 1e-14);
    EXPECT_LE(largestEntry(parts.rotation * parts.scaleShear - matrix), 1e-14);
    EXPECT_TRUE(parts.degenerate);
  }
}

// Along the axes a determinant is one exact product: a mirror is a mirror however thin it is.
TEST(Decompose, AThinMirrorAlongTheAxesIsAMirror) {
  for (const double thickness : {1e-7, 3e-6, 1e-3, 0.1}) {
    const PolarParts parts = polarParts(diagonalMatrix(1, 1, -thickness));
    EXPECT_FALSE(parts.degenerate) << thickness;
    EXPECT_LE(largestEntry(parts.rotation - diagonalMatrix(-1, -1, 1)), 1e-13) << thickness;
  }
  EXPECT_FALSE(polarParts(diagonalMatrix(1, 0.0015, -0.0015)).degenerate);
}

// Elsewhere its products cancel: within 16 roundings of 0 it counts as flat, within 32 it is a
// matter of rounding.
TEST(Decompose, MirrorsTooThinToBeToldAreDegenerate) {
  RigRandom random(11);
  int frames = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const glm::dmat3 frame = randomRotation(random);
    const auto mirror = [&](double thickness) {
      return polarParts(frame * diagonalMatrix(1, 1, -thickness) * glm::transpose(frame));
    };
    EXPECT_FALSE(mirror(1e-9).degenerate);
    EXPECT_FALSE(mirror(1e-4).degenerate);
    bool between = false;
    for (double thickness = 1e-9; thickness < 1e-4; thickness *= 1.1)
      between |= mirror(thickness).degenerate;
    frames += between ? 1 : 0;
  }
  // All but frames near the axes.
  EXPECT_GE(frames, 45);
}

TEST(Decompose, DistanceFromRotationIsTheLargestStretch) {
  RigRandom random(9);
  const glm::dmat3 rotation = randomRotation(random);
  EXPECT_LE(polarParts(rotation).distanceFromRotation, 1e-15);
  EXPECT_NEAR(polarParts(rotation * symmetric(random, {1.25, 1, 0.5})).distanceFromRotation, 0.5,
              1e-14);
  EXPECT_NEAR(polarParts(rotation * symmetric(random, {1.75, 1, 0.5})).distanceFromRotation, 0.75,
              1e-14);
  EXPECT_NEAR(polarParts(rotation * symmetric(random, {1.5, 1.25, 1.125})).largest, 1.5, 1e-14);
}

}  // namespace
}  // namespace dermis::test
