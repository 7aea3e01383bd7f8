// The commands of a frame.

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <string>

#include "abi.h"
#include "dermis/vulkan/scope.h"
#include "vulkan/system/state.h"

namespace dermis::vulkan {
namespace {

constexpr std::uint64_t leastTables = 64 * 1024;

constexpr VkPipelineStageFlags compute = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
constexpr VkPipelineStageFlags transfer = VK_PIPELINE_STAGE_TRANSFER_BIT;
constexpr VkAccessFlags shader = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT;

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

void barrier(const DispatchTable& table, VkCommandBuffer commandBuffer, const Scope& source,
             const Scope& destination) {
  const VkMemoryBarrier memory = memoryBarrier({source, destination});
  table.cmdPipelineBarrier(commandBuffer, source.stages, destination.stages, 0, 1, &memory, 0,
                           nullptr, 0, nullptr);
}

}  // namespace

/// Tables that are too small are replaced, the old ones kept until their frames are complete.
Result<void> SkinningSystem::State::makeRoomForTables() {
  const std::uint64_t needed = scene.currentPlan().buffer(BufferRole::tables).size;
  std::uint64_t size = std::max(tables.size(), leastTables);
  while (size < needed) size *= 2;
  size = std::min(size, scene.description().limits.maxStorageBufferRange & ~std::uint64_t{3});
  if (tables.size() < needed || tables.size() == 0) {
    Result<SystemBuffer> made = SystemBuffer::create(
        source,
        {size, readUsage() | VK_BUFFER_USAGE_TRANSFER_DST_BIT | VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT,
         MemoryUse::device, "dermis tables"});
    if (!made) return made.error();
    BatchBuffers buffers{meshes.range(),
                         matrices.range(),
                         made->range(),
                         palettes.range(),
                         OutputBuffers::oneBuffer(output.range()),
                         results.range()};
    Result<Bindings> bound = context->createBindings(buffers);
    if (!bound) return bound.error();
    retired.push_back({scene.frameNumber(), std::exchange(tables, std::move(*made)),
                       std::exchange(bindings, std::move(*bound))});
  }
  FrameSlot& own = slot();
  if (own.staging.size() >= needed && own.staging.size() != 0) return {};
  Result<SystemBuffer> staging = SystemBuffer::create(
      source, {size, VK_BUFFER_USAGE_TRANSFER_SRC_BIT, MemoryUse::upload, "dermis table upload"});
  if (!staging) return staging.error();
  own.staging = std::move(*staging);  // its last frame is complete
  return {};
}

Result<void> SkinningSystem::State::prepareVisibility() {
  if (preparedVisibility() != nullptr) return {};
  auto made = std::make_unique<Visibility>();
  if (Result<void> done = made->create(*context, scene.description().tuning,
                                       static_cast<std::uint32_t>(slots.size()));
      !done)
    return done;
  const std::lock_guard lock(visibilityMutex);
  if (visibility == nullptr) visibility = std::move(made);  // another thread may have been faster
  return {};
}

const Visibility* SkinningSystem::State::preparedVisibility() {
  const std::lock_guard lock(visibilityMutex);
  return visibility.get();
}

/// With the first instance that is culled on the GPU.
Result<void> SkinningSystem::State::makeHistory() {
  if (history.size() != 0) return {};
  Result<SystemBuffer> made = SystemBuffer::create(
      source, {std::uint64_t{scene.description().instanceBudget} * sizeof(abi::HistoryRecord),
               VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT,
               MemoryUse::device, "dermis history"});
  if (!made) return made.error();
  history = std::move(*made);
  return {};
}

bool SkinningSystem::State::hasWork() const {
  return !scene.currentPlan().dispatches().empty() || !scene.moves().empty() || !uploads.empty();
}

Result<void> SkinningSystem::State::recordFrame(VkCommandBuffer commandBuffer,
                                                const FrameDescription& frame) {
  const Stopwatch planning;
  if (Result<void> planned = scene.plan(); !planned) return planned;
  const Plan& plan = scene.currentPlan();
  const bool culls = scene.culled().candidateCount != 0;
  if (culls && frame.visibility == VK_NULL_HANDLE) {
    return Error{ErrorCode::invalidArgument,
                 "FrameDescription::visibility is null, and there are instances that are culled on "
                 "the GPU"};
  }
  if (scene.culled().groupCount > context->limits.maxWorkgroupCountX) {
    return Error{ErrorCode::limitExceeded,
                 "instances that are culled on the GPU have " +
                     std::to_string(scene.culled().groupCount) +
                     " meshes and layouts, more than the device can count workgroups"};
  }
  if (culls && preparedVisibility() == nullptr) {
    return Error{ErrorCode::notPrepared,
                 "there are instances that are culled on the GPU, and none such has been prepared"};
  }
  if (culls) {
    if (Result<void> made = makeHistory(); !made) return made;
  }
  const bool works = hasWork();
  if (works) {
    if (Result<void> room = makeRoomForTables(); !room) return room;
    if (Result<void> good = bindings.state_->check(plan); !good) return good;
    if (Result<void> written = writeTables(plan, slot().staging.bytes()); !written) return written;
  }
  const double planSeconds = planning.seconds();

  const Stopwatch recording;
  frameStatistics = {};
  FrameSlot& own = slot();
  own.frame = scene.frameNumber();
  own.hasCounters = own.hasTimestamps = false;
  own.results.clear();
  if (works) recordCommands(commandBuffer, frame);
  scene.commit();

  const Scene::Counts counts = scene.counts();
  frameStatistics.frame = scene.frameNumber();
  frameStatistics.instances = counts.instances;
  frameStatistics.skinnedInstances = counts.skinned;
  frameStatistics.settledInstances = counts.settled;
  frameStatistics.convertedPalettes = counts.palettes;
  frameStatistics.skinnedVertices = counts.vertices;
  frameStatistics.culledCandidates = counts.culled;
  frameStatistics.writtenBytes = counts.writtenBytes;
  frameStatistics.uploadedBytes += counts.poseBytes;
  frameStatistics.planSeconds = planSeconds;
  frameStatistics.recordSeconds = recording.seconds();
  return {};
}

void SkinningSystem::State::recordCommands(VkCommandBuffer commandBuffer,
                                           const FrameDescription& frame) {
  const DispatchTable& table = context->table;
  const Label label(table, commandBuffer, "dermis: skin a frame");
  timestamps.begin(commandBuffer, slotNumber());
  // Frames before this one have finished with what is overwritten, and what they wrote is seen.
  barrier(
      table, commandBuffer,
      {compute | transfer | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT,
       VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT},
      {compute | transfer, shader | VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_TRANSFER_WRITE_BIT});
  recordCopies(commandBuffer);
  barrier(table, commandBuffer, {transfer, VK_ACCESS_TRANSFER_WRITE_BIT}, {compute, shader});
  recordDispatches(commandBuffer, frame);
  recordReadBack(commandBuffer);
  timestamps.end(commandBuffer, slotNumber());
  slot().hasTimestamps = timestamps.isCreated();
}

void SkinningSystem::State::recordCopies(VkCommandBuffer commandBuffer) {
  const Label label(context->table, commandBuffer, "dermis: upload");
  if (const std::uint64_t size = scene.currentPlan().buffer(BufferRole::tables).size; size != 0) {
    const VkBufferCopy region{0, 0, size};
    functions.cmdCopyBuffer(commandBuffer, slot().staging.handle(), tables.handle(), 1, &region);
    ++frameStatistics.copies;
    frameStatistics.uploadedBytes += size;
  }
  for (MeshUpload& upload : uploads) {
    const Range bytes = scene.meshes().find(upload.mesh)->bytes;
    const VkBufferCopy region{0, bytes.offset, bytes.size};
    functions.cmdCopyBuffer(commandBuffer, upload.staging.handle(), meshes.handle(), 1, &region);
    ++frameStatistics.copies;
    frameStatistics.uploadedBytes += bytes.size;
    retired.push_back({scene.frameNumber(), std::move(upload.staging), {}});
  }
  uploads.clear();
  if (!scene.moves().empty()) {
    std::vector<VkBufferCopy> regions;
    for (const OutputMove& move : scene.moves()) {
      regions.push_back({move.from, move.to, move.size});
      frameStatistics.movedBytes += move.size;
    }
    functions.cmdCopyBuffer(commandBuffer, output.handle(), output.handle(),
                            static_cast<std::uint32_t>(regions.size()), regions.data());
    ++frameStatistics.copies;
  }
  if (scene.culled().candidateCount == 0) return;
  functions.cmdFillBuffer(commandBuffer, counters.handle(), 0, VK_WHOLE_SIZE, 0);
  if (!historyIsClear)
    functions.cmdFillBuffer(commandBuffer, history.handle(), 0, VK_WHOLE_SIZE, 0);
  historyIsClear = true;
}

void SkinningSystem::State::recordDispatches(VkCommandBuffer commandBuffer,
                                             const FrameDescription& frame) {
  const DispatchTable& table = context->table;
  const CulledTables& culled = scene.culled();
  if (culled.candidateCount != 0) {
    const BufferRange chosen{frame.visibility, frame.visibilityOffset,
                             std::uint64_t{scene.description().instanceBudget} * 4};
    preparedVisibility()->record(
        commandBuffer, culled,
        {tables.range(), chosen, history.range(), counters.range(), results.range()},
        static_cast<std::uint32_t>(scene.recordNumber() + 1), slotNumber());
    frameStatistics.dispatches += 2;
  }
  bool palettesVisible = false;
  const std::span<const Dispatch> dispatches = scene.currentPlan().dispatches();
  for (std::size_t index = 0; index < dispatches.size(); ++index) {
    const Dispatch& dispatch = dispatches[index];
    if (dispatch.afterPalettes && !palettesVisible) {
      recordPaletteBarrier(table, commandBuffer, bindings.state_->buffers);
      palettesVisible = true;
    }
    ++frameStatistics.dispatches;
    if (index < scene.firstIndirect()) {
      recordDispatch(commandBuffer, dispatch, *bindings.state_, nullptr);
      frameStatistics.workgroups += dispatch.constants.workgroupCount;
      continue;
    }
    const std::uint64_t offset =
        (culled.arguments + (index - scene.firstIndirect()) * abi::INDIRECT_WORDS) * 4;
    const IndirectArguments arguments{functions.cmdDispatchIndirect, tables.handle(), offset};
    recordDispatch(commandBuffer, dispatch, *bindings.state_, &arguments);
  }
}

/// The regions of the results that the frame writes, each as far into the read-back behind the
/// counters. What lies between two near each other is copied too.
void SkinningSystem::State::findResults(std::vector<VkBufferCopy>& regions) {
  constexpr std::uint32_t bits = 64;
  std::vector<std::uint64_t>& marks = resultMarks;
  marks.clear();
  for (const std::uint32_t result : scene.plannedResults()) {
    if (result / bits >= marks.size()) marks.resize(result / bits + std::size_t{1});
    marks[result / bits] |= std::uint64_t{1} << result % bits;
  }
  for (std::size_t begin = 0; begin < marks.size(); ++begin) {
    if (marks[begin] == 0) continue;
    std::size_t last = begin;
    while (last + 1 < marks.size() && marks[last + 1] != 0) ++last;
    const std::uint64_t first =
        begin * bits + static_cast<std::uint64_t>(std::countr_zero(marks[begin]));
    const std::uint64_t end =
        (last + 1) * bits - static_cast<std::uint64_t>(std::countl_zero(marks[last]));
    regions.push_back({first * sizeof(InstanceResult),
                       counters.size() + first * sizeof(InstanceResult),
                       (end - first) * sizeof(InstanceResult)});
    begin = last;
  }
}

/// Counters and boxes that the frame writes.
void SkinningSystem::State::recordReadBack(VkCommandBuffer commandBuffer) {
  const bool culls = scene.culled().candidateCount != 0;
  FrameSlot& own = slot();
  findResults(own.results);
  if (!culls && own.results.empty()) return;
  const DispatchTable& table = context->table;
  barrier(table, commandBuffer, {compute, VK_ACCESS_SHADER_WRITE_BIT},
          {transfer, VK_ACCESS_TRANSFER_READ_BIT});
  const auto copy = [&](const SystemBuffer& from, std::span<const VkBufferCopy> regions) {
    functions.cmdCopyBuffer(commandBuffer, from.handle(), own.readBack.handle(),
                            static_cast<std::uint32_t>(regions.size()), regions.data());
    ++frameStatistics.copies;
  };
  const VkBufferCopy allCounters{0, 0, counters.size()};
  if (culls) copy(counters, {&allCounters, 1});
  if (!own.results.empty()) copy(results, own.results);
  barrier(table, commandBuffer, {transfer, VK_ACCESS_TRANSFER_WRITE_BIT},
          {VK_PIPELINE_STAGE_HOST_BIT, VK_ACCESS_HOST_READ_BIT});
  own.hasCounters = culls;
}

}  // namespace dermis::vulkan
