// Verifies every way to skin: combinations of methods, inputs and outputs, by pairs.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "batch_runner.h"
#include "dermis/verify/accuracy.h"
#include "random_rig.h"
#include "stored_mesh.h"

namespace dermis::samples {

/// The formats that are verified.
inline constexpr std::array verifiedPositionFormats{
    VertexFormat::float32x3, VertexFormat::float32x4, VertexFormat::float16x3,
    VertexFormat::float16x4, VertexFormat::snorm16x3, VertexFormat::snorm16x4};
inline constexpr std::array verifiedNormalFormats{
    VertexFormat::none,           VertexFormat::float32x3,    VertexFormat::float32x4,
    VertexFormat::float16x3,      VertexFormat::float16x4,    VertexFormat::snorm16x3,
    VertexFormat::snorm16x4,      VertexFormat::snorm8x3,     VertexFormat::snorm8x4,
    VertexFormat::octahedral16x2, VertexFormat::octahedral8x2};
inline constexpr std::array verifiedTangentFormats{
    VertexFormat::none,         VertexFormat::float32x4, VertexFormat::float16x4,
    VertexFormat::snorm16x4,    VertexFormat::snorm8x4,  VertexFormat::octahedral16x2,
    VertexFormat::octahedral8x2};

/// One way to store the skinned vertices, and to divide the work.
struct OutputCase {
  OutputLayout layout;
  Tuning tuning;
  std::string name() const;  ///< "float16x4, normals octahedral8x2, interleaved, ..."
};

/// How many values of each parameter are verified.
enum class Coverage : std::uint8_t {
  full,
  quick,  ///< common values, and one of each kind
};

/// Ways in which every two values of two parameters meet, as far as a device with these limits can
/// store them.
std::vector<OutputCase> outputCases(const DeviceLimits& limits, Coverage coverage = Coverage::full);

/// One instance to verify. Spans and views refer to the caller's memory.
struct InstanceToVerify {
  const PackedMesh* packed = nullptr;
  std::span<const JointMatrix> pose, previousPose;
  std::span<const MorphWeight> morphs, previousMorphs;
  Method method = Method::dualQuaternion;
  /// The expected result, in this pose and the previous one.
  const reference::SkinnedMesh* expected = nullptr;
  const reference::SkinnedMesh* expectedBefore = nullptr;
  /// How many of their vertices may be exempt.
  Exemptions exemptions = {}, exemptionsBefore = {};
};

/// The result for one instance.
struct VerifiedInstance {
  Comparison comparison;  ///< of the skinned vertices
  std::optional<PoseStatus> status;
  std::string wrong;  ///< other errors; empty if there are none

  bool passed() const { return comparison.passed() && wrong.empty(); }
};

/// Skins a batch as the case says and holds all of it against the reference: attributes, previous
/// positions (frames before and after too), bounds, clamped vertices; and that no byte outside the
/// attributes was touched. Where it is to be thorough, also that every byte of them was written,
/// and that each instance comes out to the bit when it is skinned without the others. Fails if
/// the batch cannot be skinned.
Result<std::vector<VerifiedInstance>> verifyBatch(BatchTarget& target,
                                                  std::span<const InstanceToVerify> instances,
                                                  const OutputCase& output, bool thorough = false);

/// A random mesh in some input formats, with an awkward number of vertices, and an output.
struct RandomCase {
  InputFormats input;
  std::uint32_t vertices = 1, joints = 1, influences = 4, morphs = 0;
  Rigidity rigidity = Rigidity::rigid;
  Method method = Method::linear;
  OutputCase output;
  std::string inputName() const;
};

/// With the methods of the target, and outputs that it can store.
std::vector<RandomCase> randomCases(const BatchTarget& target, Coverage coverage = Coverage::full);

/// Three instances of the case's mesh, each in a pose of its own.
Result<std::vector<VerifiedInstance>> verifyRandomCase(BatchTarget& target,
                                                       const RandomCase& randomCase);

}  // namespace dermis::samples
