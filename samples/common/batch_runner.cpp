#include "batch_runner.h"

#include <algorithm>
#include <cstring>

#include "barrier.h"

namespace dermis::samples {
namespace {

constexpr std::array<BufferRole, streamCount> outputRoles{BufferRole::positions,
                                                          BufferRole::normals, BufferRole::tangents,
                                                          BufferRole::previousPositions};

constexpr std::array<const char*, streamCount> outputNames{
    "the positions' buffer", "the normals' buffer", "the tangents' buffer",
    "the previous positions' buffer"};

struct Buffers {
  MappedBuffer meshes, poses, tables, palettes, results;
};

Result<Buffers> makeBuffers(Device& device, const Plan& plan) {
  Buffers buffers;
  for (const auto& [buffer, role] : {std::pair{&buffers.meshes, BufferRole::meshes},
                                     {&buffers.poses, BufferRole::poses},
                                     {&buffers.tables, BufferRole::tables},
                                     {&buffers.palettes, BufferRole::palettes},
                                     {&buffers.results, BufferRole::results}}) {
    const BufferRequirement requirement = plan.buffer(role);
    const bool readBack = role == BufferRole::results || role == BufferRole::palettes;
    Result<MappedBuffer> made =
        MappedBuffer::create(device, requirement.size, requirement.usage, readBack);
    if (!made) return made.error();
    *buffer = std::move(*made);
  }
  return buffers;
}

void fill(const BatchLayout& layout, const Buffers& buffers) {
  for (const auto& [mesh, offset] : layout.meshOffsets) {
    std::memcpy(buffers.meshes.bytes().data() + offset, mesh->bytes().data(), mesh->bytes().size());
  }
  for (std::size_t index = 0; index < layout.poses.size(); ++index) {
    std::memcpy(buffers.poses.bytes().data() + layout.poseDescriptions[index].matrixOffset,
                layout.poses[index].data(), layout.poses[index].size_bytes());
  }
}

Result<void> submit(Device& device, const vulkan::Context& context, const Plan& plan,
                    const vulkan::Bindings& bindings) {
  const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  device.functions().BeginCommandBuffer(commandBuffer, &begin);
  recordBarrier(device, commandBuffer, vulkan::inputScope(vulkan::PreviousUse::previousRecord));
  Result<void> done = context.record(commandBuffer, plan, bindings);
  recordBarrier(device, commandBuffer, vulkan::outputScope(vulkan::Consumer::hostRead));
  device.functions().EndCommandBuffer(commandBuffer);
  if (done) done = device.submitAndWait(commandBuffer);
  device.freeCommandBuffer(commandBuffer);
  return done;
}

/// A tightly packed copy of one attribute of one instance.
std::vector<std::byte> copyAttribute(std::span<const std::byte> output,
                                     const OutputAttribute& attribute, std::uint32_t vertices) {
  const std::size_t size = formatSize(attribute.format);
  std::vector<std::byte> copy(size * vertices);
  for (std::size_t vertex = 0; size != 0 && vertex < vertices; ++vertex) {
    std::memcpy(copy.data() + vertex * size,
                output.data() + attribute.offset + vertex * attribute.stride, size);
  }
  return copy;
}

/// The first three floats of every element.
std::vector<float> floatsOf(const std::vector<std::byte>& bytes, VertexFormat format) {
  std::vector<float> floats;
  if (format != VertexFormat::float32x3 && format != VertexFormat::float32x4) return floats;
  const std::size_t size = formatSize(format);
  floats.resize(bytes.size() / size * 3);
  for (std::size_t element = 0; element * size < bytes.size(); ++element)
    std::memcpy(floats.data() + element * 3, bytes.data() + element * size, 12);
  return floats;
}

}  // namespace

SkinnedAttribute SkinnedVertices::attribute(Stream stream) const {
  const auto index = static_cast<std::size_t>(stream);
  const std::uint32_t size = formatSize(formats[index]);
  if (size == 0) return {};
  return {streams[index].data(), static_cast<std::uint32_t>(streams[index].size() / size), size,
          formats[index]};
}

SkinnedView SkinnedVertices::view() const {
  return {attribute(Stream::positions), attribute(Stream::normals), attribute(Stream::tangents),
          box};
}

Result<void> BatchRunner::makeOutputs(const Plan& plan) {
  for (std::size_t stream = 0; stream < (layout_.oneOutput ? 1 : streamCount); ++stream) {
    const BufferRequirement requirement = plan.buffer(outputRoles[stream]);
    if (outputs_[stream].bytes().size() == requirement.size) continue;
    Result<MappedBuffer> made =
        MappedBuffer::create(device_, requirement.size, requirement.usage, true);
    if (!made) return made.error();
    outputs_[stream] = std::move(*made);
    std::ranges::fill(outputs_[stream].bytes(), options_.poison);
  }
  return {};
}

vulkan::OutputBuffers BatchRunner::outputRanges() const {
  if (layout_.oneOutput) return vulkan::OutputBuffers::oneBuffer(outputs_[0].range());
  return {outputs_[0].range(), outputs_[1].range(), outputs_[2].range(), outputs_[3].range()};
}

void BatchRunner::countChangedBytes(BatchResult& result) const {
  std::array<std::vector<bool>, streamCount> written;
  for (std::size_t buffer = 0; buffer < streamCount; ++buffer)
    written[buffer].resize(outputs_[buffer].bytes().size());
  for (const Job& job : layout_.jobs) {
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const OutputAttribute attribute = attributeOf(job, stream);
      std::vector<bool>& marks = written[layout_.oneOutput ? 0 : stream];
      for (std::uint64_t vertex = 0; vertex < job.mesh.vertexCount; ++vertex) {
        for (std::uint64_t byte = 0; byte < formatSize(attribute.format); ++byte)
          marks[static_cast<std::size_t>(attribute.offset + vertex * attribute.stride + byte)] =
              true;
      }
    }
  }
  for (std::size_t buffer = 0; buffer < streamCount; ++buffer) {
    const std::span<const std::byte> bytes = outputs_[buffer].bytes();
    for (std::size_t byte = 0; byte < bytes.size(); ++byte) {
      if (written[buffer][byte] || bytes[byte] == options_.poison) continue;
      if (result.untouchedBytesChanged++ == 0)
        result.firstChanged = "byte " + std::to_string(byte) + " of " + outputNames[buffer];
    }
  }
}

