// The JSON text of a file, parsed and checked before tinygltf reads it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "dermis/memory_budget.h"
#include "gltf/tinygltf.h"

namespace dermis::gltf {

/// Nesting beyond this is refused: parsers recurse, and a stack has an end. Real files stay
/// below 20.
inline constexpr std::uint32_t deepestNesting = 256;

/// tinygltf refuses indices without a bufferView, which the specification allows (zeros, or a
/// sparse accessor): so it gets them under this name, as an attribute.
inline constexpr const char* indicesAttribute = "_DERMIS_INDICES";

/// What the file says about one buffer.
struct BufferDescription {
  std::uint64_t byteLength = 0;
  std::optional<std::string> uri;
};

/// A file's structure: every index in it is in range, every property that is read has its type.
struct Document {
  tinygltf::Model content;  ///< Without buffers, images, textures, cameras, extensions and extras.
  std::vector<BufferDescription> buffers;
  bool quantized = false;  ///< KHR_mesh_quantization is in use.
};

struct Appearance;

/// Parses and checks. What is made of the text is spent first. `appearance` is filled in where it
/// is wanted. Throws `Failure`.
Document parseDocument(std::string_view text, MemoryBudget& budget,
                       Appearance* appearance = nullptr);

/// Checks every index and every type in `root`, as `parseDocument` needs it; whole numbers written
/// with a fraction of zero become integers. Spends what the things that it lists will take. Throws
/// `Failure`.
void checkReferences(nlohmann::json& root, MemoryBudget& budget);

}  // namespace dermis::gltf
