#include "gltf/images.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "gltf/buffers.h"
#include "gltf/failure.h"

namespace dermis::gltf {
namespace {

using nlohmann::json;

/// A small file can name a large one very often.
constexpr std::uint64_t mostImageBytes = std::uint64_t{1} << 29;
constexpr std::size_t mostImages = 16'384;

/// A member of an object, or null where there is no such member or no object.
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
Wrap wrapOf(const json& value) {
  const std::optional<std::uint64_t> number = wholeNumber(value);
  if (number == 33071u) return Wrap::clampToEdge;
  if (number == 33648u) return Wrap::mirroredRepeat;
  return Wrap::repeat;
}

TextureUse textureOf(const json& root, const json& material) {
  TextureUse use;
  const json& info = member(member(material, "pbrMetallicRoughness"), "baseColorTexture");
  const std::optional<std::uint64_t> index = wholeNumber(member(info, "index"));
  if (!index) return use;
  const json& texture = element(member(root, "textures"), *index);
  const std::optional<std::uint64_t> image = wholeNumber(member(texture, "source"));
  if (!image || *image >= member(root, "images").size()) return use;
  use.image = static_cast<std::uint32_t>(*image);
  use.texcoord = static_cast<std::uint32_t>(
      std::min<std::uint64_t>(wholeNumber(member(info, "texCoord")).value_or(0), none));
  if (const auto sampler = wholeNumber(member(texture, "sampler"))) {
    const json& from = element(member(root, "samplers"), *sampler);
    use.wrapU = wrapOf(member(from, "wrapS"));
    use.wrapV = wrapOf(member(from, "wrapT"));
  }
  return use;
}

std::vector<std::byte> bytesOf(const ImageDescription& image, const Source& source,
                               const std::filesystem::path& folder, std::uint64_t limit,
                               const std::string& where) {
  if (image.bufferView) {
    const std::span<const std::byte> view = source.viewBytes(*image.bufferView, where);
    if (view.size() > limit) fail(ErrorCode::limitExceeded, join(where, ": it is too large"));
    return {view.begin(), view.end()};
  }
  if (!image.uri) failInvalid(where, ": it has neither a uri nor a bufferView");
  std::vector<std::byte> bytes = image.uri->starts_with("data:")
                                     ? decodeDataUri(*image.uri, where)
                                     : loadSideFile(*image.uri, limit, folder, where);
  if (bytes.size() >= limit) fail(ErrorCode::limitExceeded, join(where, ": it is too large"));
  return bytes;
}

}  // namespace

Appearance findAppearance(const json& root) {
  Appearance appearance;
  for (const json& image : member(root, "images")) {
    if (appearance.images.size() == mostImages) break;
    appearance.images.push_back({textIn(member(image, "name")).value_or(""),
                                 textIn(member(image, "uri")),
                                 wholeNumber(member(image, "bufferView"))});
  }
  for (const json& material : member(root, "materials"))
    appearance.baseColorTextures.push_back(textureOf(root, material));
  return appearance;
}

void readImages(const Appearance& appearance, const Source& source,
                const std::filesystem::path& folder, Model& model) {
  model.images.resize(appearance.images.size());
  std::vector<bool> isTried(model.images.size());
  std::uint64_t left = mostImageBytes;
  for (std::size_t i = 0; i < model.materials.size(); ++i) {
    TextureUse use = appearance.baseColorTextures[i];
    if (use.image >= model.images.size()) continue;
    Image& image = model.images[use.image];
    if (!isTried[use.image]) {
      isTried[use.image] = true;
      const ImageDescription& description = appearance.images[use.image];
      const std::string where = join("image ", use.image);
      image.name = description.name.empty() ? where : join(where, " ", inQuotes(description.name));
      try {
        image.bytes = bytesOf(description, source, folder, left, where);
        left -= image.bytes.size();
      } catch (const Failure& failure) {
        model.notes.push_back(join(failure.error.message, "; it is left out"));
      }
    }
    if (!image.bytes.empty()) model.materials[i].baseColorTexture = use;
  }
}

}  // namespace dermis::gltf
