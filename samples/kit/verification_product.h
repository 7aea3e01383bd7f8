// Verifies every way to skin: combinations of methods, inputs and outputs that cover all pairs.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dermis/verify.h"
#include "kit/batch_runner.h"
#include "kit/random_rig.h"

namespace dermis::samples {

/// The verified formats. No run of attributes may have snorm8x3.
inline constexpr std::array verifiedPositionFormats{
    VertexFormat::float32x3, VertexFormat::float32x4, VertexFormat::float16x3,
    VertexFormat::float16x4, VertexFormat::snorm16x3, VertexFormat::snorm16x4};
inline constexpr std::array verifiedNormalFormats{
    VertexFormat::none,         VertexFormat::float32x3, VertexFormat::float32x4,
    VertexFormat::float16x3,    VertexFormat::float16x4, VertexFormat::snorm16x3,
    VertexFormat::snorm16x4,    VertexFormat::snorm8x4,  VertexFormat::octahedral16x2,
    VertexFormat::octahedral8x2};
inline constexpr std::array verifiedTangentFormats{
    VertexFormat::none,         VertexFormat::float32x4, VertexFormat::float16x4,
    VertexFormat::snorm16x4,    VertexFormat::snorm8x4,  VertexFormat::octahedral16x2,
    VertexFormat::octahedral8x2};

/// A layout of the skinned vertices and a tuning.
struct OutputCase {
  OutputLayout layout;
  Tuning tuning;
  std::string name() const;  ///< "positions float16x4, normals octahedral8x2, interleaved, ..."
};

/// How many values of each parameter are verified.
enum class Coverage : std::uint8_t {
  full,
  quick,  ///< common values, and one of each kind
};

/// Output cases that combine every two values of two parameters, as far as `OutputAttribute` allows
/// for these meshes, and a device with these limits supports them. No meshes: one with all
/// attributes.
std::vector<OutputCase> outputCases(const DeviceLimits& limits, Coverage coverage = Coverage::full,
                                    std::span<const MeshInfo> meshes = {});

/// One instance to verify. Spans and views refer to the caller's memory.
struct InstanceToVerify {
  const PackedMesh* packed = nullptr;
  std::span<const JointMatrix> pose, previousPose;
  std::span<const MorphWeight> morphs, previousMorphs;
  Method method = Method::dualQuaternion;
  /// The expected result, in this pose and the previous one.
  const reference::SkinnedMesh* expected = nullptr;
  const reference::SkinnedMesh* expectedBefore = nullptr;
  /// How many of their vertices are exempt.
  Exemptions exemptions = {}, exemptionsBefore = {};
};

/// The result for one instance.
struct VerifiedInstance {
  Comparison comparison;  ///< of the skinned vertices
  std::optional<PoseStatus> status;
  std::string wrong;  ///< other errors; empty if there are none

  bool passed() const { return comparison.passed() && wrong.empty(); }
};

/// Skins a batch and compares attributes, previous positions, bounds and clamped counts with the
/// reference. If there is motion, this includes the frames before and after. Checks that no other
/// byte was written. If `thorough`, also checks that every byte of the attributes was written, and
/// that each instance has the same bits when it is skinned alone. Fails if the batch cannot be
/// skinned.
Result<std::vector<VerifiedInstance>> verifyBatch(BatchTarget& target,
                                                  std::span<const InstanceToVerify> instances,
                                                  const OutputCase& output, bool thorough = false);

/// A random mesh in some input formats, with an awkward number of vertices, and an output case.
struct RandomCase {
  InputFormats input;
  std::uint32_t vertices = 1, joints = 1, influences = 4, morphs = 0;
  Rigidity rigidity = Rigidity::rigid;
  Method method = Method::linear;
  OutputCase output;
  std::string inputName() const;
};

/// Cases with the target's methods, and with output formats that it supports.
std::vector<RandomCase> randomCases(const BatchTarget& target, Coverage coverage = Coverage::full);

/// Skins and verifies three instances of the case's mesh, each in its own pose.
Result<std::vector<VerifiedInstance>> verifyRandomCase(BatchTarget& target,
                                                       const RandomCase& randomCase);

}  // namespace dermis::samples
