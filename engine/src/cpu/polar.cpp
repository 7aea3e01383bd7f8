#include "cpu/polar.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "strict_floating_point.h"

namespace dermis::cpu {
namespace {

// In double precision, no residual with compensated sums is needed, unlike in the palette kernel
// (shaders/palette.comp), and no driver can replace operations.
using Vector = std::array<double, 4>;
using Matrix = std::array<std::array<double, 4>, 4>;

/// Horn's symmetric matrix of C (1987, "Closed-form solution of absolute orientation using unit
/// quaternions"): the eigenvector of its largest eigenvalue is the rotation nearest to C.
Matrix hornMatrix(const double c[3][3]) {
  Matrix m{};
  m[0][0] = c[0][0] - c[1][1] - c[2][2];
  m[1][1] = -c[0][0] + c[1][1] - c[2][2];
  m[2][2] = -c[0][0] - c[1][1] + c[2][2];
  m[3][3] = c[0][0] + c[1][1] + c[2][2];
  m[0][1] = m[1][0] = c[0][1] + c[1][0];
  m[0][2] = m[2][0] = c[0][2] + c[2][0];
  m[1][2] = m[2][1] = c[1][2] + c[2][1];
  m[0][3] = m[3][0] = c[2][1] - c[1][2];
  m[1][3] = m[3][1] = c[0][2] - c[2][0];
  m[2][3] = m[3][2] = c[1][0] - c[0][1];
  return m;
}

/// One rotation of Jacobi's method: makes the entry of row p and column q zero. The columns of
/// `vectors` become the eigenvectors.
void turn(Matrix& m, Matrix& vectors, std::size_t p, std::size_t q) {
  if (m[p][q] == 0) return;
  const double theta = (m[q][q] - m[p][p]) / (2 * m[p][q]);
  const double tangent = (theta < 0 ? -1 : 1) / (std::abs(theta) + std::sqrt(1 + theta * theta));
  const double cosine = 1 / std::sqrt(1 + tangent * tangent);
  const double sine = tangent * cosine;
  for (std::size_t i = 0; i < 4; ++i) {
    const double ip = m[i][p], iq = m[i][q];
    m[i][p] = cosine * ip - sine * iq;
    m[i][q] = sine * ip + cosine * iq;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const double pi = m[p][i], qi = m[q][i];
    m[p][i] = cosine * pi - sine * qi;
    m[q][i] = sine * pi + cosine * qi;
    const double vp = vectors[i][p], vq = vectors[i][q];
    vectors[i][p] = cosine * vp - sine * vq;
    vectors[i][q] = sine * vp + cosine * vq;
  }
}

Vector byJacobi(const double c[3][3]) {
  Matrix m = hornMatrix(c);
  Matrix vectors{};
  for (std::size_t i = 0; i < 4; ++i) vectors[i][i] = 1;
  // Converges quadratically: five or six sweeps suffice for nearly all matrices.
  for (int sweep = 0; sweep < 12; ++sweep) {
    double outside = 0, inside = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      inside += std::abs(m[i][i]);
      for (std::size_t j = i + 1; j < 4; ++j) outside += std::abs(m[i][j]);
    }
    if (outside <= 1e-18 * inside) break;
    for (std::size_t i = 0; i < 4; ++i) {
      for (std::size_t j = i + 1; j < 4; ++j) turn(m, vectors, i, j);
    }
  }
  std::size_t largest = 0;
  for (std::size_t i = 1; i < 4; ++i) {
    if (m[i][i] > m[largest][largest]) largest = i;
  }
  Vector q{};
  double square = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    q[i] = vectors[i][largest];
    square += q[i] * q[i];
  }
  for (double& component : q) component /= std::sqrt(square);
  return q;
}

using Matrix3 = std::array<std::array<double, 3>, 3>;

Matrix3 cofactorsOf(const Matrix3& m) {
  Matrix3 cofactors;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto &a = m[(i + 1) % 3], &b = m[(i + 2) % 3];
    cofactors[i] = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                    a[0] * b[1] - a[1] * b[0]};
  }
  return cofactors;
}

double determinantOf(const Matrix3& m, const Matrix3& cofactors) {
  return m[0][0] * cofactors[0][0] + m[0][1] * cofactors[0][1] + m[0][2] * cofactors[0][2];
}

