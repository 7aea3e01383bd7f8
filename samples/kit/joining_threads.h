// Threads that are joined when a scope ends, for standard libraries without std::jthread (libc++
// 16).
#pragma once

#include <thread>
#include <vector>

namespace dermis::samples {

/// The destructor waits for all threads.
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

}  // namespace dermis::samples
