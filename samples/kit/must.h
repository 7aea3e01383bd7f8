// Results as values or exceptions, for programs that end at the first error.
#pragma once

#include <exception>
#include <type_traits>
#include <utility>

#include "dermis/result.h"

namespace dermis::samples {

/// Thrown by `must`.
class Failure : public std::exception {
 public:
  explicit Failure(Error error) : error_(std::move(error)) {}
  const char* what() const noexcept override { return error_.message.c_str(); }
  const Error& error() const { return error_; }

 private:
  Error error_;
};

/// Returns the value, or throws `Failure` if there is none.
template <typename T>
T must(Result<T> result) {
  if (!result) throw Failure(result.error());
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

}  // namespace dermis::samples
