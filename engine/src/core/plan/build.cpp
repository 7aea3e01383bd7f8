#include <algorithm>
#include <array>
#include <limits>
#include <string>

#include "abi.h"
#include "plan/check.h"
#include "plan/state.h"
#include "plan/variant.h"

namespace dermis {
namespace {

std::uint64_t divideUp(std::uint64_t value, std::uint64_t divisor) {
  return (value + divisor - 1) / divisor;
}

}  // namespace

void Plan::State::clear() {
  dispatches.clear();
  variants.clear();
  tables.clear();
  paletteUnits.clear();
  palettesSize = meshesSize = matricesSize = outputSize = 0;
  instanceCount = 0;
  vertexCount = 0;
  groups.clear();
  pieces.clear();
  groupOf.clear();
}

void Plan::State::addPiece(const Job& job, std::uint32_t jobIndex, GroupKey key) {
  // Neighbouring jobs mostly belong together: look there before asking the map.
  std::uint32_t group = pieces.empty() ? notUsed : pieces.back().group;
  if (group == notUsed || !(groups[group].key == key)) {
    const auto [entry, isNew] = groupOf.try_emplace(key, static_cast<std::uint32_t>(groups.size()));
    group = entry->second;
    if (isNew) groups.push_back({key, job.mesh.maxInfluences, 0, 0, 0});
  }
  ++groups[group].instances;
  pieces.push_back({group, jobIndex});
}

Result<void> Plan::State::gatherPieces(const Batch& batch) {
  for (std::size_t index = 0; index < batch.jobs.size(); ++index) {
    const Job& job = batch.jobs[index];
    if (Result<void> good = checkJob(batch, job, index); !good) return good;
    if (Result<void> cut = cutIntoRuns(job, index, batch.outputSize, limits, runs); !cut)
      return cut;
    for (const VertexRun& run : runs) {
      addPiece(job, static_cast<std::uint32_t>(index),
               {job.meshOffset, run.window, run.firstVertex, run.vertexEnd, job.positions.stride,
                job.normals.stride, job.method});
    }
    ++instanceCount;
    vertexCount += job.mesh.vertexCount;
  }
  return {};
}

Result<void> Plan::State::addDispatch(const Variant& variant, std::uint64_t workgroups,
                                      const DispatchConstants& constants) {
  if (workgroups >
      std::min<std::uint64_t>(std::uint64_t{limits.maxWorkgroupCountX} * limits.maxWorkgroupCountY,
                              std::numeric_limits<std::uint32_t>::max())) {
    return Error{ErrorCode::limitExceeded,
                 "the batch needs " + std::to_string(workgroups) +
                     " workgroups in one dispatch, more than the device can count; split it"};
  }
  Dispatch dispatch;
  dispatch.variant = variant;
  dispatch.constants = constants;
  dispatch.constants.workgroupCount = static_cast<std::uint32_t>(workgroups);
  dispatch.groupCountY =
      static_cast<std::uint32_t>(divideUp(workgroups, limits.maxWorkgroupCountX));
  dispatch.groupCountX = static_cast<std::uint32_t>(divideUp(workgroups, dispatch.groupCountY));
  dispatches.push_back(dispatch);
  if (std::find(variants.begin(), variants.end(), variant) == variants.end())
    variants.push_back(variant);
  return {};
}

Result<void> Plan::State::placePalettes(const Batch& batch, const Tuning& tuning) {
  for (std::size_t index = 0; index < batch.palettes.size(); ++index) {
    if (Result<void> good = checkPalette(batch, batch.palettes[index], index); !good) return good;
  }
  paletteUnits.assign(batch.palettes.size(), notUsed);
  for (const Job& job : batch.jobs) {
    if (job.method != Method::linear) paletteUnits[job.palette] = 0;
  }
  std::uint64_t units = 0;
  std::uint32_t records = 0;
  for (std::size_t index = 0; index < batch.palettes.size(); ++index) {
    if (paletteUnits[index] == notUsed) continue;
    const Palette& palette = batch.palettes[index];
    paletteUnits[index] = static_cast<std::uint32_t>(units);
    tables.insert(tables.end(), {static_cast<std::uint32_t>(palette.matrixOffset / unitBytes),
                                 static_cast<std::uint32_t>(units), palette.jointCount,
                                 palette.mayScale ? 1u : 0u});
    units += 1 + std::uint64_t{palette.jointCount} * (palette.mayScale ? 4 : 2);
    ++records;
  }
  palettesSize = units * unitBytes;
  if (palettesSize > limits.maxStorageBufferRange ||
      batch.matricesSize > limits.maxStorageBufferRange ||
      batch.meshesSize > limits.maxStorageBufferRange) {
    return Error{
        ErrorCode::limitExceeded,
        "meshes, matrices or palettes of " +
            std::to_string(std::max({palettesSize, batch.matricesSize, batch.meshesSize})) +
            " bytes are more than a storage buffer range of " +
            std::to_string(limits.maxStorageBufferRange) +
            " bytes; a batch of fewer of them would fit"};
  }
  if (records == 0) return {};
  Variant variant;
  variant.kernel = Kernel::palette;
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  return addDispatch(variant, records, {0, records, 0, 0});
}

Result<void> Plan::State::placeGroups(const Batch& batch, const Tuning& tuning) {
  const auto variantOrder = [&](std::uint32_t index) {
    const GroupKey& key = groups[index].key;
    return std::array<std::uint32_t, 3>{key.window, static_cast<std::uint32_t>(key.method),
                                        key.normalStride != 0 ? 1u : 0u};
  };
  order.resize(groups.size());
  for (std::uint32_t index = 0; index < order.size(); ++index) order[index] = index;
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return variantOrder(a) < variantOrder(b);
  });

  const std::size_t groupRecords = tables.size();
  tables.resize(groupRecords + groups.size() * abi::GROUP_WORDS, 0u);
  const auto instanceRecords = static_cast<std::uint32_t>(tables.size());
  const bool afterPalettes = !dispatches.empty();

  std::uint32_t firstInstance = 0;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    std::uint64_t workgroups = 0;
    std::uint32_t maxInfluences = 0;
    for (; end < order.size() && variantOrder(order[end]) == variantOrder(order[begin]); ++end) {
      Group& group = groups[order[end]];
      group.firstInstance = firstInstance;
      firstInstance += group.instances;
      maxInfluences = std::max(maxInfluences, group.maxInfluences);
      const std::uint64_t vertexGroups =
          divideUp(group.key.vertexEnd - group.key.firstVertex, tuning.workgroupSize);
      workgroups += vertexGroups * divideUp(group.instances, tuning.instancesPerInvocation);
      std::uint32_t* record = &tables[groupRecords + end * abi::GROUP_WORDS];
      record[abi::GROUP_WORKGROUP_END] =
          static_cast<std::uint32_t>(std::min<std::uint64_t>(workgroups, notUsed));
      record[abi::GROUP_MESH] = static_cast<std::uint32_t>(group.key.mesh / 4);
      record[abi::GROUP_FIRST_VERTEX] = group.key.firstVertex;
      record[abi::GROUP_VERTEX_END] = group.key.vertexEnd;
      record[abi::GROUP_VERTEX_GROUPS] = static_cast<std::uint32_t>(vertexGroups);
      record[abi::GROUP_FIRST_INSTANCE] = group.firstInstance;
      record[abi::GROUP_INSTANCE_COUNT] = group.instances;
      record[abi::GROUP_POSITION_STRIDE] = group.key.positionStride / 4;
      record[abi::GROUP_NORMAL_STRIDE] = group.key.normalStride / 4;
    }
    const GroupKey& key = groups[order[begin]].key;
    Variant variant;
    variant.method = key.method;
    variant.normals = key.normalStride != 0;
    variant.influences = influenceClass(maxInfluences);
    variant.instancesPerInvocation = static_cast<std::uint8_t>(tuning.instancesPerInvocation);
    variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
    const DispatchConstants constants{
        static_cast<std::uint32_t>(groupRecords + begin * abi::GROUP_WORDS),
        static_cast<std::uint32_t>(end - begin), 0, instanceRecords};
    if (Result<void> good = addDispatch(variant, workgroups, constants); !good) return good;
    dispatches.back().outputWindow = key.window;
    dispatches.back().outputOffset = key.window * outputWindowStep(limits);
    dispatches.back().afterPalettes = afterPalettes && key.method != Method::linear;
    begin = end;
  }
  writeInstances(batch, instanceRecords);
  return {};
}

