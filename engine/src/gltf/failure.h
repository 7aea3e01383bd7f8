// How this module reports errors internally: a `Failure` is thrown, and `load`, `loadFromMemory`
// and `applyRig` turn it into a `Result`. No exception leaves the module.
#pragma once

#include <concepts>
#include <cstdint>
#include <exception>
#include <new>
#include <string>
#include <string_view>
#include <utility>

#include "core/text.h"
#include "dermis/result.h"
#include "gltf/memory_budget.h"

namespace dermis::gltf {

struct Failure {
  Error error;
};

inline std::string textOf(std::string_view text) {
  return std::string(text);
}
inline std::string textOf(double number) {
  return decimal(number);
}
template <std::integral Integer>
std::string textOf(Integer number) {
  return std::to_string(number);
}

/// Concatenates the parts; numbers are written in decimal.
template <typename... Parts>
std::string join(const Parts&... parts) {
  std::string text;
  (text.append(textOf(parts)), ...);
  return text;
}

/// "1 node", "2 nodes".
inline std::string counted(std::size_t count, std::string_view what) {
  return join(count, " ", what, count == 1 ? "" : "s");
}

[[noreturn]] void fail(ErrorCode code, std::string message);

/// Fails with `invalidData` and the sentence that the parts form.
template <typename... Parts>
[[noreturn]] void failInvalid(const Parts&... parts) {
  fail(ErrorCode::invalidData, join(parts...));
}

/// Spends memory, or fails with `limitExceeded`. `where` names the allocation in the message.
void spend(MemoryBudget& budget, std::uint64_t count, std::uint64_t bytesEach,
           std::string_view where);

/// What the function returns. The only place that catches all exceptions: `Failure`s, and whatever
/// the libraries throw.
template <typename Value, typename Function>
Result<Value> guarded(Function function) {
  try {
    return function();
  } catch (Failure& failure) {
    return std::move(failure.error);
  } catch (const std::bad_alloc&) {
    return Error{ErrorCode::limitExceeded, "there is not enough memory for the file"};
  } catch (const std::exception& exception) {
    return Error{ErrorCode::invalidData,
                 join("the file cannot be read: ", shortName(exception.what(), 400))};
  }
}

}  // namespace dermis::gltf
