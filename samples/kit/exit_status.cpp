#include "kit/exit_status.h"

#include <fmt/format.h>

#include <cstdio>
#include <new>
#include <string>
#include <utility>

#include "dermis/text.h"

namespace dermis::samples {
namespace {

const char* name = "dermis";
std::string subcommand;

/// If standard error cannot be written, the message is lost, but the exit status is right.
void print(std::string_view kind, std::string_view message) {
  std::fflush(stdout);
  try {
    const std::string line = fmt::format("{}: {}: {}\n", name, kind, oneLine(message));
    (void)std::fwrite(line.data(), 1, line.size(), stderr);
  } catch (const std::bad_alloc&) {
    (void)std::fputs("error: out of memory\n", stderr);
  }
}

}  // namespace

void setProgramName(const char* newName) {
  name = newName;
}

void setSubcommandName(std::string newName) {
  subcommand = std::move(newName);
}

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
                     fmt::format("{} (see {}{}{} --help)", message, name,
                                 subcommand.empty() ? "" : " ", subcommand));
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

}  // namespace dermis::samples
