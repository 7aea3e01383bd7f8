// Whether the clips of a bank can scale a joint.
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "clips/bank.h"
#include "clips/sample.h"
#include "clips/stretch.h"
#include "strict_floating_point.h"

namespace dermis {
Stretch stretchOf(const Affine<float>& a) {
  const auto at = [&a](std::size_t row, std::size_t column) { return double{a[row][column]}; };
  const auto product = [&](std::size_t i, std::size_t j) {
    return at(0, i) * at(0, j) + at(1, i) * at(1, j) + at(2, i) * at(2, j);
  };
  double low = HUGE_VAL, high = 0;
  for (std::size_t i = 0; i < 3; ++i) {
    const double others = std::abs(product(i, (i + 1) % 3)) + std::abs(product(i, (i + 2) % 3));
    low = std::min(low, product(i, i) - others);
    high = std::max(high, product(i, i) + others);
  }
  const double determinant = at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
                             at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
                             at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
  return {determinant > 0 && low > 0 ? std::sqrt(low) : 0, std::sqrt(high)};
}

namespace {

/// Of the scale of a node in all clips. Means of scales are between them.
Stretch scaleOf(const ClipBank& bank, std::size_t number) {
  const BankNode node = bank.node(number);
  const auto [least, most] = std::ranges::minmax(node.scale);
  Stretch result{double{least}, double{most}};
  for (std::size_t i = 0; i < bank.header.clipCount; ++i) {
    const BankClip clip = bank.clip(i);
    const std::uint32_t word = bank.words[clip.tracks + 3 * number + 2];
    const auto kind = static_cast<TrackKind>(word >> 30);
    if (kind == TrackKind::rest) continue;
    // A ratio can be applied any number of times.
    if (kind == TrackKind::animated || (clip.flags & 2) != 0) return {0, HUGE_VAL};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double scale = double{bank.number((word & 0x3fffffff) + axis)};
      result = {std::min(result.low, scale), std::max(result.high, scale)};
    }
  }
  return result;
}

}  // namespace

std::vector<bool> rigidSkins(const PackedClips& clips) {
  constexpr double tolerance = 2e-6;
  const ClipBank bank(clips);
  std::vector<Stretch> stretches(bank.header.nodeCount);
  for (std::size_t i = 0; i < stretches.size(); ++i) {
    const BankNode node = bank.node(i);
    if (node.parent != noNode) stretches[i] = stretches[node.parent];
    if (node.fixed != 0)
      stretches[i] = stretches[i] * stretchOf(bank.at<Affine<float>>(node.fixed));
    stretches[i] = stretches[i] * scaleOf(bank, i);
  }
  const auto isRigid = [&](const BankSkin& skin) {
    for (std::size_t joint = 0; joint < skin.jointCount; ++joint) {
      Stretch stretch = stretchOf(bank.at<Affine<float>>(skin.matrices + 12 * joint));
      const std::uint32_t node = bank.words[skin.nodes + joint];
      if (node != noNode) stretch = stretches[node] * stretch;
      if (!(stretch.low >= 1 - tolerance && stretch.high <= 1 + tolerance)) return false;
    }
    return true;
  };
  std::vector<bool> areRigid;
  for (std::size_t skin = 0; skin < bank.header.skinCount; ++skin)
    areRigid.push_back(isRigid(bank.skin(skin)));
  return areRigid;
}

}  // namespace dermis
