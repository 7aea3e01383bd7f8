#include "gltf/failure.h"

#include <algorithm>
#include <cstddef>
#include <limits>

#include "strict_floating_point.h"

namespace dermis::gltf {

void fail(ErrorCode code, std::string message) {
  throw Failure{Error{code, std::move(message), 0}};
}

void spend(MemoryBudget& budget, std::uint64_t count, std::uint64_t bytesEach,
           std::string_view where) {
  // No object is larger, and sizes below this do not wrap in `std::size_t`. This matters on 32-bit
  // systems.
  constexpr std::uint64_t largestSize = std::numeric_limits<std::ptrdiff_t>::max();
  if (count <= largestSize / std::max<std::uint64_t>(bytesEach, 1) &&
      budget.spend(count, bytesEach))
    return;
  fail(ErrorCode::limitExceeded,
       join(where, ": it needs more memory than the limit for a file of this size"));
}

}  // namespace dermis::gltf
