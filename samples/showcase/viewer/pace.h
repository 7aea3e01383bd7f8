// The quality of pictures. While something moves, it is reduced on slow devices so that the window
// keeps up; when nothing moves, it is the best.
#pragma once

#include <cstddef>

#include "scene_view.h"

namespace dermis::viewer {

class Pace {
 public:
  /// Software Vulkan starts at a level that a GPU hardly ever reaches.
  explicit Pace(bool isSoftware);

  Quality moving() const;
  Quality still() const;
  /// Whether the two qualities differ.
  bool hasTwo() const { return isSoftware_ || level_ != 0; }

  /// Reports how long a picture with the quality `moving` took.
  void measured(double seconds);

 private:
  bool isSoftware_;
  std::size_t level_;
};

}  // namespace dermis::viewer
