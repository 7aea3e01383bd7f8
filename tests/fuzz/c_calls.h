// Arguments for calls of the C interface, made from the data of a fuzzer: most are right; some are
// null, of a wrong size, or out of range. Memory is on the heap and not a byte larger than the call
// is told, so that the sanitizer sees where a function leaves it.
#pragma once

#include <fuzzer/FuzzedDataProvider.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <initializer_list>
#include <limits>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "dermis/dermis.h"

namespace dermis::fuzz {

inline std::string lastMessage;  // of the last call that failed

inline void expect(bool condition, int line = __builtin_LINE()) {
  if (condition) return;
  std::fprintf(stderr, "line %d: not as expected; last error: %s\n", line, lastMessage.c_str());
  std::abort();
}

using Bytes = std::unique_ptr<std::byte[]>;
struct Destroy {
  void operator()(void* object) const { dermis_destroy(object); }
};
template <typename T>
using Owned = std::unique_ptr<T, Destroy>;

template <typename List>
std::uint32_t sizeOf(const List& list) {
  return static_cast<std::uint32_t>(std::size(list));
}
inline std::uint32_t sizeOf(dermis_component type) {
  constexpr std::array<std::uint32_t, 9> sizes{4, 2, 1, 2, 1, 2, 1, 2, 4};
  return static_cast<std::uint32_t>(type) < sizes.size() ? sizes[type] : 4;
}
inline std::uint32_t sizeOf(dermis_format format) {
  constexpr std::array<std::uint32_t, 11> sizes{0, 12, 16, 6, 8, 6, 8, 3, 4, 4, 2};
  return sizes.at(format);
}

/// Memory that a call writes if it succeeds.
struct Output {
  explicit Output(std::size_t byteCount, std::byte pattern = std::byte{0xa5})
      : bytes(new std::byte[byteCount]), before(byteCount, pattern) {
    std::fill_n(bytes.get(), byteCount, pattern);
  }
  bool isUnchanged() const { return std::equal(before.begin(), before.end(), bytes.get()); }
  template <typename T>
  T* as() const {
    return reinterpret_cast<T*>(bytes.get());
  }

  Bytes bytes;
  std::vector<std::byte> before;
};
/// An array without `size`.
template <typename T>
struct Outputs : Output {
  explicit Outputs(std::size_t count = 1) : Output(count * sizeof(T)) {}
  T* get() const { return as<T>(); }
  T& operator[](std::size_t i) const { return get()[i]; }
};
/// The pointer to an object that a call makes.
template <typename T>
struct Made : Output {
  Made() : Output(sizeof(T*), std::byte{0}) {}
  T** get() const { return as<T*>(); }
  Owned<T> take() const { return Owned<T>(*get()); }
};
/// A structure that a call fills.
template <typename T>
struct Filled : Output {
  explicit Filled(std::uint32_t told = sizeof(T))
      : Output(told > 4096 ? 4 : std::max(told, 4u)), isValid(told >= sizeof(T) && told <= 4096) {
    std::memcpy(bytes.get(), &told, 4);
    std::memcpy(before.data(), &told, 4);
  }
  T* get() const { return as<T>(); }
  T* operator->() const { return get(); }

  bool isValid;
};
/// Structures that a call reads. Their size may be that of a newer header.
template <typename T>
struct Given {
  const T* get() const { return reinterpret_cast<const T*>(bytes.get()); }

  Bytes bytes;
  bool isValid = true;
};

/// A view of a mesh, and its memory.
struct MeshData {
  std::vector<Bytes> memory;
  std::vector<dermis_influence_set> sets;
  std::vector<dermis_morph_target> targets;
  dermis_mesh_view view{};
  std::uint32_t joints = 0;
  bool isGood = true;  ///< `dermis_pack` must accept it; otherwise it may
};

class Arguments {
 protected:
  Arguments(const std::uint8_t* bytes, std::size_t size) : data_(bytes, size) {}

