#include "crowd_report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "kit/output_file.h"

using namespace dermis;

namespace crowd {
namespace {

using Json = nlohmann::ordered_json;

constexpr double mebibyte = 1 << 20;

/// The mean of the known values.
class Mean {
 public:
  void add(std::optional<double> value) {
    if (!value) return;
    sum_ += *value;
    ++count_;
  }
  std::optional<double> value() const {
    return count_ == 0 ? std::nullopt : std::optional(sum_ / count_);
  }

 private:
  double sum_ = 0;
  std::uint32_t count_ = 0;
};

/// A number, or a dash if there is none.
std::string cell(const std::optional<double>& value, int digits) {
  return value ? fmt::format("{:.{}f}", *value, digits) : "-";
}

Json number(const std::optional<double>& value) {
  return value ? Json(*value) : Json();
}

std::string share(std::uint64_t part, std::uint64_t whole) {
  const double percent =
      whole == 0 ? 0 : 100 * static_cast<double>(part) / static_cast<double>(whole);
  return fmt::format("{:.1f} %", percent);
}

std::string mebibytes(const StoreStatistics& store) {
  return fmt::format("{:.1f} of {:.1f}", static_cast<double>(store.used) / mebibyte,
                     static_cast<double>(store.capacity) / mebibyte);
}

Json jsonOf(const StoreStatistics& store) {
  return {{"capacity", store.capacity}, {"used", store.used}, {"largestFree", store.largestFree}};
}

Json jsonOf(const ReportTitle& title) {
  return {{"device", title.device},
          {"driver", title.driver},
          {"model", title.model},
          {"meshes", title.meshes},
          {"verticesOfFigure", title.verticesOfFigure},
          {"framesInFlight", title.framesInFlight},
          {"culledOnGpu", title.culledOnGpu}};
}

Json jsonOf(const CheckTotals& check) {
  return {{"frames", check.frames},
          {"instances", check.instances},
          {"vertices", check.vertices},
          {"failures", check.failures},
          {"firstFailure", check.firstFailure},
          {"worst", check.worst}};
}

}  // namespace

void CrowdReport::printTitle() const {
  fmt::print("device  {}{}\n", title_.device, title_.isOnCpu ? "" : ", driver " + title_.driver);
  fmt::print("model   {}: {} vertices in {} skinned meshes\n", title_.model,
             title_.verticesOfFigure, title_.meshes);
  if (title_.isOnCpu) {
    fmt::print("frames  each row is the mean of up to {} frames\n\n", rowFrames);
  } else {
    fmt::print("frames  {} in flight; each row is the mean of up to {} frames\n\n",
               title_.framesInFlight, rowFrames);
  }
  fmt::print(
      "                                                                    upload   plan+record  "
      "{:>7}\n"
      " frame  figures  instances   skinned   settled    vertices  dispatches     KiB   ns/instance"
      "     ms\n",
      title_.isOnCpu ? "jobs" : "GPU");
}

/// With culling on the GPU, the CPU learns the number only when the frame is complete.
std::optional<std::uint32_t> CrowdReport::skinnedBy(const Frame& frame) const {
  if (!title_.culledOnGpu) return frame.cpu.skinnedInstances;
  return frame.gpu ? std::optional(frame.gpu->skinnedInstances) : std::nullopt;
}

std::optional<std::uint32_t> CrowdReport::settledBy(const Frame& frame) const {
  if (!title_.culledOnGpu) return frame.cpu.settledInstances;
  return frame.gpu ? std::optional(frame.gpu->settledInstances) : std::nullopt;
}

void CrowdReport::add(const Crowd& crowd, const ShownCounts& counts) {
  const vulkan::SystemStatistics statistics = crowd.statistics();
  Frame frame;
  frame.cpu = statistics.lastFrame;
  frame.figures =
      static_cast<std::uint32_t>(std::ranges::count_if(crowd.figures(), &CrowdFigure::isThere));
  const auto since = [](std::uint64_t now, std::uint64_t before) {
    return static_cast<std::uint32_t>(now - before);
  };
  frame.instances = since(counts.instances, before_.instances);
  frame.outOfView = since(counts.outOfView, before_.outOfView);
  frame.displayed = since(counts.displayed, before_.displayed);
  before_ = counts;
  frames_.push_back(frame);
  addCompleted(crowd);
  if (frames_.size() - rowBegin_ == rowFrames) addRow();
}

void CrowdReport::addCompleted(const Crowd& crowd) {
  const vulkan::GpuStatistics statistics = crowd.statistics().lastCompletedFrame;
  // Frames count from 1.
  if (statistics.frame != 0) frames_[statistics.frame - 1].gpu = statistics;
}

CrowdReport::Row CrowdReport::rowOf(std::size_t first, std::size_t end) const {
  Mean figures, instances, dispatches, uploaded, skinned, settled, vertices, nanoseconds, seconds;
  for (std::size_t index = first; index < end; ++index) {
    const Frame& frame = frames_[index];
    figures.add(frame.figures);
    instances.add(frame.instances);
    dispatches.add(frame.cpu.dispatches);
    uploaded.add(static_cast<double>(frame.cpu.uploadedBytes));
    skinned.add(skinnedBy(frame));
    settled.add(settledBy(frame));
    if (!title_.culledOnGpu) vertices.add(static_cast<double>(frame.cpu.skinnedVertices));
    if (frame.instances != 0) {
      nanoseconds.add((frame.cpu.planSeconds + frame.cpu.recordSeconds) * 1e9 / frame.instances);
    }
    if (frame.gpu) seconds.add(frame.gpu->seconds);
  }
  return {end,
          figures.value().value_or(0),
          instances.value().value_or(0),
          dispatches.value().value_or(0),
          uploaded.value().value_or(0),
          skinned.value(),
          settled.value(),
          vertices.value(),
          nanoseconds.value(),
          seconds.value()};
}

void CrowdReport::addRow() {
  rows_.push_back(rowOf(rowBegin_, frames_.size()));
  rowBegin_ = frames_.size();
  if (!printsLater_) printRow(rows_.back());
}

void CrowdReport::printRow(const Row& row) const {
  const std::optional<double> milliseconds =
      row.gpuSeconds ? std::optional(*row.gpuSeconds * 1e3) : std::nullopt;
  fmt::print("{:6} {:8.0f} {:10.0f} {:>9} {:>9} {:>11} {:11.1f} {:7.0f} {:>13} {:>6}\n",
             row.lastFrame, row.figures, row.instances, cell(row.skinned, 0), cell(row.settled, 0),
             cell(row.vertices, 0), row.dispatches, row.uploadedBytes / 1024,
             cell(row.nanoseconds, 0), cell(milliseconds, 1));
  std::fflush(stdout);
}

void CrowdReport::finish(const Crowd& crowd) {
  if (rowBegin_ != frames_.size()) addRow();
  if (printsLater_) {
    printTitle();
    for (const Row& row : rows_) printRow(row);
  }
  memory_ = crowd.statistics();
  totals_.refusals = crowd.refusals();
  sumUp();
  printTotals();
}

/// Sums over all frames. Instances are counted only in frames whose skinned count is known.
void CrowdReport::sumUp() {
  std::uint64_t timedVertices = 0;
  double gpuSeconds = 0;
  for (const Frame& frame : frames_) {
    totals_.cpuSeconds += frame.cpu.planSeconds + frame.cpu.recordSeconds;
    totals_.vertices += frame.cpu.skinnedVertices;
    if (frame.gpu && frame.gpu->seconds) {
      timedVertices += frame.cpu.skinnedVertices;
      gpuSeconds += *frame.gpu->seconds;
    }
    const std::optional<std::uint32_t> skinned = skinnedBy(frame);
    if (!skinned) continue;
    totals_.instances += frame.instances;
    totals_.outOfView += frame.outOfView;
    totals_.displayed += frame.displayed;
    totals_.skinned += *skinned;
  }
  if (gpuSeconds > 0 && timedVertices > 0)
    totals_.verticesPerSecond = static_cast<double>(timedVertices) / gpuSeconds;
}

void CrowdReport::printTotals() const {
  const Totals& sums = totals_;
  if (!title_.culledOnGpu) {
    fmt::print("\nskinned   {} vertices in {} frames", sums.vertices, frames_.size());
    if (sums.verticesPerSecond)
      fmt::print(", {:.1f} million per second of {}", *sums.verticesPerSecond * 1e-6,
                 title_.isOnCpu ? "job time" : "GPU time");
    fmt::print("\n");
  } else {
    fmt::print("\n");
  }
  fmt::print("instances {} skinned, {} out of view, {} not due yet\n",
             share(sums.skinned, sums.instances), share(sums.outOfView, sums.instances),
             share(sums.displayed - std::min(sums.displayed, sums.skinned), sums.instances));
  if (sums.refusals != 0) {
    fmt::print("refused   {} time{}: a figure could not be added because a buffer was full\n",
               sums.refusals, sums.refusals == 1 ? "" : "s");
  }
  if (title_.isOnCpu) {
    fmt::print("memory    MiB: outputs {}\n", mebibytes(memory_.outputs));
    return;
  }
  fmt::print(
      "memory    MiB: meshes {}, palettes {}, outputs {}; {:.1f} of device memory in total\n",
      mebibytes(memory_.meshes), mebibytes(memory_.palettes), mebibytes(memory_.outputs),
      static_cast<double>(memory_.deviceMemory) / mebibyte);
}

void CrowdReport::printCheck(const CheckTotals& check) const {
  if (check.failures != 0) return;
  fmt::print(
      "checked   in {} frames: all {} vertices of {} instances are inside their bounds; the "
      "largest error is {:.0f} % of its bound\n",
      check.frames, check.vertices, check.instances, 100 * check.worst);
}

std::string CrowdReport::json(const CheckTotals* check) const {
  Json rows = Json::array();
  for (const Row& row : rows_) {
    rows.push_back({{"frame", row.lastFrame},
                    {"figures", row.figures},
                    {"instances", row.instances},
                    {"skinned", number(row.skinned)},
                    {"settled", number(row.settled)},
                    {"vertices", number(row.vertices)},
                    {"dispatches", row.dispatches},
                    {"uploadedBytes", row.uploadedBytes},
                    {"cpuNanosecondsPerInstance", number(row.nanoseconds)},
                    {"gpuSeconds", number(row.gpuSeconds)}});
  }
  const Totals& sums = totals_;
  const Json totals{{"instances", sums.instances},
                    {"skinned", sums.skinned},
                    {"outOfView", sums.outOfView},
                    {"withinInterval", sums.displayed - std::min(sums.displayed, sums.skinned)},
                    {"refusals", sums.refusals},
                    {"vertices", title_.culledOnGpu ? Json() : Json(sums.vertices)},
                    {"verticesPerSecond", number(sums.verticesPerSecond)},
                    {"cpuSeconds", sums.cpuSeconds}};
  const Json memory{{"meshes", jsonOf(memory_.meshes)},
                    {"palettes", jsonOf(memory_.palettes)},
                    {"outputs", jsonOf(memory_.outputs)},
                    {"device", memory_.deviceMemory}};
  Json all = jsonOf(title_);
  all["frames"] = frames_.size();
  all["rows"] = rows;
  all["totals"] = totals;
  all["memory"] = memory;
  all["check"] = check != nullptr ? jsonOf(*check) : Json();
  return all.dump(2, ' ', false, Json::error_handler_t::replace);
}

Result<void> CrowdReport::writeJson(const std::filesystem::path& path,
                                    const CheckTotals* check) const {
  return samples::writeFile(path, json(check) + "\n");
}

}  // namespace crowd
