// What kernels read of a bank beside its words: in which order the transforms of nodes are
// multiplied.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/clips.h"

namespace dermis {

/// Nodes at most as deep as this are one band: a dispatch finds their global transforms, from those
/// that the dispatch for the band above has stored.
inline constexpr std::uint32_t bandDepth = 8;

struct DeviceClips {
  /// For each node, what its transform is multiplied by from the left: a matrix of the figure, or
  /// abi::CLIP_ROOT. A matrix is a node, whose local transform it is, or a global transform, with
  /// abi::CLIP_GLOBAL. Filled up to a multiple of four. Then the steps: abi::StepRecord.
  std::vector<std::uint32_t> words;
  std::uint32_t nodeCount = 0;
  std::uint32_t matrixCount = 0;        ///< of a figure: local transforms, then global ones
  std::vector<std::uint32_t> bandEnds;  ///< in steps
  std::uint32_t firstStep = 0;          ///< index into `words`
};

DeviceClips deviceClips(const PackedClips& clips);

}  // namespace dermis
