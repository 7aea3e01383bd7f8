// The crowd of the film. Some figures stand in the middle and wave. The others walk around them in
// rings, at the speed of their feet.
#pragma once

#include <cstdint>
#include <vector>

#include "character.h"
#include "dermis/types.h"
#include "figures.h"
#include "flight.h"
#include "gait.h"

namespace crowd {

struct StrollOptions {
  std::uint32_t figures = 1000;
  double framesPerSecond = 30;  ///< the character's ticks are frames
  double start = 0;             ///< seconds into the flight, at frame 1
  std::uint32_t width = 1280, height = 720;
};

class Stroll final : public Figures {
 public:
  /// `character` and `gait` must outlive it.
  Stroll(const Character& character, const Gait& gait, const StrollOptions& options);

  FigureFrame at(std::uint32_t figure, std::uint64_t frame) const override;
  /// From the character's space to the world; the ground is at height 0.
  dermis::JointMatrix place(std::uint32_t figure, std::uint64_t frame) const;

  const Flight& flight() const { return flight_; }
  Eye eye(std::uint64_t frame) const;

 private:
  struct Role {
    std::uint32_t clip = 0, phase = 0;
    double radius = 0, angle = 0;  ///< about the middle, at the beginning
    double step = 0;               ///< angle by which it moves in each frame
    double yaw = 0;                ///< direction in which it looks; 0 is outwards
    double scale = 1;
  };

  void cast(std::uint32_t figures);
  void castStanding(std::uint32_t first, std::uint32_t count);
  void castWalking(std::uint32_t first, std::uint32_t count);
  std::uint64_t clock(std::uint64_t frame) const { return frame - 1 + startFrame_; }

  const Character* character_;
  const Gait* gait_;
  double framesPerSecond_;
  std::uint64_t startFrame_;
  double unit_;
  std::vector<std::uint32_t> walkingClips_, standingClips_;
  std::vector<Role> roles_;
  Flight flight_{FlightPlan{}};
};

}  // namespace crowd
