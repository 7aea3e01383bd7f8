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
  Figures(const Character& character, std::uint32_t count)
      : character_(&character), count_(count) {}

  std::uint32_t count() const { return count_; }
  /// Frames count from 1.
  FigureFrame at(std::uint32_t figure, std::uint64_t frame) const;

 private:
  PoseKey poseAt(std::uint32_t figure, std::uint64_t frame) const;

  const Character* character_;
  std::uint32_t count_;
};

}  // namespace crowd
