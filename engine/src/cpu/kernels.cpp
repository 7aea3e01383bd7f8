// The SIMD code of all instruction sets, and which of them is used.

// Refinements of AVX-512 (the lowest eight bits) and SSSE3 would change nothing, and vectors of SVE
// have no size.
#ifndef HWY_DISABLED_TARGETS
#define HWY_DISABLED_TARGETS (0xff | HWY_SSSE3 | HWY_SVE | HWY_SVE2 | HWY_SVE_256 | HWY_SVE2_128)
#endif
// What Highway says is broken with GCC before 12.3 (bug 106322) is not used here; tests compare its
// bits.
#ifndef HWY_BROKEN_EMU128
#define HWY_BROKEN_EMU128 0
#endif

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "cpu/kernels.cpp"
#include "hwy/foreach_target.h"
// After foreach_target.h.
#include "hwy/highway.h"

#include <bit>

#include "cpu/general_inl.h"
#include "cpu/plain_inl.h"
#include "cpu/task.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// The part of a job that lies in one section.
struct SectionTask {
  const Task& task;
  const Section& section;
  std::size_t firstRun, runEnd;
  std::uint32_t firstVertex, vertexEnd;  ///< in these runs
};

/// The vertices of a run that a job skins.
inline void clipToRun(const SectionTask& part, const Run& run, std::uint32_t& first,
                      std::uint32_t& end) {
  first = std::max(part.firstVertex, run.firstBlock * blockVertices);
  end = std::min(part.vertexEnd, run.blockEnd * blockVertices);
}

/// Copies positions to the previous positions.
inline void settle(const Job& job, const Instance& instance, std::uint32_t first,
                   std::uint32_t end) {
  auto* const output = static_cast<std::byte*>(instance.output);
  const OutputAttribute &from = job.places.positions, &to = job.places.previousPositions;
  copyLanes(output + to.offset, to.stride, output + from.offset, from.stride,
            formatSize(from.format), first, end);
}

inline void write(const Findings& findings, const Instance& instance) {
  if (instance.result == nullptr) return;
  InstanceResult found;
  found.clampedVertices = findings.clamped;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(findings.least[axis] <= findings.greatest[axis])) continue;
    const auto ordered = [](float value) {
      const auto bits = std::bit_cast<std::uint32_t>(value == 0 ? 0.0f : value);
      return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
    };
    found.orderedMin[axis] = ordered(findings.least[axis]);
    found.orderedMax[axis] = ordered(findings.greatest[axis]);
  }
  addResult(*instance.result, found);
}

inline HWY_ATTR void skinGenerally(const SectionTask& part, const Instance& instance) {
  const Job& job = *part.task.job;
  const MeshData& mesh = *part.task.mesh;
  if (instance.settles && job.places.motion != Motion::none) {
    settle(job, instance, part.firstVertex, part.vertexEnd);
    return;
  }
  Scratch* const scratch = part.task.scratch;
  const Palette palette =
      makePalette(mesh, part.section, job.method, instance.pose, instance.mayScale, scratch[0]);
  Palette previous;
  const bool reskins = job.places.motion == Motion::reskinned && !instance.restartsMotion;
  if (reskins) {
    previous = makePalette(mesh, part.section, job.method, instance.previousPose, instance.mayScale,
                           scratch[1]);
  }
  Findings findings;
  for (std::size_t number = part.firstRun; number < part.runEnd; ++number) {
    const Run& run = mesh.runs[number];
    std::uint32_t first, end;
    clipToRun(part, run, first, end);
    if (first >= end) continue;
    skinGeneral({job, mesh, run, instance, palette, reskins ? &previous : nullptr, first, end},
                findings);
  }
  write(findings, instance);
}

// -- The plain way.

inline bool isPlainJob(const Job& job) {
  const VertexPlaces& places = job.places;
  return (job.method == Method::dualQuaternion || job.method == Method::linear) &&
         places.motion == Motion::none && places.positions.format == VertexFormat::float32x3 &&
         places.normals.format == VertexFormat::float32x3 &&
         places.tangents.format == VertexFormat::none &&
         places.normals.offset == places.positions.offset + 12 && places.positions.stride == 24 &&
         places.normals.stride == 24;
}

inline bool isPlainInstance(const Job& job, const Instance& instance) {
  const auto place =
      reinterpret_cast<std::uintptr_t>(instance.output) + job.places.positions.offset;
  return instance.morphs.empty() && instance.result == nullptr && place % alignof(float) == 0;
}

/// How many instances there are room for at a time.
#if HWY_MAX_BYTES >= 64
inline constexpr std::size_t mostInstances = 4;
#elif HWY_MAX_BYTES >= 32
inline constexpr std::size_t mostInstances = 2;
#else
inline constexpr std::size_t mostInstances = 1;
#endif

