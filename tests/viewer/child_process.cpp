#include "child_process.h"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <thread>

namespace dermis::test {
namespace {

[[noreturn]] void execute(std::vector<char*>& arguments, const std::string& folder,
                          const std::string& output, const std::string& errors) {
  const int flags = O_WRONLY | O_CREAT | O_TRUNC;
  dup2(open(output.c_str(), flags, 0600), STDOUT_FILENO);
  dup2(open(errors.c_str(), flags, 0600), STDERR_FILENO);
  if (chdir(folder.c_str()) == 0) execvp(arguments[0], arguments.data());
  _exit(127);
}

}  // namespace

bool waitUntil(const std::function<bool()>& isSo) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!isSo()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return true;
}

ChildProcess::ChildProcess(const std::vector<std::string>& command, const std::string& folder,
                           const std::string& output, const std::string& errors) {
  std::vector<char*> arguments;
  for (const std::string& argument : command)
    arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  child_ = fork();
  if (child_ == 0) execute(arguments, folder, output, errors);
}

ChildProcess::~ChildProcess() {
  if (!isRunning()) return;
  kill(child_, SIGKILL);
  waitpid(child_, nullptr, 0);
}

bool ChildProcess::isRunning() {
  if (status_) return false;
  int status = 0;
  if (waitpid(child_, &status, WNOHANG) == 0) return true;
  status_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return false;
}

int ChildProcess::wait() {
  waitUntil([this] { return !isRunning(); });
  return status_.value_or(-1);
}

}  // namespace dermis::test
