// The code of one instruction set: a job is skinned section by section. Each of the sources
// kernels_*.cpp compiles it for one of Highway's targets, whose macros it defines before. None is
// compiled with the compiler's flags for instructions: those would also compile inline functions of
// the standard library with them, which the linker may then choose for all other code.
#pragma once

#include <algorithm>
#include <cstring>
#include <new>
#include <span>

#include "cpu/kernels.h"
#include "cpu/stages_inl.h"
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

/// More blocks than any run has.
inline constexpr std::uint32_t mostBlocks = ~std::uint32_t{0} / blockVertices / 2;

/// The vertices of a run that a job skins.
inline void clipToRun(const SectionTask& part, const Run& run, std::uint32_t& first,
                      std::uint32_t& end) {
  first = std::max(part.firstVertex, run.firstBlock * blockVertices);
  end = std::min(part.vertexEnd, run.blockEnd * blockVertices);
}

// -- Instances that are skinned together: a company, or a lone one.

/// Calls `skin` for the blocks of each run that lie in the job, at most `most` at a time.
template <class Skin>
DERMIS_INLINE void forTiles(const SectionTask& part, std::uint32_t most, const Skin& skin) {
  const MeshData& mesh = *part.task.mesh;
  for (std::size_t number = part.firstRun; number < part.runEnd; ++number) {
    const Run& run = mesh.runs[number];
    std::uint32_t first, end;
    clipToRun(part, run, first, end);
    while (first < end) {
      const std::uint32_t block = first / blockVertices;
      const std::uint32_t blockEnd =
          std::min(block + most, (end + blockVertices - 1) / blockVertices);
      const std::uint32_t next = std::min(end, blockEnd * blockVertices);
      skin(Blocks{run, block, blockEnd},
           VertexRange{first - block * blockVertices, next - block * blockVertices});
      first = next;
    }
  }
}

/// Skins a company, or a lone instance.
template <bool isLone, class D>
inline HWY_ATTR void skinTogether(D d, const SectionTask& part, const Common& common,
                                  const Palette& palette, const TaskInstance* const* instances,
                                  std::size_t count) {
  ActiveTargets& targets = part.scratch[0].morphs;
  if (common.isMorphed) {
    std::span<const MorphWeight> morphs[isLone ? 1 : hn::MaxLanes(d)];
    for (std::size_t i = 0; i < std::size(morphs); ++i) morphs[i] = instances[i]->morphs;
    targets.begin(*part.task.mesh, morphs);
  }
  const Together together{part.task, instances, count, common, palette, targets};
  Findings<D> findings(d);
  // Not on the stack: an engine's fibers may have little of it.
  auto& tile = *new (floatsOf(part.scratch[0].tile, sizeof(Tile<D>) / sizeof(float))) Tile<D>;
  const Direct<D> direct = directOf<isLone>(d, together);
  forTiles(part, common.isDirect ? mostBlocks : tileBlocks<isLone, D>,
           [&](const Blocks& blocks, const VertexRange& range) HWY_ATTR {
             common.isDirect
                 ? skinDirectly<isLone>(d, together, direct, blocks, range, tile, findings)
                 : skinTile<isLone>(d, together, blocks, range, tile, findings);
           });
  for (std::size_t i = 0; i < count; ++i) {
    if (instances[i]->result == nullptr) continue;
    addFindings(d, findings, i, isLone ? hn::MaxLanes(d) : i + 1, findings.clamped[i],
                *instances[i]->result);
  }
}

/// Skins instances of a group from `first` on as companies of as many as D has lanes, while enough
/// are left. Returns the number of the next one.
template <class D>
inline HWY_ATTR std::size_t skinCompanies(D d, const SectionTask& part, const Group& group,
                                          std::size_t first, bool isModerate) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  while ((group.count - first) * 4 >= lanes * 3) {
    const Members<D> members(group, first, std::min(lanes, group.count - first));
    const Common common(part.task, members.instances, members.count, lanes);
    // Sixteen would begin too many cache lines at a time, and wait for them.
    const bool isShort = !group.scales && (part.task.method == Method::linear ||
                                           part.task.method == Method::dualQuaternion);
    if (lanes > 8 && common.isDirect && isShort) break;
    Palette palette = makePalette(d, *part.task.mesh, part.section, part.task.method, group,
                                  members, part.scratch[0]);
    palette.isModerate = isModerate;
    skinTogether<false>(d, part, common, palette, members.instances, members.count);
    first += members.count;
  }
  return first;
}

/// Skins all instances of the group, then empties it.
inline HWY_ATTR void skinGroup(const SectionTask& part, Group& group, bool isModerate) {
  std::size_t first = 0;
#if HWY_MAX_BYTES >= 64
  first = skinCompanies(Sixteen(), part, group, first, isModerate);
#endif
  first = skinCompanies(Wide(), part, group, first, isModerate);
  for (; first != group.count; ++first) {
    const TaskInstance* const* const instance = group.instances + first;
    Palette palette =
        makePalette(*part.task.mesh, part.section, part.task.method, group, first, part.scratch[0]);
    palette.isModerate = isModerate;
    skinTogether<true>(Wide(), part, Common(part.task, instance, 1, 1), palette, instance, 1);
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

/// Skins all instances. Those that scale, and those with morph targets, are skinned together.
inline HWY_ATTR void skinSection(const SectionTask& part) {
  const Task& task = part.task;
  const std::span<const std::uint32_t> joints = jointsOf(*task.mesh, part.section);
  Group group, scaled;
  group.assign(part.scratch[1], joints.size());
  scaled.scales = true;
  for (const TaskInstance& instance : task.instances) {
    if (instance.settles && task.places.hasMotion()) {
      keepPositions(task, instance, part.firstVertex, part.vertexEnd);
      continue;
    }
    for (Group* const other : {&group, &scaled}) {
      if (other->count != 0 && other->instances[0]->morphs.empty() != instance.morphs.empty())
        skinGroup(part, *other, true);
    }
    const std::size_t place = group.count;
    const bool scales =
        task.method != Method::linear &&
        convertJoints({joints, instance.pose, group.jointsOf(place), group.partsOf(place)}) &&
        instance.mayScale;
    Group& own = scales ? scaled : group;
    // Only these depend on the size of entries.
    const bool isModerate =
        !(scales || task.method == Method::linear) || areModerate(joints, instance.pose);
    if (!isModerate) skinGroup(part, own, true);
    if (scales) {
      if (scaled.joints.first == nullptr) scaled.assign(part.scratch[2], joints.size());
      copyJoints(joints.size(), group.jointsOf(place), scaled.jointsOf(scaled.count));
      copyJoints(joints.size(), group.partsOf(place), scaled.partsOf(scaled.count));
    }
    own.instances[own.count++] = &instance;
    if (!isModerate || own.count == mostInstances) skinGroup(part, own, isModerate);
  }
  skinGroup(part, group, true);
  skinGroup(part, scaled, true);
}

// -- A job.

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
