// Threads that end with a scope, and a parallel loop on all cores.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <exception>
#include <mutex>
#include <thread>
#include <vector>

namespace dermis::samples {

/// Threads that are joined when a scope ends, for standard libraries without std::jthread (libc++
/// 16).
class JoiningThreads {
 public:
  JoiningThreads() = default;
  JoiningThreads(const JoiningThreads&) = delete;
  JoiningThreads& operator=(const JoiningThreads&) = delete;
  ~JoiningThreads() {
    for (std::thread& thread : threads_) thread.join();
  }

  /// Starts a thread that calls copies of `function` and `arguments`.
  template <typename Function, typename... Arguments>
  void start(const Function& function, const Arguments&... arguments) {
    threads_.emplace_back(function, arguments...);
  }

 private:
  std::vector<std::thread> threads_;
};

/// Calls `body(index)` for each index below `count`, in any order and from this many threads.
/// Returns when all calls are done. If calls throw, it throws one of the exceptions.
template <typename Body>
void inParallel(std::size_t count, const Body& body,
                std::size_t threads = std::thread::hardware_concurrency()) {
  std::atomic<std::size_t> next = 0;
  std::mutex mutex;
  std::exception_ptr thrown;
  const auto work = [&] {
    try {
      for (std::size_t index = next++; index < count; index = next++) body(index);
    } catch (...) {
      const std::lock_guard lock(mutex);
      thrown = std::current_exception();
    }
  };
  {
    JoiningThreads others;
    for (std::size_t thread = 1; thread < std::min(threads, count); ++thread)
      others.start([&work] { work(); });
    work();
  }
  if (thrown) std::rethrow_exception(thrown);
}

}  // namespace dermis::samples
