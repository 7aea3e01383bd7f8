// What a batch must keep to, said in sentences that name the job or palette at fault.
#pragma once

#include <cstddef>
#include <string>

#include "dermis/plan.h"

namespace dermis {

/// Bytes of one skinned attribute: three floats.
inline constexpr std::uint32_t outputAttributeSize = 12;

Error invalid(std::string message);
std::string jobName(std::size_t index);

Result<void> checkLimits(const DeviceLimits& limits);
Result<void> checkTuning(const Tuning& tuning);
Result<void> checkPalette(const Batch& batch, const Palette& palette, std::size_t index);
Result<void> checkJob(const Batch& batch, const Job& job, std::size_t index);

}  // namespace dermis
