#include "gltf/accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <utility>

#include "gltf/failure.h"

namespace dermis::gltf {
namespace {

std::uint64_t sizeOfComponent(int componentType) {
  switch (componentType) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return 1;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return 2;
    default:
      return 4;
  }
}

std::uint32_t componentCount(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return 1;
    case TINYGLTF_TYPE_VEC2:
      return 2;
    case TINYGLTF_TYPE_VEC3:
      return 3;
    case TINYGLTF_TYPE_VEC4:
    case TINYGLTF_TYPE_MAT2:
      return 4;
    case TINYGLTF_TYPE_MAT3:
      return 9;
    default:
      return 16;
  }
}

const char* typeName(int type) {
  switch (type) {
    case TINYGLTF_TYPE_SCALAR:
      return "SCALAR";
    case TINYGLTF_TYPE_VEC2:
      return "VEC2";
    case TINYGLTF_TYPE_VEC3:
      return "VEC3";
    case TINYGLTF_TYPE_VEC4:
      return "VEC4";
    case TINYGLTF_TYPE_MAT2:
      return "MAT2";
    case TINYGLTF_TYPE_MAT3:
      return "MAT3";
    default:
      return "MAT4";
  }
}

// The columns of a matrix start at multiples of 4 bytes (glTF 2.0, 3.6.2.4). Only matrices of bytes
// and shorts feel it, and Dermis reads none of those: their ranges are checked nevertheless.
std::uint64_t elementSize(const tinygltf::Accessor& accessor) {
  const std::uint64_t component = sizeOfComponent(accessor.componentType);
  const auto matrix = [&](std::uint64_t side) { return side * ((side * component + 3) / 4 * 4); };
  switch (accessor.type) {
    case TINYGLTF_TYPE_MAT2:
      return matrix(2);
    case TINYGLTF_TYPE_MAT3:
      return matrix(3);
    case TINYGLTF_TYPE_MAT4:
      return matrix(4);
    default:
      return component * componentCount(accessor.type);
  }
}

template <typename Stored>
Stored load(const std::byte* address) {
  Stored stored;
  std::memcpy(&stored, address, sizeof stored);
  return stored;
}

template <typename Stored>
float normalize(Stored stored) {
  constexpr float largest = static_cast<float>(std::numeric_limits<Stored>::max());
  return std::max(static_cast<float>(stored) / largest, -1.0f);
}

float loadFloat(const std::byte* address, int componentType, bool normalized) {
  const auto convert = [normalized](auto stored) {
    return normalized ? normalize(stored) : static_cast<float>(stored);
  };
  switch (componentType) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      return convert(load<std::int8_t>(address));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return convert(load<std::uint8_t>(address));
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      return convert(load<std::int16_t>(address));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return convert(load<std::uint16_t>(address));
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      return static_cast<float>(load<std::uint32_t>(address));
    default:
      return load<float>(address);
  }
}

std::uint32_t loadInteger(const std::byte* address, int componentType) {
  switch (componentType) {
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      return load<std::uint8_t>(address);
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      return load<std::uint16_t>(address);
    default:
      return load<std::uint32_t>(address);
  }
}

}  // namespace

std::string formatName(Format format) {
  const char* name = "float";
  switch (format.componentType) {
    case TINYGLTF_COMPONENT_TYPE_BYTE:
      name = "byte";
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE:
      name = "unsigned byte";
      break;
    case TINYGLTF_COMPONENT_TYPE_SHORT:
      name = "short";
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT:
      name = "unsigned short";
      break;
    case TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT:
      name = "unsigned int";
      break;
    default:
      break;
  }
  return format.normalized ? join("normalized ", name) : std::string(name);
}

Source::Source(Document document, std::vector<Buffer> buffers, MemoryBudget& budget)
    : document_(std::move(document)), buffers_(std::move(buffers)), budget_(budget) {
  checkViews();
  checkAccessors();
}

void Source::checkViews() const {
  const auto& views = content().bufferViews;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const tinygltf::BufferView& view = views[i];
    // The structural check has bounded every number here by 2^53, so that no sum overflows.
    const std::uint64_t size = buffers_[static_cast<std::size_t>(view.buffer)].byteLength;
    if (view.byteOffset + view.byteLength > size) {
      failInvalid("bufferView ", i, ": bytes ", view.byteOffset, " to ",
                  view.byteOffset + view.byteLength, " are outside buffer ", view.buffer, " of ",
                  size, " bytes");
    }
  }
}

