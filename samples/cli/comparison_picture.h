// Draws the methods side by side, as in Figure 1 of Kavan et al. 2007: a strip of pictures for each
// scene, with names and numbers below, and a heat map of the distance from dual quaternions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "compared_figures.h"
#include "dermis/layout.h"
#include "kit/device.h"
#include "kit/render/camera.h"
#include "kit/render/picture.h"
#include "skinned_scene.h"

namespace dermis::cli {

struct ComparisonColumn {
  Method method = Method::linear;
  std::vector<std::string> cost;  ///< lines below its name, in strips that show the cost
};

/// A row of pictures of one scene; the columns differ only in the method.
struct ComparisonStrip {
  const Scene* scene = nullptr;  ///< must allow all methods of the columns, and `dualQuaternion`
  ScenePose pose;
  std::string title, remark;
  samples::render::CameraOptions camera;
  /// For a scene of one part: where to measure the smallest cross-section relative to bind pose,
  /// which is written below the picture.
  std::optional<SectionRange> sections;
  bool showsCost = false;
  bool hasHeatMap = false;  ///< adds another strip below this one
};

struct ComparisonSheet {
  std::uint32_t width = 1800;  ///< pixels; the height is computed
  std::vector<ComparisonColumn> columns;
  std::vector<ComparisonStrip> strips;
  std::string footer;
};

/// How many times `drawComparison` calls `step`.
std::size_t comparisonPictures(const ComparisonSheet& sheet);

/// Draws on a device that was opened for graphics. If `font` is null, there is no text. `step` is
/// called after each picture. Problems of materials are added to `notes`. Fails if the device does,
/// or with `invalidData` if there is nothing to draw.
Result<samples::render::Picture> drawComparison(samples::OpenDevice& device,
                                                const ComparisonSheet& sheet,
                                                const samples::render::Font* font,
                                                std::vector<std::string>& notes,
                                                const std::function<void()>& step);

/// Built-in scenes that show what the methods do: the sample models `bar` and `arm`. Each is
/// twisted or bent most in the middle of its clip.
struct BuiltInScenes {
  Scene bar, arm;
};

/// Both as binary glTF, in built_in_models.cpp, which embed_models.cmake writes.
extern const std::span<const std::byte> embeddedBar, embeddedArm;

Result<BuiltInScenes> loadBuiltInScenes(const MeshPreparation& preparation);

/// The time in seconds at which the clip of a built-in scene twists or bends it most.
double middleOfClip(const Scene& scene);

/// The strips of both scenes: candy wrapper and elbow. They refer to the scenes.
std::vector<ComparisonStrip> builtInStrips(const BuiltInScenes& scenes);

}  // namespace dermis::cli
