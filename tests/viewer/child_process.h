// A program that runs beside the test.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace dermis::test {

/// Long enough for a busy machine and a sanitizer; nothing waits longer than it has to.
inline constexpr std::chrono::seconds patience{240};

/// Asks again and again, until it is so. False: it never was.
bool waitUntil(const std::function<bool()>& isSo);

/// Is killed with its object.
class ChildProcess {
 public:
  /// `output` and `errors` are the files that it writes to. The program is looked for in PATH.
  ChildProcess(const std::vector<std::string>& command, const std::string& folder,
               const std::string& output, const std::string& errors);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  bool isRunning();
  /// Its exit status, when it has ended by itself; -1 where a signal did it, or it never ended.
  int wait();

 private:
  pid_t child_ = -1;
  std::optional<int> status_;
};

}  // namespace dermis::test
