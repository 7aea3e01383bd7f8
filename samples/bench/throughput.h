// How many vertices a second a crowd is skinned at: by Dermis on a device and on the CPU, by plain
// kernels, and by one that only copies.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "crowd.h"
#include "open_device.h"

namespace dermis::samples {

/// What a row belongs to, in the order of the rows.
enum class ThroughputSection : std::uint8_t { baselines, methods, formats, instances, cpu };
inline constexpr std::size_t throughputSectionCount = 5;

struct ThroughputRow {
  std::string name;  ///< gpu/METHOD/FORMATS, gpu/plain/METHOD, gpu/copy, cpu/METHOD/THREADS
  ThroughputSection section = ThroughputSection::methods;
  std::uint32_t instances = 0;
  double bestSeconds = 0;  ///< of all rounds
  double millionVerticesPerSecond = 0;
};

/// Rows that take turns.
class Throughput {
 public:
  /// Prepares all rows, and skins each once. Without a device, those of the CPU only. `open` and
  /// `crowd` must outlive this object. `step` is called once a row. Fails if a device fails, and
  /// with `invalidData` if plain kernels and Dermis skin differently: a baseline that does not
  /// do the same work is none.
  static Result<std::unique_ptr<Throughput>> create(OpenDevice* open, const Crowd& crowd,
                                                    const std::function<void()>& step);
  virtual ~Throughput() = default;

  /// Measures each row once more.
  virtual Result<void> runRound() = 0;

  const std::vector<ThroughputRow>& rows() const { return rows_; }
  /// How many `create` will make.
  static std::size_t rowCount(const OpenDevice* open, const Crowd& crowd);

 protected:
  std::vector<ThroughputRow> rows_;
};

}  // namespace dermis::samples
