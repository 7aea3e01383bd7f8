// The polynomials of rigs are as near to the functions as their comments say, and the arithmetic
// around them as docs/accuracy.md. The solver solves.
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <functional>
#include <numbers>
#include <vector>

#include "made_rig.h"
#include "random_number.h"
#include "rig/blob.h"
#include "rig/solve.h"

namespace dermis::test {
namespace {

namespace in_double {

[[maybe_unused]] double squareRoot(double square) {
  return std::sqrt(square);
}
double floorOf(double number) {
  return std::floor(number);
}
double select(bool condition, double a, double b) {
  return condition ? a : b;
}
double powerOfTwo(double exponent) {
  return std::ldexp(1.0, static_cast<int>(exponent));
}
#include "rig/evaluate_inl.h"
}  // namespace in_double

namespace in_float {

[[maybe_unused]] float squareRoot(float square) {
  return std::sqrt(square);
}
float floorOf(float number) {
  return std::floor(number);
}
float select(bool condition, float a, float b) {
  return condition ? a : b;
}
float powerOfTwo(float exponent) {
  return std::ldexp(1.0f, static_cast<int>(exponent));
}
#include "rig/evaluate_inl.h"
}  // namespace in_float

/// The largest error of a function at 50,001 points.
double worstError(double from, double to, const std::function<double(double)>& error) {
  double worst = 0;
  for (int i = 0; i <= 50000; ++i)
    worst = std::max(worst, std::abs(error(from + (to - from) * i / 50000)));
  return worst;
}

TEST(RigPolynomials, AreAsNearAsTheySay) {
  EXPECT_LT(worstError(-1, 1, [](double x) { return in_double::arcTangent(x) - std::atan(x); }),
            2.3e-8);
  EXPECT_LT(worstError(-pi / 2, pi / 2, [](double x) { return in_double::sine(x) - std::sin(x); }),
            1.8e-8);
  EXPECT_LT(
      worstError(-pi / 2, pi / 2, [](double x) { return in_double::cosine(x) - std::cos(x); }),
      5.1e-9);
  EXPECT_LT(
      worstError(-87, 0, [](double x) { return in_double::exponential(x) / std::exp(x) - 1; }),
      4.4e-9 + 2e-9);  // and of ln 2 in two numbers
}

TEST(RigPolynomials, RoundAsTheBoundsSay) {
  const double u = 0x1p-24;
  const auto worst = [](double from, double to, float (*function)(const float&), auto exact) {
    return worstError(from, to, [&](double x) {
      const float argument = static_cast<float>(x);
      return double{function(argument)} - exact(double{argument});
    });
  };
  EXPECT_LT(worst(-1, 1, in_float::arcTangent<float>, [](double x) { return std::atan(x); }),
            4 * u);
  EXPECT_LT(worst(-pi / 2, pi / 2, in_float::sine<float>, [](double x) { return std::sin(x); }),
            5 * u);
  EXPECT_LT(worst(-pi / 2, pi / 2, in_float::cosine<float>, [](double x) { return std::cos(x); }),
            5 * u);
  EXPECT_LT(
      worstError(-87, 0,
                 [](double x) {
                   const float argument = static_cast<float>(x);
                   return double{in_float::exponential(argument)} / std::exp(double{argument}) - 1;
                 }),
      4 * u);
  EXPECT_LE(in_float::exponential(-1e30f), 1.7e-38f);
  EXPECT_GE(in_float::exponential(-1e30f), 0x1p-126f);
  EXPECT_EQ(in_float::exponential(0.0f), 1);
}

TEST(RigSolver, SolvesSymmetricSystemsThatAreNotDefinite) {
  std::mt19937 random(13);
  for (std::size_t size = 1; size <= 64; size = size * 3 / 2 + 1) {
    for (int kind = 0; kind < 3; ++kind) {  // any numbers, a diagonal of 0, distances on a line
      std::vector<double> matrix(size * size), expected(size), right(size);
      for (std::size_t row = 0; row < size; ++row) {
        expected[row] = between(random, -1, 1);
        for (std::size_t column = 0; column <= row; ++column) {
          double value = between(random, -1, 1);
          if (kind != 0 && row == column) value = 0;
          if (kind == 2) value = static_cast<double>(row - column);
          matrix[row * size + column] = matrix[column * size + row] = value;
        }
      }
      const SymmetricSolver solver(matrix, size);
      if (kind != 0 && size == 1) {
        EXPECT_TRUE(solver.isSingular());
        continue;
      }
      ASSERT_FALSE(solver.isSingular()) << size << ' ' << kind;
      for (std::size_t row = 0; row < size; ++row)
        for (std::size_t column = 0; column < size; ++column)
          right[row] += matrix[row * size + column] * expected[column];
      const std::vector<double> found = solver.solve(right);
      for (std::size_t row = 0; row < size; ++row) EXPECT_NEAR(found[row], expected[row], 1e-10);
    }
  }
}

TEST(RigSolver, TwoEqualRowsAreSingular) {
  const std::vector<double> matrix{2, 1, 2, 1, 5, 1, 2, 1, 2};
  EXPECT_TRUE(SymmetricSolver(matrix, 3).isSingular());
  EXPECT_TRUE(SymmetricSolver({0}, 1).isSingular());
  EXPECT_TRUE(SymmetricSolver({std::nan("")}, 1).isSingular());
}

}  // namespace
}  // namespace dermis::test
