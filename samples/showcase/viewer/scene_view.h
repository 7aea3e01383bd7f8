// A model on the device, skinned by one method or by two side by side, and pictures of it.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "drawn_scene.h"
#include "error_check.h"
#include "kit/render/renderer.h"
#include "kit/timestamps.h"
#include "orbit_camera.h"
#include "skeleton.h"

namespace dermis::viewer {

enum class Coloring : std::uint8_t { surface, weights, error };

/// Everything that determines a picture. Equal shots look the same, as long as errors do not
/// change.
struct Shot {
  std::uint32_t clip = gltf::none;
  double time = 0;
  std::array<Method, 2> methods{Method::dualQuaternion, Method::linear};
  std::uint32_t views = 1;  ///< 2: side by side
  OrbitCamera camera;
  Coloring coloring = Coloring::surface;
  std::uint32_t joint = 0;  ///< joint whose weights are shown, in `SceneView::joints`
  VkExtent2D pixels{};      ///< of both views together

  bool operator==(const Shot& other) const;
};

/// The quality of drawing, which determines how long it takes.
struct Quality {
  float scale = 1;  ///< drawn pixels per shown pixel, along each side
  samples::render::ShadowSizes shadows;
};

/// The cost of the last picture; 0 if unknown.
struct SceneTimes {
  double skinningSeconds = 0;  ///< GPU time of the last skinning
  double drawingSeconds = 0;   ///< GPU time
  double planSeconds = 0;      ///< CPU time of `SkinningSystem::record` at the last skinning
};

/// Handles one picture at a time: recorded commands must be complete before the next call that is
/// not const.
class SceneView {
 public:
  /// `device` must outlive it. Fails with `invalidData` if nothing of the scene is skinned.
  static Result<std::unique_ptr<SceneView>> create(samples::OpenDevice& device, cli::Scene scene);

  const cli::Scene& scene() const { return scene_; }
  const std::vector<Joint>& joints() const { return joints_; }
  /// Problems of materials that could not be loaded.
  const std::vector<std::string>& notes() const { return drawn_->notes(); }
  std::uint64_t vertexCount() const;

  /// `extent` returns the box around some poses of a clip. Its first call for a clip skins them,
  /// and waits. `withGround` extends that box by the ground.
  Result<Box> extent(std::uint32_t clip);
  static Box withGround(const Box& extent);

  /// Shows these errors from now on, if errors are shown.
  void setErrors(CheckResult result);

  /// The next picture skins everything, because the kernels have changed.
  void skinAgain() { posed_.reset(); }

  /// Skins what has changed and draws it, in one command buffer. With `copiesPositions`, `skinned`
  /// returns the positions afterwards. Fails with `invalidArgument` if the scene does not allow a
  /// method.
  Result<void> record(VkCommandBuffer commandBuffer, const Shot& shot, const Quality& quality,
                      bool isStill, bool copiesPositions);
  /// Call this when the GPU is done with the picture.
  Result<void> finish();

  /// The last picture; null before the first.
  const samples::render::RenderTarget* picture() const;
  const SceneTimes& times() const { return times_; }
  CheckRequest skinned() const;

 private:
  struct PartValues {
    std::array<samples::MappedBuffer, 2> figures;
  };
  struct PictureSlot {
    std::uint32_t width = 0, height = 0, skyLights = 0;
    std::optional<samples::render::RenderFrame> frame;
  };
  /// The place of a part's positions in the copied data.
  struct CopiedPart {
    std::uint64_t offset = 0;
    std::uint32_t stride = 0;  ///< 0: the part is fixed
  };

  SceneView(samples::OpenDevice& device, cli::Scene scene)
      : device_(&device), scene_(std::move(scene)) {}
  Result<void> prepare();
  Result<void> skin(std::uint32_t clip, double time);
  Result<void> makeValues();
  void writeWeights(std::uint32_t joint);
  void writeErrors();
  void clearValues();
  Result<bool> pose(const Shot& shot);
  Result<void> recordSkinning(VkCommandBuffer commandBuffer, const Shot& shot);
  Result<void> draw(VkCommandBuffer commandBuffer, const Shot& shot,
                    samples::render::RenderFrame& frame, const Box& extent);
  Result<void> addDraws(std::uint32_t figure, Coloring coloring,
                        std::vector<samples::render::Draw>& draws) const;
  Result<samples::render::RenderFrame*> frameOf(const Shot& shot, const Quality& quality,
                                                bool isStill);
  Result<void> copyPositions(VkCommandBuffer commandBuffer, std::uint32_t figures);

  samples::OpenDevice* device_;
  cli::Scene scene_;
  std::vector<Joint> joints_;
  // Members are destroyed in reverse order of declaration: frames before the renderer.
  std::optional<samples::render::Renderer> renderer_;
  std::optional<cli::DrawnScene> drawn_;
  std::array<Method, 2> methods_{Method::dualQuaternion, Method::dualQuaternion};
  std::map<std::uint32_t, Box> extents_;    ///< by clip
  std::vector<PartValues> values_;          ///< by part
  std::optional<std::uint32_t> weightsOf_;  ///< the joint whose weights are shown
  std::optional<CheckResult> errors_;
  std::array<PictureSlot, 2> slots_;
  const PictureSlot* shown_ = nullptr;
  samples::Timestamps skinning_, drawing_;
  bool hasSkinned_ = false;
  SceneTimes times_;
  std::optional<Shot> posed_;
  cli::ScenePose pose_;
  std::array<std::vector<CopiedPart>, 2> copied_;
  samples::MappedBuffer positions_;
};

}  // namespace dermis::viewer