BatchResult BatchRunner::readBack(const Plan& plan, const MappedBuffer& palettes,
                                  const MappedBuffer& results) const {
  BatchResult result;
  result.dispatches = plan.dispatchCount();
  for (std::uint32_t index = 0; index < layout_.jobs.size(); ++index) {
    const Job& job = layout_.jobs[index];
    SkinnedVertices skinned;
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const OutputAttribute attribute = attributeOf(job, stream);
      skinned.formats[stream] = attribute.format;
      skinned.streams[stream] = copyAttribute(outputs_[layout_.oneOutput ? 0 : stream].bytes(),
                                              attribute, job.mesh.vertexCount);
    }
    skinned.positions = floatsOf(skinned.streams[0], skinned.formats[0]);
    skinned.normals = floatsOf(skinned.streams[1], skinned.formats[1]);
    skinned.box = job.box;
    if (const std::uint64_t status = plan.statusOffset(job.pose); status != Plan::noStatus)
      std::memcpy(&skinned.status, palettes.bytes().data() + status, sizeof(skinned.status));
    if (const std::uint64_t place = plan.resultOffset(index); place != Plan::noResult)
      std::memcpy(&skinned.result, results.bytes().data() + place, sizeof(skinned.result));
    result.instances.push_back(std::move(skinned));
  }
  if (options_.countUntouched) countChangedBytes(result);
  return result;
}

Result<BatchResult> BatchRunner::run(std::span<const SkinRequest> requests) {
  layout_ = layOutBatch(requests, options_.output);
  Plan plan;
  if (Result<void> planned = makePlan(layout_.batch(), context_.limits(), options_.tuning, plan);
      !planned)
    return planned.error();
  if (Result<void> ready = context_.prepare(plan.variants()); !ready) return ready.error();

  Result<Buffers> buffers = makeBuffers(device_, plan);
  if (!buffers) return buffers.error();
  if (Result<void> made = makeOutputs(plan); !made) return made.error();
  fill(layout_, *buffers);
  if (Result<void> written = writeTables(plan, buffers->tables.bytes()); !written)
    return written.error();
  Result<vulkan::Bindings> bindings = context_.createBindings(
      {buffers->meshes.range(), buffers->poses.range(), buffers->tables.range(),
       buffers->palettes.range(), outputRanges(), buffers->results.range()});
  if (!bindings) return bindings.error();
  if (Result<void> done = submit(device_, context_, plan, *bindings); !done) return done.error();
  return readBack(plan, buffers->palettes, buffers->results);
}

Result<BatchResult> runBatch(Device& device, vulkan::Context& context,
                             std::span<const SkinRequest> requests, const RunOptions& options) {
  return BatchRunner(device, context, options).run(requests);
}

}  // namespace dermis::samples