void Plan::State::writeInstances(const Batch& batch, std::uint32_t firstRecord) {
  const std::uint64_t step = outputWindowStep(limits);
  tables.resize(firstRecord + pieces.size() * abi::INSTANCE_WORDS);
  for (const Piece& piece : pieces) {
    Group& group = groups[piece.group];
    const Job& job = batch.jobs[piece.job];
    const Palette& palette = batch.palettes[job.palette];
    const std::uint64_t windowBegin = group.key.window * step;
    const auto wordOffset = [&](const OutputAttribute& attribute) {
      const std::uint64_t offset =
          attribute.offset + std::uint64_t{group.key.firstVertex} * attribute.stride;
      return static_cast<std::uint32_t>((offset - windowBegin) / 4);
    };
    std::uint32_t* record =
        &tables[firstRecord +
                std::size_t{group.firstInstance + group.filled++} * abi::INSTANCE_WORDS];
    record[abi::INSTANCE_PALETTE] =
        job.method == Method::linear ? static_cast<std::uint32_t>(palette.matrixOffset / unitBytes)
                                     : paletteUnits[job.palette];
    record[abi::INSTANCE_JOINTS] = palette.jointCount;
    record[abi::INSTANCE_POSITIONS] = wordOffset(job.positions);
    record[abi::INSTANCE_NORMALS] = job.normals.stride != 0 ? wordOffset(job.normals) : 0u;
  }
}

Result<void> Plan::State::build(const Batch& batch, const DeviceLimits& deviceLimits,
                                const Tuning& tuning) {
  limits = deviceLimits;
  if (Result<void> good = checkLimits(limits); !good) return good;
  if (Result<void> good = checkTuning(tuning); !good) return good;
  meshesSize = batch.meshesSize;
  matricesSize = batch.matricesSize;
  outputSize = batch.outputSize;
  if (batch.jobs.size() > notUsed / 2) return invalid("a batch of more than 2^31 jobs");
  if (Result<void> good = gatherPieces(batch); !good) return good;
  if (Result<void> good = placePalettes(batch, tuning); !good) return good;
  if (Result<void> good = placeGroups(batch, tuning); !good) return good;
  if (tables.size() * 4 > limits.maxStorageBufferRange) {
    return Error{ErrorCode::limitExceeded,
                 "the tables of the batch are larger than a storage buffer range; split it"};
  }
  return {};
}

}  // namespace dermis
