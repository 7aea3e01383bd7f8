#include "gltf/document.h"

#include <algorithm>
#include <array>
#include <limits>
#include <unordered_set>
#include <utility>

#include "gltf/compression.h"
#include "gltf/failure.h"
#include "gltf/images.h"
#include "gltf/notes.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

using nlohmann::json;

// Upper bounds of the memory of a parsed text: for each array or object, including its place in its
// parent; for each element or member, in a growing vector or a tree; and for each character of a
// string or number. tinygltf parses the text again, but the two results never exist at the same
// time.
constexpr std::uint64_t bytesPerBracket = 96;
constexpr std::uint64_t bytesPerComma = 48;
constexpr std::uint64_t bytesPerMember = 112;
constexpr std::uint64_t bytesPerCharacter = 4;

// Counts brackets, commas and colons outside strings; the parser checks whether they match. Spends
// the memory that the parsed text will take.
void checkNesting(std::string_view text, MemoryBudget& budget) {
  std::uint64_t bytes = bytesPerCharacter * text.size();
  std::uint32_t depth = 0;
  bool inString = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char character = text[i];
    if (inString) {
      if (character == '\\') ++i;
      if (character == '"') inString = false;
    } else if (character == '"') {
      inString = true;
    } else if (character == ',') {
      bytes += bytesPerComma;
    } else if (character == ':') {
      bytes += bytesPerMember;
    } else if (character == '[' || character == '{') {
      bytes += bytesPerBracket;
      if (++depth > deepestNesting) {
        failInvalid("the JSON text is nested deeper than ", deepestNesting, " levels at byte ", i);
      }
    } else if ((character == ']' || character == '}') && depth > 0) {
      --depth;
    }
  }
  spend(budget, bytes, 1, "the JSON text");
}

}  // namespace

json parseText(std::string_view text, MemoryBudget& budget) {
  checkNesting(text, budget);
  try {
    return json::parse(text);
  } catch (const json::parse_error& error) {
    const std::string_view before = text.substr(0, std::max<std::size_t>(error.byte, 1) - 1);
    const auto lines = std::ranges::count(before, '\n');
    if (lines == 0) failInvalid("the JSON text is invalid at byte ", error.byte);
    failInvalid("the JSON text is invalid in line ", lines + 1, ", column ",
                before.size() - before.rfind('\n'));
  } catch (const json::out_of_range&) {
    failInvalid("the JSON text has a number that is too large");
  }
}

