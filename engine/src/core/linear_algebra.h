// Vectors of three and four numbers, and column-major 3×3 matrices, for the sources of core, so
// that core needs no library. Engines with GLM convert with glm.h.
#pragma once

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>

namespace dermis::math {

template <typename T>
struct Vector3 {
  T x = 0, y = 0, z = 0;

  constexpr Vector3() = default;
  explicit constexpr Vector3(T all) : x(all), y(all), z(all) {}
  constexpr Vector3(T first, T second, T third) : x(first), y(second), z(third) {}
  template <typename From>
  explicit constexpr Vector3(const Vector3<From>& from)
      : x(static_cast<T>(from.x)), y(static_cast<T>(from.y)), z(static_cast<T>(from.z)) {}

  template <std::integral Integer>
  constexpr T& operator[](Integer axis) {
    return axis == 0 ? x : axis == 1 ? y : z;
  }
  template <std::integral Integer>
  constexpr const T& operator[](Integer axis) const {
    return axis == 0 ? x : axis == 1 ? y : z;
  }
};
using Vec3 = Vector3<double>;
using Vec3f = Vector3<float>;

inline Vec3 operator+(const Vec3& a, const Vec3& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline Vec3 operator-(const Vec3& a, const Vec3& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline Vec3 operator-(const Vec3& a) {
  return {-a.x, -a.y, -a.z};
}
inline Vec3 operator+(const Vec3& a, double b) {
  return a + Vec3(b);
}
inline Vec3 operator-(const Vec3& a, double b) {
  return a - Vec3(b);
}
inline Vec3 operator*(double factor, const Vec3& a) {
  return {factor * a.x, factor * a.y, factor * a.z};
}
inline Vec3 operator/(const Vec3& a, double divisor) {
  return {a.x / divisor, a.y / divisor, a.z / divisor};
}
inline Vec3 min(const Vec3& a, const Vec3& b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
inline Vec3 max(const Vec3& a, const Vec3& b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}
inline Vec3 abs(const Vec3& a) {
  return {std::abs(a.x), std::abs(a.y), std::abs(a.z)};
}
inline double dot(const Vec3& a, const Vec3& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline double length(const Vec3& a) {
  return std::sqrt(dot(a, a));
}
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - b.y * a.z, a.z * b.x - b.z * a.x, a.x * b.y - b.x * a.y};
}

/// A quaternion has its real part in w.
struct Vec4 {
  double x = 0, y = 0, z = 0, w = 0;

  Vec3 xyz() const { return {x, y, z}; }
};
inline Vec4 operator-(const Vec4& a) {
  return {-a.x, -a.y, -a.z, -a.w};
}
inline double dot(const Vec4& a, const Vec4& b) {
  return (a.x * b.x + a.y * b.y) + (a.z * b.z + a.w * b.w);
}
inline Vec4 normalize(const Vec4& a) {
  const double inverse = 1 / std::sqrt(dot(a, a));
  return {a.x * inverse, a.y * inverse, a.z * inverse, a.w * inverse};
}

struct Mat3 {
  Vec3 columns[3]{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};

  template <std::integral Integer>
  Vec3& operator[](Integer column) {
    return columns[static_cast<std::size_t>(column)];
  }
  template <std::integral Integer>
  const Vec3& operator[](Integer column) const {
    return columns[static_cast<std::size_t>(column)];
  }
};
inline Mat3 operator+(const Mat3& a, const Mat3& b) {
  return {{a[0] + b[0], a[1] + b[1], a[2] + b[2]}};
}
inline Mat3 operator-(const Mat3& a, const Mat3& b) {
  return {{a[0] - b[0], a[1] - b[1], a[2] - b[2]}};
}
inline Mat3 operator-(const Mat3& a) {
  return {{-a[0], -a[1], -a[2]}};
}
inline Mat3 operator*(double factor, const Mat3& a) {
  return {{factor * a[0], factor * a[1], factor * a[2]}};
}
inline Mat3 operator/(const Mat3& a, double divisor) {
  return {{a[0] / divisor, a[1] / divisor, a[2] / divisor}};
}
inline Vec3 operator*(const Mat3& a, const Vec3& v) {
  return v.x * a[0] + v.y * a[1] + v.z * a[2];
}
inline Mat3 operator*(const Mat3& a, const Mat3& b) {
  return {{a * b[0], a * b[1], a * b[2]}};
}
inline Mat3 transpose(const Mat3& a) {
  return {{{a[0].x, a[1].x, a[2].x}, {a[0].y, a[1].y, a[2].y}, {a[0].z, a[1].z, a[2].z}}};
}
inline double determinant(const Mat3& a) {
  return dot(a[0], cross(a[1], a[2]));
}

/// The rotation of a unit quaternion.
inline Mat3 rotationOf(const Vec4& q) {
  return {
      {{1 - 2 * (q.y * q.y + q.z * q.z), 2 * (q.x * q.y + q.w * q.z), 2 * (q.x * q.z - q.w * q.y)},
       {2 * (q.x * q.y - q.w * q.z), 1 - 2 * (q.x * q.x + q.z * q.z), 2 * (q.y * q.z + q.w * q.x)},
       {2 * (q.x * q.z + q.w * q.y), 2 * (q.y * q.z - q.w * q.x),
        1 - 2 * (q.x * q.x + q.y * q.y)}}};
}

/// The unit quaternion of a rotation: from the largest of its components, each of which follows
/// from the diagonal (Shepperd 1978, "Quaternion from rotation matrix").
inline Vec4 quaternionOf(const Mat3& m) {
  const double trace = m[0].x + m[1].y + m[2].z;
  const double largest = std::max(std::max(m[0].x, m[1].y), std::max(m[2].z, trace));
  const Vec3 differences(m[1].z - m[2].y, m[2].x - m[0].z, m[0].y - m[1].x);
  const Vec3 sums(m[1].z + m[2].y, m[2].x + m[0].z, m[0].y + m[1].x);
  if (largest == trace) return normalize({differences.x, differences.y, differences.z, 1 + trace});
  if (largest == m[0].x)
    return normalize({1 + m[0].x - m[1].y - m[2].z, sums.z, sums.y, differences.x});
  if (largest == m[1].y)
    return normalize({sums.z, 1 - m[0].x + m[1].y - m[2].z, sums.x, differences.y});
  return normalize({sums.y, sums.x, 1 - m[0].x - m[1].y + m[2].z, differences.z});
}

}  // namespace dermis::math
