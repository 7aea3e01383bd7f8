// Skeletons with clips, their banks, and whether a bank's poses are as near as it says.
#pragma once

#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <random>
#include <span>
#include <string>
#include <vector>

#include "dermis/clips.h"
#include "dermis/gltf.h"
#include "dermis/verify.h"

namespace dermis::test {

using Floats = std::vector<float>;

/// Nodes of `armRig`. Children may come before their parents.
namespace arm {
inline constexpr std::uint32_t hand = 0,  ///< turned; below `upper`
    root = 1,                             ///< at rest; it has no parent
    upper = 2,                            ///< turned and scaled; below `shoulder`
    body = 3,                             ///< moved and turned; below `root`
    prop = 4,                             ///< at rest, with a matrix that has shear; below `hand`
    shoulder = 5,                         ///< at rest, with a matrix that has shear; below `collar`
    collar = 6,                           ///< at rest; below `body`
    stand = 7;                            ///< at rest; it has no parent
inline constexpr std::uint32_t nodeCount = 8;
}  // namespace arm

/// A rig with the clips "wave", of 1.25 s, and "reach", of 0.8 s. Both move three of the nodes: by
/// LINEAR and CUBICSPLINE keys that are not at equal distances. Skin 0 has joints at rest and moved
/// ones. All joints of skin 1 are at rest.
gltf::Model armRig();

/// One channel. `values` has 3 or 4 numbers for each key.
gltf::Channel channel(std::uint32_t node, ChannelPath path, Floats times, Floats values,
                      Interpolation interpolation = Interpolation::linear);

/// Samples the pose of a skin from one bank.
using ClipSampler =
    std::function<std::vector<JointMatrix>(std::span<const ClipLayer> layers, std::uint32_t skin)>;
/// How rigs sample from now on. If it is empty: `samplePose`.
void setClipSampler(std::function<ClipSampler(const PackedClips& clips)> make);

/// A model, its skeleton and clips as they are packed, and their bank. What `packClips` gets may be
/// changed before `pack`.
class PackedRig {
 public:
  explicit PackedRig(gltf::Model from);
  PackedRig(const PackedRig&) = delete;
  PackedRig& operator=(const PackedRig&) = delete;

  Result<PackedClips> tryToPack();
  /// Packs, and checks the report. The test fails if that is impossible.
  bool pack();

  /// The pose in float32.
  std::vector<JointMatrix> sample(std::span<const ClipLayer> layers, std::uint32_t skin = 0) const;
  std::vector<JointMatrix> sample(const ClipLayer& layer, std::uint32_t skin = 0) const {
    return sample(std::span(&layer, 1), skin);
  }
  /// What the reference has of the source instead, with bounds.
  Result<reference::SampledPose> expected(std::span<const ClipLayer> layers,
                                          std::uint32_t skin) const;
  /// Checks the poses of up to four skins, in turn, against the reference and its bounds. Returns
  /// the largest error divided by its bound.
  double check(std::span<const ClipLayer> layers) const;
  double check(const ClipLayer& layer) const { return check(std::span(&layer, 1)); }
  /// The same for the morph weights of all nodes.
  double checkWeights(std::span<const ClipLayer> layers) const;
  /// Whether the bank may jump a little earlier or later than the clip does at this time.
  bool isNearJump(const ClipLayer& layer) const;

  /// The diagonal of the box around the nodes at rest; 1 if it is 0.
  double extent() const { return extent_; }

  const gltf::Model model;
  Skeleton skeleton;
  std::vector<ClipView> clips;
  std::vector<Floats> masks;
  PackClipsOptions options;  ///< `masks` are those above
  PackClipsReport report;
  std::optional<PackedClips> bank;

 private:
  ClipSampler sampler_;
  double checkSkin(std::span<const ClipLayer> layers, std::uint32_t skin) const;

  std::vector<std::span<const float>> maskSpans() const;
  double extent_ = 1;
  mutable std::size_t checkedSkins_ = 0;
};

/// Up to four random layers, additive ones and masks among them, that are not near a jump. The rig
/// must have clips.
std::vector<ClipLayer> randomLayers(const PackedRig& rig, std::mt19937& random);

/// Calls with each model that has skins and clips, and its number: those of the samples, and of the
/// test data if there are any. At most `maxClips` of its clips are kept.
void forEachAnimatedModel(std::uint32_t maxClips,
                          const std::function<void(gltf::Model, std::uint32_t)>& call);

/// The same with each model in which clips animate morph weights. One without skins gets one.
void forEachMorphedModel(std::uint32_t maxClips,
                         const std::function<void(gltf::Model, std::uint32_t)>& call);

/// The most memory that this process has used so far. 0 where that is unknown.
std::uint64_t peakKilobytes();

/// Whether two poses are the same bits.
bool areSame(std::span<const JointMatrix> a, std::span<const JointMatrix> b);

}  // namespace dermis::test
