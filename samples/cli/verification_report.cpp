#include "verification_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <nlohmann/json.hpp>
#include <set>

#include "kit/output_file.h"
#include "kit/plain_text.h"

namespace dermis::cli {
namespace {

using Json = nlohmann::ordered_json;

/// Converts text for XML 1.0: escapes markup, and replaces control characters and everything that
/// is not ASCII, since names come from files.
std::string xmlText(std::string_view text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      default:
        escaped += c >= 0x20 && c < 0x7f ? c : '?';
    }
  }
  return escaped;
}

struct Summary {
  std::set<std::string> poses, variants;
  std::uint64_t vertices = 0, onlyUnitNormals = 0, onlyUnitTangents = 0;
  Exemptions exempt;
  double worstPosition = 0, worstNormal = 0, worstTangent = 0;
  std::size_t failures = 0;
};

/// Lists vertices that were not compared with a bound, if there are any.
std::string exceptions(const Summary& summary) {
  std::string text;
  if (summary.exempt.onlyFinite != 0)
    text += fmt::format(", {} only required to be finite", summary.exempt.onlyFinite);
  if (summary.exempt.skipped != 0)
    text += fmt::format(", {} skipped: a joint is not finite", summary.exempt.skipped);
  if (summary.onlyUnitNormals != 0)
    text += fmt::format(", {} normals only required to have unit length", summary.onlyUnitNormals);
  if (summary.onlyUnitTangents != 0)
    text +=
        fmt::format(", {} tangents only required to have unit length", summary.onlyUnitTangents);
  return text;
}

Json describe(const VerifiedCase& verified) {
  const Comparison& comparison = verified.comparison;
  Json json;
  json["mesh"] = verified.part;
  json["method"] = verified.method;
  json["pose"] = verified.pose;
  json["variant"] = verified.variant;
  json["passed"] = verified.passed();
  if (!verified.passed()) json["failure"] = verified.failure();
  json["vertices"] = comparison.compared;
  json["onlyFinite"] = comparison.exempt.onlyFinite;
  json["skipped"] = comparison.exempt.skipped;
  json["onlyUnitNormals"] = comparison.onlyUnitNormals;
  json["onlyUnitTangents"] = comparison.onlyUnitTangents;
  json["failures"] = comparison.failures;
  json["worstPositionOfBound"] = comparison.worstPosition;
  json["worstNormalOfBound"] = comparison.worstNormal;
  json["largestPositionError"] = comparison.largestPositionError;
  json["worstTangentOfBound"] = comparison.worstTangent;
  if (verified.status) json["nonRigidJoints"] = verified.status->nonRigidJoints;
  return json;
}

}  // namespace

std::size_t ModelVerification::failures() const {
  return static_cast<std::size_t>(std::count_if(
      cases.begin(), cases.end(), [](const VerifiedCase& verified) { return !verified.passed(); }));
}

void printReport(const std::vector<ModelVerification>& models) {
  for (const ModelVerification& model : models) {
    if (!model.error.empty()) continue;  // already reported on standard error
    std::map<std::string, Summary> byMethod;
    for (const VerifiedCase& verified : model.cases) {
      Summary& summary = byMethod[verified.method];
      summary.poses.insert(verified.pose);
      summary.variants.insert(verified.variant);
      summary.vertices += verified.comparison.compared;
      summary.exempt.onlyFinite += verified.comparison.exempt.onlyFinite;
      summary.exempt.skipped += verified.comparison.exempt.skipped;
      summary.onlyUnitNormals += verified.comparison.onlyUnitNormals;
      summary.onlyUnitTangents += verified.comparison.onlyUnitTangents;
      summary.worstPosition = std::max(summary.worstPosition, verified.comparison.worstPosition);
      summary.worstNormal = std::max(summary.worstNormal, verified.comparison.worstNormal);
      summary.worstTangent = std::max(summary.worstTangent, verified.comparison.worstTangent);
      if (!verified.passed()) ++summary.failures;
    }
    for (const auto& [method, summary] : byMethod) {
      fmt::print(
          "{}  {}  {}: {} poses, {} variants, {} vertices compared{}; worst position {:.2f} of its "
          "bound, normal {:.2f}{}\n",
          summary.failures == 0 ? "passed" : "FAILED", samples::plainLine(model.model), method,
          summary.poses.size(), summary.variants.size(), summary.vertices, exceptions(summary),
          summary.worstPosition, summary.worstNormal,
          summary.worstTangent > 0 ? fmt::format(", tangent {:.2f}", summary.worstTangent) : "");
    }
    for (const VerifiedCase& verified : model.cases) {
      if (!verified.passed()) {
        fmt::print("  {}\n", samples::plainLine(fmt::format("{}, {}, {}, {}: {}", verified.part,
                                                            verified.method, verified.pose,
                                                            verified.variant, verified.failure())));
      }
    }
  }
}

Result<void> writeJsonReport(const std::filesystem::path& path, const std::string& device,
                             const std::vector<ModelVerification>& models) {
  Json json;
  json["device"] = device;
  json["passed"] = std::all_of(models.begin(), models.end(), [](const ModelVerification& model) {
    return model.error.empty() && model.failures() == 0;
  });
  json["models"] = Json::array();
  for (const ModelVerification& model : models) {
    Json entry;
    entry["model"] = model.model;
    if (!model.error.empty()) entry["error"] = model.error;
    entry["failures"] = model.failures();
    entry["cases"] = Json::array();
    for (const VerifiedCase& verified : model.cases) entry["cases"].push_back(describe(verified));
    json["models"].push_back(std::move(entry));
  }
  return samples::writeFile(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

Result<void> writeJunitReport(const std::filesystem::path& path,
                              const std::vector<ModelVerification>& models) {
  std::string suites;
  std::size_t tests = 0, failures = 0, errors = 0;
  for (const ModelVerification& model : models) {
    const std::size_t modelErrors = model.error.empty() ? 0 : 1;
    suites += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" errors=\"{}\">\n",
                          xmlText(model.model), model.cases.size() + modelErrors, model.failures(),
                          modelErrors);
    if (modelErrors != 0) {
      suites += fmt::format(
          "    <testcase classname=\"dermis.verify\" name=\"load\"><error "
          "message=\"{}\"/></testcase>\n",
          xmlText(model.error));
    }
    for (const VerifiedCase& verified : model.cases) {
      suites += fmt::format("    <testcase classname=\"dermis.verify.{}\" name=\"{}, {}, {}\"",
                            xmlText(verified.method), xmlText(verified.part),
                            xmlText(verified.pose), xmlText(verified.variant));
      suites += verified.passed() ? std::string("/>\n")
                                  : fmt::format("><failure message=\"{}\"/></testcase>\n",
                                                xmlText(verified.failure()));
    }
    suites += "  </testsuite>\n";
    tests += model.cases.size() + modelErrors;
    failures += model.failures();
    errors += modelErrors;
  }
  return samples::writeFile(
      path,
      fmt::format("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites name=\"dermis verify\" "
                  "tests=\"{}\" failures=\"{}\" errors=\"{}\">\n{}</testsuites>\n",
                  tests, failures, errors, suites));
}

}  // namespace dermis::cli
