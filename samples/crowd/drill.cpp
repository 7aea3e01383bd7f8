#include "drill.h"

#include <cmath>
#include <numbers>

namespace crowd {
namespace {

struct Place {
  double x = 0, z = 0;  ///< meters
};

constexpr double spacing = 1.2;  ///< meters, about, from figure to figure

/// Sunflower spiral: any number of figures, equally dense everywhere (Vogel 1979).
Place placeOf(std::uint32_t figure) {
  const double goldenAngle = std::numbers::pi * (3 - std::sqrt(5.0));
  const double radius = spacing * std::sqrt(figure + 0.5), angle = goldenAngle * figure;
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

/// The camera turns in the middle of the crowd, and moves from side to side.
struct Camera {
  Place place, forward;
};

Camera cameraAt(std::uint64_t frame, double crowdRadius) {
  constexpr double turnFrames = 160, walkFrames = 240;
  const double turn = 2 * std::numbers::pi * static_cast<double>(frame) / turnFrames;
  const double walk = 2 * std::numbers::pi * static_cast<double>(frame) / walkFrames;
  return {{0.5 * crowdRadius * std::sin(walk), 0}, {std::cos(turn), std::sin(turn)}};
}

/// The clock of an event that happens to a figure once in every period, in different frames for
/// different figures.
std::uint64_t clockOf(std::uint32_t figure, std::uint64_t frame, std::uint32_t spread) {
  return frame + std::uint64_t{figure} * spread;
}

constexpr std::uint32_t awayPeriod = 90, awayFrames = 5, awaySpread = 37;
constexpr std::uint32_t jumpPeriod = 131, jumpSpread = 53;

}  // namespace

/// A figure that returns plays the next clip. After a jump, it is at another time of its clip.
PoseKey Drill::poseAt(std::uint32_t figure, std::uint64_t frame) const {
  const std::uint64_t comings = clockOf(figure, frame, awaySpread) / awayPeriod;
  const std::uint64_t jumps = clockOf(figure, frame, jumpSpread) / jumpPeriod;
  const auto clip = static_cast<std::uint32_t>((figure + comings) % character_->clipCount());
  const std::uint32_t ticks = character_->tickCount(clip);
  const std::uint64_t phase = std::uint64_t{figure} * 7 + jumps * (ticks / 3);
  return {clip, static_cast<std::uint32_t>((frame + phase) % ticks)};
}

FigureFrame Drill::at(std::uint32_t figure, std::uint64_t frame) const {
  FigureFrame now;
  now.isPresent = clockOf(figure, frame, awaySpread) % awayPeriod >= awayFrames;
  now.pose = poseAt(figure, frame);
  now.teleports = clockOf(figure, frame, jumpSpread) % jumpPeriod == 0;

  // Distances are relative to the radius of the crowd, so that all update intervals occur, whatever
  // its size is.
  const double radius = spacing * std::sqrt(static_cast<double>(count()));
  const Camera camera = cameraAt(frame, radius);
  const Place own = placeOf(figure);
  const Place away{own.x - camera.place.x, own.z - camera.place.z};
  const double distance = std::hypot(away.x, away.z) / radius;
  const double ahead = away.x * camera.forward.x + away.z * camera.forward.z;
  now.updateInterval = distance < 0.3 ? 1 : distance < 0.6 ? 2 : distance < 0.9 ? 4 : 8;
  // A figure just behind the camera may still cast a shadow into the picture.
  now.isInView = distance < 1.3 && ahead > -2 * spacing;
  return now;
}

}  // namespace crowd
