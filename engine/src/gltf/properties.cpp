#include "gltf/properties.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gltf/failure.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

// Above this, a JSON number may differ from the integer that was written.
constexpr std::uint64_t largestInteger = (std::uint64_t{1} << 53) - 1;

// Numbers must be finite in float32, because they are converted to it.
void finiteNumber(const json& value, const char* property, const std::string& where) {
  if (!value.is_number())
    failInvalid(where, ": ", property, " contains something other than numbers");
  const double magnitude = std::abs(value.get<double>());
  if (!(magnitude <= static_cast<double>(std::numeric_limits<float>::max()))) {
    failInvalid(where, ": ", property, " contains a number that is out of range for float32");
  }
}

}  // namespace

float toFloat(double number) {
  constexpr double largest = std::numeric_limits<float>::max();
  return static_cast<float>(std::clamp(number, -largest, largest));
}

const json& require(const json& object, const char* property, const std::string& where) {
  const auto found = object.find(property);
  if (found == object.end()) failInvalid(where, ": it has no ", property);
  return *found;
}

json& requireObject(json& object, const char* property, const std::string& where) {
  require(object, property, where);
  if (!object[property].is_object()) failInvalid(where, ": ", property, " is not an object");
  return object[property];
}

json& requireArray(json& object, const char* property, const std::string& where) {
  require(object, property, where);
  if (!object[property].is_array()) failInvalid(where, ": ", property, " is not an array");
  return object[property];
}

std::uint64_t integer(json& value, const std::string& what) {
  if (value.is_number_float()) {
    const double number = value.get<double>();
    if (number >= 0 && std::floor(number) == number) {
      value = static_cast<std::uint64_t>(std::min(number, 0x1p63));
    }
  }
  if (!value.is_number_unsigned()) failInvalid(what, " is not an integer of at least 0");
  if (value.get<std::uint64_t>() > largestInteger)
    failInvalid(what, " is larger than ", largestInteger);
  return value.get<std::uint64_t>();
}

std::uint64_t integer(json& object, const char* property, const std::string& where,
                      std::uint64_t absent) {
  const auto found = object.find(property);
  return found == object.end() ? absent : integer(*found, join(where, ": ", property));
}

std::uint64_t byteCount(json& object, const char* property, const std::string& where,
                        std::uint64_t absent) {
  const std::uint64_t number = integer(object, property, where, absent);
  constexpr std::uint64_t largest = std::numeric_limits<std::size_t>::max();
  if (number > largest) failInvalid(where, ": ", property, " is larger than ", largest);
  return number;
}

std::uint64_t requireInteger(json& object, const char* property, const std::string& where) {
  require(object, property, where);
  return integer(object, property, where, 0);
}

void numbers(const json& object, const char* property, std::size_t count,
             const std::string& where) {
  const auto found = object.find(property);
  if (found == object.end()) return;
  if (!found->is_array() || (count != 0 && found->size() != count)) {
    failInvalid(where, ": ", property, " is not an array of ",
                count != 0 ? join(count, " numbers") : std::string("numbers"));
  }
  for (const json& number : *found) finiteNumber(number, property, where);
}

void number(const json& object, const char* property, const std::string& where) {
  const auto found = object.find(property);
  if (found != object.end()) finiteNumber(*found, property, where);
}

void boolean(const json& object, const char* property, const std::string& where) {
  const auto found = object.find(property);
  if (found != object.end() && !found->is_boolean()) {
    failInvalid(where, ": ", property, " is neither true nor false");
  }
}

void oneOf(const json& value, std::initializer_list<json> allowed, const std::string& what) {
  if (std::find(allowed.begin(), allowed.end(), value) != allowed.end()) return;
  failInvalid(what, " is ", inQuotes(value.is_string() ? value.get<std::string>() : value.dump()),
              ", which the specification does not define");
}

json* extension(json& object, std::string_view name, const std::string& where) {
  const auto extensions = object.find("extensions");
  if (extensions == object.end() || !extensions->is_object()) return nullptr;
  const auto found = extensions->find(name);
  if (found == extensions->end()) return nullptr;
  if (!found->is_object()) failInvalid(where, ": ", name, " is not an object");
  return &*found;
}

}  // namespace dermis::gltf
