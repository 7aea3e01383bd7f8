// A model on the device, skinned by one method or by two side by side, and pictures of it.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "drawn_scene.h"
#include "kit/render/renderer.h"
#include "kit/timestamps.h"
#include "orbit_camera.h"

namespace dermis::viewer {

enum class Coloring : std::uint8_t { surface, weights, error };

/// Everything that determines a picture: equal shots look the same.
struct Shot {
  std::uint32_t clip = noIndex;  ///< `none`: the rest pose
  double time = 0;               ///< seconds
  std::array<Method, 2> methods{Method::dualQuaternion, Method::linear};
  std::uint32_t views = 1;  ///< 2: side by side
  OrbitCamera camera;
  Coloring coloring = Coloring::surface;
  std::uint32_t joint = 0;              ///< the chosen one, in `SceneView::joints`
  std::uint32_t width = 0, height = 0;  ///< pixels of both views together

  bool operator==(const Shot&) const = default;
};

struct Joint {
  std::string name;
  std::uint32_t node = noIndex;
  std::uint32_t parent = noIndex;  ///< nearest ancestor that is a joint, in the same list
};

/// The joints of all skins that are drawn, without duplicates.
std::vector<Joint> jointsOf(const cli::Scene& scene);

/// The positions of joints in a pose, in the scene's space.
std::vector<glm::vec3> jointPositions(const cli::Scene& scene, const std::vector<Joint>& joints,
                                      std::uint32_t clip, double time);

/// The share of a joint in the weights of each vertex of a part, 0 to 1. Fails like
/// `reference::skin`.
Result<std::vector<float>> jointWeights(const cli::Scene& scene, const cli::ScenePart& part,
                                        std::uint32_t node);

/// The distances of skinned vertices from the reference in double precision.
struct PositionErrors {
  std::vector<std::vector<float>> errors;  ///< by part and vertex, in the model's unit
  double greatest = 0;                     ///< of all of them
  double greatestPartOfBound = 0;          ///< the largest error ÷ its bound
};

/// `positions` are what the device skinned: by part, 3 per vertex; empty for a part without joints.
/// Fails like `reference::skin`.
Result<PositionErrors> positionErrors(const cli::Scene& scene, const cli::ScenePose& pose,
                                      Method method, std::span<const std::vector<float>> positions);

/// The cost of the last picture; 0 if unknown.
struct SceneTimes {
  double skinningSeconds = 0;  ///< GPU time of the last skinning
  double drawingSeconds = 0;   ///< GPU time
  double planSeconds = 0;      ///< CPU time of `SceneRecorder::record` at the last skinning
};

/// Handles one picture at a time: recorded commands must be complete before the next call that is
/// not const.
class SceneView {
 public:
  /// `device` must outlive it. Fails with `invalidData` if nothing of the scene is skinned.
  static Result<std::unique_ptr<SceneView>> create(samples::OpenDevice& device, cli::Scene scene);

  const cli::Scene& scene() const { return scene_; }
  const std::vector<Joint>& joints() const { return joints_; }
  std::uint64_t vertexCount() const;
  /// The duration of a clip in seconds; 0 for the rest pose.
  double duration(std::uint32_t clip) const;

  /// The box around some poses of a clip. The first call for a clip skins them, and waits. Fails
  /// with `invalidData` if there is nothing to draw.
  Result<Box> extent(std::uint32_t clip);

  /// The next picture skins everything, because the kernels have changed.
  void skinAgain() { posed_.reset(), valued_.reset(); }

  /// Skins what has changed, draws it, and returns the picture. The scene must allow the methods.
  /// To show errors, it first skins in a separate submission, and waits for the reference, which
  /// is slow.
  Result<const samples::render::RenderTarget*> record(VkCommandBuffer commandBuffer,
                                                      const Shot& shot);
  /// Call this when the GPU is done with the picture.
  Result<void> finish();

  /// The last picture; null before the first.
  const samples::render::RenderTarget* picture() const {
    return frame_ ? &frame_->target() : nullptr;
  }
  const SceneTimes& times() const { return times_; }
  /// By view, if the last picture shows errors.
  std::span<const PositionErrors> errors() const { return errors_; }

 private:
  using FigureBuffers = std::vector<samples::MappedBuffer>;  ///< by part

  SceneView(samples::OpenDevice& device, cli::Scene scene)
      : device_(&device), scene_(std::move(scene)) {}
  Result<void> prepare();
  Result<void> fitFrame(std::uint32_t width, std::uint32_t height);
  Result<void> recordSkinning(VkCommandBuffer commandBuffer, const Shot& shot);
  Result<void> skin(const Shot& shot);
  Result<void> writeValues(const Shot& shot);
  Result<void> writeWeights(std::uint32_t joint);
  Result<void> writeErrors(const Shot& shot);
  Result<std::vector<std::vector<float>>> readPositions(std::uint32_t figure);
  Result<void> draw(VkCommandBuffer commandBuffer, const Shot& shot, const Box& extent);

  samples::OpenDevice* device_;
  cli::Scene scene_;
  std::vector<Joint> joints_;
  // Members are destroyed in reverse order of declaration: frames before the renderer.
  std::optional<samples::render::Renderer> renderer_;
  std::optional<cli::DrawnScene> drawn_;
  std::optional<samples::render::RenderFrame> frame_;
  std::array<Method, 2> methods_{Method::dualQuaternion, Method::dualQuaternion};
  std::map<std::uint32_t, Box> extents_;  ///< by clip
  std::optional<Shot> posed_;             ///< what is skinned
  cli::ScenePose pose_;
  std::array<FigureBuffers, 2> values_;  ///< of vertices, shown as colors
  std::optional<Shot> valued_;           ///< whose values these are
  std::vector<PositionErrors> errors_;
  samples::Timestamps skinning_, drawing_;
  bool hasSkinned_ = false;  ///< since `finish`
  SceneTimes times_;
};

}  // namespace dermis::viewer
