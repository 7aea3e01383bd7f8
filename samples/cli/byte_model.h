// A theoretical estimate of the bytes and operations that a kernel needs per vertex of an instance,
// for GPUs on which nothing has been measured yet.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dermis/plan.h"

namespace dermis::cli {

/// Bytes and float32 operations for one vertex of an instance.
struct ByteModel {
  std::string name;
  double written = 0;   ///< to memory
  double stored = 0;    ///< bytes of the 32-byte sectors that each store touches, over all stores
  double meshRead = 0;  ///< shared by the instances of an invocation
  double paletteRead = 0;
  double operations = 0;  ///< multiplications and additions; an `fma` counts once
};

/// Throughput of a GPU per second, in units of 10^12.
struct GpuSpeed {
  std::string name;
  double memory = 0;      ///< bytes
  double cache = 0;       ///< L2, bytes
  double firstLevel = 0;  ///< L1 of all cores, bytes
  double operations = 0;  ///< of float32
};

/// GPUs whose memory moves 0.5, 3.35 and 4.8 TB/s.
std::vector<GpuSpeed> gpuSpeeds();

/// How many vertices per second a GPU could skin, and what limits it.
struct ByteBound {
  double verticesPerSecond = 0;
  std::string by;  ///< "memory", "stores", "mesh", "palette" or "arithmetic"
};
ByteBound boundOf(const ByteModel& model, const GpuSpeed& gpu);

/// Models of dual quaternions and linear blending with four influences and 4 instances per
/// invocation, for common layouts and each way to store. Empty if SPIRV-Tools cannot read a kernel.
std::optional<std::vector<ByteModel>> byteModels();

/// Prints a table. Returns false if there is none.
bool printByteModels();

}  // namespace dermis::cli
