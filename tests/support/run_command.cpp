#include "run_command.h"

#include <pty.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <stdexcept>

namespace dermis::test {
namespace {

std::string readAll(std::FILE* file) {
  std::rewind(file);
  std::string text;
  char buffer[4096];
  for (std::size_t count = 0; (count = std::fread(buffer, 1, sizeof(buffer), file)) > 0;)
    text.append(buffer, count);
  std::fclose(file);
  return text;
}

[[noreturn]] void execute(const std::vector<std::string>& command,
                          const std::vector<std::string>& environment, int output, int errors) {
  dup2(output, STDOUT_FILENO);
  dup2(errors, STDERR_FILENO);
  for (const std::string& variable : environment) {
    const std::size_t equals = variable.find('=');
    if (equals == std::string::npos) {
      unsetenv(variable.c_str());
    } else {
      setenv(variable.substr(0, equals).c_str(), variable.substr(equals + 1).c_str(), 1);
    }
  }
  std::vector<char*> arguments;
  for (const std::string& argument : command)
    arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  execv(arguments[0], arguments.data());
  _exit(127);
}

/// Its exit status, or the signal.
CommandResult wait(pid_t child) {
  int status = 0;
  waitpid(child, &status, 0);
  if (WIFEXITED(status)) return {WEXITSTATUS(status), 0};
  return {-1, WIFSIGNALED(status) ? WTERMSIG(status) : 0};
}

}  // namespace

CommandResult runCommand(const std::vector<std::string>& command,
                         const std::vector<std::string>& environment) {
  std::FILE* output = std::tmpfile();
  std::FILE* errors = std::tmpfile();
  const pid_t child = fork();
  if (child == 0) execute(command, environment, fileno(output), fileno(errors));
  CommandResult result = wait(child);
  result.output = readAll(output);
  result.errors = readAll(errors);
  return result;
}

CommandResult runAndSignal(const std::vector<std::string>& command,
                           const std::vector<std::string>& environment,
                           const std::function<bool()>& isTime, int signal) {
  std::FILE* output = std::tmpfile();
  std::FILE* errors = std::tmpfile();
  const pid_t child = fork();
  if (child == 0) execute(command, environment, fileno(output), fileno(errors));
  siginfo_t ended{};
  while (!isTime() && ended.si_pid == 0) {
    waitid(P_PID, static_cast<id_t>(child), &ended, WEXITED | WNOHANG | WNOWAIT);
    usleep(1000);
  }
  kill(child, signal);
  CommandResult result = wait(child);
  result.output = readAll(output);
  result.errors = readAll(errors);
  return result;
}

std::string whyNoTerminal() {
  int master = -1, terminal = -1;
  if (openpty(&master, &terminal, nullptr, nullptr, nullptr) != 0)
    return std::string("the system gives no pseudo-terminal: ") + std::strerror(errno);
  close(master);
  close(terminal);
  return {};
}

CommandResult runOnTerminal(const std::vector<std::string>& command) {
  CommandResult result;
  int master = -1, terminal = -1;
  if (openpty(&master, &terminal, nullptr, nullptr, nullptr) != 0)
    throw std::runtime_error(whyNoTerminal());
  std::FILE* output = std::tmpfile();
  const pid_t child = fork();
  if (child == 0) execute(command, {}, fileno(output), terminal);
  close(terminal);
  char buffer[4096];
  // Ends with an error, when the child has closed the terminal.
  for (ssize_t count = 0; (count = read(master, buffer, sizeof(buffer))) > 0;)
    result.errors.append(buffer, static_cast<std::size_t>(count));
  close(master);
  const CommandResult ended = wait(child);
  result.status = ended.status;
  result.signal = ended.signal;
  result.output = readAll(output);
  return result;
}

}  // namespace dermis::test
