#include "kit/progress.h"

#include <fmt/format.h>

#ifdef _WIN32
#include <io.h>
#else
#include <unistd.h>
#endif

#include <cstdio>
#include <utility>

namespace dermis::samples {
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
