#include "gltf/accessor.h"

#include <algorithm>
#include <cstring>
#include <limits>
#include <span>
#include <utility>

#include "gltf/failure.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

/// What glTF calls a number: its name, and how many bytes or components it has.
struct Named {
  int number;
  const char* name;
  std::uint32_t size;
};
constexpr Named componentTypes[] = {{TINYGLTF_COMPONENT_TYPE_BYTE, "byte", 1},
                                    {TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE, "unsigned byte", 1},
                                    {TINYGLTF_COMPONENT_TYPE_SHORT, "short", 2},
                                    {TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT, "unsigned short", 2},
                                    {TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT, "unsigned int", 4},
                                    {TINYGLTF_COMPONENT_TYPE_FLOAT, "float", 4}};
constexpr Named types[] = {{TINYGLTF_TYPE_SCALAR, "SCALAR", 1}, {TINYGLTF_TYPE_VEC2, "VEC2", 2},
                           {TINYGLTF_TYPE_VEC3, "VEC3", 3},     {TINYGLTF_TYPE_VEC4, "VEC4", 4},
                           {TINYGLTF_TYPE_MAT2, "MAT2", 4},     {TINYGLTF_TYPE_MAT3, "MAT3", 9},
                           {TINYGLTF_TYPE_MAT4, "MAT4", 16}};

/// `ReferenceCheck` has refused files with other numbers.
const Named& find(std::span<const Named> list, int number) {
  for (const Named& named : list) {
    if (named.number == number) return named;
  }
  return list.back();
}

std::uint32_t sizeOfComponent(int componentType) {
  return find(componentTypes, componentType).size;
}

// The columns of a matrix start at multiples of 4 bytes (glTF 2.0, 3.6.2.4). This matters only for
// matrices of bytes and shorts. Dermis reads none of those, but checks their ranges.
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
      return component * find(types, accessor.type).size;
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
  const char* name = find(componentTypes, format.componentType).name;
  return format.normalized ? join("normalized ", name) : std::string(name);
}

Source::Source(Document document, std::vector<Buffer> buffers, MemoryBudget& budget, Notes& notes)
    : document_(std::move(document)), buffers_(std::move(buffers)), budget_(budget), notes_(notes) {
  checkViews();
  checkAccessors();
}

void Source::checkView(std::size_t index) const {
  const tinygltf::BufferView& view = content().bufferViews[index];
  const auto buffer = static_cast<std::size_t>(view.buffer);
  if (buffer >= buffers_.size())
    failInvalid("bufferView ", index, ": there is no buffer ", view.buffer);
  // The structural check has limited every number here, so that no sum overflows.
  const std::uint64_t size = buffers_[buffer].byteLength;
  const std::uint64_t end = std::uint64_t{view.byteOffset} + view.byteLength;
  if (end <= size) return;
  // Other programs cut the view off, too. The bytes that an accessor needs must exist.
  notes_.broken(NoteKind::viewLength, "bufferView ", index, ": bytes ", view.byteOffset, " to ",
                end, " are outside buffer ", view.buffer, " of ", size, " bytes");
}

void Source::checkViews() const {
  for (std::size_t i = 0; i < content().bufferViews.size(); ++i) {
    notes_.tolerateUnlessUsed(usage().views[i], [&] { checkView(i); });
  }
}

std::uint64_t Source::sizeOf(int view) const {
  const tinygltf::BufferView& range = content().bufferViews[static_cast<std::size_t>(view)];
  const auto buffer = static_cast<std::size_t>(range.buffer);
  if (buffer >= buffers_.size() || range.byteOffset > buffers_[buffer].byteLength) return 0;
  return std::min<std::uint64_t>(range.byteLength, buffers_[buffer].byteLength - range.byteOffset);
}

std::uint32_t Source::strideOf(int view) const {
  return usage().strides[static_cast<std::size_t>(view)];
}

void Source::checkRange(int view, std::uint64_t byteOffset, std::uint64_t bytes,
                        std::uint64_t alignment, const std::string& where) const {
  const tinygltf::BufferView& range = content().bufferViews[static_cast<std::size_t>(view)];
  if (byteOffset + bytes > sizeOf(view)) {
    failInvalid(where, ": bytes ", byteOffset, " to ", byteOffset + bytes,
                " are outside bufferView ", view, " of ", sizeOf(view), " bytes");
  }
  if (byteOffset % alignment != 0 || (range.byteOffset + byteOffset) % alignment != 0) {
    notes_.broken(NoteKind::alignment, where, ": byte ", range.byteOffset + byteOffset,
                  " of the buffer is not aligned to its components of ", alignment, " bytes");
  }
}

void Source::checkAccessors() {
  isFaulty_.resize(content().accessors.size());
  for (std::size_t i = 0; i < isFaulty_.size(); ++i) {
    const bool isUsed = usage().accessors[i];
    const bool good = notes_.tolerateUnlessUsed(isUsed, [&] { checkAccessor(i); });
    isFaulty_[i] = !good || (!isUsed && !hasBytes(content().accessors[i]));
  }
}

