// Joints taken apart: by Newton's method, and by Jacobi's where they are nearly flat.

#include "cpu/polar.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "verify/joint.h"

namespace dermis::test {
namespace {

glm::dmat3 randomRotation(std::mt19937& random) {
  std::normal_distribution<double> normal;
  glm::dvec4 q(normal(random), normal(random), normal(random), normal(random));
  q /= std::sqrt(q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w);
  const double x = q.x, y = q.y, z = q.z, w = q.w;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)},
          {2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)},
          {2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)}};
}

// Both are in double precision; what differs is that ours is stored in float32. Products of four
// components of q, each half an ulp off: 3e-7 at most. Of σ₁ / (σ₂ + σ₃) < 10⁵ roundings in double
// become 1e-10.
TEST(CpuPolarTest, PartsAreThoseOfTheReference) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> exponent(-5, 0);
  int flat = 0, round = 0;
  for (int number = 0; number < 20'000; ++number) {
    // From nearly round to nearly flat, of any size, some mirrored.
    const double reach = number % 4 == 0 ? 0.001 : 1;
    const double size = std::pow(10, (number % 7 - 3) * 3.0);
    const double sigma[3] = {size, size * std::pow(10, reach * exponent(random)),
                             size * std::pow(10, reach * exponent(random))};
    glm::dmat3 scale(0.0);
    for (int i = 0; i < 3; ++i) scale[i][i] = sigma[i];
    if (number % 5 == 0) scale[2][2] = -scale[2][2];
    const glm::dmat3 wanted = randomRotation(random) * scale * randomRotation(random);
    float rows[3][4] = {};
    glm::dmat3 matrix;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        rows[row][column] = static_cast<float>(wanted[column][row]);
        matrix[column][row] = double{rows[row][column]};
      }
    }
    const reference::PolarParts expected = reference::polarParts(matrix);
    if (expected.degenerate) continue;
    (sigma[1] * sigma[2] < 1e-4 * size * size ? flat : round)++;
    float q[4];
    cpu::ScaleShear part;
    cpu::polarParts(rows, q, part);
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double own[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                              {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                              {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    const double parts[3][3] = {{part.diagonal[0], part.mixed[0], part.mixed[1]},
                                {part.mixed[0], part.diagonal[1], part.mixed[2]},
                                {part.mixed[1], part.mixed[2], part.diagonal[2]}};
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) {
        ASSERT_NEAR(own[row][column], expected.rotation[column][row], 3e-7) << number;
        ASSERT_NEAR(parts[row][column], expected.scaleShear[column][row], 2e-7 * size) << number;
      }
    }
  }
  EXPECT_GT(flat, 5'000);
  EXPECT_GT(round, 5'000);
}

}  // namespace
}  // namespace dermis::test
