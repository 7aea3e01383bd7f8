#include "gltf/images.h"

#include <algorithm>
#include <map>
#include <string_view>

#include "gltf/buffers.h"
#include "gltf/failure.h"

namespace dermis::gltf {
namespace {

using nlohmann::json;

/// A member of an object, or null if there is no such member or `value` is not an object.
const json& member(const json& value, const char* name) {
  static const json nothing;
  if (!value.is_object()) return nothing;
  const auto found = value.find(name);
  return found == value.end() ? nothing : *found;
}

const json& element(const json& list, std::uint64_t index) {
  static const json nothing;
  return list.is_array() && index < list.size() ? list[static_cast<std::size_t>(index)] : nothing;
}

std::optional<std::uint64_t> wholeNumber(const json& value) {
  if (!value.is_number_unsigned()) return std::nullopt;
  return value.get<std::uint64_t>();
}

std::optional<std::string> textIn(const json& value) {
  if (!value.is_string()) return std::nullopt;
  return value.get<std::string>();
}

/// glTF 2.0, 5.26.
Material::Wrap wrapOf(const json& value) {
  const std::optional<std::uint64_t> number = wholeNumber(value);
  if (number == 33071u) return Material::Wrap::clampToEdge;
  if (number == 33648u) return Material::Wrap::mirroredRepeat;
  return Material::Wrap::repeat;
}

Material::Texture textureOf(const json& root, const json& material) {
  Material::Texture use;
  const json& info = member(member(material, "pbrMetallicRoughness"), "baseColorTexture");
  const std::optional<std::uint64_t> index = wholeNumber(member(info, "index"));
  if (!index) return use;
  const json& texture = element(member(root, "textures"), *index);
  const std::optional<std::uint64_t> image = wholeNumber(member(texture, "source"));
  if (!image || *image >= member(root, "images").size()) return use;
  use.image = static_cast<std::uint32_t>(*image);
  use.texcoord = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(wholeNumber(member(info, "texCoord")).value_or(0), noIndex));
  if (const auto sampler = wholeNumber(member(texture, "sampler"))) {
    const json& from = element(member(root, "samplers"), *sampler);
    use.wrapU = wrapOf(member(from, "wrapS"));
    use.wrapV = wrapOf(member(from, "wrapT"));
  }
  return use;
}

/// Reads each image when it is first requested.
class ImageReader {
 public:
  ImageReader(const Appearance& appearance, const Source& source, SideFiles& files,
              MemoryBudget& budget, Model& model)
      : appearance_(appearance), source_(source), files_(files), budget_(budget), model_(model) {
    model.images.resize(appearance.images.size());
    same_.resize(model.images.size());
  }

  /// The first image that equals this one, or `none` if it cannot be read.
  std::uint32_t find(std::uint32_t index) {
    if (index >= same_.size()) return noIndex;
    if (!same_[index]) same_[index] = read(index);
    return *same_[index];
  }

 private:
  std::uint32_t read(std::uint32_t index) {
    const ImageDescription& description = appearance_.images[index];
    const std::uint32_t named = firstNamed(description, index);
    if (named != index) return *same_[named];
    Image& image = model_.images[index];
    const std::string where = join("image ", index);
    image.name = description.name.empty() ? where : join(where, " ", inQuotes(description.name));
    try {
      image.bytes = bytesOf(description, where);
    } catch (const Failure& failure) {
      source_.notes().remark(NoteKind::image, failure.error.message, "; it is left out");
    }
    if (image.bytes.empty()) return noIndex;
    const std::string_view content(reinterpret_cast<const char*>(image.bytes.data()),
                                   image.bytes.size());
    const auto [place, isNew] = byContent_.emplace(content, index);
    if (!isNew) image.bytes = {};
    return place->second;
  }

  /// The first image with the same uri or bufferView, which may be this one.
  std::uint32_t firstNamed(const ImageDescription& description, std::uint32_t index) {
    if (description.bufferView)
      return byView_.emplace(*description.bufferView, index).first->second;
    return description.uri ? byUri_.emplace(*description.uri, index).first->second : index;
  }

  std::vector<std::byte> bytesOf(const ImageDescription& image, const std::string& where) {
    if (image.bufferView) {
      const std::span<const std::byte> view = source_.viewBytes(*image.bufferView, where);
      spend(budget_, view.size(), 1, where);
      return {view.begin(), view.end()};
    }
    if (!image.uri) failInvalid(where, ": it has neither a uri nor a bufferView");
    if (isDataUri(*image.uri)) {
      spend(budget_, image.uri->size(), 2, where);
      return decodeDataUri(*image.uri, where);
    }
    const FileToRead file = files_.find(*image.uri, where);
    const Bytes bytes = files_.read(file, file.size, where);
    spend(budget_, bytes->size(), 1, where);
    return *bytes;
  }

  const Appearance& appearance_;
  const Source& source_;
  SideFiles& files_;
  MemoryBudget& budget_;
  Model& model_;
  std::vector<std::optional<std::uint32_t>> same_;  // results of `find`
  std::map<std::uint64_t, std::uint32_t> byView_;
  std::map<std::string_view, std::uint32_t> byUri_, byContent_;
};

}  // namespace

Appearance findAppearance(const json& root, MemoryBudget& budget) {
  Appearance appearance;
  const json& images = member(root, "images");
  const json& materials = member(root, "materials");
  spend(budget, images.size(), 2 * (sizeof(ImageDescription) + sizeof(Image)), "the images");
  spend(budget, materials.size(), 2 * sizeof(Material::Texture), "the materials");
  for (const json& image : images) {
    appearance.images.push_back({textIn(member(image, "name")).value_or(""),
                                 textIn(member(image, "uri")),
                                 wholeNumber(member(image, "bufferView"))});
  }
  for (const json& material : materials)
    appearance.baseColorTextures.push_back(textureOf(root, material));
  return appearance;
}

void readImages(const Appearance& appearance, const Source& source, SideFiles& files,
                MemoryBudget& budget, Model& model) {
  ImageReader images(appearance, source, files, budget, model);
  for (std::size_t i = 0; i < model.materials.size(); ++i) {
    Material::Texture use = appearance.baseColorTextures[i];
    use.image = images.find(use.image);
    if (use.image != noIndex) model.materials[i].baseColorTexture = use;
  }
}

}  // namespace dermis::gltf
