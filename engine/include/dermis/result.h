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

/// What kind of thing went wrong. The sentence in `Error::message` says which thing it was.
enum class ErrorCode : std::uint8_t {
  invalidArgument,  ///< A call that the documentation of the function forbids.
  invalidMesh,      ///< `validate` found what `pack` refuses; `repair` may help.
  invalidData,      ///< A blob or a file that is damaged, truncated, or breaks its format's rules.
  unsupportedVersion,  ///< A blob from another version of Dermis.
  unsupportedFeature,  ///< A file that needs something Dermis does not implement.
  limitExceeded,       ///< More than the device, or a type of the interface, can hold.
  notPrepared,         ///< `record` met a variant for which `Context::prepare` has not been called.
  missingEntryPoint,   ///< The driver has no function of this name, or it was not enabled.
  missingFeature,      ///< The device lacks something that Dermis needs.
  vulkanError,         ///< A Vulkan call failed; `Error::vulkanResult` is what it returned.
  shaderError,         ///< GLSL that does not compile, or SPIR-V that is not valid.
  ioError,             ///< A file that cannot be opened, read or written.
};

/// The name of a code, as written above: for logs.
DERMIS_CORE_API std::string_view errorCodeName(ErrorCode code);

struct Error {
  ErrorCode code = ErrorCode::invalidArgument;
  std::string message;  ///< One sentence, without a full stop, that names the thing at fault.
  std::int32_t vulkanResult = 0;  ///< The `VkResult`, where a Vulkan call failed; otherwise 0.
};

/// Either a value or an `Error`. `Result<void>` for calls that only may fail.
template <typename T>
class [[nodiscard]] Result {
 public:
  Result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  bool ok() const { return state_.index() == 0; }
  explicit operator bool() const { return ok(); }

  /// The value; only where `ok()`, otherwise the program is stopped.
  T& value() & {
    require(ok());
    return *std::get_if<0>(&state_);
  }
  const T& value() const& {
    require(ok());
    return *std::get_if<0>(&state_);
  }
  T value() && {
    require(ok());
    return std::move(*std::get_if<0>(&state_));
  }
  T& operator*() & { return value(); }
  const T& operator*() const& { return value(); }
  T operator*() && { return std::move(*this).value(); }
  T* operator->() { return &value(); }
  const T* operator->() const { return &value(); }

  /// The error; only where not `ok()`, otherwise the program is stopped.
  const Error& error() const& {
    require(!ok());
    return *std::get_if<1>(&state_);
  }
  Error error() && {
    require(!ok());
    return std::move(*std::get_if<1>(&state_));
  }

 private:
  // In release too: what would follow is a null dereference somewhere else.
  static void require(bool condition) {
    if (!condition) std::abort();
  }

  std::variant<T, Error> state_;
};

template <>
class [[nodiscard]] Result<void> {
 public:
  Result() : error_(std::nullopt) {}
  Result(Error error) : error_(std::move(error)) {}

  bool ok() const { return !error_; }
  explicit operator bool() const { return ok(); }

  /// The error; only where not `ok()`, otherwise the program is stopped.
  const Error& error() const& {
    if (ok()) std::abort();
    return *error_;
  }
  Error error() && {
    if (ok()) std::abort();
    return *std::move(error_);
  }

 private:
  std::optional<Error> error_;
};

}  // namespace dermis
