// Writes a sample model as binary glTF 2.0: one skinned mesh with one or more primitives, one skin,
// and clips.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "mesh.h"
#include "skeleton.h"

namespace dermis::models {

struct Model {
  std::string name;
  Skeleton skeleton;
  Mesh mesh;
  std::vector<Part> parts;  // each becomes a primitive with a material; empty: one primitive
  std::vector<Clip> clips;
  double roughness = 0.8;
};

// Returns the bytes of the .glb file. They depend only on the model, not on a date, a version or
// the order of a hash table.
std::vector<std::byte> writeGlb(const Model& model);

}  // namespace dermis::models
