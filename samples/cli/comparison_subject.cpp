#include "comparison_subject.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <iterator>

#include "kit/plain_text.h"

namespace dermis::cli {
namespace {

/// The methods that are compared by default. With all nine, the pictures would be too small.
constexpr std::array usualMethods{Method::linear,         Method::quaternionTranslation,
                                  Method::logMatrix,      Method::sphericalBlend,
                                  Method::dualQuaternion, Method::centerOfRotation};

std::string counted(std::uint32_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

/// Formats with three digits and no exponent.
std::string nanoseconds(double value) {
  return fmt::format("{:.{}f} ns per vertex", value, value < 10 ? 2 : value < 100 ? 1 : 0);
}

std::vector<std::string> costOf(const MethodComparison& comparison, Method method) {
  const auto compared = std::ranges::find(comparison.methods, method, &ComparedMethod::method);
  if (compared == comparison.methods.end() || !compared->time) return {};
  const double vertices =
      static_cast<double>(comparison.vertices) * static_cast<double>(comparison.instances);
  return {fmt::format("{:.2f} × linear's time", *compared->time),
          nanoseconds(*compared->seconds / vertices * 1e9)};
}

}  // namespace

std::vector<Method> usualColumns(const Scene& scene) {
  std::vector<Method> columns;
  std::ranges::copy_if(usualMethods, std::back_inserter(columns),
                       [&scene](Method method) { return allows(scene, method); });
  return columns;
}

ComparisonSheet describeSheet(const ComparisonSubject& subject, const std::vector<Method>& columns,
                              const ComparisonTitle& title, const MethodComparison& comparison) {
  ComparisonSheet sheet;
  for (const Method method : columns) sheet.columns.push_back({method, costOf(comparison, method)});
  sheet.strips = builtInStrips(*subject.builtIn);
  if (subject.model) {
    ComparisonStrip& strip = sheet.strips.emplace_back();
    strip.scene = &*subject.model;
    strip.pose = subject.pose;
    strip.title = samples::plainLine(std::filesystem::path(subject.name).filename().string());
    strip.remark = samples::plainLine(subject.poseName) + "; skinning time";
  } else {
    sheet.strips.back().remark += "; skinning time";
  }
  sheet.strips.back().showsCost = true;
  sheet.strips.back().hasHeatMap = true;
  sheet.footer = samples::plainLine(fmt::format(
      "Time: median of {}, {} of {} vertices, {}", counted(comparison.repetitions, "run"),
      counted(comparison.instances, "instance"), comparison.vertices, title.device));
  return sheet;
}

}  // namespace dermis::cli
