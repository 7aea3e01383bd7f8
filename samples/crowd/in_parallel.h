// A parallel loop on all cores.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <thread>
#include <vector>

namespace crowd {

/// Calls `body(index)` for each index below `count`, in any order and from several threads. Returns
/// when all calls are done.
template <typename Body>
void inParallel(std::size_t count, const Body& body) {
  std::atomic<std::size_t> next = 0;
  const auto work = [&] {
    for (std::size_t index = next++; index < count; index = next++) body(index);
  };
  std::vector<std::jthread> others;
  const std::size_t threads = std::min<std::size_t>(std::thread::hardware_concurrency(), count);
  for (std::size_t thread = 1; thread < threads; ++thread) others.emplace_back(work);
  work();
}

}  // namespace crowd
