// Verifies every method and variant of a device, or of the CPU path, against the reference.
#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dermis/layout.h"
#include "dermis/verify.h"
#include "kit/batch_runner.h"
#include "kit/verification_product.h"
#include "skinned_scene.h"

namespace dermis::cli {

/// A part of the scene with one of the methods that it allows.
struct Figure {
  std::size_t part = 0;
  Method method = Method::linear;
};

/// An output layout, and the methods to verify with it.
struct OutputToVerify {
  samples::OutputCase output;
  std::vector<Method> methods;
};

/// The output for all divisions of the work: positions, normals and tangents as float32.
samples::OutputCase divisionOutput(const samples::Division& division);

/// Figures that are skinned together, in one pose and one way. `way` is an index: first into the
/// divisions of the work, then into the outputs.
struct SceneBatch {
  std::size_t pose = 0;
  std::size_t way = 0;
  std::vector<std::size_t> figures;
};

/// All cases of a scene.
struct SceneCases {
  std::vector<Figure> figures;
  std::vector<samples::Division> divisions;
  std::vector<OutputToVerify> outputs;
  std::vector<SceneBatch> batches;  ///< ordered by pose, then by way
};

/// Makes the cases. In each pose, all figures are skinned with each division. The outputs are
/// distributed among the poses; each is verified with all figures of its methods.
SceneCases sceneCases(std::vector<Figure> figures, std::vector<samples::Division> divisions,
                      std::vector<OutputToVerify> outputs, std::size_t poseCount);

// Of cases that compare no vertices.
inline constexpr const char* clipsMethod = "clips";
inline constexpr const char* rigMethod = "rig";
inline constexpr const char* weightsVariant = "morph weights";

/// One primitive in one pose, with one method and one output layout. Or what a figure that plays
/// clips has as the pose of a skin or the morph weights of a node, or what a rig drives: then
/// `comparison` counts points, joints or weights, and its vertices are joints or weights.
struct VerifiedCase {
  std::string part;
  std::string method;
  std::string pose;     ///< "rest pose", "clip 0 'walk' at 0.341 s"
  std::string variant;  ///< "positions float16x4, normals octahedral8x2, interleaved, ..."
  Comparison comparison;
  std::optional<PoseStatus> status;
  std::string wrong;  ///< any other fault; empty if there is none

  bool passed() const {
    return comparison.passed() && wrong.empty() &&
           comparison.compared + comparison.exempt.onlyFinite != 0;
  }
  bool comparesVertices() const { return method != clipsMethod && method != rigMethod; }
  std::string failure() const;  ///< a sentence, if it did not pass
};

struct PoseToVerify {
  std::uint32_t clip = noIndex;
  double time = 0;
  std::string name;
};

/// The rest pose, and each clip at its beginning, at two times within it, and at its end.
std::vector<PoseToVerify> posesToVerify(const gltf::Model& model);

/// The cases of a scene for this number of poses.
SceneCases casesOf(const Scene& scene, samples::BatchTarget& target, std::size_t poseCount,
                   samples::Coverage coverage = samples::Coverage::full);

/// Verifies the cases of a scene on all targets of the pool. The result does not depend on their
/// number. Any division of the work must give the same bits. Motion starts from the previous pose;
/// for the first pose, from the last one. `done` is called after each batch. Fails with
/// `invalidMesh` if a pose has positions that are out of range for float32.
Result<std::vector<VerifiedCase>> verifyScene(samples::TargetPool& pool, const Scene& scene,
                                              std::span<const PoseToVerify> poses,
                                              const SceneCases& cases,
                                              const std::function<void()>& done);

/// Verifies combinations of methods, inputs and outputs, chosen to cover all pairs, on random
/// meshes, on all targets of the pool. `done` is called after each case.
Result<std::vector<VerifiedCase>> verifyRandomMeshes(samples::TargetPool& pool,
                                                     std::span<const samples::RandomCase> cases,
                                                     const std::function<void()>& done);

}  // namespace dermis::cli
