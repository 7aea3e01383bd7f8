// The code of one instruction set: a job is skinned section by section. Each of the sources
// kernels_*.cpp compiles it for one of Highway's targets, whose macros it defines before. None is
// compiled with the compiler's flags for instructions: those would also compile inline functions of
// the standard library with them, which the linker may then choose for all other code.
#pragma once

#include <algorithm>
#include <bit>
#include <cstring>
#include <span>

#include "cpu/general_inl.h"
#include "cpu/kernels.h"
#ifndef DERMIS_CPU_GENERAL_ONLY
#include "cpu/plain_inl.h"
#endif
#include "cpu/task.h"
#include "strict_floating_point.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// The part of a job that lies in one section.
struct SectionTask {
  const Task& task;
  Scratch* scratch;
  const Section& section;
  std::size_t firstRun, runEnd;
  std::uint32_t firstVertex, vertexEnd;  ///< within these runs
};

/// The vertices of a run that a job skins.
inline void clipToRun(const SectionTask& part, const Run& run, std::uint32_t& first,
                      std::uint32_t& end) {
  first = std::max(part.firstVertex, run.firstBlock * blockVertices);
  end = std::min(part.vertexEnd, run.blockEnd * blockVertices);
}

/// Copies positions to the previous positions.
inline void settle(const Task& task, const TaskInstance& instance, std::uint32_t first,
                   std::uint32_t end) {
  const OutputAttribute &from = task.places[Stream::positions],
                        &to = task.places[Stream::previousPositions];
  copyLanes(instance.outputs[Stream::previousPositions], to.stride,
            instance.outputs[Stream::positions], from.stride, formatSize(from.format), first, end);
}

inline void write(const Findings& findings, const TaskInstance& instance) {
  if (instance.result == nullptr) return;
  InstanceResult found;
  found.clampedVertices = findings.clamped;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const float least = *std::ranges::min_element(findings.least[axis]);
    const float greatest = *std::ranges::max_element(findings.greatest[axis]);
    if (!(least <= greatest)) continue;
    const auto ordered = [](float value) {
      const auto bits = std::bit_cast<std::uint32_t>(value == 0 ? 0.0f : value);
      return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
    };
    found.orderedMin[axis] = ordered(least);
    found.orderedMax[axis] = ordered(greatest);
  }
  addResult(*instance.result, found);
}

inline HWY_ATTR void skinGenerally(const SectionTask& part, const TaskInstance& instance) {
  const Task& task = part.task;
  const MeshData& mesh = *part.task.mesh;
  if (instance.settles && task.places.hasMotion()) {
    settle(task, instance, part.firstVertex, part.vertexEnd);
    return;
  }
  const Palette palette = makePalette(mesh, part.section, task.method, instance.pose,
                                      instance.mayScale, part.scratch[0]);
  Findings findings;
  for (std::size_t number = part.firstRun; number < part.runEnd; ++number) {
    const Run& run = mesh.runs[number];
    std::uint32_t first, end;
    clipToRun(part, run, first, end);
    if (first >= end) continue;
    skinGeneral({task,
                 run,
                 instance,
                 palette,
                 first,
                 end,
                 {formatSize(task.places[Stream::positions].format),
                  formatSize(task.places[Stream::normals].format),
                  formatSize(task.places[Stream::tangents].format)},
                 areSideBySide(task.places) && areSideBySide(instance)},
                findings);
  }
  write(findings, instance);
}

// -- The fast path (plain_inl.h).

#ifndef DERMIS_CPU_GENERAL_ONLY

inline bool isPlainTask(const Task& task) {
  return (task.method == Method::dualQuaternion || task.method == Method::linear) &&
         !task.places.hasMotion() && task.places[Stream::tangents].format == VertexFormat::none &&
         areSideBySide(task.places);
}

inline bool isPlainInstance(const TaskInstance& instance) {
  return instance.morphs.empty() && instance.result == nullptr && areSideBySide(instance);
}

/// Maximum number of instances skinned at a time.
#if HWY_MAX_BYTES >= 64
inline constexpr std::size_t mostInstances = 4;
#elif HWY_MAX_BYTES >= 32
inline constexpr std::size_t mostInstances = 2;
#else
inline constexpr std::size_t mostInstances = 1;
#endif

