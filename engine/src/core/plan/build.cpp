#include <algorithm>
#include <numeric>
#include <string>
#include <tuple>

#include "abi.h"
#include "plan/check.h"
#include "plan/outputs.h"
#include "plan/state.h"
#include "plan/variant.h"

namespace dermis {
namespace {

/// Kernels number workgroups in 32 bits, with those that fill the last row: up to twice as many.
constexpr std::uint64_t maxWorkgroups = std::uint64_t{1} << 31;

std::uint64_t divideUp(std::uint64_t value, std::uint64_t divisor) {
  return (value + divisor - 1) / divisor;
}

bool hasActiveMorphs(const Job& job) {
  const auto isActive = [](const MorphWeight& morph) { return morph.weight != 0; };
  return std::any_of(job.morphs.begin(), job.morphs.end(), isActive) ||
         (job.motion == Motion::reskinned &&
          std::any_of(job.previousMorphs.begin(), job.previousMorphs.end(), isActive));
}

bool mayScale(const Batch& batch, const Job& job) {
  return job.method != Method::linear &&
         (batch.palettes[job.palette].mayScale ||
          (job.motion == Motion::reskinned && batch.palettes[job.previousPalette].mayScale));
}

}  // namespace

void Plan::State::clear() {
  dispatches.clear();
  variants.clear();
  tables.clear();
  for (std::vector<std::uint32_t>& units : paletteUnits) units.clear();
  results.clear();
  resultCount = 0;
  palettesSize = meshesSize = matricesSize = 0;
  outputs = {};
  instanceCount = 0;
  vertexCount = 0;
  groups.clear();
  pieces.clear();
  groupOf.clear();
}

void Plan::State::addPiece(const Job& job, std::uint32_t jobIndex, const GroupKey& key,
                           const Variant& variant, bool scales) {
  // Neighbouring jobs mostly belong together: look there before asking the map.
  std::uint32_t group = pieces.empty() ? notUsed : pieces.back().group;
  if (group == notUsed || !(groups[group].key == key)) {
    const auto [entry, isNew] = groupOf.try_emplace(key, static_cast<std::uint32_t>(groups.size()));
    group = entry->second;
    if (isNew) groups.push_back({key, variant, job.mesh.maxInfluences, false, 0, 0, 0});
  }
  ++groups[group].instances;
  groups[group].scales |= scales;
  pieces.push_back({group, jobIndex});
}

Result<void> Plan::State::gatherPieces(const Batch& batch, const Tuning& tuning) {
  const std::array<std::uint64_t, streamCount> sizes = outputSizes(batch.outputs);
  results.reserve(batch.jobs.size());
  for (std::size_t index = 0; index < batch.jobs.size(); ++index) {
    const Job& job = batch.jobs[index];
    if (Result<void> good = checkJob(batch, job, {"job", index}, limits); !good) return good;
    results.push_back(hasResult(job) ? resultCount++ : notUsed);

    Variant variant = outputVariant(job);
    variant.morphs = hasActiveMorphs(job);
    variant.instancesPerInvocation = static_cast<std::uint8_t>(tuning.instancesPerInvocation);
    variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
    const OutputStreams streams = outputStreams(job);
    GroupKey key;
    key.mesh = job.meshOffset;
    const bool mayPair = batch.outputs.isOneBuffer && mayStorePairs(job, limits);
    for (std::size_t stream = 0; stream < streamCount; ++stream)
      key.strides[stream] = streams[stream].size != 0 ? streams[stream].stride : 0;
    cutIntoRuns(streams, job.mesh.vertexCount, sizes, limits, runs);
    for (const VertexRun& run : runs) {
      key.windows = run.windows;
      key.firstVertex = run.firstVertex;
      key.vertexEnd = run.vertexEnd;
      variant.pairs = mayPair && run.windows[0] == run.windows[1];
      key.variant = variant.key();
      if (Result<void> good = checkWindows(streams, run.windows, {"job", index}, limits); !good)
        return good;
      addPiece(job, static_cast<std::uint32_t>(index), key, variant, mayScale(batch, job));
    }
    ++instanceCount;
    vertexCount += job.mesh.vertexCount;
  }
  return {};
}

Result<void> Plan::State::addDispatch(const Variant& variant, std::uint64_t workgroups,
                                      const DispatchConstants& constants) {
  if (workgroups > std::min(std::uint64_t{limits.maxWorkgroupCountX} * limits.maxWorkgroupCountY,
                            maxWorkgroups)) {
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
  return {};
}

/// Appends the records of the palettes that are wanted in that form, and returns their number.
std::uint32_t Plan::State::placePalettes(const Batch& batch, PaletteForm form,
                                         std::uint64_t& units) {
  std::uint32_t records = 0;
  std::vector<std::uint32_t>& places = paletteUnits[static_cast<std::size_t>(form)];
  for (std::size_t index = 0; index < places.size(); ++index) {
    if (places[index] == notUsed) continue;
    const Palette& palette = batch.palettes[index];
    places[index] = static_cast<std::uint32_t>(units);
    tables.insert(tables.end(), {static_cast<std::uint32_t>(palette.matrixOffset / unitBytes),
                                 static_cast<std::uint32_t>(units), palette.jointCount,
                                 paletteFlags(form, palette.mayScale)});
    units += paletteSize(form, palette.jointCount, palette.mayScale);
    ++records;
  }
  return records;
}

Result<void> Plan::State::placePalettes(const Batch& batch, const Tuning& tuning) {
  for (std::size_t index = 0; index < batch.palettes.size(); ++index) {
    if (Result<void> good = checkPalette(batch, batch.palettes[index], index); !good) return good;
  }
  for (std::vector<std::uint32_t>& places : paletteUnits)
    places.assign(batch.palettes.size(), notUsed);
  for (const Job& job : batch.jobs) {
    const std::optional<PaletteForm> form = paletteForm(job.method);
    if (!form) continue;
    std::vector<std::uint32_t>& places = paletteUnits[static_cast<std::size_t>(*form)];
    places[job.palette] = 0;
    if (job.motion == Motion::reskinned) places[job.previousPalette] = 0;
  }
  std::uint64_t units = 0;
  std::uint32_t records = 0;
  for (const PaletteForm form : {PaletteForm::dualQuaternions, PaletteForm::logarithms})
    records += placePalettes(batch, form, units);
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
  std::vector<std::uint32_t>& cleared = order;  // scratch
  cleared.resize(resultCount);
  std::iota(cleared.begin(), cleared.end(), 0u);
  return addPaletteDispatch(tuning, records, cleared);
}

Result<void> Plan::State::addPaletteDispatch(const Tuning& tuning, std::uint32_t palettes,
                                             std::span<const std::uint32_t> clearedResults) {
  if (palettes == 0 && clearedResults.empty()) return {};
  tables.insert(tables.end(), clearedResults.begin(), clearedResults.end());
  tables.resize(divideUp(tables.size(), 4) * 4);  // records behind it are read by four words
  // Behind the workgroups of the palettes come those that clear the results.
  return addDispatch(paletteVariant(tuning),
                     palettes + divideUp(clearedResults.size(), tuning.workgroupSize),
                     {0, palettes, 0, static_cast<std::uint32_t>(clearedResults.size())});
}

Result<void> Plan::State::placeGroups(const Tuning& tuning) {
  const auto dispatchOrder = [&](std::uint32_t index) {
    const GroupKey& key = groups[index].key;
    return std::tie(key.isCulled, key.windows, key.variant);
  };
  order.resize(groups.size());
  for (std::uint32_t index = 0; index < order.size(); ++index) order[index] = index;
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return dispatchOrder(a) < dispatchOrder(b);
  });

