// Whether stored bytes are a rig, and what it is asked.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "rig/blob.h"
#include "stored.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

constexpr StoredKind storedRig{"packed rig", rigMagic, rigVersion, sizeof(RigHeader) / 4};

/// Goes through the drivers in their order.
class RigCheck {
 public:
  explicit RigCheck(std::span<const std::uint32_t> words)
      : rig_(words), isDriven_(rig_.header.drivenJoints), isWeighed_(weights(), false) {
    for (std::size_t i = 0; i < rig_.header.givenWeights; ++i) isWeighed_[i] = true;
  }

  /// Whether the header's counts fit the words, so that this object may be made.
  static bool isSmall(const RigHeader& header) {
    return header.writtenJoints > 0 && header.writtenJoints <= maxPoseJoints &&
           header.drivenJoints <= maxPoseJoints - header.writtenJoints &&
           header.givenWeights <= header.wordCount && header.drivenWeights <= header.wordCount;
  }

  Result<void> run() {
    const RigHeader& header = rig_.header;
    if (!isSection(header.drivers, header.driverCount, abi::RIG_DRIVER_WORDS) ||
        !std::isfinite(header.residual))
      return storedRig.damaged("its header does not fit its drivers");
    for (std::size_t i = 0; i < header.driverCount; ++i) {
      if (!isDriver(rig_.driver(i)))
        return storedRig.damaged("driver " + std::to_string(i) + " is not valid");
    }
    for (const std::vector<bool>* made : {&isDriven_, &isWeighed_}) {
      if (std::ranges::find(*made, false) != made->end())
        return storedRig.damaged("a joint or a weight has no driver");
    }
    // `evaluateRig` allocates memory for them.
    if (header.mostInputs != mostInputs_)
      return storedRig.damaged("its header does not fit its drivers");
    return {};
  }

 private:
  std::size_t weights() const {
    return std::size_t{rig_.header.givenWeights} + rig_.header.drivenWeights;
  }
  /// Sections do not overlap, so that small rigs are small: what all take is at most all words.
  bool isSection(std::uint64_t offset, std::uint64_t count, std::uint64_t wordsEach) {
    const std::uint64_t total = rig_.words.size();
    if (offset % 4 != 0 || offset < sizeof(RigHeader) / 4 || offset > total ||
        count > (total - offset) / wordsEach)
      return false;
    taken_ += count * wordsEach;
    return taken_ <= total;
  }
  template <std::size_t size>
  static bool areFinite(const float (&numbers)[size]) {
    return std::ranges::all_of(numbers, [](float number) { return std::isfinite(number); });
  }
  template <std::size_t rows>
  static bool areFinite(const float (&matrix)[rows][4]) {
    return std::ranges::all_of(matrix, [](const auto& row) { return areFinite(row); });
  }
  bool areFinite(std::uint64_t offset, std::uint64_t count) const {
    return std::ranges::all_of(
        rig_.words.subspan(static_cast<std::size_t>(offset), static_cast<std::size_t>(count)),
        [](std::uint32_t word) { return std::isfinite(std::bit_cast<float>(word)); });
  }
  bool isKnown(std::uint32_t joint) const {
    const std::uint32_t written = rig_.header.writtenJoints;
    return joint < written || (joint - written < isDriven_.size() && isDriven_[joint - written]);
  }
  bool isParent(std::uint32_t joint) const { return joint == abi::RIG_NO_JOINT || isKnown(joint); }
  bool drives(std::uint32_t driven) {
    if (driven >= isDriven_.size() || isDriven_[driven]) return false;
    isDriven_[driven] = true;
    return true;
  }
  bool isSensor(const RigSensor& sensor) const {
    return isKnown(sensor.joint) && isParent(sensor.parent) && areFinite(sensor.left) &&
           areFinite(sensor.right);
  }

  bool isDriver(const RigDriver& driver) {
    switch (driver.kind) {
      case abi::RIG_TWIST:
        return isTwist(driver.data);
      case abi::RIG_CORRECTIVE:
        return isCorrective(driver.data);
      case abi::RIG_CHAIN:
        return isChain(driver);
      case abi::RIG_LINEAR:
        return isLinear(driver);
      default:
        return false;
    }
  }

  bool isTwist(std::uint32_t data) {
    if (!isSection(data, 1, sizeof(RigTwist) / 4)) return false;
    const auto twist = rig_.at<RigTwist>(data);
    return isSensor(twist.sensor) && isParent(twist.parent) && std::abs(twist.share) <= 1 &&
           areFinite(twist.axis) && areFinite(twist.direction) && areFinite(twist.origin) &&
           drives(twist.driven);
  }

