// The methods side by side, as in Figure 1 of Kavan et al. 2007: a strip of pictures for each
// scene, names and numbers under each, and a heat map of the distance from dual quaternions.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "cross_section.h"
#include "dermis/method.h"
#include "open_device.h"
#include "render/camera.h"
#include "render/picture.h"
#include "skinned_scene.h"

namespace dermis::cli {

struct ComparisonColumn {
  Method method = Method::linear;
  std::vector<std::string> cost;  ///< lines below its name, in the strips that show it
};

/// A scene that is the same in all columns, but for the method.
struct ComparisonStrip {
  const Scene* scene = nullptr;  ///< allows all methods, and `dualQuaternion`
  ScenePose pose;
  std::string title, remark;
  samples::render::CameraOptions camera;
  /// Of a scene of one part: what is left of its least section is written below it.
  std::optional<SectionRange> sections;
  bool showsCost = false;
  bool hasHeatMap = false;  ///< one more strip, below it
};

struct ComparisonSheet {
  std::uint32_t width = 1800;  ///< pixels; the height follows
  std::vector<ComparisonColumn> columns;
  std::vector<ComparisonStrip> strips;
  std::string footer;
};

/// Pictures that `drawComparison` tells of.
std::size_t comparisonPictures(const ComparisonSheet& sheet);

/// Draws on a device that was opened for graphics. `font` may be null: there are no words then.
/// `step` is called after each picture. What of the materials could not be had is added to `notes`.
/// Fails if the device does, and with `invalidData` if there is nothing to draw.
Result<samples::render::Picture> drawComparison(samples::OpenDevice& device,
                                                const ComparisonSheet& sheet,
                                                const samples::render::Font* font,
                                                std::vector<std::string>& notes,
                                                const std::function<void()>& step);

}  // namespace dermis::cli
