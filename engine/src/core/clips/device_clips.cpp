#include "clips/device_clips.h"

#include <algorithm>
#include <cstddef>
#include <cstring>

#include "clips/bank.h"

namespace dermis {
namespace {

constexpr std::uint32_t none = 0xffffffffu;

struct Step {
  std::uint32_t band;
  abi::StepRecord record;
};

/// The nodes of a bank, and the global transforms that its bands store.
class Chains {
 public:
  explicit Chains(const ClipBank& bank)
      : bank_(bank),
        depths_(bank.header.nodeCount),
        globals_(bank.header.nodeCount, none),
        matrixCount_(bank.header.nodeCount) {
    for (std::uint32_t node = 0; node < bank.header.nodeCount; ++node) {
      const std::uint32_t parent = bank.node(node).parent;
      if (parent == noNode) continue;
      depths_[node] = depths_[parent] + 1;
      if (depths_[node] % bandDepth != 0 || globals_[parent] != none) continue;
      globals_[parent] = matrixCount_++;
      stored_.push_back(parent);
    }
  }

  std::uint32_t matrixCount() const { return matrixCount_; }
  const std::vector<std::uint32_t>& stored() const { return stored_; }  ///< nodes
  std::uint32_t global(std::uint32_t node) const { return globals_[node]; }

  /// Of a node, or of none.
  Step step(std::uint32_t node, std::uint32_t matrix, std::uint32_t place) const {
    Step step{node == noNode ? 0 : depths_[node] / bandDepth, {matrix, place, 0, {}}};
    std::uint32_t& length = step.record.chainLength;
    for (; node != noNode; node = bank_.node(node).parent) {
      const bool isOfBand = depths_[node] / bandDepth == step.band;
      step.record.chain[length++] = isOfBand ? node : globals_[node];
      if (!isOfBand) break;
    }
    return step;
  }

 private:
  const ClipBank& bank_;
  std::vector<std::uint32_t> depths_;
  std::vector<std::uint32_t> globals_;  ///< of each node the matrix, or `none`
  std::uint32_t matrixCount_;
  std::vector<std::uint32_t> stored_;
};

}  // namespace

DeviceClips deviceClips(const PackedClips& clips) {
  const ClipBank bank(clips);
  const Chains chains(bank);
  std::vector<Step> steps;
  for (const std::uint32_t node : chains.stored())
    steps.push_back(chains.step(node, 0, chains.global(node)));
  std::uint32_t place = 0;
  for (std::uint32_t skin = 0; skin < bank.header.skinCount; ++skin) {
    const BankSkin record = bank.skin(skin);
    for (std::uint32_t joint = 0; joint < record.jointCount; ++joint) {
      steps.push_back(chains.step(bank.words[record.nodes + std::size_t{joint}],
                                  record.matrices + 12 * joint, place++));
    }
  }
  // Neighbors in a dispatch take equally long.
  std::ranges::stable_sort(steps, [](const Step& a, const Step& b) {
    return a.band != b.band ? a.band < b.band : a.record.chainLength < b.record.chainLength;
  });
  DeviceClips device;
  device.nodeCount = bank.header.nodeCount;
  device.matrixCount = chains.matrixCount();
  device.words.resize(steps.size() * abi::STEP_WORDS);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    std::memcpy(&device.words[i * abi::STEP_WORDS], &steps[i].record, sizeof(abi::StepRecord));
    device.bandEnds.resize(steps[i].band + std::size_t{1}, static_cast<std::uint32_t>(i));
    device.bandEnds.back() = static_cast<std::uint32_t>(i + 1);
  }
  return device;
}

}  // namespace dermis
