// Compressed data, replaced by what it decodes to before anything else reads it.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gltf/buffers.h"
#include "gltf/document.h"
#include "gltf/failure.h"
#include "gltf/notes.h"

namespace dermis::gltf {

inline constexpr std::string_view dracoExtension = "KHR_draco_mesh_compression";
/// Of one layout. The KHR extension also has a filter for colors, and newer versions of the codecs.
inline constexpr std::string_view meshoptExtensions[] = {"EXT_meshopt_compression",
                                                         "KHR_meshopt_compression"};

/// Whether this build decodes these extensions.
#ifdef DERMIS_MESHOPTIMIZER
inline constexpr bool decodesMeshopt = true;
#else
inline constexpr bool decodesMeshopt = false;
#endif
#ifdef DERMIS_DRACO
inline constexpr bool decodesDraco = true;
#else
inline constexpr bool decodesDraco = false;
#endif

/// The end of a sentence about an extension that this build does not decode.
inline std::string notDecoded(std::string_view extension) {
  return join(inQuotes(extension), ", which this build does not decode (CMake option ",
              extension == dracoExtension ? "DERMIS_DRACO" : "DERMIS_MESHOPTIMIZER",
              "); 'gltf-transform copy' writes the file without it");
}

/// Decodes all bufferViews that meshopt extensions compress, each into a new buffer. Throws
/// `Failure`: `invalidData` if the data is damaged, or `unsupportedFeature` if this build does not
/// decode it and the file has no uncompressed data. In a view that nothing skinned or animated
/// uses, that gives a note, and the view has no bytes.
void decodeViews(Document& document, std::vector<Buffer>& buffers, MemoryBudget& budget,
                 Notes& notes);

/// If KHR_draco_mesh_compression compresses the primitive, decodes it, and adds a bufferView and a
/// buffer for each of its accessors. Throws `Failure` as `decodeViews`.
void decodePrimitive(std::size_t mesh, std::size_t primitive, Document& document,
                     std::vector<Buffer>& buffers, MemoryBudget& budget);

/// Adds a buffer of these bytes and returns its index.
inline int addBuffer(std::vector<Buffer>& buffers, std::vector<std::byte> bytes) {
  Buffer& buffer = buffers.emplace_back();
  buffer.byteLength = bytes.size();
  buffer.storage = std::make_shared<const std::vector<std::byte>>(std::move(bytes));
  buffer.bytes = *buffer.storage;
  return static_cast<int>(buffers.size() - 1);
}

}  // namespace dermis::gltf
