#include "progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <cstdio>
#include <utility>

namespace dermis::samples {

Progress::Progress(std::string what, std::size_t total)
    : what_(std::move(what)), total_(total), visible_(total > 1 && isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (visible_) std::fputs("\r\x1b[K", stderr);
}

void Progress::step() {
  ++done_;
  if (!visible_) return;
  // Not fmt::print, which throws when the terminal is gone.
  std::fputs(fmt::format("\r{}: {} of {}", what_, done_, total_).c_str(), stderr);
}

}  // namespace dermis::samples
