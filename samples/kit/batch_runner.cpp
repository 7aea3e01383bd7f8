#include "kit/batch_runner.h"

#include <algorithm>
#include <cstring>

namespace dermis::samples {
namespace {

constexpr std::array<const char*, streamCount> outputNames{
    "the positions' buffer", "the normals' buffer", "the tangents' buffer",
    "the previous positions' buffer"};

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

void BatchRunner::readOutputs(BatchResult& result) const {
  for (std::size_t index = 0; index < layout_.jobs.size(); ++index) {
    const Job& job = layout_.jobs[index];
    SkinnedVertices& skinned = result.instances[index];
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const OutputAttribute attribute = attributeOf(job, stream);
      skinned.formats[stream] = attribute.format;
      skinned.streams[stream] =
          copyAttribute(outputBytes(outputOf(stream)), attribute, job.mesh.vertexCount);
    }
    skinned.positions = floatsOf(skinned.streams[0], skinned.formats[0]);
    skinned.normals = floatsOf(skinned.streams[1], skinned.formats[1]);
    skinned.box = job.box;
  }
}

void BatchRunner::countChangedBytes(BatchResult& result) const {
  std::array<std::vector<bool>, streamCount> written;
  for (std::size_t buffer = 0; buffer < streamCount; ++buffer)
    written[buffer].resize(outputBytes(buffer).size());
  for (const Job& job : layout_.jobs) {
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const OutputAttribute attribute = attributeOf(job, stream);
      std::vector<bool>& marks = written[outputOf(stream)];
      for (std::uint64_t vertex = 0; vertex < job.mesh.vertexCount; ++vertex) {
        for (std::uint64_t byte = 0; byte < formatSize(attribute.format); ++byte)
          marks[static_cast<std::size_t>(attribute.offset + vertex * attribute.stride + byte)] =
              true;
      }
    }
  }
  for (std::size_t buffer = 0; buffer < streamCount; ++buffer) {
    const std::span<const std::byte> bytes = outputBytes(buffer);
    for (std::size_t byte = 0; byte < bytes.size(); ++byte) {
      if (written[buffer][byte] || bytes[byte] == options_.poison) continue;
      if (result.untouchedBytesChanged++ == 0)
        result.firstChanged = "byte " + std::to_string(byte) + " of " + outputNames[buffer];
    }
  }
}

Result<BatchResult> BatchRunner::run(std::span<const SkinRequest> requests) {
  layout_ = layOutBatch(requests, options_.output);
  Result<BatchResult> result = skin();
  if (!result) return result;
  readOutputs(*result);
  if (options_.countUntouched) countChangedBytes(*result);
  return result;
}

}  // namespace dermis::samples
