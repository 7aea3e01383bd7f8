// Compares the methods: their cost and their results.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "comparison_tube.h"
#include "dermis/layout.h"
#include "kit/device.h"
#include "method_options.h"
#include "skinned_scene.h"

namespace dermis::cli {

struct ComparedMethod {
  Method method = Method::linear;
  std::optional<double> seconds;  ///< the median; empty if it was not timed
  std::optional<double> time;     ///< relative to linear
  std::optional<std::uint64_t> instructions;
  std::uint32_t bytesPerJoint = 0;  ///< of the palette, as the skin kernel reads it
  TubeComparison tube;
  // Distances from `dualQuaternion` in the model's pose, as a fraction of its size. Empty if no
  // vertex is finite.
  std::optional<double> largestDifference;
  std::optional<double> rootMeanSquareDifference;
};

enum class Clock : std::uint8_t { none, timestamps, submission, oneThread };
enum class InstructionSource : std::uint8_t { driver, spirv };

/// Dual quaternions on the tube of `makeCurvedTube`. Times are those of one thread of the CPU, for
/// a pose and for a vertex; empty if nothing is timed.
struct CurvedComparison {
  TubeComparison tube;
  std::optional<double> secondsPerPose;      ///< to compute the driven joints
  std::optional<double> secondsPerVertex;    ///< to skin
  std::optional<double> secondsPerStraight;  ///< the same without the chain
};

/// What the rigs of a model compute.
struct ComparedRigs {
  std::uint32_t drivenJoints = 0, drivenWeights = 0;
  std::optional<double> secondsPerPose;  ///< of all, on one thread of the CPU; empty if not timed
};

struct MethodComparison {
  std::uint32_t instances = 0;
  std::uint64_t vertices = 0;  ///< of one instance
  std::uint32_t joints = 0;    ///< of all skins
  std::uint32_t repetitions = 0;
  bool scales = false;  ///< whether joints scale or shear in the pose
  Clock clock = Clock::none;
  InstructionSource instructionSource = InstructionSource::spirv;
  std::vector<ComparedMethod> methods;  ///< in the order of `allMethods`
  ComparedRigs rigs;
  CurvedComparison curved;
};

struct ComparisonOptions {
  std::optional<std::uint32_t> instances;  ///< empty: enough to keep the device busy
  std::uint32_t repetitions = 1;
  MethodShares shares;
};

/// The device or CPU that the methods are timed on.
struct ComparisonTimer {
  samples::OpenDevice* device = nullptr;
  /// Without a device: dermis::cpu, on one thread, without the comparison methods.
  bool isCpu = false;
};

/// The maximum number of times that `compareMethods` calls `step`: methods that the scene does not
/// allow are skipped.
std::size_t comparisonSteps(const ComparisonOptions& options, const ComparisonTimer& timer);

/// Compares all methods in one pose of a scene that has a part with a mesh. All parts must have
/// been prepared with centers of rotation. Without a timer, nothing is timed. `step` is called
/// after each step. Fails if the device does, or with `invalidArgument` if this number of instances
/// has too many vertices.
Result<MethodComparison> compareMethods(const Scene& scene, const ScenePose& pose,
                                        const ComparisonTimer& timer,
                                        const ComparisonOptions& options,
                                        const std::function<void()>& step);

}  // namespace dermis::cli
