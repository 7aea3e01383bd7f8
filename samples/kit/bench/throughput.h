// How many vertices per second are skinned in a crowd: by Dermis on a device and on the CPU, by
// plain kernels, and by a kernel that only copies.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "kit/bench/crowd.h"
#include "kit/device.h"

namespace dermis::samples {

/// The group of a row, in the order of the rows.
enum class ThroughputSection : std::uint8_t { baselines, methods, formats, instances, cpu };
inline constexpr std::size_t throughputSectionCount = 5;

struct ThroughputRow {
  std::string name;  ///< gpu/METHOD/FORMATS, gpu/plain/METHOD, gpu/copy, cpu/METHOD/THREADS,
                     ///< cpu/METHOD/THREADS/CASE
  ThroughputSection section = ThroughputSection::methods;
  std::uint32_t instances = 0;
  double bestSeconds = 0;  ///< best of all rounds
  double millionVerticesPerSecond = 0;
};

/// The rows. A round measures each of them once.
class Throughput {
 public:
  /// Prepares all rows, and skins each once. Without a device, only the rows of the CPU. `open` and
  /// `crowd` must outlive this object. `step` is called once per row. Fails if a device fails, and
  /// with `invalidData` if the plain kernels and Dermis skin differently, because a baseline must
  /// do the same work, or if a crowd that plays clips is not where it should be. Without clips the
  /// crowd has no rows of clips.
  static Result<std::unique_ptr<Throughput>> create(OpenDevice* open, const Crowd& crowd,
                                                    const std::function<void()>& step);
  virtual ~Throughput() = default;

  /// Measures each row once more.
  virtual Result<void> runRound() = 0;

  const std::vector<ThroughputRow>& rows() const { return rows_; }
  /// The number of `step` calls of `create`. It makes fewer rows if the device lacks a feature.
  static std::size_t rowCount(const OpenDevice* open, const Crowd& crowd);

 protected:
  std::vector<ThroughputRow> rows_;
};

}  // namespace dermis::samples