/// Instances that are skinned together, and what their poses became.
struct PlainGroup {
  std::size_t count = 0;
  float* outputs[mostInstances] = {};
  std::span<const JointMatrix> poses[mostInstances];
  /// Dual quaternions: of each joint the real parts of all instances, and the dual parts.
  DualQuaternionArray<float> joints{nullptr, mostInstances * 4};
  float* palettes = nullptr;  ///< of those that are skinned next

  DualQuaternionArray<const float> from(std::size_t instance) const {
    return {joints.first + instance * 4, joints.stride, joints.dual};
  }
};

/// Calls `skin` for each run, with the blocks of it that the job has.
template <class Skin>
HWY_INLINE void forRuns(const SectionTask& part, const Skin& skin) {
  const MeshData& mesh = *part.task.mesh;
  for (std::size_t number = part.firstRun; number < part.runEnd; ++number) {
    const Run& run = mesh.runs[number];
    std::uint32_t first, end;
    clipToRun(part, run, first, end);
    if (first < end) skin(PlainTask{mesh, run, first / blockVertices, end / blockVertices});
  }
}

/// By dual quaternions: as many instances as D has blocks.
template <class D>
inline HWY_ATTR void turnGroup(D d, const SectionTask& part, const PlainGroup& group,
                               std::size_t first) {
  constexpr std::size_t blocks = hn::MaxLanes(d) / 4;
  const std::span<const Pair> pairs = pairsOf(*part.task.mesh, part.section);
  const std::size_t dual = pairs.size() * blocks * 4;
  convertPairs(d, pairs, group.from(first), {group.palettes, blocks * 4, dual});
  forRuns(part, [&](const PlainTask& task) HWY_ATTR {
    turnByInfluences(d, task, group.palettes, dual, group.outputs + first);
  });
}
#if HWY_MAX_BYTES >= 32
inline HWY_ATTR void turnOne(const SectionTask& part, const PlainGroup& group, std::size_t first) {
  convertPairs(Four(), pairsOf(*part.task.mesh, part.section), group.from(first), {group.palettes});
  forRuns(part, [&](const PlainTask& task)
                    HWY_ATTR { turnByInfluences(task, group.palettes, group.outputs[first]); });
}
#else
inline HWY_ATTR void turnOne(const SectionTask& part, const PlainGroup& group, std::size_t first) {
  turnGroup(Four(), part, group, first);
}
#endif

/// By matrices.
template <class D>
inline HWY_ATTR void moveGroup(D d, const SectionTask& part, const PlainGroup& group,
                               std::size_t first) {
  constexpr std::size_t blocks = hn::MaxLanes(d) / 4;
  const std::span<const std::uint32_t> joints = jointsOf(*part.task.mesh, part.section);
  const std::size_t rowFloats = joints.size() * blocks * 4;
  for (std::size_t i = 0; i < blocks; ++i) {
    for (std::size_t joint = 0; joint < joints.size(); ++joint) {
      const JointMatrix& matrix =
          joints[joint] == stillJoint ? stillMatrix : group.poses[first + i][joints[joint]];
      float* const to = group.palettes + (joint * blocks + i) * 4;
      for (std::size_t row = 0; row < 3; ++row)
        std::memcpy(to + row * rowFloats, matrix.m[row], sizeof(matrix.m[row]));
    }
  }
  forRuns(part, [&](const PlainTask& task) HWY_ATTR {
    moveByInfluences(d, task, group.palettes, rowFloats, group.outputs + first);
  });
}

inline HWY_ATTR void skinGroup(const SectionTask& part, const PlainGroup& group) {
  const bool moves = part.task.job->method == Method::linear;
  std::size_t first = 0;
#if HWY_MAX_BYTES >= 64
  if (group.count == 4) {
    if (moves) return moveGroup(Sixteen(), part, group, 0);
    return turnGroup(Sixteen(), part, group, 0);
  }
#endif
#if HWY_MAX_BYTES >= 32
  if (group.count >= 2) {
    if (moves) {
      moveGroup(Eight(), part, group, 0);
    } else {
      turnGroup(Eight(), part, group, 0);
    }
    first = 2;
  }
#endif
  if (first == group.count) return;
  if (moves) return moveGroup(Four(), part, group, first);
  turnOne(part, group, first);
}

