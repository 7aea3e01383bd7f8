// Reports the cost of the crowd as a table and as JSON.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "crowd.h"
#include "crowd_check.h"
#include "dermis/result.h"
#include "shown_poses.h"

namespace crowd {

struct ReportTitle {
  std::string device, driver, model;
  std::size_t meshes = 0;
  std::uint64_t verticesOfFigure = 0;
  std::uint32_t framesInFlight = 0;
  bool culledOnGpu = false;
  bool isOnCpu = false;  ///< without Vulkan
};

class CrowdReport {
 public:
  static constexpr std::uint64_t rowFrames = 20;

  struct Frame {
    std::uint32_t figures = 0;
    std::uint32_t instances = 0, outOfView = 0, displayed = 0;
    dermis::vulkan::FrameStatistics cpu;
    std::optional<dermis::vulkan::GpuStatistics> gpu;  ///< once it is complete
  };

  explicit CrowdReport(ReportTitle title) : title_(std::move(title)) {}

  const ReportTitle& title() const { return title_; }
  void printTitle() const;
  /// From now on, prints nothing until `finish`: standard error shows the progress of the film.
  void printLater() { printsLater_ = true; }
  /// Call it after each record. Prints a row when there are enough frames for one. `counts` is what
  /// `ShownPoses` has counted so far.
  void add(const Crowd& crowd, const ShownCounts& counts);
  /// Adds the statistics of complete frames. Call it after `Crowd::skinFrame` or `Crowd::complete`.
  void addCompleted(const Crowd& crowd);
  /// Frames count from 1.
  const Frame& frame(std::uint64_t number) const { return frames_[number - 1]; }
  /// Number of skinned instances of a frame. With culling on the GPU, empty if it is not known yet.
  std::optional<std::uint32_t> skinnedBy(const Frame& frame) const;
  /// Prints the rest of the table and the totals.
  void finish(const Crowd& crowd);
  void printCheck(const CheckTotals& check) const;
  /// `check` is null if nothing was compared. Fails with `ioError`.
  dermis::Result<void> writeJson(const std::filesystem::path& path, const CheckTotals* check) const;

 private:
  /// Means over the frames for which a value is known; empty if there are none.
  struct Row {
    std::uint64_t lastFrame = 0;
    double figures = 0, instances = 0, dispatches = 0, uploadedBytes = 0;
    std::optional<double> skinned, settled, vertices, nanoseconds, gpuSeconds;
  };
  struct Totals {
    std::uint64_t instances = 0, outOfView = 0, displayed = 0, skinned = 0;
    std::uint64_t vertices = 0;
    double cpuSeconds = 0;
    std::optional<double> verticesPerSecond;  ///< of GPU time
    std::uint64_t refusals = 0;
  };

  Row rowOf(std::size_t first, std::size_t end) const;
  void printRow(const Row& row) const;
  void addRow();
  void sumUp();
  void printTotals() const;
  std::string json(const CheckTotals* check) const;
  std::optional<std::uint32_t> settledBy(const Frame& frame) const;

  ReportTitle title_;
  bool printsLater_ = false;
  std::vector<Frame> frames_;
  ShownCounts before_;
  std::vector<Row> rows_;
  std::size_t rowBegin_ = 0;
  Totals totals_;
  dermis::vulkan::SystemStatistics memory_;
};

}  // namespace crowd
