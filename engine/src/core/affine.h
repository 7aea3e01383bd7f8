// Affine transforms as 3×4 matrices: those of nodes, in float32 and in double precision.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <optional>

namespace dermis {

/// `[row][column]`; column 3 is the translation.
template <typename T>
using Affine = std::array<std::array<T, 4>, 3>;

/// Translation × rotation × scale. The rotation is a quaternion of unit length: x, y, z, w.
template <typename T, typename Translation, typename Scale>
Affine<T> composed(const Translation& t, const std::array<T, 4>& rotation, const Scale& s) {
  const auto [x, y, z, w] = rotation;
  return {{{(1 - 2 * (y * y + z * z)) * s[0], 2 * (x * y - w * z) * s[1],
            2 * (x * z + w * y) * s[2], t[0]},
           {2 * (x * y + w * z) * s[0], (1 - 2 * (x * x + z * z)) * s[1],
            2 * (y * z - w * x) * s[2], t[1]},
           {2 * (x * z - w * y) * s[0], 2 * (y * z + w * x) * s[1],
            (1 - 2 * (x * x + y * y)) * s[2], t[2]}}};
}

/// left × right. `Right` has [row][column] of a floating-point type.
template <typename T, typename Right>
Affine<T> multiply(const Affine<T>& left, const Right& right) {
  Affine<T> product;
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      T sum = column == 3 ? left[row][3] : 0;
      for (std::size_t i = 0; i < 3; ++i) sum += left[row][i] * static_cast<T>(right[i][column]);
      product[row][column] = sum;
    }
  }
  return product;
}

/// None if the determinant is 0 beside the lengths of the rows.
inline std::optional<Affine<double>> inverseOf(const Affine<double>& m) {
  Affine<double> inverse;
  double determinant = 0, size = 1;
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
      inverse[i][j] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
    }
    determinant += m[0][i] * inverse[i][0];
    size *= std::sqrt(m[i][0] * m[i][0] + m[i][1] * m[i][1] + m[i][2] * m[i][2]);
  }
  if (!(std::abs(determinant) > 1e-9 * size)) return std::nullopt;
  for (auto& row : inverse) {
    row[3] = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      row[j] /= determinant;
      row[3] -= row[j] * m[j][3];
    }
  }
  return inverse;
}

}  // namespace dermis
