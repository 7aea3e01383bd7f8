// Which images a file's materials show, and their encoded bytes. A fault in an image only loses
// that image: the file can still be skinned.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "gltf/accessor.h"
#include "gltf/files.h"
#include "gltf/tinygltf.h"

namespace dermis::gltf {

struct ImageDescription {
  std::string name;
  std::optional<std::string> uri;
  std::optional<std::uint64_t> bufferView;
};

/// The images and textures of a file, not checked against the rest of the file.
struct Appearance {
  std::vector<ImageDescription> images;
  std::vector<Material::Texture> baseColorTextures;  ///< indexed by material
};

/// Extracts what it understands from the JSON and ignores the rest. Spends the memory that this
/// takes. Throws `Failure` with `limitExceeded`.
Appearance findAppearance(const nlohmann::json& root, MemoryBudget& budget);

/// Fills in `images` and the textures of the materials. Only images that a material shows are read;
/// equal ones are kept once. Side files are read by the same rules as those of buffers. An image
/// that cannot be read gives a note.
void readImages(const Appearance& appearance, const Source& source, SideFiles& files,
                MemoryBudget& budget, Model& model);

}  // namespace dermis::gltf
