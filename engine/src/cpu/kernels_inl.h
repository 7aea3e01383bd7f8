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
#ifndef DERMIS_CPU_STAGES_ONLY
#include "cpu/plain_inl.h"
#endif
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

/// The vertices of a run that a job skins.
inline void clipToRun(const SectionTask& part, const Run& run, std::uint32_t& first,
                      std::uint32_t& end) {
  first = std::max(part.firstVertex, run.firstBlock * blockVertices);
  end = std::min(part.vertexEnd, run.blockEnd * blockVertices);
}

// -- Instances that are skinned together: as many as a vector has blocks, or a lone one.

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

/// Skins instances of a group from `first` on, by all stages.
template <bool isLone, class D>
inline HWY_ATTR void skinByStages(D d, const SectionTask& part, const Palette& palette,
                                  const TaskInstance* const* instances) {
  constexpr std::size_t count = isLone ? 1 : blocksOf<D>;
  for (std::size_t i = 0; i < count; ++i)
    part.scratch[0].morphs[i].begin(*part.task.mesh, instances[i]->morphs);
  const Company company{part.task, instances, count, palette, part.scratch[0].morphs.data()};
  Findings<D> findings(d);
  // Not on the stack: an engine's fibers may have little of it.
  auto& tile = *new (floatsOf(part.scratch[0].tile, sizeof(Tile<D>) / sizeof(float))) Tile<D>;
  forTiles(part, isLone ? Tile<D>::most : Tile<D>::most / 2,
           [&](const Blocks& blocks, const VertexRange& range)
               HWY_ATTR { skinTile<isLone>(d, company, blocks, range, tile, findings); });
  for (std::size_t i = 0; i < count; ++i) {
    if (instances[i]->result == nullptr) continue;
    addFindings(d, findings, i * 4, isLone ? hn::MaxLanes(d) : i * 4 + 4, findings.clamped[i],
                *instances[i]->result);
  }
}

#ifndef DERMIS_CPU_STAGES_ONLY

/// How plain_inl.h can skin these instances, if it can.
inline PlainVertex plainVertexOf(const Task& task, const TaskInstance* const* instances,
                                 std::size_t count) {
  if (task.method != Method::dualQuaternion && task.method != Method::linear)
    return PlainVertex::none;
  const auto isPlain = [](const TaskInstance* instance) {
    return instance->morphs.empty() && instance->result == nullptr;
  };
  if (task.places.hasMotion() || !std::all_of(instances, instances + count, isPlain))
    return PlainVertex::none;
  return plainVertexOf(task.places, instances, count);
}

/// Skins the vertices of a job, whole blocks in place and others beside the output.
template <PlainVertex vertex, class D>
inline HWY_ATTR void skinPlainly(D d, const SectionTask& part, const Palette& palette,
                                 const TaskInstance* const* instances) {
  float* outputs[blocksOf<D>];
  for (std::size_t i = 0; i < blocksOf<D>; ++i)
    outputs[i] = reinterpret_cast<float*>(instances[i]->outputs[Stream::positions]);
  const auto skin = [&](const PlainTask& task, float* const* to) HWY_ATTR {
    byInfluences(task.run.influences, [&](auto influences) HWY_ATTR {
      if (part.task.method == Method::linear) {
        skinInstances<PlainKind::moved, vertex, influences()>(d, task, palette, to);
      } else if (palette.scales) {
        skinInstances<PlainKind::scaled, vertex, influences()>(d, task, palette, to);
      } else {
        skinInstances<PlainKind::turned, vertex, influences()>(d, task, palette, to);
      }
    });
  };
  forTiles(part, ~std::uint32_t{0} / blockVertices / 2,
           [&](const Blocks& blocks, const VertexRange& range)
               HWY_ATTR { skinBlocks<vertex, D>(*part.task.mesh, blocks, range, outputs, skin); });
}

#endif  // DERMIS_CPU_STAGES_ONLY

template <bool isLone, class D>
inline HWY_ATTR void skinTogether(D d, const SectionTask& part, const Group& group,
                                  std::size_t first, bool isModerate) {
  const TaskInstance* const* const instances = group.instances + first;
  Palette palette = makePalette<isLone>(d, *part.task.mesh, part.section, part.task.method, group,
                                        first, part.scratch[0]);
  palette.isModerate = isModerate;
#ifndef DERMIS_CPU_STAGES_ONLY
  if constexpr (!isLone) {
    switch (isModerate ? plainVertexOf(part.task, instances, blocksOf<D>) : PlainVertex::none) {
      case PlainVertex::normals:
        return skinPlainly<PlainVertex::normals>(d, part, palette, instances);
      case PlainVertex::tangents:
        return skinPlainly<PlainVertex::tangents>(d, part, palette, instances);
      case PlainVertex::none:
        break;
    }
  }
#endif
  skinByStages<isLone>(d, part, palette, instances);
}

/// Skins all instances of the group, then empties it.
inline HWY_ATTR void skinGroup(const SectionTask& part, Group& group, bool isModerate) {
  std::size_t first = 0;
#if HWY_MAX_BYTES >= 64
  if (group.count == 4) {
    skinTogether<false>(Sixteen(), part, group, 0, isModerate);
    first = 4;
  }
#endif
#if HWY_MAX_BYTES >= 32
  if (group.count - first >= 2) {
    skinTogether<false>(Eight(), part, group, first, isModerate);
    first += 2;
  }
  if (first != group.count) skinTogether<true>(Eight(), part, group, first, isModerate);
#else
  if (first != group.count) skinTogether<false>(Four(), part, group, first, isModerate);
#endif
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
