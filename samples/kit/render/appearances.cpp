#include "kit/render/appearances.h"

#include <algorithm>
#include <utility>

namespace dermis::samples {
namespace {

using render::Geometry;
using render::Surface;
using render::Transparency;

Transparency transparencyOf(gltf::Material::AlphaMode mode) {
  switch (mode) {
    case gltf::Material::AlphaMode::mask:
      return Transparency::mask;
    case gltf::Material::AlphaMode::blend:
      return Transparency::blend;
    default:
      return Transparency::opaque;
  }
}

render::Wrap wrapOf(gltf::Material::Wrap wrap) {
  switch (wrap) {
    case gltf::Material::Wrap::mirroredRepeat:
      return render::Wrap::mirror;
    case gltf::Material::Wrap::clampToEdge:
      return render::Wrap::clamp;
    default:
      return render::Wrap::repeat;
  }
}

Surface untexturedSurface(const gltf::Model& model, const gltf::Primitive& primitive) {
  // Without a material the surface is not metallic. glTF's default, fully metallic, looks dark.
  Surface surface;
  if (primitive.material == noIndex) return surface;
  const gltf::Material& material = model.materials[primitive.material];
  surface.baseColor = material.baseColor;
  surface.metallic = std::clamp(material.metallic, 0.f, 1.f);
  surface.roughness = std::clamp(material.roughness, 0.f, 1.f);
  surface.transparency = transparencyOf(material.alphaMode);
  surface.alphaCutoff = material.alphaCutoff;
  surface.isDoubleSided = material.doubleSided;
  return surface;
}

}  // namespace

gltf::Material::Texture Appearances::textureUse(const gltf::Primitive& primitive) const {
  if (primitive.material == noIndex) return {};
  return model_->materials[primitive.material].baseColorTexture;
}

Result<std::uint32_t> Appearances::decode(std::uint32_t index,
                                          const render::TextureOptions& options) {
  const gltf::Image& image = model_->images[index];
  const Result<render::TexturePixels> pixels = render::decodeImage(image.bytes, &memoryLeft_);
  if (!pixels) {
    notes_.push_back(image.name + ": " + pixels.error().message + "; the texture is ignored");
    return 0u;
  }
  return renderer_->addTexture(*pixels, options);
}

Result<std::uint32_t> Appearances::texture(const gltf::Material::Texture& use) {
  if (use.image == noIndex) return 0u;
  const auto [place, isNew] = textures_.emplace(std::tuple(use.image, use.wrapU, use.wrapV), 0);
  if (!isNew) return place->second;
  const render::TextureOptions options{wrapOf(use.wrapU), wrapOf(use.wrapV)};
  const auto [first, isFirst] = firstTextures_.emplace(use.image, 0);
  if (!isFirst && first->second == 0) return 0u;
  Result<std::uint32_t> texture =
      isFirst ? decode(use.image, options) : renderer_->addTexture(first->second, options);
  if (!texture) return texture;
  if (isFirst) first->second = *texture;
  place->second = *texture;
  return texture;
}

Result<Surface> Appearances::surface(const gltf::Primitive& primitive) {
  Surface surface = untexturedSurface(*model_, primitive);
  const gltf::Material::Texture use = textureUse(primitive);
  if (use.texcoord >= primitive.texcoords.size()) return surface;
  const Result<std::uint32_t> shown = texture(use);
  if (!shown) return shown.error();
  surface.texture = *shown;
  return surface;
}

Result<const Geometry*> Appearances::geometry(const gltf::Primitive& primitive) {
  if (const auto made = geometries_.find(&primitive); made != geometries_.end())
    return &made->second;
  render::GeometryData data;
  data.vertexCount = primitive.vertexCount;
  data.triangles = primitive.triangles;
  const std::uint32_t set = textureUse(primitive).texcoord;
  if (set < primitive.texcoords.size()) data.texcoords = primitive.texcoords[set];
  data.colors = primitive.colors;
  Result<Geometry> made = Geometry::create(*device_, data);
  if (!made) return made.error();
  return &geometries_.emplace(&primitive, std::move(*made)).first->second;
}

}  // namespace dermis::samples