/// Whole blocks of instances that are plain. Those whose joints scale, or are very large or small,
/// are left to the general way.
inline HWY_ATTR void skinPlainly(const SectionTask& part, std::span<const Instance> instances) {
  const Job& job = *part.task.job;
  const MeshData& mesh = *part.task.mesh;
  Scratch& scratch = part.task.scratch[2];
  const std::span<const std::uint32_t> joints = jointsOf(mesh, part.section);
  const std::size_t pairs = pairsOf(mesh, part.section).size();
  const bool moves = job.method == Method::linear;
  PlainGroup group;
  // Joints are converted as many at a time as there are lanes.
  group.joints.dual = (joints.size() + 8) * group.joints.stride;
  group.joints.first = floatsOf(scratch.dualQuaternions, group.joints.dual * 2);
  group.palettes =
      floatsOf(scratch.pairs, (moves ? joints.size() * 12 : pairs * 8) * mostInstances);
  for (const Instance& instance : instances) {
    const DualQuaternionArray<float> own{group.joints.first + group.count * 4, group.joints.stride,
                                         group.joints.dual};
    const bool isPlain =
        moves ? areModerate(joints, instance.pose)
              : !convertJoints({joints, instance.pose, own, nullptr}) || !instance.mayScale;
    if (!isPlain) {
      skinGenerally(part, instance);
      continue;
    }
    group.outputs[group.count] = reinterpret_cast<float*>(static_cast<std::byte*>(instance.output) +
                                                          job.places.positions.offset);
    group.poses[group.count] = instance.pose;
    if (++group.count < mostInstances) continue;
    skinGroup(part, group);
    group.count = 0;
  }
  if (group.count != 0) skinGroup(part, group);
}

// -- A job.

inline HWY_ATTR void skinSection(const SectionTask& part) {
  const Job& job = *part.task.job;
  if (!isPlainJob(job)) {
    for (const Instance& instance : job.instances) skinGenerally(part, instance);
    return;
  }
  const bool isPlain = std::ranges::all_of(
      job.instances, [&](const Instance& instance) { return isPlainInstance(job, instance); });
  // Parts of blocks go the general way.
  const std::uint32_t firstWhole =
      (part.firstVertex + blockVertices - 1) / blockVertices * blockVertices;
  const std::uint32_t wholeEnd = part.vertexEnd / blockVertices * blockVertices;
  if (!isPlain || firstWhole >= wholeEnd) {
    for (const Instance& instance : job.instances) skinGenerally(part, instance);
    return;
  }
  SectionTask whole = part;
  whole.firstVertex = firstWhole;
  whole.vertexEnd = wholeEnd;
  skinPlainly(whole, job.instances);
  for (const auto& [first, end] :
       {std::pair{part.firstVertex, firstWhole}, {wholeEnd, part.vertexEnd}}) {
    if (first == end) continue;
    SectionTask rest = part;
    rest.firstVertex = first;
    rest.vertexEnd = end;
    for (const Instance& instance : job.instances) skinGenerally(rest, instance);
  }
}

HWY_ATTR void skinTask(const Task& task) {
  const MeshData& mesh = *task.mesh;
  std::uint32_t first = task.job->firstVertex;
  const std::uint32_t end = task.job->vertexEnd;
  std::size_t run = mesh.runOf(first / blockVertices);
  while (first < end) {
    const std::uint32_t section = mesh.runs[run].section;
    std::size_t runEnd = run;
    while (runEnd < mesh.runs.size() && mesh.runs[runEnd].section == section) ++runEnd;
    const std::uint32_t sectionEnd = std::min(end, mesh.runs[runEnd - 1].blockEnd * blockVertices);
    skinSection({task, mesh.sections[section], run, runEnd, first, sectionEnd});
    first = sectionEnd;
    run = runEnd;
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
#include <string>

namespace dermis::cpu {
namespace {

HWY_EXPORT(skinTask);

}  // namespace

void skinTask(const Task& task) {
  HWY_DYNAMIC_DISPATCH(skinTask)(task);
}

std::vector<std::string_view> targetNames() {
  hwy::SetSupportedTargetsForTest(0);
  std::vector<std::string_view> names;
  // The best ones have the lowest bits.
  for (const std::int64_t target : hwy::SupportedAndGeneratedTargets())
    names.emplace_back(hwy::TargetName(target));
  return names;
}

Result<void> setTarget(std::string_view name) {
  hwy::SetSupportedTargetsForTest(0);
  if (!name.empty()) {
    std::string all;
    bool isFound = false;
    for (const std::int64_t target : hwy::SupportedAndGeneratedTargets()) {
      if (!all.empty()) all.append(", ");
      all.append(hwy::TargetName(target));
      if (name != hwy::TargetName(target)) continue;
      hwy::SetSupportedTargetsForTest(target);
      isFound = true;
      break;
    }
    if (!isFound) {
      std::string message(1, '\'');
      message.append(name).append(
          "' is no instruction set of this processor that Dermis was compiled for; those are ");
      return Error{ErrorCode::invalidArgument, message + all};
    }
  }
  hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  return {};
}

}  // namespace dermis::cpu
#endif