/// Newton's method for the orthogonal factor (Higham 1986, "Computing the polar decomposition"): X
/// ← (X + X⁻ᵀ) / 2, starting at about C / det(C)^⅓. It converges quadratically, to a rotation if
/// det(C) > 0. Returns whether it converged within a few steps, as it does unless C is nearly
/// singular.
bool nearestRotation(const double c[3][3], Matrix3& x) {
  for (std::size_t i = 0; i < 3; ++i) x[i] = {c[i][0], c[i][1], c[i][2]};
  Matrix3 cofactors = cofactorsOf(x);
  const double determinant = determinantOf(x, cofactors);
  // The largest entry is 1. Flatter matrices are left to Jacobi's method.
  if (!(determinant > 1e-4)) return false;
  // Scales by a power of two, because libraries round cube roots differently.
  int exponent = 0;
  static_cast<void>(std::frexp(determinant, &exponent));
  const double scale = std::ldexp(1.0, -exponent / 3);
  for (auto& row : x) {
    for (double& entry : row) entry *= scale;
  }
  for (int step = 0; step < 12; ++step) {
    cofactors = cofactorsOf(x);
    const double half = 0.5 / determinantOf(x, cofactors);
    double change = 0;
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t j = 0; j < 3; ++j) {
        const double next = 0.5 * x[i][j] + half * cofactors[i][j];
        change = std::max(change, std::abs(next - x[i][j]));
        x[i][j] = next;
      }
    }
    // The error is about the square of the last change.
    if (change < 1e-8) return true;
  }
  return false;
}

/// The quaternion of a rotation matrix, from its largest component (Shepperd 1978).
Vector quaternionOf(const Matrix3& r) {
  const Vector squares{1 + r[0][0] - r[1][1] - r[2][2], 1 - r[0][0] + r[1][1] - r[2][2],
                       1 - r[0][0] - r[1][1] + r[2][2], 1 + r[0][0] + r[1][1] + r[2][2]};
  const auto largest =
      static_cast<std::size_t>(std::ranges::max_element(squares) - squares.begin());
  const double a = r[2][1] - r[1][2], b = r[0][2] - r[2][0], c = r[1][0] - r[0][1];
  const double d = r[0][1] + r[1][0], e = r[0][2] + r[2][0], f = r[1][2] + r[2][1];
  const Matrix columns{
      {{squares[0], d, e, a}, {d, squares[1], f, b}, {e, f, squares[2], c}, {a, b, c, squares[3]}}};
  Vector q = columns[largest];
  double square = 0;
  for (const double component : q) square += component * component;
  for (double& component : q) component /= std::sqrt(square);
  return q;
}

}  // namespace

void polarParts(const float rows[3][4], float rotation[4], ScaleShear& scaleShear) {
  double c[3][3], largest = 0;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      c[row][column] = double{rows[row][column]};
      largest = std::max(largest, std::abs(c[row][column]));
    }
  }
  if (largest == 0) {
    rotation[0] = rotation[1] = rotation[2] = 0;
    rotation[3] = 1;
    scaleShear = {{0, 0, 0}, {0, 0, 0}};
    return;
  }
  // The determinant, and its size if no product in it cancelled. A determinant that may be negative
  // only because the matrix was rounded (24 roundings of 2^-24) counts as 0: that of a flat matrix
  // may have either sign.
  double determinant = 0, magnitude = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const double a = c[1][j] * c[2][k], b = c[1][k] * c[2][j];
    determinant += c[0][i] / largest * (a - b) / largest / largest;
    magnitude += std::abs(c[0][i]) / largest * (std::abs(a) + std::abs(b)) / largest / largest;
  }
  const double side = determinant < -1.43e-6 * magnitude ? -1 : 1;
  double scaled[3][3];
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      scaled[row][column] = side * c[row][column] / largest;
  }
  Matrix3 nearest;
  const Vector q = nearestRotation(scaled, nearest) ? quaternionOf(nearest) : byJacobi(scaled);
  const double x = q[0], y = q[1], z = q[2], w = q[3];
  const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                          {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                          {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  const auto part = [&](int i, int j) {  // of Rᵀ C
    return r[0][i] * c[0][j] + r[1][i] * c[1][j] + r[2][i] * c[2][j];
  };
  for (int i = 0; i < 3; ++i) scaleShear.diagonal[i] = static_cast<float>(part(i, i));
  scaleShear.mixed[0] = static_cast<float>((part(0, 1) + part(1, 0)) / 2);
  scaleShear.mixed[1] = static_cast<float>((part(0, 2) + part(2, 0)) / 2);
  scaleShear.mixed[2] = static_cast<float>((part(1, 2) + part(2, 1)) / 2);
  for (int i = 0; i < 4; ++i) rotation[i] = static_cast<float>(q[static_cast<std::size_t>(i)]);
}

}  // namespace dermis::cpu
