// The words of a packed rig. All offsets count words from the beginning, and are multiples of 4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>

#include "abi.h"
#include "dermis/rig.h"

namespace dermis {

inline constexpr std::uint32_t rigMagic = 0x47495244u;  // "DRIG"
inline constexpr std::uint32_t rigVersion = 1;

/// The first four words are those of a packed mesh header, so that the checksum is computed in the
/// same way.
struct RigHeader {
  std::uint32_t magic, version, checksum, wordCount;
  std::uint32_t writtenJoints, drivenJoints, givenWeights, drivenWeights;
  std::uint32_t drivers, driverCount;  ///< in the order in which they are computed
  std::uint32_t weightsOf;
  std::uint32_t isRigid;
  float residual;
  std::uint32_t mostInputs;  ///< of a corrective
  std::uint32_t unused[2];
};
static_assert(sizeof(RigHeader) == 64);

/// Numbers of a driver's kind: abi::RIG_TWIST and the like.
struct RigDriver {
  std::uint32_t kind;
  std::uint32_t data;
  std::uint32_t count;  ///< chain: nodes; linear: terms
  std::uint32_t unused;
};
static_assert(sizeof(RigDriver) == 4 * abi::RIG_DRIVER_WORDS);

/// How the rotation of a joint relative to its parent and its bind pose is found: it is that of
/// left × (parent's matrix)⁻¹ × (joint's matrix) × right.
struct RigSensor {
  std::uint32_t joint, parent;  ///< abi::RIG_NO_JOINT: none
  std::uint32_t unused[2];
  float left[3][4], right[3][4];  ///< the last column is 0
};
static_assert(sizeof(RigSensor) == 4 * abi::RIG_SENSOR_WORDS);

// `driven` counts driven joints, `parent` all joints.

struct RigTwist {
  RigSensor sensor;
  std::uint32_t driven, parent;
  float share;
  std::uint32_t unused;
  float axis[4];       ///< unit, in the axes of the sensor's rotation
  float direction[4];  ///< the same in bind space
  float origin[4];     ///< of the driven joint in bind space
};
static_assert(sizeof(RigTwist) == 4 * (abi::RIG_SENSOR_WORDS + 16));

/// After it: a `RigSensor` for each input; for each example a unit quaternion for each input; for
/// each four weights and each example four coefficients; for each joint a `RigOffsetJoint`, then
/// for each example a `RigOffset` of coefficients.
struct RigCorrective {
  std::uint32_t inputCount, exampleCount, weightCount, jointCount;
  std::uint32_t firstWeight;
  float factor;  ///< of squares of distances in the exponential; 0: linear functions
  std::uint32_t unused[2];
};
static_assert(sizeof(RigCorrective) == 4 * abi::RIG_CORRECTIVE_WORDS);

struct RigOffsetJoint {
  std::uint32_t driven, parent;
  std::uint32_t unused[2];
  float bind[3][4], inverse[3][4];
};
static_assert(sizeof(RigOffsetJoint) == 4 * abi::RIG_OFFSET_JOINT_WORDS);

/// Differences from no offset.
struct RigOffset {
  float translation[4], rotation[4], scale[4];
};
static_assert(sizeof(RigOffset) == 4 * abi::RIG_OFFSET_WORDS);

/// A joint of a chain, and the driven joints between it and the next one.
struct RigNode {
  std::uint32_t joint;
  std::uint32_t joints, jointCount;  ///< `RigChainJoint`s; their offset
  std::uint32_t unused;
  float origin[4], direction[4];  ///< in bind pose: of the joint, and of the curve there
};
static_assert(sizeof(RigNode) == 4 * abi::RIG_NODE_WORDS);

/// Its place on the curve is h p + (1 - h) q + a s + b t, where p, q are the places of both nodes,
/// and s, t the directions of the curve there; its direction is g (p - q) + c s + d t.
struct RigChainJoint {
  std::uint32_t driven;
  float share;  ///< from one node to the next
  float h, a, b, g, c, d;
  float point[4], direction[4];  ///< on the curve in bind pose; the direction is of unit length
};
static_assert(sizeof(RigChainJoint) == 4 * abi::RIG_CHAIN_JOINT_WORDS);

/// After it: `RigTerm`s.
struct RigLinear {
  std::uint32_t driven, parent;
  std::uint32_t unused[2];
};
static_assert(sizeof(RigLinear) == 4 * abi::RIG_LINEAR_WORDS);

struct RigTerm {
  std::uint32_t weight;
  std::uint32_t unused[3];
  float matrix[3][4];
};
static_assert(sizeof(RigTerm) == 4 * abi::RIG_TERM_WORDS);

/// Reads a rig whose words were checked, or its header.
struct RigBlob {
  std::span<const std::uint32_t> words;
  RigHeader header;

  explicit RigBlob(std::span<const std::uint32_t> blob) : words(blob) { read(header, 0); }
  explicit RigBlob(const PackedRig& rig) : RigBlob(std::span<const std::uint32_t>(rig.words_)) {}

  template <typename Record>
  void read(Record& record, std::size_t offset) const {
    std::memcpy(&record, &words[offset], sizeof(Record));
  }
  template <typename Record>
  Record at(std::uint64_t offset) const {
    Record record;
    read(record, static_cast<std::size_t>(offset));
    return record;
  }
  RigDriver driver(std::size_t number) const {
    return at<RigDriver>(header.drivers + number * abi::RIG_DRIVER_WORDS);
  }
};

/// As `evaluateRig`, with memory of the caller, four floats for each of `RigHeader::mostInputs`.
/// The sizes are those that the rig says.
DERMIS_CORE_API void evaluateRigIn(float* scratch, const PackedRig& rig,
                                   std::span<const JointMatrix> written,
                                   std::span<const float> givenWeights,
                                   std::span<JointMatrix> driven, std::span<float> weights);

/// Checks the length, the version, the checksum, every offset and index, and that numbers are
/// finite and drivers read what is computed before.
Result<void> checkRig(std::span<const std::uint32_t> words);

}  // namespace dermis
