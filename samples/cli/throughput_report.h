// Reports the results of `bench`, as text, as JSON and as a picture.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>

#include "kit/bench/start_up.h"
#include "kit/bench/throughput.h"
#include "kit/render/picture.h"

namespace dermis::cli {

struct ThroughputTitle {
  std::string device, driver;  ///< empty: only the CPU was measured
  std::string model;
  std::uint32_t vertices = 0, joints = 0, instances = 0, rounds = 0;
  std::optional<samples::StartUp> startUp;  ///< of the device
};

/// Prints a line for each row.
void printThroughput(const ThroughputTitle& title, std::span<const samples::ThroughputRow> rows);

/// Fails with `ioError`.
Result<void> writeJsonThroughput(const std::filesystem::path& path, const ThroughputTitle& title,
                                 std::span<const samples::ThroughputRow> rows);

/// Draws a bar for each row, in sections. If `font` is null, there is no text.
samples::render::Picture drawThroughput(const ThroughputTitle& title,
                                        std::span<const samples::ThroughputRow> rows,
                                        const samples::render::Font* font);

}  // namespace dermis::cli
