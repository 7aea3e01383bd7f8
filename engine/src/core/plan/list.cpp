// The commands of encoded work: what each dispatch binds, and what is copied, cleared and waited
// for around them.
#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>
#include <variant>
#include <vector>

#include "plan/encode.h"

namespace dermis {
namespace {

constexpr Use computeBoth = Use::computeRead | Use::computeWrite;

}  // namespace

/// Lists what the kernel reads and writes. A descriptor that its module declares must be valid even
/// if the variant does not use it, so such a slot gets a buffer that the kernel reads anyway.
void Encoder::listDispatch(const Dispatch& dispatch, const PlanBuffers& buffers) {
  const Variant& variant = dispatch.variant;
  std::array<BufferPart, abi::BINDING_COUNT> parts;
  const auto orElse = [](const BufferPart& part, const BufferPart& other) {
    return part.size != 0 ? part : other;
  };
  const BufferPart& tables = buffers[BufferRole::tables];
  const BufferPart& results = buffers[BufferRole::results];
  const bool readsPoses = dispatch.joints != BufferRole::palettes;  // or writes them
  const BufferPart& joints = readsPoses && !buffers.poses.empty()
                                 ? buffers.poses[dispatch.poseBuffer]
                                 : buffers[dispatch.joints];
  const BufferPart driven =
      dispatch.drivenBuffer != notUsed ? buffers.poses[dispatch.drivenBuffer] : BufferPart();
  parts[abi::BINDING_TABLES] = tables;
  if (variant.kernel == Kernel::visibility) {
    parts[abi::BINDING_VISIBILITY] = buffers[BufferRole::visibility];
    parts[abi::BINDING_HISTORY] = buffers[BufferRole::history];
    parts[abi::BINDING_VISIBLE_RESULTS] = orElse(results, buffers[BufferRole::history]);
  } else if (variant.kernel == Kernel::skin) {
    parts[abi::BINDING_MESHES] = buffers[BufferRole::meshes];
    parts[abi::BINDING_PALETTES] = joints;
    const std::uint64_t range = plan_->limits.maxStorageBufferRange;
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      BufferPart& part = parts[abi::BINDING_POSITIONS + stream];
      part = parts[abi::BINDING_POSITIONS];
      if (!writesStream(variant, stream)) continue;
      part = buffers.parts[static_cast<std::size_t>(BufferRole::positions) + stream];
      if (part.size > range) {
        const std::uint64_t step = outputWindowStep(plan_->limits);
        // Without separate ranges all outputs that have several windows have the same one.
        const std::uint64_t begin =
            (plan_->limits.separateRanges ? dispatch.windows[stream]
                                          : std::ranges::max(dispatch.windows)) *
            step;
        part.offset = std::min(begin, (part.size - 1) / step * step);
        part.size = std::min(part.size - part.offset, range);
      }
    }
    // Not an output: the validation layer would report results that are read there and that another
    // dispatch wrote.
    parts[abi::BINDING_RESULTS] = orElse(results, tables);
  } else if (variant.kernel == Kernel::morphLists) {
    parts[abi::BINDING_MESHES] = buffers[BufferRole::meshes];
    parts[abi::BINDING_WEIGHTS] = readsPoses ? joints : buffers[BufferRole::meshes];
    parts[abi::BINDING_DRIVEN] = orElse(driven, buffers[BufferRole::meshes]);
  } else if (variant.kernel == Kernel::rig) {
    parts[abi::BINDING_MESHES] = buffers[BufferRole::meshes];
    parts[abi::BINDING_JOINTS] = joints;
    parts[abi::BINDING_DRIVEN] = driven;
  } else if (variant.kernel == Kernel::sample || variant.kernel == Kernel::compose) {
    parts[abi::BINDING_MESHES] = buffers[BufferRole::meshes];
    parts[abi::BINDING_PALETTES] = buffers[BufferRole::palettes];
    if (readsPoses) parts[abi::BINDING_POSITIONS] = joints;
  } else {
    const BufferPart& palettes = buffers[BufferRole::palettes];
    parts[abi::BINDING_MESHES] =
        variant.kernel == Kernel::palette ? orElse(joints, tables) : tables;
    parts[abi::BINDING_PALETTES] = orElse(palettes, results);
    if (variant.kernel == Kernel::palette)
      parts[abi::BINDING_DRIVEN] = orElse(driven, parts[abi::BINDING_MESHES]);
    parts[abi::BINDING_RESULTS] = orElse(results, palettes);
  }
  const std::uint32_t count = plan_->limits.maxStorageBuffersPerStage < storageBuffersWanted
                                  ? abi::MIN_BINDING_COUNT
                                  : abi::BINDING_COUNT;
  std::vector<Binding>& bindings = plan_->bindings;
  const std::size_t first = bindings.size();
  for (std::uint32_t slot = 0; slot < count; ++slot) {
    if (parts[slot].size != 0) bindings.push_back({slot, false, parts[slot]});
  }
  if (variant.texels) {
    const auto texels = [&](std::uint32_t slot, const BufferPart& part) {
      if (part.size >= abi::TEXEL_BYTES) bindings.push_back({slot, true, part});
    };
    texels(abi::BINDING_TABLE_TEXELS, tables);
    texels(abi::BINDING_MESH_TEXELS, buffers[BufferRole::meshes]);
    const bool writesPoses = variant.kernel == Kernel::compose;
    texels(abi::BINDING_PALETTE_TEXELS, writesPoses ? buffers[BufferRole::palettes] : joints);
  }
  auto& command = std::get<DispatchCommand>(
      plan_->commands.emplace_back(std::in_place_type<DispatchCommand>, dispatch.command));
  command.bindings = std::span(bindings).subspan(first);
  if (command.indirect.size != 0) command.indirect.buffer = tables.buffer;
  if (std::ranges::find(plan_->pipelines, command.pipeline) == plan_->pipelines.end())
    plan_->pipelines.push_back(command.pipeline);
}

