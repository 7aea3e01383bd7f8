// Properties of JSON objects: whether they are there and of the right type. `where` names the
// object in the message of a `Failure` with `invalidData`.
#pragma once

#include <cstddef>
#include <cstdint>
#include <initializer_list>
#include <string>
#include <string_view>
#include <utility>

#include "gltf/document.h"
#include "gltf/failure.h"

namespace dermis::gltf {

using nlohmann::json;

/// These fail if the object has no such property, or if it has another type.
const json& require(const json& object, const char* property, const std::string& where);
json& requireObject(json& object, const char* property, const std::string& where);
json& requireArray(json& object, const char* property, const std::string& where);
std::uint64_t requireInteger(json& object, const char* property, const std::string& where);

/// The nearest finite number: splines may leave the range of their keys, and so that of a float.
float toFloat(double number);

/// An integer of at least 0. JSON has no integers: 3.0 counts as one, and is replaced by it.
std::uint64_t integer(json& value, const std::string& what);
/// The same of a property, or `absent` if there is none.
std::uint64_t integer(json& object, const char* property, const std::string& where,
                      std::uint64_t absent);
/// The same of a size or an offset: tinygltf keeps these as size_t, which has 32 bits in 32-bit
/// builds.
std::uint64_t byteCount(json& object, const char* property, const std::string& where,
                        std::uint64_t absent);

/// These check a property if it is there: an array of `count` numbers (0: of any number), one
/// number, true or false.
void numbers(const json& object, const char* property, std::size_t count, const std::string& where);
void number(const json& object, const char* property, const std::string& where);
void boolean(const json& object, const char* property, const std::string& where);

/// Fails unless the value is one of these.
void oneOf(const json& value, std::initializer_list<json> allowed, const std::string& what);

/// The extension of an object, or null if it has none of this name.
json* extension(json& object, std::string_view name, const std::string& where);

/// The value that the property names. It must be there.
template <typename Value>
Value valueOf(const json& object, const char* property, const std::string& where,
              std::initializer_list<std::pair<const char*, Value>> names) {
  const json& name = require(object, property, where);
  for (const auto& [known, value] : names) {
    if (name == known) return value;
  }
  failInvalid(where, ": ", property, " is ",
              inQuotes(name.is_string() ? name.get<std::string>() : name.dump()),
              ", which is not supported");
}

}  // namespace dermis::gltf
