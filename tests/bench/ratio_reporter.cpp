#include "ratio_reporter.h"

#include <algorithm>
#include <cstdio>

namespace dermis::bench {
namespace {

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

}  // namespace

void RatioReporter::ReportRuns(const std::vector<Run>& runs) {
  std::vector<Run> shown;
  for (const Run& run : runs) {
    if (run.run_type == Run::RT_Iteration)
      times_[run.run_name.function_name].push_back(run.GetAdjustedRealTime());
    // Where there are repetitions, their median says enough.
    if (run.repetitions <= 1 || run.aggregate_name == "median") shown.push_back(run);
  }
  ConsoleReporter::ReportRuns(shown);
}

void RatioReporter::Finalize() {
  ConsoleReporter::Finalize();
  bool first = true;
  for (const Ratio& ratio : ratios_) {
    const auto time = times_.find(ratio.name), baseline = times_.find(ratio.baseline);
    if (time == times_.end() || baseline == times_.end()) continue;
    if (first) std::printf("\nRatios of medians\n");
    first = false;
    std::printf("  %5.2f  %s\n", median(time->second) / median(baseline->second),
                ratio.meaning.c_str());
  }
}

}  // namespace dermis::bench
