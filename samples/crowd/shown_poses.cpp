#include "shown_poses.h"

#include <algorithm>

using namespace dermis;

namespace crowd {

void ShownPoses::follow(const Crowd& crowd, std::uint64_t frame) {
  markSkinned(crowd);
  const std::span<const CrowdFigure> figures = crowd.figures();
  entries_.resize(figures.size() * parts_);
  for (std::size_t figure = 0; figure < figures.size(); ++figure) {
    for (std::size_t part = 0; part < parts_; ++part) {
      Entry& entry = entries_[figure * parts_ + part];
      const InstanceHandle handle =
          figures[figure].isThere() ? figures[figure].instances[part] : InstanceHandle{};
      if (entry.handle != handle) {
        entry = {};
        entry.handle = handle;
      }
      if (handle) followInstance(crowd, figures[figure].now, entry, frame);
    }
  }
}

void ShownPoses::markSkinned(const Crowd& crowd) {
  std::ranges::fill(skinned_, std::uint8_t{0});
  for (const InstanceHandle handle : crowd.system().skinnedInstances()) {
    if (skinned_.size() <= handle.index) skinned_.resize(handle.index + 1);
    skinned_[handle.index] = 1;
  }
}

void ShownPoses::followInstance(const Crowd& crowd, const FigureFrame& now, Entry& entry,
                                std::uint64_t frame) {
  ++counts_.instances;
  if (now.updateInterval != entry.interval) {
    entry.interval = now.updateInterval;
    entry.intervalSince = frame;
  }
  entry.restarts |= now.teleports;
  if (!now.isInView) {
    entry.isDisplayed = false;
    ++counts_.outOfView;
    return;
  }
  ++counts_.displayed;
  const bool isKnown = !crowd.isCulledOnGpu();
  const bool wasSkinned =
      isKnown && entry.handle.index < skinned_.size() && skinned_[entry.handle.index] != 0;
  display(now, entry, frame, !isKnown ? Skinned::unknown : wasSkinned ? Skinned::yes : Skinned::no);
}

void ShownPoses::display(const FigureFrame& now, Entry& entry, std::uint64_t frame,
                         Skinned skinned) {
  // After a return to the view or a jump, previous positions are the current ones.
  const bool restarts = entry.restarts || !entry.isDisplayed;
  const auto mayRest = [&](const ShownPose& pose) {
    // In each complete interval there is a frame in which it is skinned.
    return !entry.restarts && std::min(frame - pose.since, frame - entry.intervalSince + 1) <
                                  std::uint64_t{entry.interval};
  };
  std::vector<ShownPose> poses;
  const auto add = [&poses](const ShownPose& pose) {
    if (std::ranges::find(poses, pose) == poses.end()) poses.push_back(pose);
  };
  for (const ShownPose& pose : entry.poses) {
    if (skinned != Skinned::no) add({now.pose, restarts ? now.pose : pose.current, frame});
    if (skinned != Skinned::yes && mayRest(pose)) add({pose.current, pose.current, pose.since});
  }
  if (entry.poses.empty() && skinned != Skinned::no) add({now.pose, now.pose, frame});
  if (poses.empty()) {
    ++overdue_;
    for (const ShownPose& pose : entry.poses) add({pose.current, pose.current, pose.since});
  }
  if (skinned != Skinned::no) entry.restarts = false;
  entry.isDisplayed = true;
  entry.poses = std::move(poses);
}

std::vector<ShownInstance> ShownPoses::displayed() const {
  std::vector<ShownInstance> displayed;
  for (std::size_t index = 0; index < entries_.size(); ++index) {
    const Entry& entry = entries_[index];
    if (!entry.handle || !entry.isDisplayed) continue;
    displayed.push_back({entry.handle, static_cast<std::uint32_t>(index % parts_), entry.poses});
  }
  return displayed;
}

}  // namespace crowd
