// One call of `skin`, as the SIMD code gets it: checked, and with memory to work in.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "cpu/mesh_data.h"
#include "dermis/cpu/skin.h"

namespace dermis::cpu {

/// As wide as the widest vectors.
struct alignas(64) CacheLine {
  float v[16];
};

/// Memory of one thread, as large as the largest section that it has skinned needs.
struct Scratch {
  std::vector<CacheLine> dualQuaternions;  ///< of joints: real and dual part
  std::vector<CacheLine> scaleShears;      ///< of joints: diagonal and mixed entries, and two zeros
  std::vector<CacheLine> rows;             ///< of joints: 3×4, and four zeros
  std::vector<CacheLine> pairs;            ///< dual quaternions, of up to four instances
  std::vector<CacheLine> scalePairs;       ///< the joint's scale/shear part less the pivot's
};

struct Task {
  const Job* job;
  const MeshData* mesh;
  Scratch* scratch;  ///< three: of an instance, of its previous pose, and of several at a time
};

/// By the best instructions that the processor has, or those that `setTarget` chose.
void skinTask(const Task& task);

}  // namespace dermis::cpu
