// The words of a bank of clips, and how a key is read. All offsets count words from the beginning.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>

#include "abi.h"
#include "dermis/clips.h"

namespace dermis {

inline constexpr std::uint32_t clipsMagic = 0x504c4344u;  // "DCLP"
inline constexpr std::uint32_t clipsVersion = 2;
inline constexpr std::uint32_t noNode = 0xffffffffu;
inline constexpr float leastMaskFactor = 0x1p-60f;  ///< smaller ones are stored as 0

/// The first four words are those of a packed mesh header, so that the checksum is computed in the
/// same way.
struct BankHeader {
  std::uint32_t magic, version, checksum, wordCount;
  std::uint32_t nodeCount, skinCount, clipCount, maskCount;
  std::uint32_t nodes, skins, clips, masks;  ///< `masks`: `nodeCount` factors for each
  std::uint32_t morphedCount, morphed;       ///< nodes with morph weights
  std::uint32_t groupCount;                  ///< groups of three weights, of all these nodes
  std::uint32_t motion;                      ///< a `BankMotion`; 0: there is no root motion
};

/// A node that clips move. Parents come before their children.
struct BankNode {
  std::uint32_t parent;  ///< a node of the bank, or `noNode`
  std::uint32_t source;  ///< node of the skeleton
  std::uint32_t fixed;   ///< 12 numbers: what is folded in, between the parent and this; 0: nothing
  float translation[3], rotation[4], scale[3];  ///< at rest
  float translationError, rotationError, scaleError;
};

/// A node with morph weights, whether or not it moves. Weight i is component i % 3 of the group
/// `firstGroup` + i / 3. In a clip the track of group g is word 3 × `nodeCount` + g of its tracks,
/// and is stored as one of a translation.
struct BankMorphed {
  std::uint32_t source;  ///< node of the skeleton; ascending
  std::uint32_t count;   ///< weights, at least 1
  std::uint32_t firstGroup;
  std::uint32_t rest;   ///< 3 numbers for each group
  std::uint32_t masks;  ///< for each mask the factor of the node
  float error;          ///< of each weight
  std::uint32_t unused[2];

  std::uint32_t groupCount() const { return count / 3 + (count % 3 != 0 ? 1 : 0); }
};

/// Root motion. In a clip its track is the last one. Its values are those of `motionBetween`.
struct BankMotion {
  std::uint32_t upAxis;
  float length;  ///< by which headings are multiplied
  float translationError, rotationError;
};

struct BankSkin {
  std::uint32_t jointCount;
  std::uint32_t nodes;     ///< for each joint the node that moves it, or `noNode`
  std::uint32_t matrices;  ///< for each joint 12 numbers: what is folded in × inverse bind
  std::uint32_t unused;
};

struct BankClip {
  float duration, rate;  ///< `rate`: finest intervals a second
  std::uint32_t flags;   ///< wraps | 2 additive
  std::uint32_t classCount;
  std::uint32_t classes;
  std::uint32_t tracks;  ///< for each node three words: translation, rotation, scale; then for
                         ///< each group of weights one, and one for the root motion if any
  std::uint32_t unused[2];
};

/// Tracks of a clip with keys at the same times and in the same format. They are columns; a row has
/// the keys of one time.
struct BankClass {
  std::uint32_t format;  ///< of `KeyFormat`
  std::uint32_t level;   ///< an interval is 2^level of the finest
  std::uint32_t keyCount, columnCount;
  std::uint32_t keys;
  std::uint32_t rowHalves;  ///< 16-bit halves of a row, an even number
  std::uint32_t ranges;     ///< for each column 3 minima, a 0, 3 steps, a 0; 0 for rotations
  std::uint32_t jumps;      ///< for each interval a byte a column, in whole words; 0: none
};

/// A word of `BankClip::tracks`: the kind, and a class and a column or the offset of a value.
enum class TrackKind : std::uint32_t { rest = 0, constant = 1, animated = 2 };
inline constexpr std::uint32_t trackColumnBits = 22;
/// Of a track. Their numbers are exact in float32.
inline constexpr std::uint32_t mostKeys = 1u << 24;
constexpr std::uint32_t trackWord(TrackKind kind, std::uint32_t value) {
  return static_cast<std::uint32_t>(kind) << 30 | value;
}

/// Three numbers of equal size. Those of a rotation are the smallest components of its quaternion;
/// two more bits say which is missing.
struct KeyFormat {
  bool isRotation = false;
  std::uint32_t size = 0;  ///< 0: 32 bits, 1: 48, 2: 64

