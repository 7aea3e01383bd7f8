#include "throughput_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string_view>

#include "kit/output_file.h"
#include "kit/plain_text.h"
#include "picture_sheet.h"

namespace dermis::cli {
namespace {

using samples::ThroughputRow;
using samples::ThroughputSection;
using Json = nlohmann::ordered_json;

constexpr std::uint32_t pictureWidth = 1100;
constexpr float nameRoom = 430, valueRoom = 130, barHeight = 18;

constexpr std::array<std::string_view, samples::throughputSectionCount> sectionTitles{
    "Plain kernels, and one that only copies", "Methods", "Formats and extras", "Instances",
    "On the CPU, by threads"};

std::string_view titleOf(ThroughputSection section) {
  return sectionTitles[static_cast<std::size_t>(section)];
}

const ThroughputRow* find(std::span<const ThroughputRow> rows, std::string_view name) {
  const auto row = std::ranges::find(rows, name, &ThroughputRow::name);
  return row == rows.end() ? nullptr : &*row;
}

/// The baseline of a row: the plain linear kernel for linear blending, otherwise the plain dual
/// quaternion kernel.
const ThroughputRow* baselineOf(const ThroughputRow& row, std::span<const ThroughputRow> rows) {
  const bool isLinear = row.name.find("/linear") != std::string::npos;
  return find(rows, isLinear ? "gpu/plain/linear" : "gpu/plain/dual_quaternion");
}

std::string whatWasMeasured(const ThroughputTitle& title) {
  return fmt::format("{}: {} vertices, {} joints; {} instances; best of {} rounds", title.model,
                     title.vertices, title.joints, title.instances, title.rounds);
}

std::string whereItWasMeasured(const ThroughputTitle& title) {
  if (title.device.empty()) return "the CPU";
  return title.driver.empty() ? title.device : title.device + ", driver " + title.driver;
}

/// The color of the row's section.
SheetColor colorOf(ThroughputSection section) {
  constexpr std::array<SheetColor, samples::throughputSectionCount> colors{
      {{148, 156, 168}, {43, 108, 176}, {44, 139, 118}, {124, 92, 176}, {196, 116, 44}}};
  return colors[static_cast<std::size_t>(section)];
}

}  // namespace

void printThroughput(const ThroughputTitle& title, std::span<const ThroughputRow> rows) {
  fmt::print("device   {}\n", samples::plainLine(whereItWasMeasured(title)));
  fmt::print("model    {}\n", samples::plainLine(whatWasMeasured(title)));
  if (title.startUp) {
    fmt::print(
        "start    {:.0f} ms from Context::create to the first frame, {:.0f} ms if no joint "
        "scales\n",
        title.startUp->seconds * 1e3, title.startUp->secondsWithoutScale * 1e3);
  }
  const ThroughputRow* last = nullptr;
  for (const ThroughputRow& row : rows) {
    if (last == nullptr || last->section != row.section) {
      fmt::print("\n{:<52} {:>10} {:>16} {:>8}\n", titleOf(row.section), "instances",
                 "M vertices/s", "x plain");
    }
    const ThroughputRow* baseline = baselineOf(row, rows);
    const std::string ratio = baseline == nullptr
                                  ? "-"
                                  : fmt::format("{:.2f}", row.millionVerticesPerSecond /
                                                              baseline->millionVerticesPerSecond);
    fmt::print("{:<52} {:>10} {:>16.1f} {:>8}\n", row.name, row.instances,
               row.millionVerticesPerSecond, ratio);
    last = &row;
  }
}

Result<void> writeJsonThroughput(const std::filesystem::path& path, const ThroughputTitle& title,
                                 std::span<const ThroughputRow> rows) {
  Json json;
  json["device"] = title.device;
  json["driver"] = title.driver;
  json["model"] = title.model;
  json["vertices"] = title.vertices;
  json["joints"] = title.joints;
  json["instances"] = title.instances;
  json["rounds"] = title.rounds;
  if (title.startUp) {
    json["start_up"] = {{"seconds", title.startUp->seconds},
                        {"seconds_without_scale", title.startUp->secondsWithoutScale}};
  }
  json["rows"] = Json::array();
  for (const ThroughputRow& row : rows) {
    json["rows"].push_back({{"name", row.name},
                            {"instances", row.instances},
                            {"best_seconds", row.bestSeconds},
                            {"million_vertices_per_second", row.millionVerticesPerSecond}});
  }
  return samples::writeFile(path, json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
}

samples::render::Picture drawThroughput(const ThroughputTitle& title,
                                        std::span<const ThroughputRow> rows,
                                        const samples::render::Font* font) {
  Sheet sheet(pictureWidth, 1, font);
  const Sheet::Style heading{26, sheetInk}, usual{19, sheetInk}, pale{17, sheetPaleInk};
  sheet.advance(18);
  sheet.left("Million vertices a second", heading);
  sheet.advance(34);
  for (const std::string& line : {whereItWasMeasured(title), whatWasMeasured(title)}) {
    sheet.left(line, pale);
    sheet.advance(24);
  }
  double most = 0;
  for (const ThroughputRow& row : rows) most = std::max(most, row.millionVerticesPerSecond);
  const float room = sheet.innerWidth() - nameRoom - valueRoom;
  const ThroughputRow* last = nullptr;
  for (const ThroughputRow& row : rows) {
    if (last == nullptr || last->section != row.section) {
      sheet.advance(14);
      sheet.rule();
      sheet.advance(12);
      sheet.left(titleOf(row.section), usual);
      sheet.advance(30);
    }
    sheet.left(row.name, pale, 0, nameRoom - 10);
    const float length =
        std::max(static_cast<float>(row.millionVerticesPerSecond / most) * room, 1.0f);
    const SheetColor color = colorOf(row.section);
    sheet.gradient({color, color}, nameRoom, length, barHeight);
    sheet.left(fmt::format("{:.1f}", row.millionVerticesPerSecond), pale, nameRoom + length + 10);
    sheet.advance(25);
    last = &row;
  }
  sheet.advance(16);
  return sheet.take();
}

}  // namespace dermis::cli
