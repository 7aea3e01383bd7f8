#include "kit/program.h"

#include <fmt/format.h>

#ifdef _WIN32
#include <io.h>
#include <windows.h>
// After windows.h.
#include <shellapi.h>
#else
#include <fcntl.h>
#include <unistd.h>
#endif

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <cstdio>
#include <exception>
#include <new>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "kit/output_file.h"
#include "kit/text.h"

namespace dermis::samples {
namespace {

const char* programName = "dermis";  // until `runProgram` sets it
std::string subcommandName;          // empty for the program itself

/// If standard error cannot be written, the message is lost, but the exit status is right.
void print(std::string_view kind, std::string_view message) {
  std::fflush(stdout);
  try {
    const std::string line = fmt::format("{}: {}: {}\n", programName, kind, oneLine(message));
    (void)std::fwrite(line.data(), 1, line.size(), stderr);
  } catch (const std::bad_alloc&) {
    (void)std::fputs("error: out of memory\n", stderr);
  }
}

}  // namespace

ExitStatus reportError(ExitStatus status, std::string_view message) {
  print("error", message);
  return status;
}

void reportWarning(std::string_view message) {
  print("warning", message);
}

void reportNote(std::string_view message) {
  print("note", message);
}

ExitStatus reportWrongUsage(std::string_view message) {
  return reportError(ExitStatus::wrongUsage,
                     fmt::format("{} (see {}{}{} --help)", message, programName,
                                 subcommandName.empty() ? "" : " ", subcommandName));
}

ExitStatus reportModelError(const Error& error) {
  return reportError(ExitStatus::badInput, error.message);
}

ExitStatus deviceErrorStatus(const Error& error) {
  const bool noDevice =
      error.code == ErrorCode::missingFeature || error.code == ErrorCode::missingEntryPoint;
  return noDevice ? ExitStatus::noDevice : ExitStatus::stopped;
}

ExitStatus reportDeviceError(const Error& error) {
  return reportError(deviceErrorStatus(error), error.message);
}

namespace {

bool isOption(std::string_view argument) {
  return argument.size() > 1 && argument[0] == '-';
}

bool isFlag(std::string_view argument, const CLI::App& command) {
  const CLI::Option* option =
      isOption(argument) ? command.get_option_no_throw(std::string(argument)) : nullptr;
  return option != nullptr && option->get_items_expected_max() == 0;
}

const CLI::App* findSubcommand(const CLI::App& app, std::string_view name) {
  for (const CLI::App* command : app.get_subcommands([](const CLI::App*) { return true; })) {
    if (command->get_name() == name) return command;
  }
  return nullptr;
}

/// Finds arguments that CLI11 would misunderstand; empty if there are none.
std::string complaintAbout(std::span<char* const> arguments, const CLI::App& command) {
  std::string_view before;
  for (const std::string_view argument : arguments) {
    if (argument == "--") break;
    const std::size_t equals = argument.find('=');
    const std::string name(argument.substr(0, equals));
    if (argument.empty()) {
      return isOption(before) && !isFlag(before, command)
                 ? fmt::format("{} has an empty value", before)
                 : "an argument is empty";
    }
    if (isOption(argument) && equals != std::string_view::npos) {
      if (isFlag(name, command)) return fmt::format("{} takes no value", name);
      if (equals + 1 == argument.size()) return fmt::format("{} has an empty value", name);
      if (equals == 2 && std::isalpha(static_cast<unsigned char>(name[1])) != 0)
        return fmt::format("{} takes its value without '='", name);
    }
    before = argument;
  }
  return {};
}

#ifdef _WIN32
std::string toUtf8(const wchar_t* text) {
  const int size = WideCharToMultiByte(CP_UTF8, 0, text, -1, nullptr, 0, nullptr, nullptr);
  std::string utf8(static_cast<std::size_t>(std::max(size, 1)), '\0');
  WideCharToMultiByte(CP_UTF8, 0, text, -1, utf8.data(), size, nullptr, nullptr);
  utf8.pop_back();  // the zero at the end
  return utf8;
}

/// On Windows, the arguments of `main` are in the code page of the machine, which lacks most
/// characters.
ExitStatus runWithArguments(int, char**, ExitStatus (*run)(int, char**)) {
  SetConsoleOutputCP(CP_UTF8);
  int count = 0;
  wchar_t** const wide = CommandLineToArgvW(GetCommandLineW(), &count);
  std::vector<std::string> arguments;
  for (int i = 0; i < count; ++i) arguments.push_back(toUtf8(wide[i]));
  LocalFree(wide);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  pointers.push_back(nullptr);
  return run(count, pointers.data());
}
#else
/// Opens the standard streams that are closed. Otherwise the next file that is opened would become
/// standard output or error. They are opened for the wrong direction, so that using them fails as
/// for a closed stream.
void fillClosedStreams() {
  for (const int stream : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO}) {
    if (fcntl(stream, F_GETFD) == -1)
      (void)open("/dev/null", stream == STDIN_FILENO ? O_WRONLY : O_RDONLY);
  }
}

ExitStatus runWithArguments(int argc, char** argv, ExitStatus (*run)(int, char**)) {
  fillClosedStreams();
  return run(argc, argv);
}
#endif

}  // namespace

std::optional<ExitStatus> parseOptions(CLI::App& app, int argc, char** argv) {
  const CLI::App* command = findSubcommand(app, argc > 1 ? argv[1] : "");
  if (command != nullptr) subcommandName = command->get_name();
  const std::string complaint =
      complaintAbout(std::span(argv, static_cast<std::size_t>(argc)).subspan(argc > 0 ? 1 : 0),
                     command != nullptr ? *command : app);
  if (!complaint.empty()) return reportWrongUsage(complaint);
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& success) {
    app.exit(success);  // --help, --version
    return ExitStatus::done;
  } catch (const CLI::ParseError& error) {
    // An unknown option may be the reason why another one seems to be missing.
    const std::vector<std::string> extras = app.remaining(true);
    const auto unknown = std::ranges::find_if(extras, isOption);
    if (unknown == extras.end()) return reportWrongUsage(error.what());
    return reportWrongUsage(
        fmt::format("there is no option {}", unknown->substr(0, unknown->find('='))));
  }
  return std::nullopt;
}

int runProgram(const char* name, int argc, char** argv, ExitStatus (*run)(int argc, char** argv)) {
  handleSignals();
  programName = name;
  ExitStatus status = ExitStatus::stopped;
  try {
    status = runWithArguments(argc, argv, run);
  } catch (const std::bad_alloc&) {
    status = reportError(ExitStatus::stopped, "out of memory");
  } catch (const std::exception& error) {
    status = reportError(ExitStatus::stopped, error.what());
  }
  if (std::fflush(stdout) != 0 && status == ExitStatus::done)
    status = reportError(ExitStatus::stopped, "standard output cannot be written");
  return static_cast<int>(status);
}

namespace {

bool isTerminal(std::FILE* stream) {
#ifdef _WIN32
  return _isatty(_fileno(stream)) != 0;
#else
  return isatty(fileno(stream)) == 1;
#endif
}

}  // namespace

Progress::Progress(std::string what, std::size_t total)
    : what_(std::move(what)), total_(total), visible_(total > 1 && isTerminal(stderr)) {}

Progress::~Progress() {
  if (visible_) std::fputs("\r\x1b[K", stderr);
}

void Progress::step() {
  ++done_;
  if (!visible_) return;
  // Not fmt::print, which throws if the terminal is gone.
  std::fputs(fmt::format("\r{}: {} of {}", what_, done_, total_).c_str(), stderr);
}

}  // namespace dermis::samples
