// Shapes as signed distance functions: negative inside, positive outside. Near the surface the
// value is about the distance in meters.
//
// The formulas for the round cone, the ellipsoid and the smooth minimum are from Inigo Quilez
// (https://iquilezles.org/articles/distfunctions, …/ellipsoids, …/smin).
#pragma once

#include <functional>
#include <vector>

#include "maths.h"

namespace dermis::models {

using Field = std::function<double(const Vec3&)>;

// A sphere that contains the inside of a field.
struct Bound {
  Vec3 center;
  double radius;
};

struct Solid {
  Field field;
  Bound bound;
};

Solid sphere(const Vec3& center, double radius);
Solid ellipsoid(const Vec3& center, const Vec3& radii);
// An ellipsoid whose axes are the orthogonal unit vectors x, y and z.
Solid ellipsoid(const Vec3& center, const Vec3& radii, const Vec3& x, const Vec3& y, const Vec3& z);
// Two spheres and the cone that is tangent to both.
Solid roundCone(const Vec3& from, const Vec3& to, double fromRadius, double toRadius);
// `solid` mirrored at x = 0.
Solid mirrored(const Solid& solid);

// The smaller of two distances, smoothed if they differ by less than `blend` meters; exact
// otherwise.
double smoothMinimum(double a, double b, double blend);
double smoothMaximum(double a, double b, double blend);

// A combination of solids, in the order in which they were added.
class Shape {
 public:
  // Adds a solid, with a fillet of about `blend` meters. `distance` skips solids that are far from
  // its point, so add large solids first.
  void add(const Solid& solid, double blend);
  // Adds a solid and its mirror image.
  void addPair(const Solid& solid, double blend);
  // Subtracts a solid.
  void carve(const Solid& solid, double blend);

  double distance(const Vec3& point) const;

 private:
  struct Part {
    Solid solid;
    double blend;
    bool isCarved;
  };
  std::vector<Part> parts_;
};

// The gradient of `field`, by central differences.
Vec3 gradient(const Field& field, const Vec3& point, double step);

}  // namespace dermis::models