  /// Never once the data has come to its end.
  bool seldom() { return data_.ConsumeIntegral<std::uint8_t>() > 247; }
  std::uint32_t number(std::uint32_t first, std::uint32_t last) {
    return data_.ConsumeIntegralInRange(first, last);
  }
  bool oneOf(std::uint32_t count) { return number(1, count) == count; }
  template <typename T>
  T any() {
    return data_.ConsumeIntegral<T>();
  }
  template <typename List>
  auto& anyOf(List& list) {
    return list[number(0, sizeOf(list) - 1)];
  }
  /// For what there is much of.
  std::uint32_t random() {
    state_ ^= state_ << 13;
    state_ ^= state_ >> 17;
    return state_ ^= state_ << 5;
  }
  /// C++ knows no enumerators with more than 31 bits.
  template <typename Enum>
  Enum enumerator(std::uint32_t last) {
    constexpr std::array<std::uint32_t, 3> odd{255, 256, 0x7fffffff};
    return static_cast<Enum>(seldom() ? data_.PickValueInArray(odd) : number(0, last));
  }
  template <typename T>
  T* orNull(T* pointer) {
    if (!seldom()) return pointer;
    isNull_ = true;
    return nullptr;
  }
  template <typename T>
  Filled<T> filled() {
    constexpr std::uint32_t size = sizeof(T);
    constexpr std::array<std::uint32_t, 5> odd{0, size - 4, size + 8, 4096, 5000};
    return Filled<T>(seldom() ? data_.PickValueInArray(odd) : size);
  }
  template <typename T>
  Given<T> given(std::vector<T> values) {
    const std::size_t stride = sizeof(T) + (seldom() ? 8 : 0);
    Given<T> result{Bytes(new std::byte[values.size() * stride]())};
    for (std::size_t i = 0; i < values.size(); ++i) {
      const bool isSmall = seldom(), isUnknown = stride > sizeof(T) && seldom();
      values[i].size = static_cast<std::uint32_t>(isSmall ? sizeof(T) - 4 : stride);
      std::memcpy(result.bytes.get() + i * stride, &values[i], sizeof(T));
      if (isUnknown) result.bytes[(i + 1) * stride - 1] = std::byte{1};
      if (isSmall || isUnknown) result.isValid = false;
    }
    return result;
  }
  template <typename T>
  Given<T> given(const T& value) {
    return given(std::vector<T>{value});
  }
  /// A copy, sometimes shorter or with other bits.
  template <typename Byte>
  std::vector<std::byte> damaged(const Byte* bytes, std::size_t byteCount) {
    const auto* first = reinterpret_cast<const std::byte*>(bytes);
    std::vector<std::byte> copy(first,
                                first + (seldom() ? any<std::uint32_t>() % byteCount : byteCount));
    for (std::uint32_t i = number(0, 7); i > 5 && !copy.empty(); --i)
      anyOf(copy) ^= static_cast<std::byte>(1u << number(0, 7));
    copy.shrink_to_fit();
    return copy;
  }

  /// Calls a function, and checks what is true of every call.
  template <typename... Parameters, typename... Values>
  dermis_code call(std::initializer_list<const Output*> outputs,
                   dermis_code (*function)(Parameters...), Values... values) {
    ++calls;
    dermis_error error;
    std::memset(&error, 0x5a, sizeof(error));
    const bool isWanted = wantsErrors_ || !seldom();
    const dermis_code code = function(values..., isWanted ? &error : nullptr);
    lastMessage.clear();
    if (code == DERMIS_OK) {
      expect(static_cast<int>(error.code) == 0x5a5a5a5a && error.message[0] == 0x5a);
      return code;
    }
    for (const Output* output : outputs) expect(output->isUnchanged());
    // No other code can be the outcome without a device and with memory.
    constexpr std::array usual{DERMIS_INVALID_ARGUMENT,    DERMIS_INVALID_MESH,
                               DERMIS_INVALID_DATA,        DERMIS_UNSUPPORTED_VERSION,
                               DERMIS_UNSUPPORTED_FEATURE, DERMIS_LIMIT_EXCEEDED,
                               DERMIS_MISSING_FEATURE,     DERMIS_IO_ERROR};
    expect(std::find(usual.begin(), usual.end(), code) != usual.end() || codes_.contains(code));
    if (!isWanted) return code;
    expect(error.code == code && error.vulkan_result == 0 && error.message[0] != '\0');
    expect(std::memchr(error.message, '\0', sizeof(error.message)) != nullptr);
    lastMessage = error.message;
    expect(lastMessage.find('\n') == std::string::npos && lastMessage.back() != '.');
    return code;
  }