  const std::size_t groupRecords = tables.size();
  tables.resize(groupRecords + groups.size() * abi::GROUP_WORDS, 0u);
  const auto instanceRecords = static_cast<std::uint32_t>(tables.size());
  const bool palettesRun = !dispatches.empty();

  std::uint32_t firstInstance = 0;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    std::uint64_t workgroups = 0;
    std::uint32_t maxInfluences = 0;
    bool scales = false;
    for (; end < order.size() && dispatchOrder(order[end]) == dispatchOrder(order[begin]); ++end) {
      Group& group = groups[order[end]];
      group.firstInstance = firstInstance;
      firstInstance += group.instances;
      maxInfluences = std::max(maxInfluences, group.maxInfluences);
      scales |= group.scales;
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
      std::copy(group.key.strides.begin(), group.key.strides.end(),
                record + abi::GROUP_POSITION_STRIDE);
    }
    const Group& group = groups[order[begin]];
    Variant variant = group.variant;
    variant.influences = influenceClass(maxInfluences);
    variant.scales = scales;
    const DispatchConstants constants{
        static_cast<std::uint32_t>(groupRecords + begin * abi::GROUP_WORDS),
        static_cast<std::uint32_t>(end - begin), 0, instanceRecords};
    if (Result<void> good = addDispatch(variant, workgroups, constants); !good) return good;
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const std::uint32_t window = group.key.windows[stream];
      dispatches.back().windows[stream] = {window, window * outputWindowStep(limits)};
    }
    // A kernel that may name the results counts as one that reads them.
    dispatches.back().afterPalettes =
        palettesRun &&
        (variant.method != Method::linear || variant.motion != Motion::none || hasResults(variant));
    begin = end;
  }
  return {};
}

/// All that a variant reads through texels has to fit, or nothing is read so.
void Plan::State::chooseTexels() {
  const bool fits = fitsUnitTexels(tables.size() * 4, limits) && fitsWordTexels(meshesSize, limits);
  for (Dispatch& dispatch : dispatches) {
    Variant& variant = dispatch.variant;
    const std::uint64_t palettes = variant.method == Method::linear ? matricesSize : palettesSize;
    variant.texels = fits && fitsUnitTexels(palettes, limits) && mayReadTexels(variant, limits);
    variant.pairs &= variant.texels;
  }
}

void Plan::State::listVariants() {
  for (const Dispatch& dispatch : dispatches) {
    if (std::find(variants.begin(), variants.end(), dispatch.variant) == variants.end())
      variants.push_back(dispatch.variant);
  }
}

Result<void> Plan::State::build(const Batch& batch, const DeviceLimits& deviceLimits,
                                const Tuning& tuning) {
  limits = deviceLimits;
  if (Result<void> good = checkLimits(limits); !good) return good;
  if (Result<void> good = checkTuning(tuning); !good) return good;
  meshesSize = batch.meshesSize;
  matricesSize = batch.matricesSize;
  outputs = batch.outputs;
  if (batch.jobs.size() > notUsed / 2) return invalid("a batch of more than 2^31 jobs");
  if (Result<void> good = gatherPieces(batch, tuning); !good) return good;
  if (Result<void> good = placePalettes(batch, tuning); !good) return good;
  if (Result<void> good = placeGroups(tuning); !good) return good;
  writeInstances(batch, static_cast<std::uint32_t>(tables.size()));
  if (tables.size() * 4 > limits.maxStorageBufferRange) {
    return Error{ErrorCode::limitExceeded,
                 "the tables of the batch are larger than a storage buffer range; split it"};
  }
  chooseTexels();
  listVariants();
  return {};
}

}  // namespace dermis