void Encoder::listDispatches(const PlanBuffers& buffers) {
  constexpr Use any = Use::computeRead | Use::computeWrite | Use::indirectRead;
  std::uint32_t stage = 0;
  bool isListed = drivenLists_.empty();
  for (const Dispatch& dispatch : dispatches_) {
    if (!isListed && dispatch.stage >= paletteStage_) {  // rigs are done
      isListed = true;
      for (const Dispatch& list : drivenLists_) {
        plan_->commands.emplace_back(BarrierCommand{Use::computeWrite, computeBoth});
        listDispatch(list, buffers);
      }
      plan_->commands.emplace_back(BarrierCommand{Use::computeWrite, any});
      stage = dispatch.stage;
    }
    if (dispatch.stage > stage) {
      plan_->commands.emplace_back(BarrierCommand{Use::computeWrite, computeBoth});
      stage = dispatch.stage;
    }
    listDispatch(dispatch, buffers);
  }
}

bool Encoder::listsNothing(const FrameWork& frame) const {
  return dispatches_.empty() && frame.growth.empty() && frame.uploads.empty() &&
         frame.moves.empty();
}

void Encoder::listBatch(const PlanBuffers& buffers) {
  listDispatches(buffers);
}

void Encoder::listFrame(const PlanBuffers& buffers, const FrameWork& frame) {
  std::vector<Command>& commands = plan_->commands;
  const auto append = [&commands](const auto& list) {
    commands.insert(commands.end(), list.begin(), list.end());
  };
  const bool culls = !work_->culled.empty();
  constexpr Use copyBoth = Use::copyRead | Use::copyWrite;
  // Earlier frames have finished reading what this frame overwrites, and their writes are visible.
  commands.emplace_back(
      BarrierCommand{computeBoth | copyBoth | Use::indirectRead, computeBoth | copyBoth});
  if (!frame.growth.empty()) {
    append(frame.growth);
    commands.emplace_back(BarrierCommand{Use::copyWrite, copyBoth});
  }
  if (const std::span<const std::byte> bytes = plan_->tables.bytes(); !bytes.empty()) {
    BufferPart tables = buffers[BufferRole::tables];
    tables.size = bytes.size();
    commands.emplace_back(UploadCommand{tables, bytes});
  }
  append(frame.uploads);
  append(frame.moves);
  const BufferPart counters{buffers[BufferRole::history].buffer, 0, historyRecords};
  if (culls) commands.emplace_back(ClearCommand{counters});
  BufferPart unclear = buffers[BufferRole::history];
  const std::uint64_t clear =
      historyRecords + frame.clearHistory * std::uint64_t{sizeof(abi::HistoryRecord)};
  if (culls && clear < unclear.size) {
    unclear.offset += clear;
    unclear.size -= clear;
    commands.emplace_back(ClearCommand{unclear});
  }
  commands.emplace_back(BarrierCommand{Use::copyWrite, computeBoth});
  for (const Dispatch& dispatch : lists_) {  // each reads and writes tables
    listDispatch(dispatch, buffers);
    commands.emplace_back(BarrierCommand{Use::computeWrite, computeBoth});
  }
  if (culls) {
    listDispatch(visibility_[0], buffers);
    commands.emplace_back(BarrierCommand{Use::computeWrite, computeBoth});
    listDispatch(visibility_[1], buffers);
    commands.emplace_back(BarrierCommand{Use::computeWrite, computeBoth | Use::indirectRead});
  }
  listDispatches(buffers);
  if (culls || !frame.results.empty()) {
    commands.emplace_back(BarrierCommand{Use::computeWrite, Use::copyRead});
    if (culls) {
      commands.emplace_back(CopyCommand{counters.buffer, buffers[BufferRole::readBack].buffer, 0,
                                        readBackCounters, counters.size});
      if (frame.history.size != 0) commands.emplace_back(frame.history);
    }
    append(frame.results);
    commands.emplace_back(BarrierCommand{Use::copyWrite, Use::hostRead});
  }
}

}  // namespace dermis