  /// For one attribute of a mesh: numbers from 0 to 1, or integers below `limit`.
  dermis_attribute attribute(MeshData& mesh, dermis_component type, std::uint32_t components,
                             std::uint32_t count, std::uint32_t limit = 0) {
    dermis_attribute view{nullptr, 0, type, components};
    const bool isOdd = seldom();
    if (isOdd) view = {nullptr, 0, enumerator<dermis_component>(8), number(0, 5)};
    const std::uint32_t one = sizeOf(view.type), size = one * view.components;
    if (oneOf(2)) view.stride = isOdd ? number(0, size + 5) : size + number(0, 5);
    const std::uint32_t stride = view.stride == 0 ? size : view.stride;
    const std::size_t byteCount = count == 0 ? 0 : std::size_t{stride} * (count - 1) + size;
    Bytes& bytes = mesh.memory.emplace_back(new std::byte[byteCount]);
    for (std::size_t i = 0; i < byteCount; ++i) bytes[i] = static_cast<std::byte>(random());
    for (std::uint32_t i = 0; i < count * view.components; ++i) {
      std::byte* to =
          bytes.get() + std::size_t{stride} * (i / view.components) + i % view.components * one;
      const float share = static_cast<float>(random() % 1025) / 1024;
      const std::uint32_t whole = random() % std::max(limit, 1u), half = random() % 0x3c01;
      if (type == DERMIS_FLOAT32 || type == DERMIS_FLOAT16)
        std::memcpy(to, one == 4 ? static_cast<const void*>(&share) : &half, one);
      else if (limit != 0)
        std::memcpy(to, &whole, one);
    }
    constexpr std::array odd{-1.0f, 3e38f, std::numeric_limits<float>::quiet_NaN()};
    const bool isWrong = type == DERMIS_FLOAT32 && byteCount >= 4 && seldom();
    if (isWrong) std::memcpy(bytes.get(), &anyOf(odd), 4);
    if (isOdd || isWrong) mesh.isGood = false;
    view.data = bytes.get();
    return view;
  }
  std::unique_ptr<MeshData> makeMesh() {
    constexpr std::array positions{DERMIS_FLOAT32, DERMIS_FLOAT16, DERMIS_SNORM16, DERMIS_UNORM16};
    constexpr std::array directions{DERMIS_FLOAT32, DERMIS_FLOAT16, DERMIS_SNORM8, DERMIS_SNORM16};
    constexpr std::array joints{DERMIS_UINT8, DERMIS_UINT16, DERMIS_UINT32};
    constexpr std::array weights{DERMIS_FLOAT32, DERMIS_UNORM8, DERMIS_UNORM16};
    auto made = std::make_unique<MeshData>();
    MeshData& mesh = *made;
    dermis_mesh_view& view = mesh.view;
    state_ = number(1, 0xffff);
    const std::uint32_t count = seldom() ? 0 : number(1, 80), has = number(0, 255);
    const std::uint32_t setCount = seldom() ? 0 : number(1, 2);
    view.size = sizeof(view);
    view.name = oneOf(2) ? "fuzz" : nullptr;
    view.vertex_count = count;
    mesh.joints = seldom() ? 0 : number(1, 40);
    mesh.isGood = count > 0 && mesh.joints > 0 && setCount > 0;
    view.positions = attribute(mesh, anyOf(positions), 3, count);
    if ((has & 1) != 0) view.normals = attribute(mesh, anyOf(directions), 3, count);
    if ((has & 2) != 0) view.tangents = attribute(mesh, anyOf(directions), 4, count);
    if ((has & 4) != 0) view.dual_quaternion_weights = attribute(mesh, anyOf(weights), 1, count);
    if ((has & 8) != 0) view.bulge_strengths = attribute(mesh, anyOf(weights), 1, count);
    if ((has & 16) != 0) view.centers_of_rotation = attribute(mesh, DERMIS_FLOAT32, 3, count);
    for (std::uint32_t i = 0; i < setCount; ++i) {
      const std::uint32_t slots = number(1, 5), tooMany = seldom() ? 1 : 0;
      if (tooMany != 0) mesh.isGood = false;
      mesh.sets.push_back(
          {attribute(mesh, anyOf(joints), slots, count, std::max(mesh.joints, 1u) + tooMany),
           attribute(mesh, anyOf(weights), slots, count)});
    }
    for (std::uint32_t i = has >> 6; i > 0; --i) {
      dermis_morph_target target{};
      const std::uint32_t elements = oneOf(2) ? number(0, count) : count;
      if (elements < count) {
        target.vertices = reinterpret_cast<const std::uint32_t*>(
            mesh.memory.emplace_back(new std::byte[elements * 4]).get());
        target.vertex_count = elements;
        for (std::uint32_t v = 0; v < elements; ++v)
          std::memcpy(mesh.memory.back().get() + v * 4, &v, 4);
      }
      if (!oneOf(4)) target.positions = attribute(mesh, DERMIS_FLOAT32, 3, elements);
      if ((has & 1) != 0 && oneOf(2))
        target.normals = attribute(mesh, anyOf(directions), 3, elements);
      if ((has & 2) != 0 && oneOf(2))
        target.tangents = attribute(mesh, anyOf(directions), 3, elements);
      mesh.targets.push_back(target);
    }
    view.influence_sets = mesh.sets.data();
    view.influence_set_count = setCount;
    view.morph_targets = mesh.targets.data();
    view.morph_target_count = sizeOf(mesh.targets);
    return made;
  }

  FuzzedDataProvider data_;
  std::uint32_t state_ = 1;
  bool isNull_ = false;       ///< whether an argument is null, since it was last set
  bool wantsErrors_ = false;  ///< whether every call gets an error to fill
  std::set<int> codes_;       ///< that callbacks returned

  inline static std::uint64_t calls = 0;
};

}  // namespace dermis::fuzz
