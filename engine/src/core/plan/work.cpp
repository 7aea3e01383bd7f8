#include "plan/work.h"

#include <algorithm>
#include <tuple>

namespace dermis {
namespace {

auto dispatchOf(const GroupKey& key) {
  return std::tie(key.isCulled, key.windows, key.pipeline);
}

}  // namespace

void assignActive(std::span<const MorphWeight> morphs, std::vector<MorphWeight>& active) {
  active.assign(morphs.begin(), morphs.end());
  std::erase_if(active, [](const MorphWeight& morph) { return morph.weight == 0; });
  std::ranges::sort(active, {}, &MorphWeight::target);
}

void Work::begin(Groups& groupsInUse) {
  groups_ = &groupsInUse;
  ++number_;
  for (Poses& lists : poses) {
    for (auto& ofForm : lists.records) {
      for (std::vector<abi::PaletteRecord>& records : ofForm) records.clear();
    }
    for (auto& ofForm : lists.driven) {
      for (std::vector<abi::DrivenRecord>& records : ofForm) records.clear();
    }
  }
  banks.clear();
  rigs.clear();
  for (std::vector<abi::FigureRecord>& records : figures) records.clear();
  figurePlaces.clear();
  poseCount = 0;
  clearedResults.clear();
  instances.clear();
  culled.clear();
  morphLists.clear();
  groups.clear();
}

void Work::addFigure(std::uint32_t poseBuffer, const Bank& bank, abi::FigureRecord record) {
  // Mostly that of the figure before.
  if (banks.empty() || banks.back().clips != bank.clips) {
    const auto known = std::ranges::find(banks, bank.clips, &Bank::clips);
    if (known == banks.end()) {
      banks.push_back(bank);
    } else {
      record.bank = static_cast<std::uint32_t>(known - banks.begin());
    }
  }
  if (record.bank == notUsed) record.bank = static_cast<std::uint32_t>(banks.size() - 1);
  while (figures.size() <= poseBuffer) figures.emplace_back();
  figurePlaces.push_back({poseBuffer, static_cast<std::uint32_t>(figures[poseBuffer].size())});
  figures[poseBuffer].push_back(record);
}

void Work::addRig(std::uint32_t words, const PoseSource& source, const abi::RigRecord& record,
                  std::uint32_t figure) {
  const auto isOf = [&](const Rig& rig) {
    return rig.words == words && rig.buffer == source.buffer &&
           rig.drivenBuffer == source.drivenBuffer;
  };
  // Mostly that of the pose before.
  auto rig =
      !rigs.empty() && isOf(rigs.back()) ? std::prev(rigs.end()) : std::ranges::find_if(rigs, isOf);
  if (rig == rigs.end()) {
    rigs.push_back({words, source.buffer, source.drivenBuffer, source.role, {}, {}});
    rig = std::prev(rigs.end());
  }
  rig->poses.push_back(record);
  rig->figures.push_back(figure);
}

void Work::startGroup(Groups::Entry& entry) {
  entry.plan = number_;
  entry.planGroup = static_cast<std::uint32_t>(groups.size());
  groups.push_back(entry.group);
}

bool Work::shareDispatch(std::uint32_t group, std::uint32_t other) const {
  return dispatchOf(groups[group].key) == dispatchOf(groups[other].key);
}

void Work::arrange() {
  order.resize(groups.size());
  for (std::uint32_t index = 0; index < order.size(); ++index) order[index] = index;
  // Stable. std::stable_sort would allocate.
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return std::tuple_cat(dispatchOf(groups[a].key), std::tie(a)) <
           std::tuple_cat(dispatchOf(groups[b].key), std::tie(b));
  });
  std::uint32_t first = 0;
  for (const std::uint32_t index : order) {
    groups[index].firstInstance = first;
    first += groups[index].instances;
  }
}

}  // namespace dermis
