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
      : device_(&device), renderer_(&renderer), model_(&model) {}

  /// A texture that cannot be decoded is left out, with a note. Fails with `vulkanError`.
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

  Device* device_;
  render::Renderer* renderer_;
  const gltf::Model* model_;
  std::map<const gltf::Primitive*, render::Geometry> geometries_;
  /// The renderer's, by image and how it is wrapped; 0 for one that cannot be decoded.
  std::map<std::tuple<std::uint32_t, gltf::Wrap, gltf::Wrap>, std::uint32_t> textures_;
  std::vector<std::string> notes_;
};

}  // namespace dermis::samples
