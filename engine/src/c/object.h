// What every function of the C interface does: turns failures into error codes, and checks pointers
// and sizes of structures.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <new>
#include <span>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "dermis/dermis.h"
#include "dermis/result.h"

namespace dermis::c {

/// The base of all objects, so that one function destroys them.
struct Object {
  Object() = default;
  virtual ~Object() = default;
  Object(const Object&) = delete;
  Object& operator=(const Object&) = delete;

  bool isLent = false;  ///< a scene, which another object owns
};

/// Inside the C layer an error is thrown; `guarded` catches it. An error that a callback of the
/// caller returned has the caller's code, which need not be one of Dermis.
struct Failure {
  dermis_code code;
  std::string message;
  std::int32_t vulkanResult = 0;
};

inline dermis_code codeOf(ErrorCode code) {
  return static_cast<dermis_code>(static_cast<int>(code) + 1);
}
[[noreturn]] inline void fail(std::string message, dermis_code code = DERMIS_INVALID_ARGUMENT) {
  throw Failure{code, std::move(message)};
}

/// The value, or an exception.
template <typename T>
T must(Result<T> result) {
  if (!result) {
    const Error& error = result.error();
    throw Failure{codeOf(error.code), error.message, error.vulkanResult};
  }
  if constexpr (!std::is_void_v<T>) return std::move(result).value();
}

/// Writes a message to the caller's buffer. If it is cut, it does not end inside a character.
void cutTo(char (&buffer)[504], std::string_view message);

/// Fills the caller's error, and returns its code.
dermis_code report(dermis_error* error, dermis_code code, std::string_view message,
                   std::int32_t vulkanResult = 0);

/// What a callback of the engine reported, as an error of C++: Dermis' own code if it is one.
Error callbackError(dermis_code code, const dermis_error& error, const char* callback);

/// Calls a function, and turns what it throws into an error.
template <typename Function>
dermis_code guarded(dermis_error* error, Function&& function) {
  try {
    function();
    return DERMIS_OK;
  } catch (const Failure& failure) {
    return report(error, failure.code, failure.message, failure.vulkanResult);
  } catch (const std::bad_alloc&) {
    return report(error, DERMIS_OUT_OF_MEMORY, "there is not enough memory");
  } catch (...) {
    return report(error, DERMIS_OUT_OF_MEMORY, "an exception of the standard library");
  }
}

/// Fails if a pointer is null.
template <typename T>
T& required(T* pointer, const char* name) {
  if (pointer == nullptr) fail(std::string(name) + " is null");
  return *pointer;
}

/// The elements of an array, which may be null if there are none.
template <typename T>
std::span<T> array(T* first, std::size_t count, const char* name) {
  if (first == nullptr && count != 0) fail(std::string(name) + " is null");
  return {first, count};
}

/// Fails if the `size` of a structure is less than what this library knows. Members that it does
/// not know must be 0 if the caller filled the structure.
void checkSize(const void* structure, std::size_t known, const char* name, bool isFilled);

/// A structure of the caller.
template <typename T>
T in(const T* structure, const char* name) {
  checkSize(&required(structure, name), sizeof(T), name, true);
  T copy;
  std::memcpy(&copy, structure, sizeof(T));
  return copy;
}
/// The same, where null means the defaults.
template <typename T>
T inOrDefault(const T* structure, const char* name) {
  if (structure != nullptr) return in(structure, name);
  T defaults{};
  defaults.size = sizeof(T);
  return defaults;
}

/// Structures of the caller, which may be larger than those that this library knows.
template <typename T>
std::vector<T> inArray(const T* first, std::uint32_t count, const char* name) {
  std::vector<T> copies;
  if (count == 0) return copies;
  const std::size_t stride = required(first, name).size;
  if (stride % alignof(T) != 0)
    fail(std::string(name) + ": its size is " + std::to_string(stride) + ", which is not aligned");
  copies.reserve(count);
  for (std::uint32_t i = 0; i < count; ++i) {
    const void* element = reinterpret_cast<const std::byte*>(first) + i * stride;
    const std::string elementName = std::string(name) + "[" + std::to_string(i) + "]";
    copies.push_back(in(static_cast<const T*>(element), elementName.c_str()));
    if (copies.back().size != stride) fail(elementName + ": its size differs from the first");
  }
  return copies;
}

/// Checks a structure that a function fills.
template <typename T>
void checkOut(T* structure, const char* name) {
  checkSize(&required(structure, name), sizeof(T), name, false);
}
/// Fills it, but for its size and for members that this library does not know.
template <typename T>
void give(T* structure, T value) {
  value.size = structure->size;
  std::memcpy(structure, &value, sizeof(T));
}

/// An enumerator of the caller: from 0 to `last`. It is read as a number, since it may be none that
/// the type can have.
template <typename Enum>
std::uint8_t enumerator(const Enum& value, Enum last, const char* name) {
  std::uint32_t number = 0;
  static_assert(sizeof(number) == sizeof(value));
  std::memcpy(&number, &value, sizeof(number));
  if (number > static_cast<std::uint32_t>(last))
    fail(std::string(name) + " is " + std::to_string(number) + ", which has no meaning");
  return static_cast<std::uint8_t>(number);
}

inline std::string_view text(const char* string) {
  return string == nullptr ? "" : string;
}

}  // namespace dermis::c
