// Which images a file's materials show, and their encoded bytes. Whatever is wrong with them costs
// a picture and no more: a file that can be skinned can be skinned.
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

/// What a file says of images and textures. Nothing in it is checked against the rest of the file.
struct Appearance {
  std::vector<ImageDescription> images;
  std::vector<TextureUse> baseColorTextures;  ///< by material
};

/// Takes out of the JSON what it understands; leaves the rest as it is. Spends what that takes.
/// Throws `Failure` with `limitExceeded`.
Appearance findAppearance(const nlohmann::json& root, MemoryBudget& budget);

/// images, and the textures of the materials: those images that one shows, equal ones once. Side
/// files are read by the rules of buffers. What cannot be had is said in a note.
void readImages(const Appearance& appearance, const Source& source, SideFiles& files, Model& model);

}  // namespace dermis::gltf
