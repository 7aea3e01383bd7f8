// The bytes and operations that a kernel needs for a vertex of an instance, on paper: an estimate
// for GPUs, on which nothing has been measured yet.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dermis/plan.h"

namespace dermis::cli {

/// A vertex of an instance. Bytes, and operations on one float32.
struct ByteModel {
  std::string name;
  double written = 0;   ///< to memory
  double stored = 0;    ///< of the sectors of 32 bytes that all stores touch, each by itself
  double meshRead = 0;  ///< shared by the instances of an invocation
  double paletteRead = 0;
  double operations = 0;       ///< each multiplication and each addition by itself
  double fusedOperations = 0;  ///< an addition of a product counted with it
};

/// What a GPU can do in a second, in units of 10^12.
struct GpuSpeed {
  std::string name;
  double memory = 0;      ///< bytes
  double cache = 0;       ///< L2, bytes
  double firstLevel = 0;  ///< L1 of all cores, bytes
  double operations = 0;  ///< of float32
};

/// 0.5, 3.35 and 4.8 TB/s.
std::vector<GpuSpeed> gpuSpeeds();

/// How many vertices a second a GPU could skin, and what keeps it from more.
struct ByteBound {
  double verticesPerSecond = 0;
  std::string by;  ///< "memory", "stores", "mesh", "palette" or "arithmetic"
};
ByteBound boundOf(const ByteModel& model, const GpuSpeed& gpu);

/// Dual quaternions and linear blending, four influences, 4 instances an invocation, in layouts of
/// every day and by each way to store. Fails if SPIRV-Tools cannot read a kernel.
std::optional<std::vector<ByteModel>> byteModels();

/// As a table. Returns whether there is one.
bool printByteModels();

}  // namespace dermis::cli
