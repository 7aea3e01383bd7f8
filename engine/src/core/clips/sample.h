// Poses of a bank: layers as scenes and kernels have them, and their sampling in two steps, nodes
// and joints.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "affine.h"
#include "clips/bank.h"
#include "dermis/clips.h"
#include "dermis/result.h"

namespace dermis {

/// A layer whose time is inside its clip.
struct PackedLayer {
  float time = 0;          ///< seconds
  std::uint32_t bits = 0;  ///< as abi::FigureRecord::layer0

  std::uint32_t clip() const { return bits & 1023; }
  std::uint32_t mask() const { return bits >> 10 & 31; }
  std::uint16_t weight() const { return static_cast<std::uint16_t>(bits >> 16); }
};

/// What a pose is made of: layers that are blended, then those of additive clips.
struct PackedLayers {
  std::array<PackedLayer, maxClipLayers> layers;
  std::uint32_t count = 0;
};

/// Fails as `samplePose` does, with a message that begins with `subject`.
DERMIS_CORE_API Result<PackedLayers> packLayers(const PackedClips& clips,
                                                std::span<const ClipLayer> layers,
                                                const char* subject);

/// For each skin, whether all singular values of its joints are within 2e-6 of 1, and none mirrors,
/// whatever is played. O(nodes × clips + joints).
std::vector<bool> rigidSkins(const PackedClips& clips);

/// Computes the global transforms of the nodes of a bank, one for each.
DERMIS_CORE_API void sampleNodes(const PackedClips& clips, const PackedLayers& layers,
                                 std::span<Affine<float>> globals);

/// Samples the morph weights of a node of the bank: `node.count` of them.
DERMIS_CORE_API void sampleWeights(const PackedClips& clips, const PackedLayers& layers,
                                   const BankMorphed& node, std::span<float> weights);

/// Samples a track of three numbers, which are 0 at rest. `track`: its place in those of the clip.
std::array<float, 4> sampleVector(const ClipBank& bank, const BankClip& clip, std::size_t track,
                                  float time);

/// Computes the pose of a skin from the transforms of the nodes.
DERMIS_CORE_API void poseSkin(const PackedClips& clips, std::uint32_t skin,
                              std::span<const Affine<float>> globals, std::span<JointMatrix> pose);

}  // namespace dermis
