// What the sampling of a bank of clips reads beside its words, prepared once.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "clips/bank.h"
#include "clips/sample.h"
#include "cpu/task.h"
#include "dermis/clips.h"

namespace dermis::cpu {

/// As many nodes as the widest vectors hold are sampled at a time.
inline constexpr std::size_t nodesTogether = 8;

/// Sizes of keys, those of vectors before those of rotations.
inline constexpr std::size_t keyFormats = 6;

/// Local transforms of all nodes, as the sampling writes them. Each coordinate of translations, and
/// each factor of scales, has `padded` numbers, one for each node. Four numbers for the rotation of
/// each node follow.
struct PlanLocals {
  std::size_t padded = 0;  ///< the number of nodes, as a multiple of `nodesTogether`

  std::size_t translations() const { return 0; }
  std::size_t scales() const { return 3 * padded; }
  std::size_t rotations() const { return 6 * padded; }
  std::size_t size() const { return 10 * padded; }
};

struct PlanTrack {
  /// In bytes, from the beginning of a row to 8 bytes that end with the key. They may begin before
  /// the row, but not before the bank.
  std::int32_t key;
  std::uint32_t keyClass;  ///< of the clip
  std::uint32_t place;     ///< of its first number, in the locals
  std::uint32_t range;     ///< of vectors: word of the bank
};

/// A track of which a row may have a jump.
struct PlanJumps {
  std::uint32_t track;  ///< of those with the same format
  std::uint32_t keyClass;
  std::size_t jumps, rowBytes;  ///< the byte of its first interval, from the beginning of the bank
};

struct PlanClass {
  const std::byte* keys;
  std::size_t rowBytes;
  float scale;  ///< from the finest intervals to its own
  float last;   ///< number of the last interval
};

/// The tracks of one clip with one size of keys.
struct PlanTracks {
  std::vector<PlanTrack> tracks;
  std::vector<PlanJumps> jumps;
};

struct PlanClip {
  float rate = 0;
  bool isAdditive = false;
  std::vector<PlanClass> classes;
  std::array<PlanTracks, keyFormats> tracks;
  std::vector<CacheLine> base;  ///< locals without animated tracks
};

/// A node, whose parent comes before it.
struct PlanNode {
  std::uint32_t parent;  ///< or `noNode`
  std::uint32_t fixed;   ///< word of the matrix between the parent and the node; 0: none
};

struct PlanSkin {
  std::uint32_t jointCount, nodes, matrices;  ///< as in `BankSkin`
};

/// Of a bank, which must live as long and may not change.
struct ClipPlan {
  explicit ClipPlan(const PackedClips& clips);

  const PackedClips* bank;
  std::span<const std::uint32_t> words;  ///< of the bank
  std::size_t nodeCount = 0;
  PlanLocals locals;
  std::size_t mostClasses = 0;  ///< of a clip
  std::array<std::size_t, keyFormats> mostTracks{};
  std::vector<CacheLine> rest;
  std::vector<PlanClip> clips;
  std::vector<PlanNode> nodes;
  std::vector<PlanSkin> skins;
  std::vector<CacheLine> masks;  ///< `padded` factors for each mask, and ones for mask 0
};

/// Where the clip of a layer is read.
struct ClassTime {
  const std::byte *from, *to;  ///< rows
  float fraction;
  std::uint32_t row;
};

/// Tracks with one size of keys, of all layers.
struct KeyBatch {
  std::size_t count = 0;
  std::vector<std::uint64_t> from, to;
  std::vector<float> fractions;
  std::vector<float*> places;
  std::vector<const float*> ranges;
};

/// Memory of a thread that samples figures.
struct ClipScratch {
  std::vector<ClassTime> times;
  std::array<KeyBatch, keyFormats> batches;
  std::vector<CacheLine> locals;     ///< of each layer, and a place for what is not needed
  std::vector<CacheLine> matrices;   ///< of nodes: 3×4
  std::vector<Affine<float>> nodes;  ///< the same, for `samplePlainly`

  /// Makes room for figures of a bank.
  void prepare(const ClipPlan& plan);
};

/// Samples the poses of all skins into `poses`, with the bits of `samplePose`. `scratch` was
/// prepared for the bank. Uses the instruction set that `dispatchTask` uses.
void dispatchSampling(const ClipPlan& plan, const PackedLayers& layers, ClipScratch& scratch,
                      std::span<JointMatrix> poses);

/// The same by the code of core. It is faster than SIMD code for plain arrays.
void samplePlainly(const ClipPlan& plan, const PackedLayers& layers, ClipScratch& scratch,
                   std::span<JointMatrix> poses);

}  // namespace dermis::cpu
