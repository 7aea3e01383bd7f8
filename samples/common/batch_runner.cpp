#include "batch_runner.h"

#include <algorithm>
#include <cstring>
#include <map>

#include "dermis/vulkan/scope.h"

namespace dermis::samples {
namespace {

constexpr std::byte poison{0xa5};

/// Everything that stands in one mesh buffer, one matrices buffer and one output buffer.
struct Layout {
  std::map<const PackedMesh*, std::uint64_t> meshOffsets;
  std::vector<Palette> palettes;
  std::vector<Job> jobs;
  std::uint64_t meshesSize = 0, matricesSize = 0, outputSize = 0;
  std::vector<std::uint64_t> matrixOffsets;
};

Layout layOut(std::span<const SkinRequest> requests, const RunOptions& options) {
  Layout layout;
  for (const SkinRequest& request : requests) {
    const auto [entry, isNew] = layout.meshOffsets.try_emplace(request.mesh, layout.meshesSize);
    if (isNew) layout.meshesSize += request.mesh->bytes().size();

    Palette palette;
    palette.jointCount = static_cast<std::uint32_t>(request.palette.size());
    palette.matrixOffset = layout.matricesSize;
    palette.mayScale = request.mayScale;
    layout.matricesSize += request.palette.size_bytes();
    layout.palettes.push_back(palette);

    const bool normals = options.normals && request.mesh->hasNormals();
    const std::uint32_t stride = std::max(options.stride, normals ? 24u : 12u);
    Job job;
    job.mesh = request.mesh->info();
    job.meshOffset = entry->second;
    job.palette = static_cast<std::uint32_t>(layout.palettes.size() - 1);
    job.method = request.method;
    job.positions = {layout.outputSize, stride};
    if (normals) job.normals = {layout.outputSize + 12, stride};
    layout.jobs.push_back(job);
    layout.outputSize += std::uint64_t{request.mesh->vertexCount()} * stride;
  }
  return layout;
}

struct Buffers {
  MappedBuffer meshes, matrices, tables, palettes, output;
};

Result<Buffers> makeBuffers(Device& device, const Plan& plan) {
  Buffers buffers;
  for (const auto& [buffer, role] : {std::pair{&buffers.meshes, BufferRole::meshes},
                                     {&buffers.matrices, BufferRole::matrices},
                                     {&buffers.tables, BufferRole::tables},
                                     {&buffers.palettes, BufferRole::palettes},
                                     {&buffers.output, BufferRole::output}}) {
    const BufferRequirement requirement = plan.buffer(role);
    const bool readBack = role == BufferRole::output || role == BufferRole::palettes;
    Result<MappedBuffer> made =
        MappedBuffer::create(device, requirement.size, requirement.usage, readBack);
    if (!made) return made.error();
    *buffer = std::move(*made);
  }
  return buffers;
}

void fill(const Layout& layout, std::span<const SkinRequest> requests, const Buffers& buffers) {
  for (const auto& [mesh, offset] : layout.meshOffsets) {
    std::memcpy(buffers.meshes.bytes().data() + offset, mesh->bytes().data(), mesh->bytes().size());
  }
  for (std::size_t index = 0; index < requests.size(); ++index) {
    std::memcpy(buffers.matrices.bytes().data() + layout.palettes[index].matrixOffset,
                requests[index].palette.data(), requests[index].palette.size_bytes());
  }
  std::ranges::fill(buffers.output.bytes(), poison);
}

void recordBarrier(const Device& device, VkCommandBuffer commandBuffer,
                   const vulkan::Dependency& dependency) {
  const VkMemoryBarrier barrier = vulkan::memoryBarrier(dependency);
  device.functions().CmdPipelineBarrier(commandBuffer, dependency.source.stages,
                                        dependency.destination.stages, 0, 1, &barrier, 0, nullptr,
                                        0, nullptr);
}

Result<void> submit(Device& device, const vulkan::Context& context, const Plan& plan,
                    const vulkan::Bindings& bindings) {
  const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  device.functions().BeginCommandBuffer(commandBuffer, &begin);
  Result<void> done = context.record(commandBuffer, plan, bindings);
  recordBarrier(device, commandBuffer, vulkan::outputScope(vulkan::Consumer::hostRead));
  device.functions().EndCommandBuffer(commandBuffer);
  if (done) done = device.submitAndWait(commandBuffer);
  device.freeCommandBuffer(commandBuffer);
  return done;
}

void readVector(std::span<const std::byte> bytes, std::uint64_t offset, std::vector<float>& out) {
  float vector[3];
  std::memcpy(vector, bytes.data() + offset, sizeof(vector));
  out.insert(out.end(), vector, vector + 3);
}

BatchResult readBack(const Layout& layout, const Plan& plan, const Buffers& buffers) {
  BatchResult result;
  result.dispatches = plan.dispatches().size();
  const std::span<const std::byte> output = buffers.output.bytes();
  for (const Job& job : layout.jobs) {
    SkinnedVertices skinned;
    const std::uint64_t used = job.normals.stride != 0 ? 24 : 12;
    for (std::uint64_t vertex = 0; vertex < job.mesh.vertexCount; ++vertex) {
      const std::uint64_t offset = job.positions.offset + vertex * job.positions.stride;
      readVector(output, offset, skinned.positions);
      if (job.normals.stride != 0) readVector(output, offset + 12, skinned.normals);
      for (std::uint64_t byte = used; byte < job.positions.stride; ++byte) {
        if (output[offset + byte] != poison) ++result.untouchedBytesChanged;
      }
    }
    if (const std::uint64_t status = plan.statusOffset(job.palette); status != Plan::noStatus) {
      std::memcpy(&skinned.status, buffers.palettes.bytes().data() + status,
                  sizeof(skinned.status));
    }
    result.instances.push_back(std::move(skinned));
  }
  return result;
}

}  // namespace

Result<BatchResult> runBatch(Device& device, vulkan::Context& context,
                             std::span<const SkinRequest> requests, const RunOptions& options) {
  const Layout layout = layOut(requests, options);
  Batch batch;
  batch.palettes = layout.palettes;
  batch.jobs = layout.jobs;
  batch.meshesSize = layout.meshesSize;
  batch.matricesSize = layout.matricesSize;
  batch.outputSize = layout.outputSize;
  Plan plan;
  if (Result<void> planned = makePlan(batch, context.limits(), options.tuning, plan); !planned)
    return planned.error();
  if (Result<void> ready = context.prepare(plan.variants()); !ready) return ready.error();

  Result<Buffers> buffers = makeBuffers(device, plan);
  if (!buffers) return buffers.error();
  fill(layout, requests, *buffers);
  if (Result<void> written = writeTables(plan, buffers->tables.bytes()); !written)
    return written.error();
  Result<vulkan::Bindings> bindings = context.createBindings(
      {buffers->meshes.range(), buffers->matrices.range(), buffers->tables.range(),
       buffers->palettes.range(), buffers->output.range()});
  if (!bindings) return bindings.error();
  if (Result<void> done = submit(device, context, plan, *bindings); !done) return done.error();
  return readBack(layout, plan, *buffers);
}

}  // namespace dermis::samples