  static constexpr std::uint32_t rotationBits[3] = {10, 15, 20};
  static constexpr std::uint32_t vectorBits[3] = {10, 16, 21};

  static constexpr KeyFormat of(std::uint32_t word) { return {(word & 4) != 0, word & 3}; }
  constexpr std::uint32_t word() const { return size | (isRotation ? 4u : 0u); }
  constexpr std::uint32_t halves() const { return 2 + size; }
  constexpr std::uint32_t bits() const {
    return isRotation ? rotationBits[size] : vectorBits[size];
  }
  constexpr std::uint32_t largest() const { return (1u << bits()) - 1; }
};

/// A key as integers. `missing` is the component of a rotation that is not stored.
struct KeyBits {
  std::uint32_t values[3];
  std::uint32_t missing;
};

/// The key whose first 16-bit half is `half`.
inline KeyBits readKey(std::span<const std::uint32_t> words, std::size_t half, KeyFormat format) {
  const std::uint32_t* w = &words[half / 2];
  if (format.size == 0) return {{w[0] & 1023, w[0] >> 10 & 1023, w[0] >> 20 & 1023}, w[0] >> 30};
  if (format.size == 1) {
    const std::uint32_t low = half % 2 == 0 ? w[0] : w[0] >> 16 | w[1] << 16;
    const std::uint32_t high = half % 2 == 0 ? w[1] & 0xffff : w[1] >> 16;
    if (!format.isRotation) return {{low & 0xffff, low >> 16, high}, 0};
    return {{low & 0x7fff, low >> 16 & 0x7fff, high & 0x7fff}, (low >> 15 & 1) | low >> 31 << 1};
  }
  if (!format.isRotation) {
    return {{w[0] & 0x1fffff, w[0] >> 21 | (w[1] & 1023) << 11, w[1] >> 10 & 0x1fffff}, 0};
  }
  return {{w[0] & 0xfffff, (w[0] >> 20 & 1023) | (w[1] & 1023) << 10, w[1] >> 10 & 0xfffff},
          w[0] >> 30};
}

/// Writes what `readKey` reads, to zeros.
inline void writeKey(std::span<std::uint32_t> words, std::size_t half, KeyFormat format,
                     const KeyBits& key) {
  std::uint32_t* w = &words[half / 2];
  const auto& v = key.values;
  if (format.size == 0) {
    w[0] = v[0] | v[1] << 10 | v[2] << 20 | key.missing << 30;
  } else if (format.size == 1) {
    const std::uint32_t low = v[0] | (key.missing & 1) << 15 | v[1] << 16 | key.missing >> 1 << 31;
    if (half % 2 == 0) {
      w[0] = low;
      w[1] |= v[2];
    } else {
      w[0] |= low << 16;
      w[1] = low >> 16 | v[2] << 16;
    }
  } else if (format.isRotation) {
    w[0] = v[0] | (v[1] & 1023) << 20 | key.missing << 30;
    w[1] = v[1] >> 10 | v[2] << 10;
  } else {
    w[0] = v[0] | v[1] << 21;
    w[1] = v[1] >> 11 | v[2] << 10;
  }
}

inline constexpr float rootOfHalf = 0.70710678f;

inline std::array<float, 4> rotationOf(const KeyBits& key, KeyFormat format) {
  const float step = 2 * rootOfHalf / static_cast<float>(format.largest());
  std::array<float, 4> q{};
  float squares = 0;
  for (std::uint32_t i = 0; i < 3; ++i) {
    const float value = static_cast<float>(key.values[i]) * step - rootOfHalf;
    q[i < key.missing ? i : i + 1] = value;
    squares = squares + value * value;
  }
  q[key.missing] = std::sqrt(std::max(0.0f, 1 - squares));
  return q;
}

/// `range`: 3 minima, a 0, 3 steps, a 0.
inline std::array<float, 4> vectorOf(const KeyBits& key, std::span<const float, 8> range) {
  std::array<float, 4> v{};
  for (std::size_t i = 0; i < 3; ++i)
    v[i] = range[i] + static_cast<float>(key.values[i]) * range[4 + i];
  return v;
}

/// Reads a bank that has been checked.
struct ClipBank {
  std::span<const std::uint32_t> words;
  BankHeader header;

