#include "comparison_report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <string_view>

#include "kit/output_file.h"
#include "kit/plain_text.h"

namespace dermis::cli {
namespace {

using Json = nlohmann::ordered_json;

/// A number, or a dash if there is none.
template <typename Value>
std::string cell(const std::optional<Value>& value, fmt::format_string<const Value&> format) {
  return value ? fmt::format(format, *value) : "-";
}

std::string percent(const std::optional<double>& share) {
  return share ? fmt::format("{:.3f} %", *share * 100) : "-";
}

std::string_view clockName(Clock clock) {
  switch (clock) {
    case Clock::timestamps:
      return "the device's timestamps";
    case Clock::submission:
      return "from submission to the end of waiting: the device has no timestamps";
    case Clock::oneThread:
      return "one thread of the CPU";
    case Clock::none:
      break;
  }
  return "";
}

std::string_view sourceName(InstructionSource source) {
  return source == InstructionSource::driver ? "driver" : "SPIR-V";
}

void printTitle(const ComparisonTitle& title, const MethodComparison& comparison) {
  fmt::print("device   {}\n",
             samples::plainLine(title.driver.empty() ? title.device
                                                     : title.device + ", driver " + title.driver));
  fmt::print("model    {}, {}\n", samples::plainLine(title.model), samples::plainLine(title.pose));
  fmt::print("         {} vertices, {} joints{}\n", comparison.vertices, comparison.joints,
             comparison.scales ? ", some of which scale or shear" : "");
  if (comparison.clock == Clock::none) {
    fmt::print("timed    nothing: the reference is not optimized for speed\n");
    return;
  }
  fmt::print("timed    {} instances, {} vertices per run, positions and normals as float32\n",
             comparison.instances, comparison.instances * comparison.vertices);
  fmt::print("         medians of {} runs; methods take turns; {}\n", comparison.repetitions,
             clockName(comparison.clock));
  fmt::print("         linear takes {:.3f} ms\n",
             comparison.methods.front().seconds.value_or(0) * 1e3);
}

void printExplanation(const MethodComparison& comparison) {
  const bool byDriver = comparison.instructionSource == InstructionSource::driver;
  fmt::print(
      "\n"
      "time          relative to linear; smaller is faster\n"
      "instructions  of the skin kernel; loop bodies are counted once; {}\n"
      "joint bytes   that the skin kernel reads for each joint of a palette\n"
      "twist         a tube of two joints, twisted by {}°: smallest radius, and volume of the\n"
      "              blend zone, relative to bind pose\n"
      "bend          the tube, bent by {}°: smallest cross-section area and volume, relative to\n"
      "              bind pose\n"
      "reach         largest distance of a vertex of the bent tube from the bones, in tube\n"
      "              radii; 1 means no bulge\n"
      "difference    from dual_quaternion, on the model in this pose: largest and rms distance,\n"
      "              in % of the diagonal of the model's box\n\n",
      byDriver ? "machine instructions, counted by the driver"
               : "SPIR-V that computes or accesses memory",
      tubeTwistDegrees, tubeBendDegrees);
}

void printTable(const MethodComparison& comparison) {
  fmt::print("{:25} {:>6} {:>12} {:>6} {:>15} {:>22} {:>21}\n", "", "", "instructions", "joint",
             "twist", "bend", "difference");
  fmt::print("{:25} {:>6} {:>12} {:>6} {:>7} {:>7} {:>8} {:>7} {:>5} {:>11} {:>9}\n", "method",
             "time", fmt::format("({})", sourceName(comparison.instructionSource)), "bytes",
             "radius", "volume", "section", "volume", "reach", "largest", "rms");
  for (const ComparedMethod& compared : comparison.methods) {
    const TubeShape &twisted = compared.tube.twisted, &bent = compared.tube.bent;
    fmt::print(
        "{:25} {:>6} {:>12} {:>6} {:>7.3f} {:>7.3f} {:>8.3f} {:>7.3f} {:>5.2f} {:>11} {:>9}\n",
        methodName(compared.method), cell(compared.time, "{:.2f}"),
        cell(compared.instructions, "{}"), compared.bytesPerJoint, twisted.leastRadius,
        twisted.volume, bent.leastSection, bent.volume, bent.reach,
        percent(compared.largestDifference), percent(compared.rootMeanSquareDifference));
  }
}

template <typename Value>
Json optionalNumber(const std::optional<Value>& value) {
  return value ? Json(*value) : Json();
}

Json describe(const ComparedMethod& compared) {
  const TubeShape &twisted = compared.tube.twisted, &bent = compared.tube.bent;
  Json json;
  json["method"] = methodName(compared.method);
  json["time"] = optionalNumber(compared.time);
  json["seconds"] = optionalNumber(compared.seconds);
  json["instructions"] = optionalNumber(compared.instructions);
  json["bytesPerJoint"] = compared.bytesPerJoint;
  json["twist"] = {
      {"degrees", tubeTwistDegrees}, {"radius", twisted.leastRadius}, {"volume", twisted.volume}};
  json["bend"] = {{"degrees", tubeBendDegrees},
                  {"section", bent.leastSection},
                  {"volume", bent.volume},
                  {"reach", bent.reach}};
  json["difference"] = {{"largest", optionalNumber(compared.largestDifference)},
                        {"rootMeanSquare", optionalNumber(compared.rootMeanSquareDifference)}};
  return json;
}

}  // namespace

void printComparison(const ComparisonTitle& title, const MethodComparison& comparison) {
  printTitle(title, comparison);
  printExplanation(comparison);
  printTable(comparison);
}

Result<void> writeJsonComparison(const std::filesystem::path& path, const ComparisonTitle& title,
                                 const MethodComparison& comparison) {
  Json json;
  json["device"] = title.device;
  json["driver"] = title.driver;
  json["model"] = title.model;
  json["pose"] = title.pose;
  json["vertices"] = comparison.vertices;
  json["joints"] = comparison.joints;
  json["scales"] = comparison.scales;
  json["instances"] = comparison.instances;
  json["repetitions"] = comparison.repetitions;
  json["clock"] = comparison.clock == Clock::timestamps   ? Json("timestamps")
                  : comparison.clock == Clock::submission ? Json("submission")
                  : comparison.clock == Clock::oneThread  ? Json("oneThread")
                                                          : Json();
  json["instructionsOf"] = sourceName(comparison.instructionSource);
  json["methods"] = Json::array();
  for (const ComparedMethod& compared : comparison.methods)
    json["methods"].push_back(describe(compared));
  // Names come from a file: invalid UTF-8 in them is replaced.
  const std::string text = json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
  return samples::writeFile(path, text);
}

}  // namespace dermis::cli
