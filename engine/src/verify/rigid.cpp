#include "verify/rigid.h"

#include <cmath>

#include <glm/geometric.hpp>

#include "strict_floating_point.h"

namespace dermis::reference {
namespace {

using glm::dvec3;
using glm::dvec4;

dvec4 multiply(const dvec4& a, const dvec4& b) {
  const dvec3 x(a), y(b);
  return dvec4(a.w * y + b.w * x + glm::cross(x, y), a.w * b.w - glm::dot(x, y));
}

dvec4 conjugate(const dvec4& q) {
  return dvec4(-dvec3(q), q.w);
}

}  // namespace

Rigid operator*(const Rigid& a, const Rigid& b) {
  return {multiply(a.real, b.real), multiply(a.real, b.dual) + multiply(a.dual, b.real)};
}
Rigid operator*(const Rigid& a, double factor) {
  return {a.real * factor, a.dual * factor};
}
Rigid operator+(const Rigid& a, const Rigid& b) {
  return {a.real + b.real, a.dual + b.dual};
}
Rigid operator-(const Rigid& a) {
  return {-a.real, -a.dual};
}

Rigid rigidOf(const dvec4& rotation, const dvec3& translation) {
  return {rotation, 0.5 * multiply(dvec4(translation, 0), rotation)};
}

Rigid conjugate(const Rigid& a) {
  return {conjugate(a.real), conjugate(a.dual)};
}

Rigid normalize(const Rigid& a) {
  const double length = glm::length(a.real);
  const dvec4 real = a.real / length, dual = a.dual / length;
  return {real, dual - glm::dot(real, dual) * real};
}

dvec3 translationOf(const Rigid& a) {
  return 2.0 / glm::dot(a.real, a.real) * dvec3(multiply(a.dual, conjugate(a.real)));
}

dvec3 rotate(const dvec4& rotation, const dvec3& v) {
  const dvec3 r(rotation);
  return v + 2.0 * glm::cross(r, glm::cross(r, v) + rotation.w * v);
}

dvec3 transformPoint(const Rigid& a, const dvec3& point) {
  return rotate(a.real, point) + translationOf(a);
}

glm::dmat3 matrixOf(const dvec4& rotation) {
  return glm::dmat3(rotate(rotation, {1, 0, 0}), rotate(rotation, {0, 1, 0}),
                    rotate(rotation, {0, 0, 1}));
}

Rigid log(const Rigid& a) {
  const dvec3 r(a.real), d(a.dual);
  const double sine = glm::length(r);
  // No turn or a full turn, which has no axis: −a is the same transform, a translation.
  if (sine == 0) return {dvec4(0.0), dvec4(a.real.w < 0 ? -d : d, 0)};
  const double angle = std::atan2(sine, a.real.w);
  const double factor = angle / sine;
  // (1 − angle cot angle) / sine². The series avoids cancellation at small angles: with s = sine²,
  // 1/3 + 2/15 s + 8/105 s² + …, each coefficient is (2k + 2) / (2k + 5) times the one before.
  double slope = (1 - factor * a.real.w) / (sine * sine);
  if (angle < 0.3) {
    double term = 1.0 / 3;
    slope = 0;
    for (int k = 0; k < 16; ++k) {
      slope += term;
      term *= sine * sine * (2 * k + 2) / (2 * k + 5);
    }
  }
  return {dvec4(factor * r, 0), dvec4(factor * d - slope * a.dual.w * r, 0)};
}

Rigid exp(const Rigid& screw) {
  const dvec3 r(screw.real), d(screw.dual);
  const double square = glm::dot(r, r), angle = std::sqrt(square);
  double sinc = 0, slope = 0;  // sin a / a, and (cos a − sin a / a) / a²
  if (angle < 0.3) {
    // Σ (−1)^k a^2k / (2k + 1)!, and its derivative divided by a: Σ (−1)^(k+1) (2k + 2) a^2k / (2k
    // + 3)!.
    double term = 1;
    for (int k = 0; k < 8; ++k) {
      sinc += term;
      const double next = -term / ((2 * k + 2) * (2 * k + 3));
      slope += (2 * k + 2) * next;
      term = next * square;
    }
  } else {
    sinc = std::sin(angle) / angle;
    slope = (std::cos(angle) - sinc) / square;
  }
  const double along = glm::dot(r, d);
  return {dvec4(sinc * r, std::cos(angle)), dvec4(sinc * d + slope * along * r, -sinc * along)};
}

}  // namespace dermis::reference
