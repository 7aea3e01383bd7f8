// What a batch must keep to, said in sentences that name the job or palette at fault.
#pragma once

#include <array>
#include <cstddef>
#include <string>

#include "dermis/plan.h"
#include "plan/outputs.h"

namespace dermis {

Error invalid(std::string message);
std::string jobName(std::size_t index);

Result<void> checkLimits(const DeviceLimits& limits);
Result<void> checkTuning(const Tuning& tuning);
Result<void> checkPalette(const Batch& batch, const Palette& palette, std::size_t index);
Result<void> checkJob(const Batch& batch, const Job& job, std::size_t index,
                      const DeviceLimits& limits);
/// Whether a kernel can see all windows that a run is written to.
Result<void> checkWindows(const OutputStreams& streams,
                          const std::array<std::uint32_t, streamCount>& windows, std::size_t index,
                          const DeviceLimits& limits);

}  // namespace dermis