// Buffers that nothing skinned uses may be missing.
bool Source::hasBytes(const tinygltf::Accessor& accessor) const {
  const auto there = [&](int view) {
    if (view < 0) return true;
    const auto& range = content().bufferViews[static_cast<std::size_t>(view)];
    const auto buffer = static_cast<std::size_t>(range.buffer);
    return buffer < buffers_.size() && !buffers_[buffer].bytes.empty();
  };
  if (!accessor.sparse.isSparse) return there(accessor.bufferView);
  return there(accessor.bufferView) && there(accessor.sparse.indices.bufferView) &&
         there(accessor.sparse.values.bufferView);
}

void Source::checkAccessor(std::size_t index) const {
  const tinygltf::Accessor& accessor = content().accessors[index];
  const std::string where = join("accessor ", index);
  if (accessor.normalized && accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT)
    failInvalid(where, ": ", formatName({accessor.componentType}), " may not be normalized");
  if (accessor.bufferView >= 0) {
    const std::uint64_t size = elementSize(accessor);
    const std::uint64_t stride = strideOf(accessor);
    if (stride < size) {
      failInvalid(where, ": its elements of ", size, " bytes do not fit the byteStride ", stride,
                  " of bufferView ", accessor.bufferView);
    }
    // Strides are below 2^31 and counts below 2^32.
    const std::uint64_t bytes = accessor.count == 0 ? 0 : stride * (accessor.count - 1) + size;
    checkRange(accessor.bufferView, accessor.byteOffset, bytes,
               sizeOfComponent(accessor.componentType), where);
  }
  if (accessor.sparse.isSparse) checkSparse(index);
}

void Source::checkSparse(std::size_t index) const {
  const tinygltf::Accessor& accessor = content().accessors[index];
  const std::string where = join("accessor ", index, " sparse");
  const auto count = static_cast<std::uint64_t>(accessor.sparse.count);
  const auto& indices = accessor.sparse.indices;
  const auto& values = accessor.sparse.values;
  const std::uint64_t indexSize = sizeOfComponent(indices.componentType);
  const std::uint64_t valueSize = elementSize(accessor);
  for (const auto& [view, size] :
       {std::pair(indices.bufferView, indexSize), std::pair(values.bufferView, valueSize)}) {
    if (strideOf(view) == 0) continue;
    // Programs disagree whether to use the stride, so it must make no difference.
    const std::string sentence =
        join(where, ": bufferView ", view, " has a byteStride, which sparse data may not have");
    if (strideOf(view) != size) failInvalid(sentence);
    notes_.broken(NoteKind::stride, sentence);
  }
  checkRange(indices.bufferView, static_cast<std::uint64_t>(indices.byteOffset), count * indexSize,
             indexSize, where + " indices");
  checkRange(values.bufferView, static_cast<std::uint64_t>(values.byteOffset), count * valueSize,
             sizeOfComponent(accessor.componentType), where + " values");
}

std::uint64_t Source::strideOf(const tinygltf::Accessor& accessor) const {
  const std::uint32_t stride = accessor.bufferView < 0 ? 0 : strideOf(accessor.bufferView);
  return stride != 0 ? stride : elementSize(accessor);
}

const std::byte* Source::viewData(int view) const {
  const tinygltf::BufferView& range = content().bufferViews[static_cast<std::size_t>(view)];
  const auto index = static_cast<std::size_t>(range.buffer);
  if (index >= buffers_.size())
    failInvalid("bufferView ", view, ": there is no buffer ", range.buffer);
  const Buffer& buffer = buffers_[index];
  if (buffer.bytes.empty() && buffer.byteLength != 0) {
    failInvalid("buffer ", range.buffer,
                ": it has no uri, and the file has no binary chunk for it");
  }
  return buffer.bytes.data() + std::min<std::size_t>(range.byteOffset, buffer.bytes.size());
}

std::span<const std::byte> Source::viewBytes(std::uint64_t view, const std::string& where) const {
  if (view >= content().bufferViews.size()) failInvalid(where, ": there is no bufferView ", view);
  const auto size = sizeOf(static_cast<int>(view));
  if (size == 0) failInvalid(where, ": bufferView ", view, " has no bytes");
  return {viewData(static_cast<int>(view)), static_cast<std::size_t>(size)};
}

void Source::leaveOut(std::size_t mesh, std::size_t primitive, const std::string& attribute) {
  document_.content.meshes[mesh].primitives[primitive].attributes.erase(attribute);
}

void Source::refuseFaulty(int index) const {
  if (isFaulty_[static_cast<std::size_t>(index)])
    failInvalid("accessor ", index, ": it is invalid, or its data is missing");
}

