// Errors as values, the version, and the export macros of shared libraries.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>

// ---- Export macros of the shared libraries, one for each library. If DERMIS_SHARED is defined, a
// declaration with the macro is exported while that library is compiled, and imported elsewhere;
// everything else is hidden. The CMake targets and dermis.pc of a shared build define
// DERMIS_SHARED. In a static build the macros are empty, so a plugin that links Dermis exports
// nothing of it.

/// @cond
#if !defined(DERMIS_SHARED)
#define DERMIS_EXPORTED
#define DERMIS_IMPORTED
#elif defined(_WIN32)
#define DERMIS_EXPORTED __declspec(dllexport)
#define DERMIS_IMPORTED __declspec(dllimport)
#else
#define DERMIS_EXPORTED __attribute__((visibility("default")))
#define DERMIS_IMPORTED __attribute__((visibility("default")))
#endif

// DERMIS_BUILDS_... is defined while the sources of that library are compiled.
#if defined(DERMIS_BUILDS_CORE)
#define DERMIS_CORE_API DERMIS_EXPORTED
#else
#define DERMIS_CORE_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_CPU)
#define DERMIS_CPU_API DERMIS_EXPORTED
#else
#define DERMIS_CPU_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_VERIFY)
#define DERMIS_VERIFY_API DERMIS_EXPORTED
#else
#define DERMIS_VERIFY_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_VULKAN)
#define DERMIS_VULKAN_API DERMIS_EXPORTED
#else
#define DERMIS_VULKAN_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_SHADER_COMPILER)
#define DERMIS_SHADER_COMPILER_API DERMIS_EXPORTED
#else
#define DERMIS_SHADER_COMPILER_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_RUNTIME_COMPILER)
#define DERMIS_RUNTIME_COMPILER_API DERMIS_EXPORTED
#else
#define DERMIS_RUNTIME_COMPILER_API DERMIS_IMPORTED
#endif
#if defined(DERMIS_BUILDS_GLTF)
#define DERMIS_GLTF_API DERMIS_EXPORTED
#else
#define DERMIS_GLTF_API DERMIS_IMPORTED
#endif
/// @endcond

// ---- Errors as values: no exception crosses the interface of Dermis.

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
  static constexpr bool hasValue = !std::is_void_v<T>;
  using Value = std::conditional_t<hasValue, T, std::monostate>;  // void cannot be a member

 public:
  /// A success of a function that returns no value.
  Result() requires(!hasValue) {}
  /// A success.
  Result(Value value) requires hasValue : state_(std::in_place_index<0>, std::move(value)) {}
  /// A failure.
  Result(Error error) : state_(std::in_place_index<1>, std::move(error)) {}

  /// Whether the function succeeded.
  bool ok() const { return state_.index() == 0; }
  /// Whether the function succeeded.
  explicit operator bool() const { return ok(); }

  /// The value. Calls std::abort if there is none.
  Value& value() & requires hasValue {
    require(ok());
    return *std::get_if<0>(&state_);
  }
  /// The value. Calls std::abort if there is none.
  const Value& value() const& requires hasValue {
    require(ok());
    return *std::get_if<0>(&state_);
  }
  /// The value, moved out. Calls std::abort if there is none.
  Value value() && requires hasValue {
    require(ok());
    return std::move(*std::get_if<0>(&state_));
  }
  Value& operator*() & requires hasValue { return value(); }                   ///< `value`
  const Value& operator*() const& requires hasValue { return value(); }        ///< `value`
  Value operator*() && requires hasValue { return std::move(*this).value(); }  ///< `value`
  Value* operator->() requires hasValue { return &value(); }                   ///< `&value()`
  const Value* operator->() const requires hasValue { return &value(); }       ///< `&value()`

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

  std::variant<Value, Error> state_;
};

/// `Result(value)` is a success.
template <typename T>
Result(T value) -> Result<T>;

}  // namespace dermis

// ---- The version of these headers and of the library that is used at run time. CMake reads the
// version from here.

/// Changes if the interface breaks.
#define DERMIS_VERSION_MAJOR 0
/// Changes if the interface grows. While the major version is 0: also if it breaks.
#define DERMIS_VERSION_MINOR 1
/// Changes if only the implementation changes.
#define DERMIS_VERSION_PATCH 0

namespace dermis {

/// The version of the headers that the program was compiled with: 10000 × major + 100 × minor +
/// patch, as in C.
inline constexpr std::uint32_t headerVersion =
    DERMIS_VERSION_MAJOR * 10000 + DERMIS_VERSION_MINOR * 100 + DERMIS_VERSION_PATCH;

/// The version of the library that the program was linked with or has loaded.
DERMIS_CORE_API std::uint32_t libraryVersion();

/// Whether the library that is used at run time has the interface of the headers that the caller
/// was compiled with: the same major version, and a minor version that is not lower, or while the
/// major version is 0, the same. A program that loads Dermis as a shared library calls this first.
inline bool libraryFitsHeaders() {
  // Without the patches.
  const std::uint32_t library = libraryVersion() / 100, headers = headerVersion / 100;
  if (headers < 100) return library == headers;
  return library / 100 == headers / 100 && library >= headers;
}

}  // namespace dermis
