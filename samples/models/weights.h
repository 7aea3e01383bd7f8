// Influences of vertices: spread along the surface, then cut to four and quantised.
#pragma once

#include <functional>
#include <vector>

#include "mesh.h"

namespace dermis::models {

// The weight of every joint on one vertex.
using WeightRow = std::vector<double>;

// Keeps the four largest weights, rounds them to 1/65536 and makes them sum to exactly 1.
Influences quantise(const WeightRow& weights);

// How weights spread from where they start.
struct Diffusion {
  std::size_t jointCount;
  // The joint that has all of a vertex's weight at the start.
  std::vector<std::size_t> nearestJoint;
  // How much of a vertex's weight a step may replace, 0 to 1.
  std::vector<double> spread;
  int steps;
  // The part of its weight that a joint keeps on a vertex in the end, 0 to 1.
  std::function<double(const Vec3& position, std::size_t joint)> allowance;
};

// Spreads weights along the edges of the mesh. What spreads over the surface cannot jump from one
// leg to the other or from an arm to the waist, however close they are in space.
std::vector<Influences> diffuseWeights(const Mesh& mesh, const Diffusion& diffusion);

}  // namespace dermis::models
