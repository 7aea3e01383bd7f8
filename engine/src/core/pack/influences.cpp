#include "pack/influences.h"

#include <algorithm>
#include <cmath>

#include "attribute.h"
#include "strict_floating_point.h"

namespace dermis {

void gatherInfluences(const MeshView& mesh, std::uint32_t vertex,
                      std::vector<PackedInfluence>& influences) {
  influences.clear();
  for (const InfluenceSet& set : mesh.influenceSets) {
    for (std::uint32_t slot = 0; slot < set.weights.components; ++slot) {
      const double weight = loadWeight(set.weights, vertex, slot);
      if (weight != 0) influences.push_back({loadJoint(set.joints, vertex, slot), weight});
    }
  }
}

void mergeJoints(std::vector<PackedInfluence>& influences) {
  // Also by weight: the order in which duplicates are added must not depend on their slots.
  std::sort(influences.begin(), influences.end(),
            [](const PackedInfluence& a, const PackedInfluence& b) {
              return a.joint != b.joint ? a.joint < b.joint : a.weight < b.weight;
            });
  std::size_t kept = 0;
  for (const PackedInfluence& influence : influences) {
    if (kept > 0 && influences[kept - 1].joint == influence.joint) {
      influences[kept - 1].weight += influence.weight;
    } else {
      influences[kept++] = influence;
    }
  }
  influences.resize(kept);
}

namespace {

/// The nearest float32 that also is a multiple of 2^-48: sums of such weights are exact in double.
double quantize(double weight) {
  const double rounded = static_cast<double>(static_cast<float>(weight));
  return std::max(0.0, std::nearbyint(rounded * 0x1p48) * 0x1p-48);
}

double missing(const std::vector<PackedInfluence>& influences) {
  double sum = 0;
  for (const PackedInfluence& influence : influences) sum += influence.weight;
  return 1 - sum;
}

/// Divides by the sum and rounds so that the sum is exactly 1: linear blending then does not scale
/// the mesh. The remainder of rounding is distributed from the strongest to the weakest weight. The
/// steps of float32 become finer there, and the remainder is a multiple of them, so nothing is left
/// in the end.
void normalize(std::vector<PackedInfluence>& influences) {
  double sum = 0;
  for (const PackedInfluence& influence : influences) sum += influence.weight;
  for (PackedInfluence& influence : influences) influence.weight /= sum;
  for (PackedInfluence& influence : influences) influence.weight = quantize(influence.weight);
  double left = missing(influences);
  for (PackedInfluence& influence : influences) {
    if (left == 0) break;
    const double adjusted = quantize(influence.weight + left);
    left -= adjusted - influence.weight;
    influence.weight = adjusted;
  }
  std::erase_if(influences, [](const PackedInfluence& influence) { return influence.weight == 0; });
}

}  // namespace

void packInfluences(const MeshView& mesh, std::uint32_t vertex,
                    std::vector<PackedInfluence>& influences) {
  gatherInfluences(mesh, vertex, influences);
  mergeJoints(influences);
  std::sort(influences.begin(), influences.end(),
            [](const PackedInfluence& a, const PackedInfluence& b) {
              return a.weight != b.weight ? a.weight > b.weight : a.joint < b.joint;
            });
  if (!influences.empty()) normalize(influences);
}

}  // namespace dermis
