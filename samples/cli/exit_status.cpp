#include "exit_status.h"

#include <fmt/format.h>

#include <cstdio>

#include "plain_text.h"

namespace dermis::cli {
namespace {

void print(std::string_view kind, std::string_view message) {
  std::fflush(stdout);
  fmt::print(stderr, "dermis: {}: {}\n", kind, plainLine(message));
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

ExitStatus reportModelError(const Error& error) {
  return reportError(ExitStatus::badInput, error.message);
}

ExitStatus reportDeviceError(const Error& error) {
  const bool noDevice =
      error.code == ErrorCode::missingFeature || error.code == ErrorCode::missingEntryPoint;
  return reportError(noDevice ? ExitStatus::noDevice : ExitStatus::stopped, error.message);
}

}  // namespace dermis::cli
