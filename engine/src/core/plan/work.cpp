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
  }
  figures.clear();
  poseCount = 0;
  clearedResults.clear();
  instances.clear();
  culled.clear();
  groups.clear();
}

void Work::addFigure(const Figures& figure, const abi::FigureRecord& record) {
  // Mostly that of the figure before.
  auto entry = std::ranges::find_if(figures, [&](const Figures& other) {
    return other.clips == figure.clips && other.poseBuffer == figure.poseBuffer;
  });
  if (entry == figures.end())
    entry = figures.insert(figures.end(),
                           {figure.clips, figure.bank, figure.kernelWords, figure.poseBuffer, {}});
  entry->records.push_back(record);
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
