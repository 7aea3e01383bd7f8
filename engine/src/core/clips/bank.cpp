// What a bank is asked, and whether stored bytes are one.
#include "clips/bank.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "clips/errors.h"
#include "dermis/clips.h"
#include "stored.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

constexpr StoredKind storedClips{"packed clips", clipsMagic, clipsVersion, sizeof(BankHeader) / 4};

class BankCheck {
 public:
  explicit BankCheck(std::span<const std::uint32_t> words) : bank_(words), total_(words.size()) {}

  Result<void> run() {
    const BankHeader& header = bank_.header;
    const std::uint64_t nodes = header.nodeCount;
    if (!isSection(header.nodes, nodes * sizeof(BankNode) / 4) ||
        !isSection(header.skins, header.skinCount * std::uint64_t{sizeof(BankSkin) / 4}) ||
        !isSection(header.clips, header.clipCount * std::uint64_t{sizeof(BankClip) / 4}) ||
        !areFactors(header.masks, header.maskCount * nodes) || header.skinCount == 0 ||
        !isSection(header.morphed, header.morphedCount * std::uint64_t{sizeof(BankMorphed) / 4}) ||
        (header.motion != 0 && !isMotion(header.motion)) || header.clipCount > maxClips ||
        header.maskCount > maxMasks || header.nodes % 4 != 0 || header.clips % 4 != 0 ||
        header.groupCount > total_)
      return storedClips.damaged("its header does not fit its sections");
    for (std::size_t i = 0; i < nodes; ++i) {
      if (!isNode(i)) return storedClips.damaged("node " + std::to_string(i) + " is not valid");
    }
    for (std::size_t i = 0; i < header.skinCount; ++i) {
      if (!isSkin(bank_.skin(i)))
        return storedClips.damaged("skin " + std::to_string(i) + " is not valid");
    }
    for (std::size_t i = 0; i < header.morphedCount; ++i) {
      if (!isMorphed(bank_.morphed(i)) ||
          (i > 0 && bank_.morphed(i).source <= bank_.morphed(i - 1).source))
        return storedClips.damaged("node with weights " + std::to_string(i) + " is not valid");
    }
    for (std::size_t i = 0; i < header.clipCount; ++i) {
      if (!isClip(bank_.clip(i)))
        return storedClips.damaged("clip " + std::to_string(i) + " is not valid");
    }
    return {};
  }

 private:
  /// Sections do not overlap, so that small banks are small: what all take is at most all words.
  bool isSection(std::uint64_t offset, std::uint64_t count) {
    if (offset < sizeof(BankHeader) / 4 || offset > total_ || count > total_ - offset) return false;
    taken_ += count;
    return taken_ <= total_;
  }
  bool allAre(bool (*good)(float), std::uint64_t offset, std::uint64_t count) {
    if (!isSection(offset, count)) return false;
    for (std::uint64_t i = offset; i < offset + count; ++i) {
      if (!good(bank_.number(static_cast<std::size_t>(i)))) return false;
    }
    return true;
  }
  bool areFinite(std::uint64_t offset, std::uint64_t count) {
    return allAre([](float number) { return std::isfinite(number); }, offset, count);
  }
  /// One of another length would scale the pose of a skin that `rigidSkins` calls rigid: the
  /// rotation at rest is used as it is stored, and float32 cannot normalize a very short one.
  static bool isUnit(std::span<const float, 4> rotation) {
    double square = 0;
    for (const float number : rotation) square += double{number} * double{number};
    return std::abs(square - 1) <= 1e-5;
  }
  bool areFactors(std::uint64_t offset, std::uint64_t count) {
    return allAre([](float factor) { return factor >= 0 && factor <= 1; }, offset, count);
  }

