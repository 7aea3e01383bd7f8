// Errors as values: no exception crosses the interface of Dermis.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <variant>

#include "dermis/export.h"

namespace dermis {

/// The kind of an error. `Error::message` says what is wrong.
enum class ErrorCode : std::uint8_t {
  invalidArgument = 0,  ///< the caller broke a rule of the function
  invalidMesh = 1,      ///< `validate` finds a problem that `pack` refuses; `repair` may help
  invalidData = 2,      ///< a blob or file is damaged, truncated, or breaks the rules of its format
  unsupportedVersion = 3,  ///< a blob is from another version of Dermis
  unsupportedFeature = 4,  ///< a file needs a feature that Dermis does not implement
  limitExceeded = 5,       ///< more than the device, or a type of the interface, can hold
  notPrepared = 6,         ///< `record` needs a pipeline that `prepare` has not built
  missingEntryPoint = 7,   ///< the driver does not have a function, or it was not enabled
  missingFeature = 8,      ///< the device, or this build of Dermis, lacks a feature
  vulkanError = 9,         ///< a Vulkan function failed; `Error::vulkanResult` is what it returned
  shaderError = 10,        ///< GLSL does not compile, or SPIR-V is not valid
  ioError = 11,            ///< a file cannot be opened, read or written
};

/// The name of a code as it is written above, for logs.
DERMIS_CORE_API std::string_view errorCodeName(ErrorCode code);

/// Why a function failed.
struct Error {
  ErrorCode code = ErrorCode::invalidArgument;
  std::string message;  ///< one sentence, without a full stop, that names the thing at fault
  std::int32_t vulkanResult = 0;  ///< the VkResult if a Vulkan function failed, otherwise 0
};

/// Either a value or an `Error`. Functions that return no value return `Result<void>`.
template <typename T>
class [[nodiscard]] Result {
 public:
  /// A success.
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  /// A failure.
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  /// Whether there is a value.
  bool ok() const { return state_.index() == 0; }
  /// Whether there is a value.
  explicit operator bool() const { return ok(); }

  /// The value. Calls std::abort if there is none.
  T& value() & {
    require(ok());
    return *std::get_if<0>(&state_);
  }
  /// The value. Calls std::abort if there is none.
  const T& value() const& {
    require(ok());
    return *std::get_if<0>(&state_);
  }
  /// The value, moved out. Calls std::abort if there is none.
  T value() && {
    require(ok());
    return std::move(*std::get_if<0>(&state_));
  }
  T& operator*() & { return value(); }                   ///< `value`
  const T& operator*() const& { return value(); }        ///< `value`
  T operator*() && { return std::move(*this).value(); }  ///< `value`
  T* operator->() { return &value(); }                   ///< the address of `value`
  const T* operator->() const { return &value(); }       ///< the address of `value`

  /// The error. Calls std::abort if there is none.
  const Error& error() const& {
    require(!ok());
    return *std::get_if<1>(&state_);
  }
  /// The error, moved out. Calls std::abort if there is none.
  Error error() && {
    require(!ok());
    return std::move(*std::get_if<1>(&state_));
  }

 private:
  // In release builds, too: otherwise a null pointer would be dereferenced somewhere else.
  static void require(bool condition) {
    if (!condition) std::abort();
  }

  std::variant<T, Error> state_;
};

/// Success, or an `Error`.
template <>
class [[nodiscard]] Result<void> {
 public:
  /// A success.
  Result() : error_(std::nullopt) {}
  /// A failure.
  Result(Error error) : error_(std::move(error)) {}

  /// Whether the function succeeded.
  bool ok() const { return !error_; }
  /// Whether the function succeeded.
  explicit operator bool() const { return ok(); }

  /// The error. Calls std::abort if there is none.
  const Error& error() const& {
    if (ok()) std::abort();
    return *error_;
  }
  /// The error, moved out. Calls std::abort if there is none.
  Error error() && {
    if (ok()) std::abort();
    return *std::move(error_);
  }

 private:
  std::optional<Error> error_;
};

}  // namespace dermis
