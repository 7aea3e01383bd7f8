// What a bank is made of, and its words.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "clips/bank.h"
#include "clips/curve.h"
#include "clips/track.h"
#include "dermis/clips.h"

namespace dermis {

inline constexpr Transform identity{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};

/// Translation, rotation, scale.
using Local = std::array<Value, 3>;

/// A node that a clip moves.
struct MovedNode {
  std::uint32_t source;
  std::uint32_t parent;        ///< in the list of these, or `noNode`
  Transform fixed = identity;  ///< between the parent and this
  Local rest;
  Transform global;  ///< at rest
  double reach = 0;  ///< of what it moves itself, in the units of the skeleton
  ClipError error{};
};

/// A node with morph weights.
struct MorphedNode {
  std::uint32_t source;
  std::uint32_t firstGroup;  ///< of its groups of three weights, the last filled up with zeros
  std::vector<Value> rest;   ///< of each group
  float error = 0;           ///< of each weight
};

/// Where something that no clip moves hangs.
struct Hanging {
  std::uint32_t node = noNode;  ///< of the bank
  Transform fixed = identity;
};

struct FittedClip {
  double rate = 1;
  /// Of each node. Most clips leave most nodes at rest: these share a track.
  std::vector<std::array<std::shared_ptr<const Track>, 3>> tracks;
  std::vector<Track> vectorTracks;  ///< of each group of weights, then of the root motion if any
};

struct BankParts {
  const Skeleton& skeleton;
  std::span<const ClipView> clips;
  std::span<const std::span<const float>> masks;
  std::span<const MovedNode> moved;
  std::span<const MorphedNode> morphed;
  std::span<const Hanging> hanging;  ///< of each node of the skeleton
  std::span<const FittedClip> fitted;
  std::optional<BankMotion> motion;
};

/// The words of a bank. Counts them, the tracks and the keys.
Result<std::vector<std::uint32_t>> writeBank(const BankParts& parts, PackClipsReport& report);

}  // namespace dermis
