#include "crowd_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "kit/clip_check.h"
#include "kit/in_parallel.h"
#include "kit/program.h"

namespace crowd {

using namespace dermis;
using namespace dermis::samples;

void CrowdCheck::follow(std::uint64_t frame, std::span<const AskedInstance> instances,
                        std::span<const InstanceHandle> skinned, bool culledOnGpu) {
  std::set<std::uint32_t> skinnedIndices;
  for (const InstanceHandle handle : skinned) skinnedIndices.insert(handle.index);
  frame_ = frame;
  for (const AskedInstance& asked : instances) {
    if (followed_.size() <= asked.handle.index) followed_.resize(asked.handle.index + 1);
    Followed& followed = followed_[asked.handle.index];
    if (followed.handle != asked.handle) {
      followed = {};
      followed.handle = asked.handle;
      followed.part = asked.part;
    }
    const bool isSkinned = skinnedIndices.contains(asked.handle.index);
    follow(followed, asked, culledOnGpu || isSkinned, culledOnGpu || !isSkinned);
  }
}

void CrowdCheck::follow(Followed& followed, const AskedInstance& asked, bool maySkin,
                        bool mayRest) {
  followed.frame = frame_;
  if (asked.updateInterval != followed.interval) {
    followed.interval = asked.updateInterval;
    followed.intervalSince = frame_;
  }
  followed.restarts |= asked.teleports;
  const bool wasVisible = std::exchange(followed.isVisible, asked.isVisible);
  if (!asked.isVisible) return;

  // After a return to the view or a jump, previous positions are the current ones.
  const bool restartsMotion = followed.restarts || !wasVisible;
  std::vector<Skinned> possible;
  const auto add = [&possible](const Playing& current, const Playing& previous,
                               std::uint64_t frame) {
    const Skinned skinned{{current, previous}, frame};
    if (std::ranges::find(possible, skinned) == possible.end()) possible.push_back(skinned);
  };
  if (followed.skinned.empty() && maySkin) add(asked.playing, asked.playing, frame_);
  for (const Skinned& last : followed.skinned) {
    const Playing shown = last.pose.current;
    if (maySkin) add(asked.playing, restartsMotion ? asked.playing : shown, frame_);
    // In each complete interval there is a frame in which it is skinned.
    const std::uint64_t rested = std::min(frame_ - last.frame, frame_ - followed.intervalSince + 1);
    if (mayRest && !followed.restarts && rested < followed.interval) add(shown, shown, last.frame);
  }
  if (possible.empty()) {
    ++overdue_;
    for (const Skinned& last : followed.skinned)
      add(last.pose.current, last.pose.current, last.frame);
  }
  if (maySkin) followed.restarts = false;
  followed.skinned = std::move(possible);
}

std::vector<ShownInstance> CrowdCheck::shown(const Scene& scene) const {
  std::vector<ShownInstance> all;
  for (const Followed& followed : followed_) {
    if (followed.frame != frame_ || !followed.isVisible) continue;
    ShownInstance& instance = all.emplace_back();
    instance.handle = followed.handle;
    instance.part = followed.part;
    instance.output = must(scene.output(followed.handle));
    for (const Skinned& skinned : followed.skinned) instance.poses.push_back(skinned.pose);
  }
  return all;
}

void CrowdCheck::samplePoses(std::span<const ShownInstance> instances) {
  std::set<Playing> missing;
  for (const ShownInstance& instance : instances) {
    for (const ShownPose& shown : instance.poses) {
      for (const Playing& playing : {shown.current, shown.previous}) {
        if (!poses_.contains(playing)) missing.insert(playing);
      }
    }
  }
  if (missing.empty()) return;
  const std::vector<Playing> added(missing.begin(), missing.end());
  std::vector<std::vector<ClipLayer>> plays(added.size());
  for (std::size_t index = 0; index < added.size(); ++index)
    character_->addLayers(added[index], plays[index]);
  Poses sampled = must(target_->samplePoses(*bank_, plays));

  const std::size_t skins = bank_->skinCount();
  const Skeleton skeleton = character_->skeleton();
  const std::vector<ClipView> clips = gltf::clips(character_->model());
  std::vector<double> worst(sampled.size());
  inParallel(sampled.size(), [&](std::size_t index) {
    const auto skin = static_cast<std::uint32_t>(index % skins);
    const reference::SampledPose exact =
        must(reference::samplePose(skeleton, clips, {}, plays[index / skins], skin, bank_));
    worst[index] = comparePose(sampled[index], exact, skeleton.skins[skin]).worstPosition;
  });
  for (std::size_t index = 0; index < sampled.size(); ++index) {
    totals_.worstPose = std::max(totals_.worstPose, worst[index]);
    poses_[added[index / skins]].push_back(std::move(sampled[index]));
  }
  totals_.poses += sampled.size();
}

const reference::SkinnedMesh& CrowdCheck::expected(std::uint32_t part, const Playing& playing) {
  Expected* kept = nullptr;
  {
    const std::lock_guard lock(mutex_);
    kept = &expected_[{part, playing}];
  }
  std::call_once(kept->once, [&] {
    const Part& source = character_->parts()[part];
    kept->mesh =
        must(reference::skin(source.primitive.mesh(), poses_.at(playing)[source.skin], method_));
  });
  return *kept->mesh;
}

CrowdCheck::Finding CrowdCheck::check(const ShownInstance& instance, const ShownPose& pose,
                                      std::span<const std::byte> bytes) {
  const auto attribute = [&](const OutputAttribute& output) -> SkinnedAttribute {
    if (output.format == VertexFormat::none) return {};
    const std::uint32_t vertexCount = character_->parts()[instance.part].packed.vertexCount();
    return {bytes.data() + output.offset, vertexCount, output.stride, output.format};
  };
  SkinnedView current, previous;
  current.positions = attribute(instance.output.places[Stream::positions]);
  current.normals = attribute(instance.output.places[Stream::normals]);
  previous.positions = attribute(instance.output.places[Stream::previousPositions]);
  const reference::SkinnedMesh& now = expected(instance.part, pose.current);
  const reference::SkinnedMesh& before = expected(instance.part, pose.previous);
  Finding finding;
  for (const auto& [mesh, view] : {std::pair{&now, &current}, {&before, &previous}}) {
    const Comparison comparison = must(compareWithReference(*mesh, *view));
    if (view == &current) finding.compared = comparison.compared;
    if (finding.failures == 0) finding.firstFailure = comparison.firstFailure;
    // A vertex without a bound fails the comparison, and is not among its failures.
    finding.failures += std::max<std::uint64_t>(comparison.failures, comparison.passed() ? 0 : 1);
    finding.worst = std::max({finding.worst, comparison.worstPosition, comparison.worstNormal});
    if (finding.failures != 0) break;
  }
  return finding;
}

/// Returns the finding for the pose that it shows, or else for the one with the fewest failures.
CrowdCheck::Finding CrowdCheck::check(const ShownInstance& instance,
                                      std::span<const std::byte> bytes) {
  std::optional<Finding> best;
  for (const ShownPose& pose : instance.poses) {
    const Finding finding = check(instance, pose, bytes);
    if (!best || finding.failures < best->failures) best = finding;
    if (best->failures == 0) break;
  }
  return best.value_or(Finding{.failures = 1});
}

void CrowdCheck::compare(std::uint64_t frame, std::span<const ShownInstance> instances,
                         std::span<const std::byte> bytes) {
  samplePoses(instances);
  std::vector<Finding> findings(instances.size());
  inParallel(instances.size(),
             [&](std::size_t index) { findings[index] = check(instances[index], bytes); });
  // Few figures fade at the same moments.
  std::erase_if(expected_, [](const auto& entry) { return entry.first.second.fades(); });
  std::erase_if(poses_, [](const auto& entry) { return entry.first.fades(); });
  ++totals_.frames;
  totals_.instances += instances.size();
  for (std::size_t index = 0; index < instances.size(); ++index) {
    const Finding& finding = findings[index];
    totals_.vertices += finding.compared;
    if (finding.failures == 0) {
      totals_.worst = std::max(totals_.worst, finding.worst);
      continue;
    }
    if (totals_.failures++ != 0) continue;
    const ShownInstance& instance = instances[index];
    totals_.firstFailure = fmt::format(
        "frame {}, instance {} of generation {}, part {}: vertex {} is the first outside its "
        "bound; the largest error is {:.3g} times its bound",
        frame, instance.handle.index, instance.handle.generation, instance.part,
        finding.firstFailure, finding.worst);
  }
}

std::string CrowdCheck::complaint() const {
  std::string complaint;
  if (totals_.failures != 0) {
    complaint = fmt::format("{} of {} instances are wrong; the first: {}", totals_.failures,
                            totals_.instances, totals_.firstFailure);
  }
  if (totals_.worstPose > 1) {
    complaint += fmt::format("{}a pose is {:.3g} times its bound away from the clips",
                             complaint.empty() ? "" : "; ", totals_.worstPose);
  }
  if (!complaint.empty()) return complaint;
  if (overdue_ != 0)
    return fmt::format("{} times an instance was due but was not skinned", overdue_);
  return {};
}

}  // namespace crowd
