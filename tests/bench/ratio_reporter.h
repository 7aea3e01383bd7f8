// Benchmarks reported as ratios: each against a baseline that ran in the same process, by medians.
#pragma once

#include <benchmark/benchmark.h>

#include <map>
#include <string>
#include <vector>

namespace dermis::bench {

/// One claim: how long `name` takes, relative to `baseline`.
struct Ratio {
  std::string name;
  std::string baseline;
  std::string meaning;  ///< "300 targets, 3 active / 3 targets, 3 active"
};

/// Prints as the console does, and the ratios of medians at the end.
class RatioReporter : public benchmark::ConsoleReporter {
 public:
  explicit RatioReporter(std::vector<Ratio> ratios)
      : ConsoleReporter(OO_Tabular), ratios_(std::move(ratios)) {}
  void ReportRuns(const std::vector<Run>& runs) override;
  void Finalize() override;

 private:
  std::vector<Ratio> ratios_;
  std::map<std::string, std::vector<double>> times_;
};

}  // namespace dermis::bench
