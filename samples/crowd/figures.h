// What the figures do, as a function of the frame: where they stand, how they move, what the camera
// sees of them. An engine has its game for that.
#pragma once

#include <cstdint>

#include "character.h"

namespace crowd {

/// A figure in one frame.
struct FigureFrame {
  bool isPresent = false;  ///< figures come and go
  PoseKey pose;
  bool teleports = false;            ///< its pose has nothing to do with that of the last frame
  bool isInView = false;             ///< neither behind the camera nor too far away
  std::uint32_t updateInterval = 1;  ///< by the distance to the camera
};

class Figures {
 public:
  explicit Figures(std::uint32_t count) : count_(count) {}
  virtual ~Figures() = default;

  std::uint32_t count() const { return count_; }
  /// Frames count from 1.
  virtual FigureFrame at(std::uint32_t figure, std::uint64_t frame) const = 0;

 private:
  std::uint32_t count_;
};

}  // namespace crowd