void Source::require(int index, int type, std::span<const Format> formats, const std::string& where,
                     std::span<const Format> tolerated) const {
  refuseFaulty(index);
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  const Format format{accessor.componentType, accessor.normalized};
  const auto isIn = [&](std::span<const Format> list) {
    return std::find(list.begin(), list.end(), format) != list.end();
  };
  if (accessor.type == type && isIn(formats)) return;
  std::string allowed;
  for (const Format& candidate : formats) {
    if (!allowed.empty()) allowed += " or ";
    allowed += formatName(candidate);
  }
  const std::string sentence =
      join(where, ": accessor ", index, " is ", find(types, accessor.type).name, " of ",
           formatName(format), ", not ", find(types, type).name, " of ", allowed);
  if (accessor.type != type || !isIn(tolerated)) failInvalid(sentence);
  notes_.broken(NoteKind::format, sentence);
}

void Source::noteAttributeAlignment(int index, const std::string& where) const {
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  if (accessor.bufferView < 0) return;
  if (accessor.byteOffset % 4 == 0 && strideOf(accessor) % 4 == 0) return;
  notes_.broken(NoteKind::alignment, where, ": accessor ", index, " starts at byte ",
                accessor.byteOffset, " with a stride of ", strideOf(accessor),
                ": vertex attributes must be aligned to 4 bytes");
}

void Source::noteStride(int index, const std::string& where) const {
  const int view = content().accessors[static_cast<std::size_t>(index)].bufferView;
  if (view < 0 || strideOf(view) == 0) return;
  notes_.broken(NoteKind::stride, where, ": bufferView ", view, " of accessor ", index,
                " has a byteStride of ", strideOf(view), ", which only vertex attributes may have");
}

Format Source::format(int accessor) const {
  const auto& found = content().accessors[static_cast<std::size_t>(accessor)];
  return {found.componentType, found.normalized};
}

std::uint32_t Source::count(int accessor) const {
  return static_cast<std::uint32_t>(content().accessors[static_cast<std::size_t>(accessor)].count);
}

std::uint32_t Source::components(int accessor) const {
  return find(types, content().accessors[static_cast<std::size_t>(accessor)].type).size;
}

bool Source::hasNoData(int accessor) const {
  const auto& found = content().accessors[static_cast<std::size_t>(accessor)];
  return found.bufferView < 0 && !found.sparse.isSparse;
}

bool Source::isZeroElsewhere(int accessor) const {
  return content().accessors[static_cast<std::size_t>(accessor)].bufferView < 0;
}

void Source::spendOnAccessor(int index) {
  refuseFaulty(index);
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
      // Values are written in order: of two for the same element, the last one wins.
      notes_.broken(NoteKind::sparse, "accessor ", index, ": sparse index ", i, " is ", elements[i],
                    " after ", elements[i - 1], ": they must ascend");
    }
  }
  return elements;
}

const std::byte* Source::sparseData(int index) const {
  const auto& values = content().accessors[static_cast<std::size_t>(index)].sparse.values;
  return viewData(values.bufferView) + values.byteOffset;
}

// Calls `visit` with the index and the address of each component, then again for those that sparse
// values replace. Components of an accessor without a bufferView are zero and not visited.
template <typename Visit>
void Source::forEachComponent(int index, Visit visit) {
  const tinygltf::Accessor& accessor = content().accessors[static_cast<std::size_t>(index)];
  const std::size_t width = components(index);
  const std::size_t component = sizeOfComponent(accessor.componentType);
  if (accessor.bufferView >= 0) {
    const std::byte* element = viewData(accessor.bufferView) + accessor.byteOffset;
    const auto stride = static_cast<std::size_t>(strideOf(accessor));
    for (std::size_t i = 0; i < accessor.count; ++i) {
      for (std::size_t j = 0; j < width; ++j) {
        visit(i * width + j, element + i * stride + j * component);
      }
    }
  }
  if (accessor.sparse.isSparse) {
    const std::byte* data = sparseData(index);
    for (const std::uint32_t element : sparseIndices(index)) {
      for (std::size_t j = 0; j < width; ++j, data += component) visit(element * width + j, data);
    }
  }
}

// `read` converts the component at an address to a Value.
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

Source::SparseValues Source::sparseFloats(int index) {
  refuseFaulty(index);
  const auto [componentType, normalized] = format(index);
  const std::size_t width = components(index), size = sizeOfComponent(componentType);
  SparseValues sparse{sparseIndices(index), {}};
  spend(sparse.elements.size() * width, sizeof(float), join("accessor ", index, " sparse values"));
  sparse.values.resize(sparse.elements.size() * width);
  const std::byte* data = sparseData(index);
  for (float& value : sparse.values) {
    value = loadFloat(data, componentType, normalized);
    data += size;
  }
  return sparse;
}

std::vector<std::uint32_t> Source::integers(int index) {
  const int type = content().accessors[static_cast<std::size_t>(index)].componentType;
  return decode<std::uint32_t>(
      index, [type](const std::byte* address) { return loadInteger(address, type); });
}

}  // namespace dermis::gltf
