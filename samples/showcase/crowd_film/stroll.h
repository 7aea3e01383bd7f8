// The crowd of the film. Some figures stand in the middle and wave now and then. The others walk
// around them in rings, at the speed of their feet.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/mesh.h"
#include "flight.h"
#include "gait.h"
#include "kit/character.h"

namespace crowd_film {

struct StrollOptions {
  std::uint32_t figures = 1000;
  double framesPerSecond = 30;  ///< the character's ticks are frames
  double start = 0;             ///< seconds into the flight, at frame 1
  std::uint32_t width = 1280, height = 720;
};

/// The state of a figure in one frame.
struct FigureState {
  dermis::samples::Playing playing;
  bool isInView = false;
  std::uint32_t updateInterval = 1;  ///< by the distance from the camera
  double distance = 0;
  /// From the character's space to the world; the ground is at height 0.
  dermis::JointMatrix place;
};

class Stroll {
 public:
  /// `character` and `gait` must outlive it.
  Stroll(const dermis::samples::Character& character, const Gait& gait,
         const StrollOptions& options);

  std::uint32_t count() const { return static_cast<std::uint32_t>(roles_.size()); }
  /// Frames are numbered from 1.
  FigureState at(std::uint32_t figure, std::uint64_t frame) const;

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

  void castStanding(std::uint32_t figures);
  void castWalking(std::uint32_t figures);
  Flight planFlight(const StrollOptions& options) const;
  dermis::JointMatrix placeAt(const Role& role, double angle, double ground) const;
  void pose(std::uint32_t figure, std::uint64_t frame, FigureState& state) const;
  std::uint64_t clock(std::uint64_t frame) const { return frame - 1 + startFrame_; }

  const dermis::samples::Character* character_;
  const Gait* gait_;
  double framesPerSecond_;
  std::uint64_t startFrame_;
  double unit_;
  std::vector<std::uint32_t> walkingClips_, standingClips_;
  std::vector<Role> roles_;
  Flight flight_{FlightPlan{}};
};

}  // namespace crowd_film
