#include "progress.h"

#include <fmt/format.h>
#include <unistd.h>

#include <utility>

namespace dermis::samples {

Progress::Progress(std::string what, std::size_t total)
    : what_(std::move(what)), total_(total), visible_(total > 1 && isatty(STDERR_FILENO) == 1) {}

Progress::~Progress() {
  if (visible_) fmt::print(stderr, "\r\x1b[K");
}

void Progress::step() {
  ++done_;
  if (visible_) fmt::print(stderr, "\r{}: {} of {}", what_, done_, total_);
}

}  // namespace dermis::samples
