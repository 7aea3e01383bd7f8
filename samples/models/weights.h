// Influences of vertices: weights spread along the surface, then the four largest are quantized.
#pragma once

#include <functional>
#include <vector>

#include "mesh.h"

namespace dermis::models {

// The weights of all joints for one vertex.
using WeightRow = std::vector<double>;

// Keeps the four largest weights, and rounds them to multiples of 1/65536 that sum to exactly 1.
Influences quantize(const WeightRow& weights);

// Parameters of `diffuseWeights`.
struct Diffusion {
  std::size_t jointCount;
  // For each vertex, the joint with the initial weight 1.
  std::vector<std::size_t> nearestJoint;
  // For each vertex, how fast weights spread, 0 to 1. A step replaces half of this fraction of its
  // weights.
  std::vector<double> spread;
  int steps;
  // The factor of a joint's final weight at a position, 0 to 1.
  std::function<double(const Vec3& position, std::size_t joint)> allowance;
};

// Spreads weights along the edges of the mesh. Along the surface, weights cannot jump from one leg
// to the other or from an arm to the waist, even if these are close in space.
std::vector<Influences> diffuseWeights(const Mesh& mesh, const Diffusion& diffusion);

}  // namespace dermis::models
