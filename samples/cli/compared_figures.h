// A scene in one pose, skinned by several methods, to draw them side by side, with the distances
// from dual quaternions as a heat map.
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/layout.h"
#include "drawn_scene.h"

namespace dermis::cli {

/// Distances of the vertices that are finite with both methods, in units of the model.
struct FigureDifference {
  double largest = 0;
  double rootMeanSquare = 0;
};

class ComparedFigures {
 public:
  /// Skins on the device, and waits for it. All arguments must outlive this object. The scene must
  /// allow all methods. Fails if the device does, and with `invalidData` if no vertex is finite.
  static Result<ComparedFigures> create(samples::OpenDevice& device,
                                        samples::render::Renderer& renderer, const Scene& scene,
                                        const ScenePose& pose, std::span<const Method> methods);

  /// The box around all figures, without vertices that a method moves far away from their position
  /// with dual quaternions, or below the floor.
  const Box& box() const { return box_; }
  /// The height of the floor: below all feet, but not below vertices that a method has torn off.
  float floor() const { return floor_; }
  /// The diagonal of the box of the figure with dual quaternions; above 0.
  double size() const { return size_; }
  /// A part's vertices as the device wrote them, 3 floats each; empty if no joint moves it.
  std::span<const float> positions(std::size_t method, std::size_t part) const {
    return positions_[method][part];
  }
  const FigureDifference& difference(std::size_t method) const { return differences_[method]; }

  /// Makes the heat maps. `hottest` is the distance that the last color stands for.
  Result<void> makeHeatMaps(double hottest);

  Result<void> addDraws(std::size_t method, std::vector<samples::render::Draw>& draws) const;
  Result<void> addHeatMap(std::size_t method, std::vector<samples::render::Draw>& draws) const;

  /// Problems of materials that could not be loaded.
  const std::vector<std::string>& notes() const { return drawn_.notes(); }

 private:
  using Positions = std::vector<std::vector<float>>;  ///< by part

  ComparedFigures(samples::OpenDevice& device, const Scene& scene, DrawnScene drawn)
      : device_(&device), scene_(&scene), drawn_(std::move(drawn)) {}
  Result<void> skin(const ScenePose& pose);
  Result<void> readBack();
  Result<void> findBox();
  void compareAll();
  std::vector<double> distances(std::size_t method, std::size_t part) const;

  samples::OpenDevice* device_;
  const Scene* scene_;
  DrawnScene drawn_;  ///< The last figure is skinned with dual quaternions.
  std::vector<Positions> positions_;
  std::vector<FigureDifference> differences_;
  std::vector<std::vector<samples::MappedBuffer>> heat_;  ///< by method, by part
  Box box_;
  float floor_ = 0;
  double size_ = 0;
};

/// The sections are perpendicular to the x axis of bind space, from `from` to `to`.
struct SectionRange {
  double from = 0, to = 0;
};

/// The smallest ratio of a section's area after skinning to its area in bind pose. The mesh must be
/// closed. A section is the intersection of a plane and the mesh in bind pose, moved with the skin.
/// Its area is that of its projection onto the plane in which it is largest. `positions` are the
/// skinned positions. 1 if no plane meets the mesh.
double leastSection(const gltf::Primitive& primitive, std::span<const float> positions,
                    const SectionRange& range);

}  // namespace dermis::cli
