#include <algorithm>

#include "gltf/properties.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

Material::AlphaMode alphaModeOf(const std::string& name) {
  if (name == "MASK") return Material::AlphaMode::mask;
  if (name == "BLEND") return Material::AlphaMode::blend;
  return Material::AlphaMode::opaque;
}

}  // namespace

void readMaterials(const Source& source, Model& model) {
  for (const tinygltf::Material& from : source.content().materials) {
    const tinygltf::PbrMetallicRoughness& factors = from.pbrMetallicRoughness;
    Material material;
    material.name = from.name;
    std::transform(factors.baseColorFactor.begin(), factors.baseColorFactor.end(),
                   material.baseColor.begin(), toFloat);
    material.metallic = toFloat(factors.metallicFactor);
    material.roughness = toFloat(factors.roughnessFactor);
    std::transform(from.emissiveFactor.begin(), from.emissiveFactor.end(),
                   material.emissive.begin(), toFloat);
    material.alphaMode = alphaModeOf(from.alphaMode);
    material.alphaCutoff = toFloat(from.alphaCutoff);
    material.doubleSided = from.doubleSided;
    model.materials.push_back(std::move(material));
  }
}

}  // namespace dermis::gltf
