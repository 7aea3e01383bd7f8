// Draws the numbers of a frame in a corner of its picture.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "kit/render/picture.h"

namespace crowd {

/// The numbers that the panel shows.
struct PanelNumbers {
  std::string device;
  std::uint64_t figures = 0, verticesOfFigure = 0, instances = 0;
  /// Numbers of instances. With culling on the GPU, empty if they are not known.
  std::optional<std::uint64_t> skinned, notDue;
  std::uint64_t outOfView = 0;
  std::optional<std::uint64_t> vertices;  ///< skinned
  std::uint64_t dispatches = 0;
  double cpuSeconds = 0;             ///< of planning and recording
  std::optional<double> gpuSeconds;  ///< of skinning
};

class StatisticsPanel {
 public:
  explicit StatisticsPanel(dermis::samples::render::Font font) : font_(std::move(font)) {}

  void draw(dermis::samples::render::Picture& picture, const PanelNumbers& numbers) const;

 private:
  dermis::samples::render::Font font_;
};

}  // namespace crowd