  bool isCorrective(std::uint32_t data) {
    if (!isSection(data, 1, abi::RIG_CORRECTIVE_WORDS)) return false;
    const auto record = rig_.at<RigCorrective>(data);
    const std::uint64_t inputs = record.inputCount, examples = record.exampleCount;
    // A GPU may take a denormal factor for 0, which stands for linear functions.
    if (inputs == 0 || examples == 0 || examples > maxRigExamples || record.factor > 0 ||
        !(record.factor == 0 || std::isnormal(record.factor)))
      return false;
    mostInputs_ = std::max(mostInputs_, record.inputCount);
    std::uint64_t offset = data + std::uint64_t{abi::RIG_CORRECTIVE_WORDS};
    if (!isSection(offset, inputs, abi::RIG_SENSOR_WORDS)) return false;
    for (std::size_t i = 0; i < inputs; ++i) {
      if (!isSensor(rig_.at<RigSensor>(offset + i * abi::RIG_SENSOR_WORDS))) return false;
    }
    offset += inputs * abi::RIG_SENSOR_WORDS;
    const std::uint64_t numbers = 4 * examples * (inputs + (record.weightCount + 3ull) / 4);
    if (!isSection(offset, numbers, 1) || !areFinite(offset, numbers)) return false;
    offset += numbers;
    const std::uint64_t ofJoint = abi::RIG_OFFSET_JOINT_WORDS + examples * abi::RIG_OFFSET_WORDS;
    if (!isSection(offset, record.jointCount, ofJoint)) return false;
    for (std::size_t i = 0; i < record.jointCount; ++i, offset += ofJoint) {
      const auto joint = rig_.at<RigOffsetJoint>(offset);
      if (!isParent(joint.parent) || !areFinite(offset + 4, ofJoint - 4) || !drives(joint.driven))
        return false;
    }
    if (record.firstWeight > weights() || record.weightCount > weights() - record.firstWeight)
      return false;
    for (std::size_t i = 0; i < record.weightCount; ++i) {
      if (isWeighed_[record.firstWeight + i]) return false;
      isWeighed_[record.firstWeight + i] = true;
    }
    return true;
  }

  bool isChain(const RigDriver& driver) {
    if (driver.count == 0 || !isSection(driver.data, driver.count, abi::RIG_NODE_WORDS))
      return false;
    const auto nodeAt = [&](std::size_t i) {
      return rig_.at<RigNode>(driver.data + i * abi::RIG_NODE_WORDS);
    };
    for (std::size_t i = 0; i < driver.count; ++i) {
      const RigNode node = nodeAt(i);
      if (!isKnown(node.joint) || !areFinite(node.origin) || !areFinite(node.direction) ||
          !isSection(node.joints, node.jointCount, abi::RIG_CHAIN_JOINT_WORDS))
        return false;
    }
    // None reads what another one drives. After the last node there are none.
    for (std::size_t i = 0; i + 1 < driver.count; ++i) {
      const RigNode node = nodeAt(i);
      for (std::size_t joint = 0; joint < node.jointCount; ++joint) {
        const std::size_t offset = node.joints + joint * abi::RIG_CHAIN_JOINT_WORDS;
        if (!areFinite(offset + 1, abi::RIG_CHAIN_JOINT_WORDS - 1) || !drives(rig_.words[offset]))
          return false;
      }
    }
    return true;
  }

  bool isLinear(const RigDriver& driver) {
    if (!isSection(driver.data, 1, abi::RIG_LINEAR_WORDS) ||
        !isSection(driver.data + abi::RIG_LINEAR_WORDS, driver.count, abi::RIG_TERM_WORDS))
      return false;
    for (std::size_t i = 0; i < driver.count; ++i) {
      const auto term =
          rig_.at<RigTerm>(driver.data + abi::RIG_LINEAR_WORDS + i * abi::RIG_TERM_WORDS);
      if (term.weight >= weights() || !isWeighed_[term.weight] || !areFinite(term.matrix))
        return false;
    }
    const auto linear = rig_.at<RigLinear>(driver.data);
    return isParent(linear.parent) && drives(linear.driven);
  }

  RigBlob rig_;
  std::uint64_t taken_ = sizeof(RigHeader) / 4;
  std::vector<bool> isDriven_, isWeighed_;  ///< so far
  std::uint32_t mostInputs_ = 0;            ///< the same, of a corrective
};

}  // namespace

Result<void> checkRig(std::span<const std::uint32_t> words) {
  const RigHeader header = RigBlob(words).header;
  if (!RigCheck::isSmall(header))
    return storedRig.damaged("its header has counts that are not valid");
  return RigCheck(words).run();
}

Result<PackedRig> PackedRig::fromBytes(std::span<const std::byte> bytes) {
  Result<std::vector<std::uint32_t>> words = storedRig.wordsOf(bytes);
  if (!words) return words.error();
  if (Result<void> good = checkRig(*words); !good) return good.error();
  PackedRig rig;
  rig.words_ = *std::move(words);
  return rig;
}

std::uint32_t PackedRig::writtenJoints() const {
  return RigBlob(*this).header.writtenJoints;
}
std::uint32_t PackedRig::drivenJoints() const {
  return RigBlob(*this).header.drivenJoints;
}
std::uint32_t PackedRig::givenWeights() const {
  return RigBlob(*this).header.givenWeights;
}
std::uint32_t PackedRig::drivenWeights() const {
  return RigBlob(*this).header.drivenWeights;
}
std::uint32_t PackedRig::weightsOf() const {
  return RigBlob(*this).header.weightsOf;
}
bool PackedRig::isRigid() const {
  return RigBlob(*this).header.isRigid != 0;
}
float PackedRig::residual() const {
  return RigBlob(*this).header.residual;
}

}  // namespace dermis
