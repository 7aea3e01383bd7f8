#include "clips/bank_writer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <map>
#include <tuple>
#include <utility>

#include "affine.h"
#include "pack/check.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

class BankWriter {
 public:
  explicit BankWriter(const BankParts& parts) : parts_(parts) {}

  Result<std::vector<std::uint32_t>> write(PackClipsReport& report) && {
    BankHeader header{};
    header.magic = clipsMagic;
    header.version = clipsVersion;
    header.nodeCount = static_cast<std::uint32_t>(parts_.moved.size());
    header.skinCount = static_cast<std::uint32_t>(parts_.skeleton.skins.size());
    header.clipCount = static_cast<std::uint32_t>(parts_.clips.size());
    header.maskCount = static_cast<std::uint32_t>(parts_.masks.size());
    reserve(sizeof(header) / 4);
    header.nodes = reserve(parts_.moved.size() * sizeof(BankNode) / 4);
    header.skins = reserve(parts_.skeleton.skins.size() * sizeof(BankSkin) / 4);
    header.morphedCount = static_cast<std::uint32_t>(parts_.morphed.size());
    header.morphed = reserve(parts_.morphed.size() * sizeof(BankMorphed) / 4);
    header.clips = reserve(parts_.clips.size() * sizeof(BankClip) / 4);
    header.masks = reserve(parts_.masks.size() * parts_.moved.size());
    for (std::size_t mask = 0; mask < parts_.masks.size(); ++mask) {
      for (std::size_t i = 0; i < parts_.moved.size(); ++i) {
        words_[header.masks + mask * parts_.moved.size() + i] =
            factorWord(parts_.masks[mask][parts_.moved[i].source]);
      }
    }
    for (std::size_t i = 0; i < parts_.moved.size(); ++i)
      writeNode(header.nodes + 16 * i, parts_.moved[i]);
    for (std::size_t i = 0; i < parts_.skeleton.skins.size(); ++i)
      writeSkin(header.skins + 4 * i, parts_.skeleton.skins[i]);
    if (parts_.motion) {
      header.motion = reserve(sizeof(BankMotion) / 4);
      put(header.motion, *parts_.motion);
    }
    for (std::size_t i = 0; i < parts_.morphed.size(); ++i) {
      writeMorphed(header.morphed + 8 * i, parts_.morphed[i]);
      header.groupCount += static_cast<std::uint32_t>(parts_.morphed[i].rest.size());
    }
    for (std::size_t i = 0; i < parts_.clips.size(); ++i) {
      writeClip(header.clips + 8 * i, i, report);
      if (words_.size() > 0x3fffffff)
        return Error{ErrorCode::limitExceeded, "packClips: the clips need more than 4 GiB"};
    }
    put(0, header);
    finishStored(words_);
    report.byteCount = words_.size() * 4;
    return std::move(words_);
  }

 private:
  template <typename Record>
  void put(std::size_t offset, const Record& record) {
    std::memcpy(&words_[offset], &record, sizeof(record));
  }
  std::uint32_t reserve(std::size_t count) {
    const auto offset = static_cast<std::uint32_t>(words_.size());
    words_.resize(words_.size() + count);
    return offset;
  }
  /// At a multiple of four words, which kernels read at once.
  std::uint32_t reserveUnits(std::size_t count) {
    words_.resize((words_.size() + 3) / 4 * 4);
    return reserve(count);
  }
  std::uint32_t append(const Transform& transform) {
    const std::uint32_t offset = reserveUnits(12);
    for (std::size_t i = 0; i < 12; ++i)
      words_[offset + i] =
          std::bit_cast<std::uint32_t>(static_cast<float>(transform[i / 4][i % 4]));
    return offset;
  }

  /// Times any weight it is a normal number, or 0.
  static std::uint32_t factorWord(float factor) {
    return std::bit_cast<std::uint32_t>(factor < leastMaskFactor ? 0.0f : factor);
  }

  void writeNode(std::size_t offset, const MovedNode& node) {
    BankNode record{};
    record.parent = node.parent;
    record.source = node.source;
    if (node.fixed != identity) record.fixed = append(node.fixed);
    for (std::size_t i = 0; i < 4; ++i) {
      if (i < 3) record.translation[i] = static_cast<float>(node.rest[0][i]);
      record.rotation[i] = static_cast<float>(node.rest[1][i]);
      if (i < 3) record.scale[i] = static_cast<float>(node.rest[2][i]);
    }
    record.translationError = node.error.translation;
    record.rotationError = node.error.rotation;
    record.scaleError = node.error.scale;
    put(offset, record);
  }

  void writeMorphed(std::size_t offset, const MorphedNode& node) {
    BankMorphed record{};
    record.source = node.source;
    record.count = static_cast<std::uint32_t>(parts_.skeleton.nodes[node.source].weights.size());
    record.firstGroup = node.firstGroup;
    record.rest = reserve(3 * node.rest.size());
    for (std::size_t i = 0; i < 3 * node.rest.size(); ++i)
      words_[record.rest + i] =
          std::bit_cast<std::uint32_t>(static_cast<float>(node.rest[i / 3][i % 3]));
    record.masks = reserve(parts_.masks.size());
    for (std::size_t mask = 0; mask < parts_.masks.size(); ++mask)
      words_[record.masks + mask] = factorWord(parts_.masks[mask][node.source]);
    record.error = node.error;
    put(offset, record);
  }