  explicit ClipBank(const PackedClips& clips) : ClipBank(std::span(clips.words_)) {}
  explicit ClipBank(std::span<const std::uint32_t> checked)
      : words(checked), header(at<BankHeader>(0)) {}

  template <typename Record>
  Record at(std::size_t offset) const {
    Record record;
    std::memcpy(static_cast<void*>(&record), &words[offset], sizeof(record));
    return record;
  }
  BankNode node(std::size_t i) const { return at<BankNode>(header.nodes + i * wordsOf<BankNode>); }
  BankSkin skin(std::size_t i) const { return at<BankSkin>(header.skins + i * wordsOf<BankSkin>); }
  BankMorphed morphed(std::size_t i) const {
    return at<BankMorphed>(header.morphed + i * wordsOf<BankMorphed>);
  }
  /// The one of a node of the skeleton, if it has weights.
  std::optional<BankMorphed> morphedNode(std::uint32_t source) const {
    std::size_t begin = 0, end = header.morphedCount;
    while (begin < end) {
      const std::size_t middle = begin + (end - begin) / 2;
      const BankMorphed found = morphed(middle);
      if (found.source == source) return found;
      (found.source < source ? begin : end) = found.source < source ? middle + 1 : middle;
    }
    return std::nullopt;
  }
  /// In a clip.
  std::size_t trackCount() const {
    return std::size_t{3} * header.nodeCount + header.groupCount + (header.motion != 0 ? 1 : 0);
  }
  BankClip clip(std::size_t i) const { return at<BankClip>(header.clips + i * wordsOf<BankClip>); }
  BankClass keyClass(const BankClip& clip, std::size_t i) const {
    return at<BankClass>(clip.classes + i * wordsOf<BankClass>);
  }
  /// Where a time is among the keys of a track, in intervals.
  static float positionOf(float time, const BankClip& clip, const BankClass& keys) {
    return time * clip.rate * (1.0f / static_cast<float>(1u << keys.level));
  }
  /// The fraction of an interval, with which its keys are interpolated: if the interval has a jump,
  /// 0 before that and 1 from then on.
  float fractionOf(float fraction, const BankClass& keys, std::size_t row,
                   std::uint32_t column) const {
    if (keys.jumps == 0) return fraction;
    const std::size_t rowWords = (keys.columnCount + 3) / 4;
    const std::uint32_t jump =
        words[keys.jumps + row * rowWords + column / 4] >> (column % 4 * 8) & 255;
    if (jump == 0) return fraction;
    // The jump is at (jump + 1) / 256.
    return fraction * 256 >= static_cast<float>(jump + 1) ? 1.0f : 0.0f;
  }
  float number(std::size_t offset) const { return std::bit_cast<float>(words[offset]); }
  /// 1 for mask 0.
  float mask(std::uint32_t mask, std::size_t node) const {
    return mask == 0 ? 1 : number(header.masks + std::size_t{mask - 1} * header.nodeCount + node);
  }

  template <typename Record>
  static constexpr std::size_t wordsOf = sizeof(Record) / 4;
};
static_assert(offsetof(BankHeader, nodes) == abi::CLIPS_OFFSETS * 4 &&
              sizeof(BankNode) == abi::CLIP_NODE_WORDS * 4 &&
              sizeof(BankClip) == abi::CLIP_WORDS * 4 &&
              sizeof(BankClass) == abi::CLIP_CLASS_WORDS * 4 &&
              trackColumnBits == abi::TRACK_COLUMN_BITS);
static_assert(sizeof(BankHeader) == 64 && sizeof(BankNode) == 64 && sizeof(BankSkin) == 16 &&
              sizeof(BankMorphed) == 32 && sizeof(BankMotion) == 16 && sizeof(BankClip) == 32 &&
              sizeof(BankClass) == 32);

/// Checks the length, the version, the checksum, every offset and index, and that numbers are
/// finite and rotations of unit length. O(words).
Result<void> checkClips(std::span<const std::uint32_t> words);

}  // namespace dermis
