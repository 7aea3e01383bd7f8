// The JSON text of a file, parsed and checked before tinygltf reads it.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "gltf/memory_budget.h"
#include "gltf/tinygltf.h"

namespace dermis::gltf {

/// Maximum nesting of JSON. Parsers recurse, so deeper nesting could overflow the stack. Real files
/// stay below 20, but `extras` may contain anything.
inline constexpr std::uint32_t deepestNesting = 512;

/// tinygltf refuses indices without a bufferView, which the specification allows (zeros, or a
/// sparse accessor). Therefore indices are passed to it as an attribute of this name.
inline constexpr const char* indicesAttribute = "_DERMIS_INDICES";

/// What the file says about one buffer.
struct BufferDescription {
  std::uint64_t byteLength = 0;
  std::optional<std::string> uri;
};

/// A bufferView that a meshopt extension compresses.
struct CompressedView {
  enum class Mode : std::uint8_t { attributes, triangles, indices };
  enum class Filter : std::uint8_t { unfiltered, octahedral, quaternion, exponential };

  std::size_t view = 0;
  std::string_view extension;
  std::size_t buffer = 0;                        ///< of the compressed bytes
  std::uint64_t byteOffset = 0, byteLength = 0;  ///< of the compressed bytes
  std::uint64_t count = 0;                       ///< elements, at least 1
  std::uint32_t stride = 0;                      ///< of an element; mode and filter allow it
  Mode mode = Mode::attributes;
  Filter filter = Filter::unfiltered;
};

/// A primitive that KHR_draco_mesh_compression compresses.
struct CompressedPrimitive {
  std::size_t view = 0;                             ///< bufferView of the compressed bytes
  std::map<std::string, std::uint32_t> attributes;  ///< their ids there, by name
};

/// Which objects are read for skinning or animation, by index.
struct Usage {
  std::vector<bool> meshes;  ///< of nodes with a skin
  std::vector<bool> skins;   ///< of nodes with a mesh
  std::vector<bool> accessors, views, buffers;
  std::vector<std::uint32_t> strides;  ///< byteStride by bufferView; 0: none
  std::vector<CompressedView> compressedViews;
  /// By mesh and primitive.
  std::map<std::pair<std::size_t, std::size_t>, CompressedPrimitive> compressedPrimitives;
};

/// A file's structure. Every index in it is in range, and every property that is read has its type.
struct Document {
  tinygltf::Model content;  ///< Without buffers, images, textures, cameras, extensions and extras.
  std::vector<BufferDescription> buffers;
  Usage usage;
  bool quantized = false;  ///< KHR_mesh_quantization is in use.
  /// From `extras`: names of morph targets by mesh, and the JSON text of rigs by skin.
  std::vector<std::vector<std::string>> targetNames;
  std::vector<std::string> rigs;
  /// Accessors that Draco streams have filled: the bufferView of the stream, and the attribute's id
  /// there, or `none` for indices.
  std::map<int, std::pair<std::size_t, std::uint32_t>> decodedAccessors;
};

struct Appearance;
class Notes;

/// Parses JSON text. Spends the memory of the result before it is allocated. Throws `Failure`.
nlohmann::json parseText(std::string_view text, MemoryBudget& budget);

/// Parses and checks the text. Spends the memory of the result before it is allocated. Fills in
/// `appearance` unless it is null. Throws `Failure`.
Document parseDocument(std::string_view text, MemoryBudget& budget, Notes& notes,
                       Appearance* appearance = nullptr);

/// Checks every index and every type in `root`, as `parseDocument` needs it. Whole numbers written
/// with a fraction of zero become integers. Faults with only one possible meaning are repaired in
/// place. Spends the memory that the listed objects will take. Throws `Failure`.
Usage checkReferences(nlohmann::json& root, MemoryBudget& budget, Notes& notes);

}  // namespace dermis::gltf