namespace {

// The parser treats a zero byte as the end of the text.
std::string_view trimText(std::string_view text, Notes& notes) {
  constexpr std::string_view byteOrderMark = "\xef\xbb\xbf";
  if (text.starts_with(byteOrderMark)) {
    notes.broken(NoteKind::text, "the JSON text begins with a byte order mark");
    text.remove_prefix(byteOrderMark.size());
  }
  if (text.ends_with('\0')) {
    notes.broken(NoteKind::text, "the JSON text is padded with zero bytes, not with spaces");
    text = text.substr(0, text.find_last_not_of('\0') + 1);
  }
  const std::size_t zero = text.find('\0');
  if (zero != std::string_view::npos) failInvalid("the JSON text is invalid at byte ", zero);
  return text;
}

// "2" and the number 2 mean what "2.0" means.
std::string versionOf(const json& version, Notes& notes) {
  const bool isText = version.is_string();
  if (isText && version != "2") return version.get<std::string>();
  if (!isText && !version.is_number()) failInvalid("asset: version is not a string");
  const double number = isText ? 2 : version.get<double>();
  notes.broken(NoteKind::version, "asset: version is not written as '2.0'");
  return number == 2 ? "2.0" : textOf(number);
}

void checkVersion(json& root, Notes& notes) {
  const auto asset = root.find("asset");
  if (asset == root.end() || !asset->is_object()) {
    failInvalid("the JSON text has no object 'asset': this is not a glTF 2.0 file");
  }
  const auto version = asset->find("version");
  if (version == asset->end()) failInvalid("asset: it has no version");
  const std::string text = versionOf(*version, notes);
  // tinygltf expects a string.
  *version = text;
  if (text.substr(0, 2) != "2.") {
    fail(ErrorCode::unsupportedFeature,
         join("glTF version ", inQuotes(text), " is not supported: only version 2.0 is"));
  }
  const auto least = asset->find("minVersion");
  if (least != asset->end() && *least != "2.0") {
    fail(ErrorCode::unsupportedFeature,
         join("the file needs glTF version ",
              inQuotes(least->is_string() ? least->get_ref<const std::string&>() : least->dump()),
              ": only version 2.0 is supported"));
  }
}

// Extensions that change the appearance of a surface, not its position: a file that requires them
// can be skinned without them.
bool concernsOnlyAppearance(std::string_view extension) {
  constexpr std::array<std::string_view, 8> prefixes = {
      "KHR_materials_", "KHR_texture_", "EXT_texture_",   "MSFT_texture_",
      "KHR_lights_",    "EXT_lights_",  "EXT_materials_", "KHR_xmp"};
  return std::any_of(prefixes.begin(), prefixes.end(),
                     [&](std::string_view prefix) { return extension.starts_with(prefix); });
}

// Extensions of an application around the model: what is shown, how it is used. Dermis reads none
// of them, but their authors may want a reader to notice.
bool concernsOnlyApplication(std::string_view extension) {
  constexpr std::array<std::string_view, 5> names = {"KHR_animation_pointer", "KHR_interactivity",
                                                     "KHR_node_visibility", "VRM", "VRMC_vrm"};
  return std::ranges::find(names, extension) != names.end();
}

std::vector<std::string> extensionNames(const json& root, const char* property, Notes& notes) {
  std::vector<std::string> names;
  const auto list = root.find(property);
  if (list == root.end()) return names;
  if (list->is_array() && list->empty())
    notes.broken(NoteKind::emptyArray, inQuotes(property), " is an empty array");
  if (!list->is_array()) failInvalid(property, " is not an array");
  for (const json& name : *list) {
    if (!name.is_string()) failInvalid(property, " contains something that is not a string");
    names.push_back(name.get<std::string>());
  }
  return names;
}

bool usesQuantization(const json& root, Notes& notes) {
  constexpr std::string_view quantization = "KHR_mesh_quantization";
  std::vector<std::string> used;
  notes.tolerate(NoteKind::extensions, "; it is ignored",
                 [&] { used = extensionNames(root, "extensionsUsed", notes); });
  const auto required = extensionNames(root, "extensionsRequired", notes);
  const std::unordered_set<std::string> usedNames(used.begin(), used.end());
  if (usedNames.size() < used.size())
    notes.broken(NoteKind::extensions, "extensionsUsed names an extension twice");
  for (const std::string& name : required) {
    if (!usedNames.contains(name)) {
      notes.broken(NoteKind::extensions, "extensionsRequired names ", inQuotes(name),
                   ", which extensionsUsed does not");
    }
    if (name == quantization || concernsOnlyAppearance(name)) continue;
    if (concernsOnlyApplication(name)) {
      notes.remark(NoteKind::extension, "the file requires the extension ", inQuotes(name),
                   ", which is ignored");
      continue;
    }
    const bool isDraco = name == dracoExtension;
    const bool isMeshopt =
        std::ranges::find(meshoptExtensions, name) != std::end(meshoptExtensions);
    if ((isDraco && decodesDraco) || (isMeshopt && decodesMeshopt)) continue;
    fail(ErrorCode::unsupportedFeature,
         join("the file requires the extension ",
              isDraco || isMeshopt ? notDecoded(name)
                                   : join(inQuotes(name), ", which is not supported")));
  }
  return std::find(used.begin(), used.end(), quantization) != used.end() ||
         std::find(required.begin(), required.end(), quantization) != required.end();
}

std::vector<BufferDescription> takeBuffers(json& root) {
  std::vector<BufferDescription> buffers;
  const auto list = root.find("buffers");
  if (list == root.end()) return buffers;
  for (json& buffer : *list) {
    BufferDescription description;
    description.byteLength = buffer["byteLength"].get<std::uint64_t>();
    if (buffer.contains("uri")) {
      description.uri = std::move(buffer["uri"].get_ref<std::string&>());
    }
    buffers.push_back(std::move(description));
  }
  return buffers;
}

// The property of an object's `extras`, or null. They may be anything.
const json* findExtra(const json& object, const char* property) {
  const auto extras = object.find("extras");
  if (extras == object.end() || !extras->is_object()) return nullptr;
  const auto found = extras->find(property);
  return found == extras->end() ? nullptr : &*found;
}

void readExtras(const json& root, MemoryBudget& budget, Document& document) {
  static const json nothing = json::array();
  const auto list = [&](const char* name) -> const json& {
    return root.contains(name) ? root.at(name) : nothing;
  };
  for (const json& mesh : list("meshes")) {
    std::vector<std::string>& names = document.targetNames.emplace_back();
    const json* targets = findExtra(mesh, "targetNames");
    if (targets == nullptr || !targets->is_array()) continue;
    for (const json& name : *targets) {
      const std::string text = name.is_string() ? name.get<std::string>() : std::string();
      spend(budget, text.size() + 2 * sizeof(text), 1, "names of morph targets");
      names.push_back(text);
    }
  }
  for (const json& skin : list("skins")) {
    const json* rig = findExtra(skin, "dermis_rig");
    document.rigs.push_back(rig != nullptr ? rig->dump() : std::string());
    spend(budget, document.rigs.back().size() + sizeof(std::string), 1, "a rig");
  }
}

// Nothing in these is read, so they need not be parsed. The recursion is limited by
// `deepestNesting`.
void eraseExtensions(json& value) {
  if (value.is_object()) {
    value.erase("extensions");
    value.erase("extras");
  }
  if (value.is_structured()) {
    for (json& child : value) eraseExtensions(child);
  }
}

void moveIndices(json& root) {
  const auto meshes = root.find("meshes");
  if (meshes == root.end()) return;
  for (json& mesh : *meshes) {
    for (json& primitive : mesh["primitives"]) {
      primitive["attributes"].erase(indicesAttribute);
      const auto indices = primitive.find("indices");
      if (indices == primitive.end()) continue;
      primitive["attributes"][indicesAttribute] = *indices;
      primitive.erase(indices);
    }
  }
}

tinygltf::Model parseContent(json root) {
  constexpr std::array kept = {"asset",     "scene",       "scenes", "nodes",      "meshes",
                               "accessors", "bufferViews", "skins",  "animations", "materials"};
  json lean = json::object();
  for (const char* section : kept) {
    if (root.contains(section)) lean[section] = std::move(root[section]);
  }
  eraseExtensions(lean);
  moveIndices(lean);

  const std::string text = lean.dump();
  root = nullptr;
  lean = nullptr;
  if (text.size() > std::numeric_limits<unsigned int>::max()) {
    fail(ErrorCode::limitExceeded, "the JSON text is longer than 4 GiB");
  }
  tinygltf::TinyGLTF parser;
  tinygltf::Model content;
  std::string error, warning;
  if (!parser.LoadASCIIFromString(&content, &error, &warning, text.data(),
                                  static_cast<unsigned int>(text.size()), "")) {
    failInvalid("the file cannot be read: ", shortName(error, 400));
  }
  return content;
}

}  // namespace

Document parseDocument(std::string_view text, MemoryBudget& budget, Notes& notes,
                       Appearance* appearance) {
  text = trimText(text, notes);
  json root = parseText(text, budget);
  if (!root.is_object()) failInvalid("the JSON text is not an object");
  checkVersion(root, notes);

  Document document;
  document.quantized = usesQuantization(root, notes);
  // Before the check, which removes textures.
  if (appearance != nullptr) *appearance = findAppearance(root, budget);
  document.usage = checkReferences(root, budget, notes);
  document.buffers = takeBuffers(root);
  readExtras(root, budget, document);
  document.content = parseContent(std::move(root));
  return document;
}

}  // namespace dermis::gltf
