// How well pictures are drawn, so that the window keeps up while something moves: worse then where
// the device is slow, and as well as it can once nothing does.
#pragma once

#include <cstddef>

#include "scene_view.h"

namespace dermis::viewer {

class Pace {
 public:
  /// Software Vulkan begins where a graphics card hardly ever gets.
  explicit Pace(bool isSoftware);

  Quality moving() const;
  Quality still() const;
  /// Whether the two differ.
  bool hasTwo() const { return isSoftware_ || level_ != 0; }

  /// How long a picture took that was drawn as `moving` said.
  void measured(double seconds);

 private:
  bool isSoftware_;
  std::size_t level_;
};

}  // namespace dermis::viewer
