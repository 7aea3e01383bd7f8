// A thousand instances: Dermis against the plain kernel.
#pragma once

#include <vector>

#include "ratio_reporter.h"

namespace dermis::bench {

/// Registers crowd/1000_figure/… and crowd/1000_real_model/…, and returns their ratios. A real
/// model is not part of the repository: where there is none its benchmarks are left out, which is
/// said on standard output.
std::vector<Ratio> registerCrowdBenchmarks();

}  // namespace dermis::bench
