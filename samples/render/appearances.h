// How a model's primitives look, and the triangles of them, as the renderer takes them.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <tuple>
#include <vector>

#include "dermis/gltf.h"
#include "render/renderer.h"

namespace dermis::samples {

class Appearances {
 public:
  /// All three must outlive it.
  Appearances(Device& device, render::Renderer& renderer, const gltf::Model& model)
      : device_(&device), renderer_(&renderer), model_(&model), budget_(model.budget) {}

  /// A texture that cannot be decoded, or whose pixels take more memory than the model's file
  /// justifies, is left out, with a note. Fails with `vulkanError`.
  Result<render::Surface> surface(const gltf::Primitive& primitive);
  /// Made when it is first asked for; lives as long as this object. Fails with `vulkanError`.
  Result<const render::Geometry*> geometry(const gltf::Primitive& primitive);
  /// The same vertices with other triangles between them: a level of detail.
  Result<render::Geometry> geometry(const gltf::Primitive& primitive,
                                    std::span<const std::uint32_t> triangles) const;

  const std::vector<std::string>& notes() const { return notes_; }

 private:
  gltf::TextureUse textureUse(const gltf::Primitive& primitive) const;
  Result<std::uint32_t> texture(const gltf::TextureUse& use);
  /// 0 if it is left out.
  Result<std::uint32_t> decode(std::uint32_t image, const render::TextureOptions& options);

  Device* device_;
  render::Renderer* renderer_;
  const gltf::Model* model_;
  gltf::MemoryBudget budget_;  ///< for pixels
  std::map<const gltf::Primitive*, render::Geometry> geometries_;
  /// The renderer's, by image and how it is wrapped; 0 for one that is left out.
  std::map<std::tuple<std::uint32_t, gltf::Wrap, gltf::Wrap>, std::uint32_t> textures_;
  std::map<std::uint32_t, std::uint32_t> firstTextures_;  ///< by image: one with its pixels, or 0
  std::vector<std::string> notes_;
};

}  // namespace dermis::samples