void Source::checkRange(int view, std::uint64_t byteOffset, std::uint64_t bytes,
                        std::uint64_t alignment, const std::string& where) const {
  const tinygltf::BufferView& range = content().bufferViews[static_cast<std::size_t>(view)];
  if (byteOffset + bytes > range.byteLength) {
    failInvalid(where, ": bytes ", byteOffset, " to ", byteOffset + bytes,
                " are outside bufferView ", view, " of ", range.byteLength, " bytes");
  }
  if (byteOffset % alignment != 0 || (range.byteOffset + byteOffset) % alignment != 0) {
    failInvalid(where, ": byte ", range.byteOffset + byteOffset,
                " of the buffer is not aligned to its components of ", alignment, " bytes");
  }
}

void Source::checkAccessors() const {
  const auto& accessors = content().accessors;
  for (std::size_t i = 0; i < accessors.size(); ++i) {
    const tinygltf::Accessor& accessor = accessors[i];
    const std::string where = join("accessor ", i);
    const bool wide = accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT ||
                      accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    if (accessor.normalized && wide) {
      failInvalid(where, ": ", formatName({accessor.componentType}), " may not be normalized");
    }
    if (accessor.bufferView >= 0) {
      const std::uint64_t size = elementSize(accessor);
      const std::uint64_t stride = strideOf(accessor);
      if (stride < size) {
        failInvalid(where, ": its elements of ", size, " bytes do not fit the byteStride ", stride,
                    " of bufferView ", accessor.bufferView);
      }
      checkRange(accessor.bufferView, accessor.byteOffset, stride * (accessor.count - 1) + size,
                 sizeOfComponent(accessor.componentType), where);
    }
    if (accessor.sparse.isSparse) checkSparse(i);
  }
}

void Source::checkSparse(std::size_t index) const {
  const tinygltf::Accessor& accessor = content().accessors[index];
  const std::string where = join("accessor ", index, " sparse");
  const auto count = static_cast<std::uint64_t>(accessor.sparse.count);
  const auto& indices = accessor.sparse.indices;
  const auto& values = accessor.sparse.values;
  for (const int view : {indices.bufferView, values.bufferView}) {
    if (content().bufferViews[static_cast<std::size_t>(view)].byteStride != 0) {
      failInvalid(where, ": bufferView ", view,
                  " has a byteStride, which sparse data may not have");
    }
  }
  const std::uint64_t indexSize = sizeOfComponent(indices.componentType);
  checkRange(indices.bufferView, static_cast<std::uint64_t>(indices.byteOffset), count * indexSize,
             indexSize, where + " indices");
  checkRange(values.bufferView, static_cast<std::uint64_t>(values.byteOffset),
             count * elementSize(accessor), sizeOfComponent(accessor.componentType),
             where + " values");
}

std::uint64_t Source::strideOf(const tinygltf::Accessor& accessor) const {
  if (accessor.bufferView < 0) return elementSize(accessor);
  const auto& view = content().bufferViews[static_cast<std::size_t>(accessor.bufferView)];
  return view.byteStride != 0 ? view.byteStride : elementSize(accessor);
}

const std::byte* Source::viewData(int view) const {
  const tinygltf::BufferView& range = content().bufferViews[static_cast<std::size_t>(view)];
  const Buffer& buffer = buffers_[static_cast<std::size_t>(range.buffer)];
  if (buffer.bytes.empty()) {
    failInvalid("buffer ", range.buffer,
                ": it has no uri, and the file has no binary chunk for it");
  }
  return buffer.bytes.data() + range.byteOffset;
}

std::span<const std::byte> Source::viewBytes(std::uint64_t view, const std::string& where) const {
  if (view >= content().bufferViews.size()) failInvalid(where, ": there is no bufferView ", view);
  const tinygltf::BufferView& range = content().bufferViews[static_cast<std::size_t>(view)];
  if (buffers_[static_cast<std::size_t>(range.buffer)].bytes.empty())
    failInvalid(where, ": its buffer has no bytes");
  return {viewData(static_cast<int>(view)), range.byteLength};
}

void Source::require(int index, int type, std::span<const Format> formats,
                     const std::string& where) const {
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  const Format format{accessor.componentType, accessor.normalized};
  const bool known = std::find(formats.begin(), formats.end(), format) != formats.end();
  if (accessor.type == type && known) return;
  std::string allowed;
  for (const Format& candidate : formats) {
    if (!allowed.empty()) allowed += " or ";
    allowed += formatName(candidate);
  }
  failInvalid(where, ": accessor ", index, " is ", typeName(accessor.type), " of ",
              formatName(format), " where ", typeName(type), " of ", allowed, " must be");
}

void Source::requireAttributeAlignment(int index, const std::string& where) const {
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  if (accessor.bufferView < 0) return;
  if (accessor.byteOffset % 4 == 0 && strideOf(accessor) % 4 == 0) return;
  failInvalid(where, ": accessor ", index, " starts at byte ", accessor.byteOffset,
              " with a stride of ", strideOf(accessor),
              ": vertex attributes must be aligned to 4 bytes");
}