  void writeSkin(std::size_t offset, const SkeletonSkin& skin) {
    BankSkin record{};
    record.jointCount = static_cast<std::uint32_t>(skin.joints.size());
    record.nodes = reserve(skin.joints.size());
    for (std::size_t i = 0; i < skin.joints.size(); ++i)
      words_[record.nodes + i] = parts_.hanging[skin.joints[i]].node;
    record.matrices = reserveUnits(0);
    for (std::size_t i = 0; i < skin.joints.size(); ++i)
      append(multiply(parts_.hanging[skin.joints[i]].fixed, skin.inverseBind[i].m));
    put(offset, record);
  }

  void writeClip(std::size_t offset, std::size_t number, PackClipsReport& report) {
    const FittedClip& clip = parts_.fitted[number];
    std::vector<const Track*> tracks;  // in the order of their words
    for (const auto& ofNode : clip.tracks) {
      for (const auto& track : ofNode) tracks.push_back(track.get());
    }
    for (const Track& track : clip.vectorTracks) tracks.push_back(&track);
    int finest = 20;
    for (const Track* track : tracks) {
      if (track->kind == TrackKind::animated) finest = std::min(finest, track->level);
    }
    BankClip record{};
    record.duration = static_cast<float>(parts_.clips[number].duration);
    record.rate = static_cast<float>(clip.rate / std::ldexp(1, finest));
    record.flags =
        (parts_.clips[number].wraps ? 1u : 0u) | (parts_.clips[number].additive ? 2u : 0u);
    record.tracks = reserve(tracks.size());

    using Columns = std::vector<std::pair<std::size_t, const Track*>>;  // word of `tracks`
    std::map<std::tuple<int, std::uint32_t, bool>, Columns> classes;
    for (std::size_t i = 0; i < tracks.size(); ++i) {
      const Track& track = *tracks[i];
      if (track.kind == TrackKind::constant) {
        const std::size_t width = i % 3 == 1 && i < 3 * clip.tracks.size() ? 4 : 3;
        const std::uint32_t value = reserve(width);
        for (std::size_t c = 0; c < width; ++c)
          words_[value + c] = std::bit_cast<std::uint32_t>(track.constant[c]);
        words_[record.tracks + i] = trackWord(TrackKind::constant, value);
        ++report.constantTracks;
      } else if (track.kind == TrackKind::animated) {
        classes[{track.level, track.format.word(), !track.jumps.empty()}].emplace_back(
            record.tracks + i, &track);
        ++report.animatedTracks;
        report.keyCount += track.keys.size();
        const double rate = clip.rate / std::ldexp(1, track.level);
        report.slowestRate = report.slowestRate == 0 ? rate : std::min(report.slowestRate, rate);
        report.fastestRate = std::max(report.fastestRate, rate);
      }
    }
    record.classCount = static_cast<std::uint32_t>(classes.size());
    record.classes = reserveUnits(classes.size() * sizeof(BankClass) / 4);
    std::uint32_t classNumber = 0;
    for (const auto& [kind, columns] : classes) {
      writeClass(record.classes + 8 * std::size_t{classNumber}, std::get<int>(kind) - finest,
                 columns);
      for (std::size_t c = 0; c < columns.size(); ++c) {
        words_[columns[c].first] = trackWord(
            TrackKind::animated, classNumber << trackColumnBits | static_cast<std::uint32_t>(c));
      }
      ++classNumber;
    }
    put(offset, record);
  }

  void writeClass(std::size_t offset, int level,
                  const std::vector<std::pair<std::size_t, const Track*>>& columns) {
    const Track& first = *columns[0].second;
    BankClass record{};
    record.format = first.format.word();
    record.level = static_cast<std::uint32_t>(level);
    record.keyCount = static_cast<std::uint32_t>(first.keys.size());
    record.columnCount = static_cast<std::uint32_t>(columns.size());
    record.rowHalves = (record.columnCount * first.format.halves() + 1) / 2 * 2;
    record.keys = reserve(std::size_t{record.keyCount} * record.rowHalves / 2);
    if (!first.format.isRotation) record.ranges = reserveUnits(8 * columns.size());
    const std::size_t jumpWords = (columns.size() + 3) / 4;
    if (!first.jumps.empty()) record.jumps = reserve(first.jumps.size() * jumpWords);
    for (std::size_t c = 0; c < columns.size(); ++c) {
      const Track& track = *columns[c].second;
      for (std::size_t row = 0; row < track.keys.size(); ++row) {
        writeKey(words_,
                 2 * std::size_t{record.keys} + row * record.rowHalves + c * track.format.halves(),
                 track.format, track.keys[row]);
      }
      if (!track.format.isRotation) put(record.ranges + 8 * c, track.range);
      for (std::size_t k = 0; k < track.jumps.size(); ++k)
        words_[record.jumps + k * jumpWords + c / 4] |= std::uint32_t{track.jumps[k]} << c % 4 * 8;
    }
    put(offset, record);
  }

  const BankParts& parts_;
  std::vector<std::uint32_t> words_;
};

}  // namespace

Result<std::vector<std::uint32_t>> writeBank(const BankParts& parts, PackClipsReport& report) {
  return BankWriter(parts).write(report);
}

}  // namespace dermis
