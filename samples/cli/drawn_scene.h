// A scene, drawn once or many times from the output of a SceneRecorder.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dermis/vulkan/scene_recorder.h"
#include "kit/device.h"
#include "kit/render/appearances.h"
#include "kit/render/renderer.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// Every figure of a crowd is the whole scene in its own pose.
class DrawnScene {
 public:
  /// `device`, `renderer` and `scene` must outlive it. The scene must allow the method.
  static Result<DrawnScene> create(samples::OpenDevice& device, samples::render::Renderer& renderer,
                                   const Scene& scene, std::uint32_t figures, Method method);
  /// Creates one figure for each method, in this order.
  static Result<DrawnScene> create(samples::OpenDevice& device, samples::render::Renderer& renderer,
                                   const Scene& scene, std::span<const Method> methods);

  std::uint32_t figureCount() const { return static_cast<std::uint32_t>(figures_.size()); }

  /// Begins the next frame. All recorded frames must be complete.
  Result<void> beginFrame();
  Result<void> setPose(std::uint32_t figure, const ScenePose& pose);
  /// Skins a figure with another method from now on, which the scene must allow. The figure must be
  /// posed again. Begins a frame; all recorded frames must be complete.
  Result<void> setMethod(std::uint32_t figure, Method method);
  /// Records the skinning, and the barriers for drawing and copying the output.
  Result<void> recordSkinning(VkCommandBuffer commandBuffer);

  /// Adds the draws of a figure in its last pose, transformed by `transform`.
  Result<void> addDraws(std::uint32_t figure, const JointMatrix& transform,
                        std::vector<samples::render::Draw>& draws) const;
  /// The box around a figure as skinned in the last complete frame; nothing if none of its vertices
  /// is finite. Call `beginFrame` first.
  Result<std::optional<Box>> bounds(std::uint32_t figure) const;

  vulkan::RecorderStatistics statistics() const { return recorder_->statistics(); }

  /// Problems of materials that could not be loaded.
  const std::vector<std::string>& notes() const { return appearances_->notes(); }

 private:
  /// A part that no joint moves.
  struct FixedPart {
    samples::MappedBuffer vertices;  ///< positions, then normals if there are any
    Box box;
  };
  struct FigurePart {
    std::optional<InstanceHandle> instance;
    FixedPart fixed;
    bool isMirrored = false;
  };
  struct Figure {
    std::vector<PoseHandle> poses;  ///< by skin; null if no part uses it
    std::vector<FigurePart> parts;
  };
  /// The data of a part that all figures share.
  struct SharedPart {
    const samples::render::Geometry* geometry = nullptr;
    samples::render::Surface surface;
    std::optional<MeshHandle> mesh;
  };

  DrawnScene() = default;
  Result<void> makeSystem(std::uint32_t figures);
  Result<void> addSharedParts(samples::render::Renderer& renderer);
  Result<void> addFigure(Method method);
  Result<void> addInstances(Figure& figure, Method method);
  Result<void> prepare(const Figure& figure, Method method);
  /// Of a part that is skinned.
  InstanceDescription instanceOf(const Figure& figure, std::size_t part, Method method) const;
  Result<void> placeFixed(const ScenePart& part, std::span<const MorphWeight> morphs,
                          FixedPart& fixed) const;

  samples::OpenDevice* device_ = nullptr;
  const Scene* scene_ = nullptr;
  std::optional<vulkan::SceneRecorder> recorder_;
  std::uint64_t frame_ = 0;
  std::optional<samples::Appearances> appearances_;
  std::vector<SharedPart> shared_;
  std::vector<Figure> figures_;
};

}  // namespace dermis::cli
