#include "pace.h"

#include <array>

namespace dermis::viewer {
namespace {

constexpr double slow = 0.070, fast = 0.020;  // seconds

const std::array<Quality, 5> levels{{
    {1.0f, {2048, 256, 24}},
    {1.0f, {1024, 256, 6}},
    {0.75f, {1024, 256, 4}},
    {0.5f, {512, 128, 3}},
    {0.4f, {512, 128, 2}},
}};
const Quality softwareStill{1.0f, {1024, 256, 20}};

}  // namespace

Pace::Pace(bool isSoftware) : isSoftware_(isSoftware), level_(isSoftware ? 3 : 0) {}

Quality Pace::moving() const {
  return levels[level_];
}

Quality Pace::still() const {
  return isSoftware_ ? softwareStill : levels[0];
}

void Pace::measured(double seconds) {
  if (seconds > slow && level_ + 1 < levels.size()) ++level_;
  if (seconds > 0 && seconds < fast && level_ > 0) --level_;
}

}  // namespace dermis::viewer
