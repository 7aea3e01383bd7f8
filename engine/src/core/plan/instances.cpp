// The instance records of a plan, and what some instances have besides.

#include <algorithm>
#include <bit>

#include "plan/instances.h"

#include "abi.h"
#include "plan/state.h"

namespace dermis {
namespace {

bool hasActive(std::span<const MorphWeight> morphs) {
  return std::any_of(morphs.begin(), morphs.end(),
                     [](const MorphWeight& morph) { return morph.weight != 0; });
}

bool hasExtension(const Job& job) {
  return hasResult(job) || job.motion == Motion::reskinned || hasActive(job.morphs);
}

void writeFloat(std::uint32_t& word, double value) {
  word = std::bit_cast<std::uint32_t>(static_cast<float>(value));
}

}  // namespace

void writeBox(std::uint32_t* extension, const Box& box) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double low = static_cast<double>(box.min[axis]);
    const double high = static_cast<double>(box.max[axis]);
    writeFloat(extension[abi::EXTENSION_CENTRE + axis], (low + high) / 2);
    writeFloat(extension[abi::EXTENSION_INVERSE + axis], 2 / (high - low));
  }
}

std::uint32_t Plan::State::paletteOf(const Batch& batch, Method method,
                                     std::uint32_t palette) const {
  const std::optional<PaletteForm> form = paletteForm(method);
  return form ? paletteUnits[static_cast<std::size_t>(*form)][palette]
              : static_cast<std::uint32_t>(batch.palettes[palette].matrixOffset / unitBytes);
}

/// The place and number of the active targets, in rising order: the order of a sum decides on its
/// last bits.
std::array<std::uint32_t, 2> Plan::State::appendMorphs(std::span<const MorphWeight> morphs) {
  const auto first = static_cast<std::uint32_t>(tables.size());
  sortedMorphs.assign(morphs.begin(), morphs.end());
  std::erase_if(sortedMorphs, [](const MorphWeight& morph) { return morph.weight == 0; });
  std::sort(sortedMorphs.begin(), sortedMorphs.end(),
            [](const MorphWeight& a, const MorphWeight& b) { return a.target < b.target; });
  for (const MorphWeight& morph : sortedMorphs) {
    tables.push_back(morph.target);
    tables.push_back(std::bit_cast<std::uint32_t>(morph.weight));
  }
  return {first, static_cast<std::uint32_t>(sortedMorphs.size())};
}

std::uint32_t Plan::State::appendExtension(const Batch& batch, std::uint32_t jobIndex) {
  const Job& job = batch.jobs[jobIndex];
  const auto place = static_cast<std::uint32_t>(tables.size());
  tables.resize(tables.size() + abi::EXTENSION_WORDS, 0u);
  const std::array<std::uint32_t, 2> morphs = appendMorphs(job.morphs);
  std::array<std::uint32_t, 2> previousMorphs{};
  if (job.motion == Motion::reskinned) previousMorphs = appendMorphs(job.previousMorphs);

  std::uint32_t* extension = &tables[place];
  extension[abi::EXTENSION_MORPHS] = morphs[0];
  extension[abi::EXTENSION_MORPH_COUNT] = morphs[1];
  extension[abi::EXTENSION_PREVIOUS_MORPHS] = previousMorphs[0];
  extension[abi::EXTENSION_PREVIOUS_MORPH_COUNT] = previousMorphs[1];
  if (job.motion == Motion::reskinned) {
    extension[abi::EXTENSION_PREVIOUS_PALETTE] = paletteOf(batch, job.method, job.previousPalette);
    extension[abi::EXTENSION_PREVIOUS_JOINTS] = batch.palettes[job.previousPalette].jointCount;
  }
  if (results[jobIndex] != notUsed)
    extension[abi::EXTENSION_RESULT] = results[jobIndex] * abi::RESULT_WORDS;
  writeBox(extension, job.box);
  return place;
}

void Plan::State::writeInstances(const Batch& batch, std::uint32_t firstRecord) {
  const std::uint64_t step = outputWindowStep(limits);
  tables.resize(firstRecord + pieces.size() * abi::INSTANCE_WORDS);
  for (const Piece& piece : pieces) {
    Group& group = groups[piece.group];
    const Job& job = batch.jobs[piece.job];
    const std::size_t place =
        firstRecord + std::size_t{group.firstInstance + group.filled++} * abi::INSTANCE_WORDS;
    const std::uint32_t extension = hasExtension(job) ? appendExtension(batch, piece.job) : 0;
    std::uint32_t* record = &tables[place];
    record[abi::INSTANCE_PALETTE] = paletteOf(batch, job.method, job.palette);
    record[abi::INSTANCE_JOINTS] = batch.palettes[job.palette].jointCount;
    record[abi::INSTANCE_FLAGS] = (job.restartsMotion ? abi::INSTANCE_RESTARTS : 0u) |
                                  (job.settles ? abi::INSTANCE_SETTLES : 0u);
    record[abi::INSTANCE_EXTENSION] = extension;
    const OutputStreams streams = outputStreams(job);
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      record[abi::INSTANCE_POSITIONS + stream] =
          streams[stream].size == 0
              ? 0u
              : static_cast<std::uint32_t>(streams[stream].begin(group.key.firstVertex) -
                                           group.key.windows[stream] * step);
    }
  }
}

}  // namespace dermis