void Source::requireNoStride(int index, const std::string& where) const {
  const int view = content().accessors[static_cast<std::size_t>(index)].bufferView;
  if (view < 0) return;
  const auto stride = content().bufferViews[static_cast<std::size_t>(view)].byteStride;
  if (stride == 0) return;
  failInvalid(where, ": bufferView ", view, " of accessor ", index, " has a byteStride of ", stride,
              ", which only vertex attributes may have");
}

Format Source::format(int accessor) const {
  const auto& found = content().accessors[static_cast<std::size_t>(accessor)];
  return {found.componentType, found.normalized};
}

std::uint32_t Source::count(int accessor) const {
  return static_cast<std::uint32_t>(content().accessors[static_cast<std::size_t>(accessor)].count);
}

std::uint32_t Source::components(int accessor) const {
  return componentCount(content().accessors[static_cast<std::size_t>(accessor)].type);
}

bool Source::hasNoData(int accessor) const {
  const auto& found = content().accessors[static_cast<std::size_t>(accessor)];
  return found.bufferView < 0 && !found.sparse.isSparse;
}

// Primitives may share accessors, and shared data is decoded, and spent, once for each.
void Source::spendOnAccessor(int index) {
  spend(std::uint64_t{count(index)} * components(index), sizeof(float),
        join("accessor ", index, " of ", count(index), " elements"));
}

std::vector<std::uint32_t> Source::sparseIndices(int index) {
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  const auto& indices = accessor.sparse.indices;
  const auto sparseCount = static_cast<std::size_t>(accessor.sparse.count);
  const std::size_t size = sizeOfComponent(indices.componentType);
  const std::byte* data = viewData(indices.bufferView) + indices.byteOffset;
  spend(sparseCount, sizeof(std::uint32_t), join("accessor ", index, " sparse indices"));
  std::vector<std::uint32_t> elements(sparseCount);
  for (std::size_t i = 0; i < sparseCount; ++i) {
    elements[i] = loadInteger(data + i * size, indices.componentType);
    if (elements[i] >= accessor.count) {
      failInvalid("accessor ", index, ": sparse index ", i, " is ", elements[i],
                  ", and the accessor has ", accessor.count, " elements");
    }
    if (i > 0 && elements[i] <= elements[i - 1]) {
      failInvalid("accessor ", index, ": sparse index ", i, " is ", elements[i], " after ",
                  elements[i - 1], ": they must rise");
    }
  }
  return elements;
}

// Calls `visit` with the number of each component and its address; sparse values come later, with
// the numbers of those that they replace. What is all zeros is not visited.
template <typename Visit>
void Source::forEachComponent(int index, Visit visit) {
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  const std::size_t width = components(index);
  const std::size_t component = sizeOfComponent(accessor.componentType);
  if (accessor.bufferView >= 0) {
    const std::byte* element = viewData(accessor.bufferView) + accessor.byteOffset;
    const std::size_t stride = strideOf(accessor);
    for (std::size_t i = 0; i < accessor.count; ++i) {
      for (std::size_t j = 0; j < width; ++j) {
        visit(i * width + j, element + i * stride + j * component);
      }
    }
  }
  if (accessor.sparse.isSparse) {
    const std::byte* data =
        viewData(accessor.sparse.values.bufferView) + accessor.sparse.values.byteOffset;
    for (const std::uint32_t element : sparseIndices(index)) {
      for (std::size_t j = 0; j < width; ++j, data += component) visit(element * width + j, data);
    }
  }
}

// `read` makes a Value of the address of a component.
template <typename Value, typename Read>
std::vector<Value> Source::decode(int index, Read read) {
  spendOnAccessor(index);
  std::vector<Value> values(std::size_t{count(index)} * components(index));
  forEachComponent(
      index, [&](std::size_t place, const std::byte* address) { values[place] = read(address); });
  return values;
}

std::vector<std::byte> Source::stored(int index) {
  spendOnAccessor(index);
  const std::size_t size = sizeOfComponent(format(index).componentType);
  std::vector<std::byte> bytes(std::size_t{count(index)} * components(index) * size);
  forEachComponent(index, [&](std::size_t place, const std::byte* address) {
    std::memcpy(&bytes[place * size], address, size);
  });
  return bytes;
}

std::vector<float> Source::floats(int index) {
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  return decode<float>(index, [&](const std::byte* address) {
    return loadFloat(address, accessor.componentType, accessor.normalized);
  });
}

std::vector<std::uint32_t> Source::integers(int index) {
  const int type = content().accessors[static_cast<std::size_t>(index)].componentType;
  return decode<std::uint32_t>(
      index, [type](const std::byte* address) { return loadInteger(address, type); });
}

}  // namespace dermis::gltf
