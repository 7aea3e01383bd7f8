// Converts the materials and triangles of a glTF model for the renderer.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "dermis/gltf.h"
#include "kit/render/renderer.h"

namespace dermis::samples {

class Appearances {
 public:
  /// The arguments must outlive this object.
  Appearances(Device& device, render::Renderer& renderer, const gltf::Model& model)
      : device_(&device), renderer_(&renderer), model_(&model), memoryLeft_(model.memoryLeft) {}

  /// Ignores a texture, and adds a note, if it cannot be decoded or if its pixels need more memory
  /// than the model's file justifies. Fails with `vulkanError`.
  Result<render::Surface> surface(const gltf::Primitive& primitive);
  /// Created by the first call. Valid while this object lives. Fails with `vulkanError`.
  Result<const render::Geometry*> geometry(const gltf::Primitive& primitive);

  const std::vector<std::string>& notes() const { return notes_; }

 private:
  gltf::Material::Texture textureUse(const gltf::Primitive& primitive) const;
  Result<std::uint32_t> texture(const gltf::Material::Texture& use);
  /// Returns 0 if the texture is ignored.
  Result<std::uint32_t> decode(std::uint32_t image, const render::TextureOptions& options);

  Device* device_;
  render::Renderer* renderer_;
  const gltf::Model* model_;
  std::uint64_t memoryLeft_;  ///< for pixels
  std::map<const gltf::Primitive*, render::Geometry> geometries_;
  /// Textures of the renderer, by image and wrap modes; 0 for an ignored texture.
  std::map<std::tuple<std::uint32_t, gltf::Material::Wrap, gltf::Material::Wrap>, std::uint32_t>
      textures_;
  /// The first texture of each image, which has the pixels; 0 for an ignored image.
  std::map<std::uint32_t, std::uint32_t> firstTextures_;
  std::vector<std::string> notes_;
};

}  // namespace dermis::samples