/// Instances that are skinned together, and their converted poses.
struct PlainGroup {
  std::size_t count = 0;
  float* outputs[mostInstances] = {};
  std::span<const JointMatrix> poses[mostInstances];
  /// For each joint, the real parts of all instances; the dual parts follow. The same for its
  /// scale/shear parts.
  DualQuaternionArray<float> joints{nullptr, mostInstances * 4};
  DualQuaternionArray<float> parts = joints;
  float* palettes = nullptr;  ///< of the instances that are skinned next

  /// Gets memory for the joints and the palettes of `mostInstances` instances.
  void assign(Scratch& scratch, std::size_t jointCount, std::size_t paletteFloats) {
    // Joints are converted in whole vectors, so the last one may write beyond the last joint.
    joints.dual = parts.dual = (jointCount + blockVertices) * joints.stride;
    joints.first = floatsOf(scratch.dualQuaternions, joints.dual * 2);
    parts.first = floatsOf(scratch.scaleShears, joints.dual * 2);
    palettes = floatsOf(scratch.pairs, paletteFloats * mostInstances);
  }
  DualQuaternionArray<float> jointsOf(std::size_t instance) const {
    return {joints.first + instance * 4, joints.stride, joints.dual};
  }
  DualQuaternionArray<float> partsOf(std::size_t instance) const {
    return {parts.first + instance * 4, parts.stride, parts.dual};
  }
};

template <class T>
inline DualQuaternionArray<const T> readOnly(const DualQuaternionArray<T>& array) {
  return {array.first, array.stride, array.dual};
}

/// Skins a partial block: skins the whole block to a temporary buffer and copies the part to the
/// output.
template <class Skin>
DERMIS_INLINE void skinPart(const SectionTask& part, const Run& run, std::uint32_t first,
                            std::uint32_t end, std::size_t instances, float* const* outputs,
                            const Skin& skin) {
  CacheLine blocks[mostInstances][blockFloats * sizeof(float) / sizeof(CacheLine)];
  float* beside[mostInstances];
  for (std::size_t i = 0; i < instances; ++i) beside[i] = blocks[i]->v;
  const std::uint32_t block = first / blockVertices, within = first - block * blockVertices;
  skin(PlainTask{*part.task.mesh, run, block, block + 1, block}, beside);
  for (std::size_t i = 0; i < instances; ++i) {
    std::memcpy(outputs[i] + std::size_t{first} * vertexFloats, beside[i] + within * vertexFloats,
                (end - first) * vertexFloats * sizeof(float));
  }
}

/// Calls `skin` for the blocks of each run that lie in the job. `skinPart` handles blocks that lie
/// in the job only partly.
template <class Skin>
DERMIS_INLINE void forRuns(const SectionTask& part, std::size_t instances, float* const* outputs,
                           const Skin& skin) {
  const MeshData& mesh = *part.task.mesh;
  for (std::size_t number = part.firstRun; number < part.runEnd; ++number) {
    const Run& run = mesh.runs[number];
    std::uint32_t first, end;
    clipToRun(part, run, first, end);
    if (first >= end) continue;
    std::uint32_t whole = (first + blockVertices - 1) / blockVertices;
    if (first != whole * blockVertices) {
      const std::uint32_t partEnd = std::min(end, whole * blockVertices);
      skinPart(part, run, first, partEnd, instances, outputs, skin);
      first = partEnd;
    }
    if (first >= end) continue;
    const std::uint32_t wholeEnd = end / blockVertices;
    if (whole < wholeEnd) skin(PlainTask{mesh, run, whole, wholeEnd, 0}, outputs);
    if (end != wholeEnd * blockVertices)
      skinPart(part, run, std::max(first, wholeEnd * blockVertices), end, instances, outputs, skin);
  }
}

