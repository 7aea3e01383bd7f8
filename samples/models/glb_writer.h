// Binary glTF 2.0 of a sample model: one skinned mesh of one primitive or several, one skin, its
// clips.
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
  std::vector<Part> parts;  // a primitive and a material each; empty: the mesh is all one
  std::vector<Clip> clips;
  double roughness = 0.8;
};

// The bytes of the .glb file. They depend on the model alone: no date, no version, no order of a
// hash table.
std::vector<std::byte> writeGlb(const Model& model);

}  // namespace dermis::models
