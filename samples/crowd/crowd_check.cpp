#include "crowd_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "dermis/verify/accuracy.h"
#include "frames.h"
#include "in_parallel.h"
#include "kit/barrier.h"

using namespace dermis;

namespace crowd {
namespace {

SkinnedAttribute attributeAt(std::span<const std::byte> bytes, const OutputAttribute& attribute,
                             std::uint32_t vertexCount) {
  return {bytes.data() + attribute.offset, vertexCount, attribute.stride, attribute.format};
}

}  // namespace

Result<std::vector<CrowdCheck::Instance>> CrowdCheck::displayedBy(const Crowd& crowd,
                                                                  const ShownPoses& shown) const {
  std::vector<Instance> instances;
  for (ShownInstance& each : shown.displayed()) {
    const Result<InstanceOutput> output = crowd.system().output(each.handle);
    if (!output) return output.error();
    instances.push_back({std::move(each), *output});
  }
  return instances;
}

Result<samples::MappedBuffer> CrowdCheck::readBackBuffer(std::uint64_t size) {
  for (auto buffer = unused_.begin(); buffer != unused_.end(); ++buffer) {
    if (buffer->bytes().size() < size) continue;
    samples::MappedBuffer found = std::move(*buffer);
    unused_.erase(buffer);
    return found;
  }
  return samples::MappedBuffer::create(*device_, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
}

Result<void> CrowdCheck::capture(const Crowd& crowd, const ShownPoses& shown, std::uint64_t frame,
                                 VkCommandBuffer commandBuffer) {
  Result<std::vector<Instance>> instances = displayedBy(crowd, shown);
  if (!instances) return instances.error();
  std::uint64_t size = 0;
  for (const Instance& instance : *instances)
    size = std::max(size, instance.output.offset + instance.output.size);
  if (size == 0) return {};
  Result<samples::MappedBuffer> buffer = readBackBuffer(size);
  if (!buffer) return buffer.error();
  const VkBufferCopy region{0, 0, size};
  device_->functions().CmdCopyBuffer(commandBuffer, crowd.system().onDevice()->outputBuffer(),
                                     buffer->handle(), 1, &region);
  const vulkan::Dependency toHost{{VK_PIPELINE_STAGE_TRANSFER_BIT, VK_ACCESS_TRANSFER_WRITE_BIT},
                                  {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT}};
  recordBarrier(*device_, commandBuffer, toHost);
  captures_.push_back({frame, std::move(*instances), std::move(*buffer), {}});
  return {};
}

Result<void> CrowdCheck::captureOnCpu(const Crowd& crowd, const ShownPoses& shown,
                                      std::uint64_t frame) {
  Result<std::vector<Instance>> instances = displayedBy(crowd, shown);
  if (!instances) return instances.error();
  const std::span<const std::byte> bytes = crowd.system().onCpu()->outputBytes();
  captures_.push_back({frame, std::move(*instances), {}, {bytes.begin(), bytes.end()}});
  return {};
}

Result<void> CrowdCheck::compareUpTo(std::uint64_t completedFrame) {
  while (!captures_.empty() && captures_.front().frame <= completedFrame) {
    Capture capture = std::move(captures_.front());
    captures_.pop_front();
    if (Result<void> prepared = prepareReferences(capture); !prepared) return prepared;
    std::vector<MeshFinding> findings(capture.instances.size());
    inParallel(findings.size(), [&](std::size_t index) {
      findings[index] = check(capture, capture.instances[index]);
    });
    for (std::size_t index = 0; index < findings.size(); ++index) {
      if (!findings[index].done) return findings[index].done;
      count(capture, capture.instances[index], findings[index]);
    }
    ++totals_.frames;
    if (capture.onCpu.empty()) unused_.push_back(std::move(capture.output));
  }
  return {};
}

Result<void> CrowdCheck::prepareReferences(const Capture& capture) {
  std::vector<ReferenceKey> keys;
  for (const Instance& instance : capture.instances) {
    for (const ShownPose& pose : instance.shown.poses) {
      keys.push_back({instance.shown.part, pose.current});
      keys.push_back({instance.shown.part, pose.previous});
    }
  }
  return references_.prepare(keys);
}

/// Sum of the distances of some positions of an attribute from those of a pose.
double CrowdCheck::distanceFrom(PoseKey pose, std::uint32_t part, const Capture& capture,
                                const OutputAttribute& attribute) const {
  constexpr std::size_t samples = 16;
  const std::vector<reference::Double3>& expected = references_.of({part, pose}).positions;
  const std::byte* first = capture.bytes().data() + attribute.offset;
  double sum = 0;
  for (std::size_t sample = 0; sample < samples; ++sample) {
    const std::size_t vertex = sample * expected.size() / samples;
    const std::array<double, 3> actual =
        decodePosition(attribute.format, first + vertex * attribute.stride, {});
    for (std::size_t axis = 0; axis < 3; ++axis)
      sum += std::abs(actual[axis] - expected[vertex][axis]);
  }
  return sum;
}

/// The poses that the output may show, the most likely first.
std::vector<ShownPose> CrowdCheck::byLikelihood(const Capture& capture,
                                                const Instance& instance) const {
  if (instance.shown.poses.size() < 2) return instance.shown.poses;
  std::vector<std::pair<double, ShownPose>> ranked;
  for (const ShownPose& pose : instance.shown.poses) {
    const std::uint32_t part = instance.shown.part;
    const double distance =
        distanceFrom(pose.current, part, capture, instance.output.positions) +
        distanceFrom(pose.previous, part, capture, instance.output.previousPositions);
    // A NaN is never a likely pose.
    ranked.emplace_back(std::isnan(distance) ? HUGE_VAL : distance, pose);
  }
  std::ranges::stable_sort(ranked, {}, &std::pair<double, ShownPose>::first);
  std::vector<ShownPose> poses;
  poses.reserve(ranked.size());
  for (const auto& [distance, pose] : ranked) poses.push_back(pose);
  return poses;
}

/// Checks whether the output shows one of the possible poses, with all vertices in the same pose.
CrowdCheck::MeshFinding CrowdCheck::check(const Capture& capture, const Instance& instance) const {
  MeshFinding likeliest;
  bool isFirst = true;
  for (const ShownPose& pose : byLikelihood(capture, instance)) {
    MeshFinding finding = checkPose(capture, instance, pose);
    if (!finding.done || finding.passed) return finding;
    if (std::exchange(isFirst, false)) likeliest = std::move(finding);
  }
  return likeliest;
}

CrowdCheck::MeshFinding CrowdCheck::checkPose(const Capture& capture, const Instance& instance,
                                              const ShownPose& pose) const {
  const InstanceOutput& output = instance.output;
  const std::uint32_t vertexCount = character_->parts()[instance.shown.part].packed.vertexCount();
  const std::span<const std::byte> bytes = capture.bytes();
  SkinnedView current, previous;
  current.positions = attributeAt(bytes, output.positions, vertexCount);
  if (output.normals.format != VertexFormat::none)
    current.normals = attributeAt(bytes, output.normals, vertexCount);
  previous.positions = attributeAt(bytes, output.previousPositions, vertexCount);

  MeshFinding finding;
  finding.passed = true;
  for (const auto& [view, key] : {std::pair{&current, pose.current}, {&previous, pose.previous}}) {
    const Result<Comparison> comparison =
        compareWithReference(references_.of({instance.shown.part, key}), *view);
    if (!comparison) {
      finding.done = comparison.error();
      return finding;
    }
    if (finding.passed && !comparison->passed()) finding.firstFailure = comparison->firstFailure;
    finding.passed &= comparison->passed();
    if (view == &current) finding.compared = comparison->compared;
    finding.worst = std::max({finding.worst, comparison->worstPosition, comparison->worstNormal});
    if (!finding.passed) break;
  }
  return finding;
}

void CrowdCheck::count(const Capture& capture, const Instance& instance,
                       const MeshFinding& finding) {
  ++totals_.instances;
  totals_.vertices += finding.compared;
  if (finding.passed) {
    totals_.worst = std::max(totals_.worst, finding.worst);
    return;
  }
  if (totals_.failures++ != 0) return;
  totals_.firstFailure = fmt::format(
      "frame {}, instance {} of generation {}, part {}: vertex {} is the first outside its bound; "
      "the largest error is {:.3g} times its bound",
      capture.frame, instance.shown.handle.index, instance.shown.handle.generation,
      instance.shown.part, finding.firstFailure, finding.worst);
}

}  // namespace crowd
