// What each figure does, as a function of the frame: presence, pose, teleports, visibility, update
// interval. In an engine the game decides this.
#pragma once

#include <cstdint>

#include "character.h"

namespace crowd {

/// The state of a figure in one frame.
struct FigureFrame {
  bool isPresent = false;  ///< figures come and go
  PoseKey pose;
  bool teleports = false;            ///< its pose is unrelated to the pose of the last frame
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