/// Skins by dual quaternions; as many instances as D has blocks.
template <class D>
inline HWY_ATTR void turnGroup(D d, const SectionTask& part, const PlainGroup& group,
                               std::size_t first) {
  constexpr std::size_t blocks = hn::MaxLanes(d) / 4;
  const std::span<const Pair> pairs = pairsOf(*part.task.mesh, part.section);
  const std::size_t dual = pairs.size() * blocks * 4;
  convertPairs(d, pairs, readOnly(group.jointsOf(first)), {group.palettes, blocks * 4, dual});
  forRuns(part, blocks, group.outputs + first,
          [&](const PlainTask& task, float* const* to) HWY_ATTR {
            byInfluences(task.run.influences, [&](auto influences) HWY_ATTR {
              turnInstances<influences()>(d, task, group.palettes, dual, to);
            });
          });
}
#if HWY_MAX_BYTES >= 32
inline HWY_ATTR void turnOne(const SectionTask& part, const PlainGroup& group, std::size_t first) {
  convertPairs(Four(), pairsOf(*part.task.mesh, part.section), readOnly(group.jointsOf(first)),
               {group.palettes});
  forRuns(part, 1, group.outputs + first, [&](const PlainTask& task, float* const* to) HWY_ATTR {
    byInfluences(task.run.influences, [&](auto influences) HWY_ATTR {
      turnInstance<influences()>(Eight(), task, group.palettes, to[0]);
    });
  });
}
#else
inline HWY_ATTR void turnOne(const SectionTask& part, const PlainGroup& group, std::size_t first) {
  turnGroup(Four(), part, group, first);
}
#endif

/// Skins by matrices.
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
  forRuns(part, blocks, group.outputs + first,
          [&](const PlainTask& task, float* const* to) HWY_ATTR {
            byInfluences(task.run.influences, [&](auto influences) HWY_ATTR {
              moveInstances<influences()>(d, task, group.palettes, rowFloats, to);
            });
          });
}

/// Skins by dual quaternions, with two-phase scale.
template <class D>
inline HWY_ATTR void turnScaledGroup(D d, const SectionTask& part, const PlainGroup& group,
                                     std::size_t first) {
  constexpr std::size_t blocks = hn::MaxLanes(d) / 4;
  const std::span<const Pair> pairs = pairsOf(*part.task.mesh, part.section);
  const std::span<const std::uint32_t> joints = jointsOf(*part.task.mesh, part.section);
  const std::size_t stride = blocks * 4, dual = pairs.size() * stride;
  float* const scalePairs = group.palettes + dual * 2;
  float* const parts = scalePairs + dual * 2;
  const std::size_t second = joints.size() * stride;
  convertPairs(d, pairs, readOnly(group.jointsOf(first)), {group.palettes, stride, dual});
  subtractPivots(d, pairs, readOnly(group.partsOf(first)), {scalePairs, stride, dual});
  for (std::size_t joint = 0; joint < joints.size(); ++joint) {
    const float* const from = group.partsOf(first).first + joint * group.parts.stride;
    hn::Store(hn::LoadU(d, from), d, parts + joint * stride);
    hn::Store(hn::LoadU(d, from + group.parts.dual), d, parts + second + joint * stride);
  }
  const ScaledPalette palette{group.palettes, scalePairs, parts, dual, second};
  forRuns(part, blocks, group.outputs + first,
          [&](const PlainTask& task, float* const* to) HWY_ATTR {
            byInfluences(task.run.influences, [&](auto influences) HWY_ATTR {
              turnScaledInstances<influences()>(d, task, palette, to);
            });
          });
}

enum class PlainKind : std::uint8_t { turned, scaled, moved };

template <class D>
inline HWY_ATTR void skinBlocks(D d, PlainKind kind, const SectionTask& part,
                                const PlainGroup& group, std::size_t first) {
  if (kind == PlainKind::moved) return moveGroup(d, part, group, first);
  if (kind == PlainKind::scaled) return turnScaledGroup(d, part, group, first);
  turnGroup(d, part, group, first);
}

