// What kernels read of a bank beside its words: in which order the transforms of nodes are
// multiplied.
#pragma once

#include <cstdint>
#include <vector>

#include "abi.h"
#include "dermis/clips.h"

namespace dermis {

/// So many levels of nodes are a band: a dispatch finds their global transforms, from those that
/// the dispatch for the band above has stored.
inline constexpr std::uint32_t bandDepth = abi::MAX_CHAIN - 1;

struct DeviceClips {
  std::vector<std::uint32_t> words;  ///< abi::StepRecord, band after band
  std::uint32_t nodeCount = 0;
  std::uint32_t matrixCount = 0;        ///< of a figure: local transforms, then global ones
  std::vector<std::uint32_t> bandEnds;  ///< in steps
};

DeviceClips deviceClips(const PackedClips& clips);

}  // namespace dermis