  bool isNode(std::size_t index) {
    const BankNode node = bank_.node(index);
    const auto isFinite = [](float number) { return std::isfinite(number); };
    return (node.parent == noNode || node.parent < index) &&
           std::ranges::all_of(node.translation, isFinite) && isUnit(node.rotation) &&
           std::ranges::all_of(node.scale, isFinite) &&
           isFinite(node.translationError + node.rotationError + node.scaleError) &&
           (node.fixed == 0 || (node.fixed % 4 == 0 && areFinite(node.fixed, 12)));
  }

  bool isSkin(const BankSkin& skin) {
    if (skin.jointCount == 0 || skin.jointCount > maxPoseJoints || skin.matrices % 4 != 0 ||
        !isSection(skin.nodes, skin.jointCount) ||
        !areFinite(skin.matrices, std::uint64_t{12} * skin.jointCount))
      return false;
    for (std::size_t joint = 0; joint < skin.jointCount; ++joint) {
      const std::uint32_t node = bank_.words[skin.nodes + joint];
      if (node != noNode && node >= bank_.header.nodeCount) return false;
    }
    return true;
  }

  bool isMorphed(const BankMorphed& node) {
    const std::uint64_t groups = node.groupCount();
    return groups > 0 && groups + node.firstGroup <= bank_.header.groupCount &&
           areFinite(node.rest, 3 * groups) && areFactors(node.masks, bank_.header.maskCount) &&
           std::isfinite(node.error);
  }

  bool isMotion(std::uint32_t offset) {
    if (!isSection(offset, sizeof(BankMotion) / 4)) return false;
    const auto motion = bank_.at<BankMotion>(offset);
    return motion.upAxis < 3 && motion.length > 0 && std::isfinite(motion.length) &&
           std::isfinite(motion.translationError + motion.rotationError);
  }

  bool isClass(const BankClass& keys) {
    const KeyFormat format = KeyFormat::of(keys.format);
    const std::uint64_t columns = keys.columnCount, intervals = std::uint64_t{keys.keyCount} - 1;
    return keys.format < 8 && format.size < 3 && keys.level < 32 && keys.keyCount >= 2 &&
           keys.keyCount <= mostKeys && columns > 0 && columns < 1u << trackColumnBits &&
           keys.rowHalves % 2 == 0 && keys.rowHalves >= columns * format.halves() &&
           isSection(keys.keys, keys.keyCount * std::uint64_t{keys.rowHalves / 2}) &&
           (format.isRotation || (keys.ranges % 4 == 0 && areFinite(keys.ranges, 8 * columns))) &&
           (keys.jumps == 0 || isSection(keys.jumps, intervals * ((columns + 3) / 4)));
  }

  bool isTrack(const BankClip& clip, std::uint32_t word, bool isRotation) {
    switch (static_cast<TrackKind>(word >> 30)) {
      case TrackKind::rest:
        return word == 0;
      case TrackKind::constant:
        return areFinite(word & 0x3fffffff, isRotation ? 4 : 3) &&
               (!isRotation || isUnit(bank_.at<std::array<float, 4>>(word & 0x3fffffff)));
      case TrackKind::animated: {
        const std::uint32_t number = word >> trackColumnBits & 255;
        if (number >= clip.classCount) return false;
        const BankClass keys = bank_.keyClass(clip, number);
        return KeyFormat::of(keys.format).isRotation == isRotation &&
               (word & ((1u << trackColumnBits) - 1)) < keys.columnCount;
      }
    }
    return false;
  }

  bool isClip(const BankClip& clip) {
    const std::uint64_t ofNodes = std::uint64_t{3} * bank_.header.nodeCount;
    const std::uint64_t tracks = bank_.trackCount();
    if (!std::isfinite(clip.duration) || clip.duration < 0 || !std::isfinite(clip.rate) ||
        clip.rate < 0 || clip.flags > 3 || clip.classCount > 256 ||
        !std::isfinite(clip.duration * clip.rate) || clip.classes % 4 != 0 ||
        !isSection(clip.classes, clip.classCount * std::uint64_t{sizeof(BankClass) / 4}) ||
        !isSection(clip.tracks, tracks))
      return false;
    for (std::size_t i = 0; i < clip.classCount; ++i) {
      if (!isClass(bank_.keyClass(clip, i))) return false;
    }
    for (std::size_t i = 0; i < tracks; ++i) {
      if (!isTrack(clip, bank_.words[clip.tracks + i], i < ofNodes && i % 3 == 1)) return false;
    }
    return true;
  }