/// Skins all instances of the group, then empties it.
inline HWY_ATTR void skinGroup(PlainKind kind, const SectionTask& part, PlainGroup& group) {
  std::size_t first = 0;
#if HWY_MAX_BYTES >= 64
  if (group.count == 4) {
    skinBlocks(Sixteen(), kind, part, group, 0);
    first = 4;
  }
#endif
#if HWY_MAX_BYTES >= 32
  if (group.count - first >= 2) {
    skinBlocks(Eight(), kind, part, group, first);
    first += 2;
  }
#endif
  if (first != group.count) {
    if (kind == PlainKind::turned) {
      turnOne(part, group, first);
    } else {
      skinBlocks(Four(), kind, part, group, first);
    }
  }
  group.count = 0;
}

inline void copyJoints(std::size_t count, const DualQuaternionArray<float>& from,
                       const DualQuaternionArray<float>& to) {
  for (std::size_t joint = 0; joint < count; ++joint) {
    std::memcpy(to.first + joint * to.stride, from.first + joint * from.stride, 16);
    std::memcpy(to.first + to.dual + joint * to.stride,
                from.first + from.dual + joint * from.stride, 16);
  }
}

/// Skins all instances. Those that are not plain, and those whose matrices for linear blending are
/// very large or small, take the general path.
inline HWY_ATTR void skinPlainly(const SectionTask& part) {
  const Task& task = part.task;
  const MeshData& mesh = *task.mesh;
  const std::span<const std::uint32_t> joints = jointsOf(mesh, part.section);
  const std::size_t pairs = pairsOf(mesh, part.section).size();
  const bool moves = task.method == Method::linear;
  const PlainKind kind = moves ? PlainKind::moved : PlainKind::turned;
  PlainGroup group, scaled;
  group.assign(part.scratch[1], joints.size(), moves ? joints.size() * 12 : pairs * 8);
  const auto add = [&](PlainGroup& to, const TaskInstance& instance) {
    to.outputs[to.count] = reinterpret_cast<float*>(instance.outputs[Stream::positions]);
    to.poses[to.count++] = instance.pose;
  };
  for (const TaskInstance& instance : task.instances) {
    if (!isPlainInstance(instance) || (moves && !areModerate(joints, instance.pose))) {
      skinGenerally(part, instance);
      continue;
    }
    const std::size_t place = group.count;
    const bool scales =
        !moves &&
        convertJoints({joints, instance.pose, group.jointsOf(place), group.partsOf(place)}) &&
        instance.mayScale;
    if (scales) {
      if (scaled.palettes == nullptr)
        scaled.assign(part.scratch[2], joints.size(), pairs * 16 + joints.size() * 8);
      copyJoints(joints.size(), group.jointsOf(place), scaled.jointsOf(scaled.count));
      copyJoints(joints.size(), group.partsOf(place), scaled.partsOf(scaled.count));
      add(scaled, instance);
      if (scaled.count == mostInstances) skinGroup(PlainKind::scaled, part, scaled);
    } else {
      add(group, instance);
      if (group.count == mostInstances) skinGroup(kind, part, group);
    }
  }
  skinGroup(kind, part, group);
  skinGroup(PlainKind::scaled, part, scaled);
}

#endif  // DERMIS_CPU_GENERAL_ONLY

// -- A job.

inline HWY_ATTR void skinSection(const SectionTask& part) {
#ifndef DERMIS_CPU_GENERAL_ONLY
  if (isPlainTask(part.task)) {
    skinPlainly(part);
    return;
  }
#endif
  for (const TaskInstance& instance : part.task.instances) skinGenerally(part, instance);
}

inline HWY_ATTR void skinTask(const Task& task, Scratch* scratch) {
  const MeshData& mesh = *task.mesh;
  std::uint32_t first = task.firstVertex;
  const std::uint32_t end = task.vertexEnd;
  std::size_t run = mesh.runOf(first / blockVertices);
  while (first < end) {
    const std::uint32_t section = mesh.runs[run].section;
    std::size_t runEnd = run;
    while (runEnd < mesh.runs.size() && mesh.runs[runEnd].section == section) ++runEnd;
    const std::uint32_t sectionEnd = std::min(end, mesh.runs[runEnd - 1].blockEnd * blockVertices);
    skinSection({task, scratch, mesh.sections[section], run, runEnd, first, sectionEnd});
    first = sectionEnd;
    run = runEnd;
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
