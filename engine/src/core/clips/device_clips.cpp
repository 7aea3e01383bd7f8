#include "clips/device_clips.h"

#include <algorithm>
#include <cstddef>

#include "abi.h"
#include "clips/bank.h"

namespace dermis {
namespace {

constexpr std::uint32_t none = 0xffffffffu;

struct Step {
  std::uint32_t band;
  abi::StepRecord record;
};

}  // namespace

DeviceClips deviceClips(const PackedClips& clips) {
  const ClipBank bank(clips);
  DeviceClips device;
  device.nodeCount = device.matrixCount = bank.header.nodeCount;
  std::vector<std::uint32_t> depths(device.nodeCount), globals(device.nodeCount, none);
  std::vector<Step> steps;
  for (std::uint32_t node = 0; node < device.nodeCount; ++node) {
    const std::uint32_t parent = bank.node(node).parent;
    std::uint32_t above = abi::CLIP_ROOT;
    if (parent != noNode) {
      depths[node] = depths[parent] + 1;
      above = parent;
      if (depths[node] % bandDepth == 0) {
        std::uint32_t& global = globals[parent];
        if (global == none) {
          global = device.matrixCount++;
          steps.push_back({depths[parent] / bandDepth, {parent, 0, global, 0}});
        }
        above = global | abi::CLIP_GLOBAL;
      }
    }
    device.words.push_back(above);
  }
  std::uint32_t place = 0;
  for (std::uint32_t skin = 0; skin < bank.header.skinCount; ++skin) {
    const BankSkin record = bank.skin(skin);
    for (std::uint32_t joint = 0; joint < record.jointCount; ++joint) {
      const std::uint32_t node = bank.words[record.nodes + std::size_t{joint}];
      const std::uint32_t band = node == noNode ? 0 : depths[node] / bandDepth;
      steps.push_back(
          {band,
           {node == noNode ? abi::CLIP_ROOT : node, record.matrices + 12 * joint, place++, 0}});
    }
  }
  std::ranges::stable_sort(steps, {}, &Step::band);
  device.words.resize((device.words.size() + 3) / 4 * 4);
  device.firstStep = static_cast<std::uint32_t>(device.words.size());
  for (std::size_t i = 0; i < steps.size(); ++i) {
    const abi::StepRecord& step = steps[i].record;
    device.words.insert(device.words.end(), {step.node, step.matrix, step.place, 0u});
    device.bandEnds.resize(steps[i].band + std::size_t{1}, static_cast<std::uint32_t>(i));
    device.bandEnds.back() = static_cast<std::uint32_t>(i + 1);
  }
  return device;
}

}  // namespace dermis
