// Shapes as signed distances: negative inside, positive outside, about metres near the surface.
//
// The formulas for the round cone, the ellipsoid and the smooth minimum are Inigo Quilez's
// (https://iquilezles.org/articles/distfunctions, …/ellipsoids, …/smin).
#pragma once

#include <functional>
#include <vector>

#include "maths.h"

namespace dermis::models {

using Field = std::function<double(const Vec3&)>;

// A sphere that holds all of a field's inside.
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
// An ellipsoid whose own axes are the unit vectors x, y, z, at right angles to one another.
Solid ellipsoid(const Vec3& center, const Vec3& radii, const Vec3& x, const Vec3& y, const Vec3& z);
// Two spheres and the cone that touches both.
Solid roundCone(const Vec3& from, const Vec3& to, double fromRadius, double toRadius);
// `solid` mirrored at x = 0.
Solid mirrored(const Solid& solid);

// The smaller of two distances, rounded off over `blend` metres where they are alike; exact
// elsewhere.
double smoothMinimum(double a, double b, double blend);
double smoothMaximum(double a, double b, double blend);

// Solids put together in the order they were added.
class Shape {
 public:
  // Adds a solid, with a fillet of about `blend` metres. Solids that are far from a point are
  // skipped there, so the large ones should come first.
  void add(const Solid& solid, double blend);
  // Adds a solid and its mirror image.
  void addPair(const Solid& solid, double blend);
  // Takes a solid away.
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

// The direction in which `field` grows, by central differences; its length is the field's slope.
Vec3 gradient(const Field& field, const Vec3& point, double step);

}  // namespace dermis::models
