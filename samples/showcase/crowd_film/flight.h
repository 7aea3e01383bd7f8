// The camera of the film: around the crowd, down into the aisle between the standing and the
// walking figures, and up again.
#pragma once

#include <cstdint>

#include <glm/vec3.hpp>

#include "kit/render/camera.h"

namespace crowd_film {

/// Where the camera flies. Lengths are in world units.
struct FlightPlan {
  double unit = 1;         ///< a meter, if a figure has a height of 1.75 m
  double aisleRadius = 5;  ///< the middle of the aisle
  double crowdRadius = 10;
  double aspect = 16.0 / 9;
  std::uint32_t height = 720;  ///< of the picture, pixels
};

struct Eye {
  glm::dvec3 place, forward, right, up;
};

class Flight {
 public:
  static constexpr double seconds = 24;  ///< then it begins again

  explicit Flight(const FlightPlan& plan) : plan_(plan) {}

  Eye at(double time) const;
  dermis::samples::render::Camera camera(const Eye& eye) const;

  /// Whether a sphere is in the picture or near it.
  bool sees(const Eye& eye, const glm::dvec3& center, double radius) const;
  /// Size of a pixel at this distance.
  double pixelSize(double distance) const;

  const FlightPlan& plan() const { return plan_; }

 private:
  double clearance(double radius) const;

  FlightPlan plan_;
};

}  // namespace crowd_film
