// EXT_meshopt_compression and KHR_meshopt_compression.
#include <limits>
#include <utility>

#include "gltf/compression.h"

#ifdef DERMIS_MESHOPTIMIZER
#include <meshoptimizer.h>
#endif

namespace dermis::gltf {
namespace {

#ifdef DERMIS_MESHOPTIMIZER
std::vector<std::byte> decode(const CompressedView& from, std::span<const std::byte> bytes,
                              const std::string& where) {
  const auto count = static_cast<std::size_t>(from.count);
  std::vector<std::byte> decoded(count * from.stride);
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  using Mode = CompressedView::Mode;
  using Filter = CompressedView::Filter;
  int error = 0;
  if (from.mode == Mode::attributes) {
    error = meshopt_decodeVertexBuffer(decoded.data(), count, from.stride, data, bytes.size());
  } else if (from.mode == Mode::triangles) {
    error = meshopt_decodeIndexBuffer(decoded.data(), count, from.stride, data, bytes.size());
  } else {
    error = meshopt_decodeIndexSequence(decoded.data(), count, from.stride, data, bytes.size());
  }
  if (error != 0) {
    failInvalid(where, ": its data (", from.extension,
                ") cannot be decoded: it is damaged, or too new for this build's meshoptimizer");
  }
  if (from.filter == Filter::octahedral)
    meshopt_decodeFilterOct(decoded.data(), count, from.stride);
  if (from.filter == Filter::quaternion)
    meshopt_decodeFilterQuat(decoded.data(), count, from.stride);
  if (from.filter == Filter::exponential)
    meshopt_decodeFilterExp(decoded.data(), count, from.stride);
  return decoded;
}

void decodeView(const CompressedView& from, tinygltf::BufferView& view,
                std::vector<Buffer>& buffers, MemoryBudget& budget) {
  const std::string where = join("bufferView ", from.view);
  // Has no bytes if it cannot be decoded.
  view.buffer = std::numeric_limits<int>::max();
  const std::span<const std::byte> bytes =
      bytesIn(buffers, from.buffer, from.byteOffset, from.byteLength, where);
  spend(budget, from.count, from.stride, where);
  std::vector<std::byte> decoded = decode(from, bytes, where);
  view.byteOffset = 0;
  view.byteLength = decoded.size();
  view.buffer = addBuffer(buffers, std::move(decoded));
}
#else
// A file that does not require the extension may have uncompressed data.
void decodeView(const CompressedView& from, const tinygltf::BufferView& view,
                const std::vector<Buffer>& buffers, MemoryBudget&) {
  if (!buffers[static_cast<std::size_t>(view.buffer)].bytes.empty()) return;
  fail(ErrorCode::unsupportedFeature,
       join("bufferView ", from.view, " has no data, but ", notDecoded(from.extension)));
}
#endif

}  // namespace

void decodeViews(Document& document, std::vector<Buffer>& buffers, MemoryBudget& budget,
                 Notes& notes) {
  for (const CompressedView& from : document.usage.compressedViews) {
    tinygltf::BufferView& view = document.content.bufferViews[from.view];
    notes.tolerateUnlessUsed(document.usage.views[from.view],
                             [&] { decodeView(from, view, buffers, budget); });
  }
}

}  // namespace dermis::gltf
