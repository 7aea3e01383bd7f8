// The film's camera: round the crowd, down into the aisle between those who stand and those who
// walk, and up again.
#pragma once

#include <array>

#include "render/camera.h"

namespace crowd {

/// Where it flies. Lengths are those of the figures' world.
struct FlightPlan {
  double unit = 1;         ///< what is a metre to someone of 1.75 m
  double aisleRadius = 5;  ///< the middle of the aisle
  double crowdRadius = 10;
  double aspect = 16.0 / 9;
  std::uint32_t height = 720;  ///< of the picture, pixels
};

struct Eye {
  std::array<double, 3> place, forward, right, up;
  double slope = 0;  ///< tangent of half the vertical field of view
};

class Flight {
 public:
  static constexpr double seconds = 24;  ///< then it begins again

  explicit Flight(const FlightPlan& plan) : plan_(plan) {}

  Eye at(double time) const;
  dermis::samples::render::Camera camera(const Eye& eye) const;

  /// Whether a ball is in the picture, or near it.
  bool sees(const Eye& eye, const std::array<double, 3>& centre, double radius) const;
  /// What a pixel shows of something so far away.
  double pixelSize(const Eye& eye, double distance) const;

  const FlightPlan& plan() const { return plan_; }

 private:
  double clearance(double radius) const;

  FlightPlan plan_;
};

}  // namespace crowd
