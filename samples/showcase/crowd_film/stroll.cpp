#include "stroll.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <span>

#include <glm/geometric.hpp>

#include "chance.h"

using namespace dermis;

namespace crowd_film {
namespace {

/// Purposes of `chance`.
enum Purpose : std::uint32_t {
  clipChoice,
  phaseChoice,
  alongPath,
  acrossPath,
  look,
  size,
  changeTime
};

// In meters, for a figure of 1.75 m. A long animal is measured by its length.
constexpr double standingSpacing = 0.95;
constexpr double aisleInside = 1.6, aisleWidth = 3.0;
constexpr double ringSpacing = 1.3, walkingSpacing = 1.75;
constexpr std::uint32_t ringsOneWay = 3;

/// Radius of a sphere around the middle of a figure that contains the figure and almost all of its
/// shadow.
constexpr double reach = 2.3;

/// A figure that stands chooses a clip every so often, and fades to it.
constexpr double changeSeconds = 6, fadeSeconds = 0.5;

/// An update may be late as long as the feet move less than this number of pixels.
constexpr double unseenPixels = 2;

std::uint32_t choose(std::span<const std::uint32_t> clips, std::uint32_t number) {
  return clips[static_cast<std::size_t>(chance(number, clipChoice) *
                                        static_cast<double>(clips.size()))];
}

}  // namespace

Stroll::Stroll(const samples::Character& character, const Gait& gait, const StrollOptions& options)
    : character_(&character),
      gait_(&gait),
      framesPerSecond_(options.framesPerSecond),
      startFrame_(static_cast<std::uint64_t>(std::llround(options.start * framesPerSecond_))),
      unit_(std::max(gait.height / 1.75, gait.length / 1.3)) {
  for (std::uint32_t clip = 0; clip < gait.clips.size(); ++clip)
    (gait.clips[clip].walks() ? walkingClips_ : standingClips_).push_back(clip);
  // If no clip walks, all figures stand; if no clip stands, all walk.
  std::uint32_t standing = walkingClips_.empty() ? options.figures : (options.figures + 8) / 12;
  if (standingClips_.empty()) standing = 0;
  castStanding(standing);
  castWalking(options.figures - standing);
  flight_ = planFlight(options);
}

/// Sunflower spiral: any number of figures, equally dense everywhere (Vogel 1979).
void Stroll::castStanding(std::uint32_t figures) {
  const double goldenAngle = std::numbers::pi * (3 - std::sqrt(5.0));
  for (std::uint32_t figure = 0; figure < figures; ++figure) {
    Role role;
    role.clip = choose(standingClips_, figure);
    role.phase =
        static_cast<std::uint32_t>(chance(figure, phaseChoice) * character_->tickCount(role.clip));
    role.radius = standingSpacing * unit_ * std::sqrt(figure + 0.5);
    role.angle = goldenAngle * figure;
    role.yaw = 0.7 * deviation(figure, look);
    role.scale = 1 + 0.05 * deviation(figure, size);
    roles_.push_back(role);
  }
}

/// All figures of a ring have the same height, so the same speed, and do not collide.
void Stroll::castWalking(std::uint32_t figures) {
  double radius = aisleInside + aisleWidth;
  if (!roles_.empty()) radius += roles_.back().radius / unit_;
  std::uint32_t figure = count();
  const std::uint32_t end = figure + figures;
  for (std::uint32_t ring = 0; figure < end; ++ring, radius += ringSpacing) {
    const auto room = static_cast<std::uint32_t>(2 * std::numbers::pi * radius / walkingSpacing);
    const std::uint32_t here = std::min(room, end - figure);
    const double direction = ring / ringsOneWay % 2 == 0 ? -1 : 1;
    Role role;
    role.clip = choose(walkingClips_, ring);
    role.scale = 1 + 0.05 * deviation(ring, size);
    role.yaw = direction * std::numbers::pi / 2;
    const ClipGait& gait = gait_->clips[role.clip];
    role.step = direction * role.scale * std::hypot(gait.stepX, gait.stepZ) / (radius * unit_);
    for (std::uint32_t place = 0; place < here; ++place, ++figure) {
      role.phase = static_cast<std::uint32_t>(chance(figure, phaseChoice) *
                                              character_->tickCount(role.clip));
      role.radius = (radius + 0.2 * deviation(figure, acrossPath)) * unit_;
      role.angle =
          2 * std::numbers::pi * (place + 0.2 * deviation(figure, alongPath)) / room + ring;
      roles_.push_back(role);
    }
  }
}

Flight Stroll::planFlight(const StrollOptions& options) const {
  FlightPlan plan;
  plan.unit = unit_;
  plan.aspect = static_cast<double>(options.width) / options.height;
  plan.height = options.height;
  double inside = 0;
  for (const Role& role : roles_) {
    plan.crowdRadius = std::max(plan.crowdRadius, role.radius + unit_);
    if (role.step == 0) inside = std::max(inside, role.radius);
  }
  plan.aisleRadius = inside + (aisleInside + 0.5 * aisleWidth - 0.8) * unit_;
  plan.crowdRadius = std::max(plan.crowdRadius, plan.aisleRadius + 3 * unit_);
  return Flight(plan);
}

Eye Stroll::eye(std::uint64_t frame) const {
  return flight_.at(static_cast<double>(clock(frame)) / framesPerSecond_);
}

/// Rotates from the direction in which the clip walks to the direction in which the figure should
/// walk.
JointMatrix Stroll::placeAt(const Role& role, double angle, double ground) const {
  const ClipGait& gait = gait_->clips[role.clip];
  const double own = gait.walks() ? std::atan2(gait.stepX, gait.stepZ) : 0;
  const double heading = angle + role.yaw;
  const double turn = std::atan2(std::cos(heading), std::sin(heading)) - own;
  const double cosine = role.scale * std::cos(turn), sine = role.scale * std::sin(turn);
  JointMatrix matrix;
  auto& m = matrix.m;
  m[0][0] = m[2][2] = static_cast<float>(cosine);
  m[0][2] = static_cast<float>(sine);
  m[2][0] = static_cast<float>(-sine);
  m[1][1] = static_cast<float>(role.scale);
  m[0][3] = static_cast<float>(role.radius * std::cos(angle) - cosine * gait_->middleX -
                               sine * gait_->middleZ);
  m[1][3] = static_cast<float>(-role.scale * ground);
  m[2][3] = static_cast<float>(role.radius * std::sin(angle) + sine * gait_->middleX -
                               cosine * gait_->middleZ);
  return matrix;
}

/// Clips play on while others fade in and out.
void Stroll::pose(std::uint32_t figure, std::uint64_t frame, FigureState& state) const {
  const Role& role = roles_[figure];
  const auto keyOf = [&](std::uint32_t clip) -> samples::PoseKey {
    return {clip,
            static_cast<std::uint32_t>((clock(frame) + role.phase) % character_->tickCount(clip))};
  };
  state.playing.pose = keyOf(role.clip);
  if (role.step != 0 || standingClips_.size() < 2) return;
  const double time = static_cast<double>(clock(frame)) / framesPerSecond_ / changeSeconds +
                      chance(figure, changeTime);
  const auto turn = static_cast<std::uint32_t>(time);
  const auto clipIn = [&](std::uint32_t number) {
    return number == 0 ? role.clip : choose(standingClips_, figure + number * count());
  };
  state.playing.pose = keyOf(clipIn(turn));
  if (turn == 0) return;
  state.playing.before = keyOf(clipIn(turn - 1));
  const double t = std::min((time - turn) * changeSeconds / fadeSeconds, 1.0);
  if (state.playing.before.clip != state.playing.pose.clip)
    state.playing.weight = static_cast<float>(t * t * (3 - 2 * t));
}

FigureState Stroll::at(std::uint32_t figure, std::uint64_t frame) const {
  const Role& role = roles_[figure];
  const double angle = role.angle + role.step * static_cast<double>(clock(frame));
  const glm::dvec3 middle(role.radius * std::cos(angle), 0.5 * gait_->height,
                          role.radius * std::sin(angle));
  const Eye seenFrom = eye(frame);
  FigureState state;
  pose(figure, frame, state);
  const auto groundOf = [&](const samples::PoseKey& key) { return gait_->clips[key.clip].ground; };
  const auto& [now, before, weight] = state.playing;
  state.place = placeAt(role, angle, std::lerp(groundOf(before), groundOf(now), double{weight}));
  state.isInView = flight_.sees(seenFrom, middle, reach * unit_);
  state.distance = glm::distance(middle, seenFrom.place);
  // Approximate distance that a hand or foot moves in a frame.
  const double moved = 1.3 * unit_ / framesPerSecond_;
  const double late = unseenPixels * flight_.pixelSize(state.distance) / moved;
  state.updateInterval = late < 1 ? 1 : late < 3 ? 2 : late < 7 ? 4 : 8;
  return state;
}

}  // namespace crowd_film