  ClipBank bank_;
  std::uint64_t total_;
  std::uint64_t taken_ = sizeof(BankHeader) / 4;
};

}  // namespace

Result<void> checkClips(std::span<const std::uint32_t> words) {
  return BankCheck(words).run();
}

Result<PackedClips> PackedClips::fromBytes(std::span<const std::byte> bytes) {
  Result<std::vector<std::uint32_t>> words = storedClips.wordsOf(bytes);
  if (!words) return words.error();
  if (Result<void> good = checkClips(*words); !good) return good.error();
  PackedClips clips;
  clips.words_ = *std::move(words);
  return clips;
}

std::uint32_t PackedClips::nodeCount() const {
  return ClipBank(*this).header.nodeCount;
}
std::uint32_t PackedClips::skinCount() const {
  return ClipBank(*this).header.skinCount;
}
std::uint32_t PackedClips::clipCount() const {
  return ClipBank(*this).header.clipCount;
}
std::uint32_t PackedClips::maskCount() const {
  return ClipBank(*this).header.maskCount;
}

std::uint32_t PackedClips::jointCount(std::uint32_t skin) const {
  const ClipBank bank(*this);
  return skin < bank.header.skinCount ? bank.skin(skin).jointCount : 0;
}

ClipInfo PackedClips::clip(std::uint32_t number) const {
  const ClipBank bank(*this);
  if (number >= bank.header.clipCount) return {};
  const BankClip clip = bank.clip(number);
  return {clip.duration, (clip.flags & 1) != 0, (clip.flags & 2) != 0};
}

std::vector<std::uint32_t> PackedClips::morphedNodes() const {
  const ClipBank bank(*this);
  std::vector<std::uint32_t> nodes;
  for (std::uint32_t i = 0; i < bank.header.morphedCount; ++i)
    nodes.push_back(bank.morphed(i).source);
  return nodes;
}

std::uint32_t PackedClips::weightCount(std::uint32_t node) const {
  const ClipBank bank(*this);
  const std::optional<BankMorphed> found = bank.morphedNode(node);
  return found ? found->count : 0;
}

bool PackedClips::hasRootMotion() const {
  return ClipBank(*this).header.motion != 0;
}

ClipError PackedClips::rootMotionError() const {
  const ClipBank bank(*this);
  if (bank.header.motion == 0) return {};
  const auto motion = bank.at<BankMotion>(bank.header.motion);
  return {motion.translationError, motion.rotationError};
}

std::vector<ClipError> errorsOf(const PackedClips& clips, std::size_t nodeCount) {
  const ClipBank bank(clips);
  std::vector<ClipError> errors(nodeCount);
  for (std::size_t i = 0; i < bank.header.nodeCount; ++i) {
    const BankNode node = bank.node(i);
    if (node.source < nodeCount)
      errors[node.source] = {node.translationError, node.rotationError, node.scaleError, 0};
  }
  return errors;
}

ClipError PackedClips::error(std::uint32_t node) const {
  const ClipBank bank(*this);
  ClipError error;
  for (std::size_t i = 0; i < bank.header.nodeCount; ++i) {
    const BankNode found = bank.node(i);
    if (found.source == node)
      error = {found.translationError, found.rotationError, found.scaleError, 0};
  }
  if (const std::optional<BankMorphed> found = bank.morphedNode(node)) error.weight = found->error;
  return error;
}

}  // namespace dermis
