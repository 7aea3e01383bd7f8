#include "gait.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <span>
#include <utility>

#include "dermis/verify/reference.h"
#include "in_parallel.h"

using namespace dermis;

namespace crowd {
namespace {

using Points = std::vector<reference::Double3>;

struct Extent {
  std::array<double, 3> min, max;
};

Result<Points> pointsAt(const Character& character, std::span<const Part* const> parts,
                        PoseKey pose) {
  Points points;
  for (const Part* part : parts) {
    const Result<reference::SkinnedMesh> skinned = reference::skin(
        part->primitive.mesh(), character.pose(pose, part->skin), Method::dualQuaternion);
    if (!skinned) return skinned.error();
    points.insert(points.end(), skinned->positions.begin(), skinned->positions.end());
  }
  return points;
}

Extent extentOf(const Points& points) {
  constexpr double infinity = std::numeric_limits<double>::infinity();
  Extent extent{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
  for (const reference::Double3& point : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      extent.min[axis] = std::min(extent.min[axis], point[axis]);
      extent.max[axis] = std::max(extent.max[axis], point[axis]);
    }
  }
  return extent;
}

/// How the character stands in the first tick of its first clip, and which parts touch the ground:
/// the vertices of the others are all far above it.
struct Stand {
  Extent extent;
  std::vector<const Part*> parts;
};

Result<Stand> standOf(const Character& character) {
  std::vector<Extent> extents;
  Points all;
  for (const Part& part : character.parts()) {
    const Result<Points> points = pointsAt(character, std::array{&part}, {});
    if (!points) return points.error();
    extents.push_back(extentOf(*points));
    all.insert(all.end(), points->begin(), points->end());
  }
  Stand stand{extentOf(all), {}};
  const double nearGround = 0.05 * (stand.extent.max[1] - stand.extent.min[1]);
  for (std::size_t part = 0; part < extents.size(); ++part) {
    if (extents[part].min[1] < stand.extent.min[1] + nearGround)
      stand.parts.push_back(&character.parts()[part]);
  }
  return stand;
}

double median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

double lowestOf(std::span<const Points> ticks) {
  double lowest = std::numeric_limits<double>::infinity();
  for (const Points& points : ticks) {
    for (const reference::Double3& point : points) lowest = std::min(lowest, point[1]);
  }
  return lowest;
}

/// A point that touches the ground in two consecutive ticks does not slide. So its displacement in
/// the clip, reversed, is the movement of the character.
ClipGait gaitOf(std::span<const Points> ticks, double height) {
  ClipGait gait;
  gait.ground = lowestOf(ticks);
  const double touches = gait.ground + 0.012 * height;
  std::vector<double> movedX, movedZ;
  for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
    const Points& now = ticks[tick];
    const Points& next = ticks[(tick + 1) % ticks.size()];
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (now[i][1] > touches || next[i][1] > touches) continue;
      movedX.push_back(next[i][0] - now[i][0]);
      movedZ.push_back(next[i][2] - now[i][2]);
    }
  }
  const double x = -median(movedX), z = -median(movedZ);
  // A character that moves less than this in a whole clip is swaying, not walking.
  if (std::hypot(x, z) * static_cast<double>(ticks.size()) < 0.2 * height) return gait;
  gait.stepX = x;
  gait.stepZ = z;
  return gait;
}

}  // namespace

Result<Gait> measureGait(const Character& character) {
  const Result<Stand> stand = standOf(character);
  if (!stand) return stand.error();
  const Extent& extent = stand->extent;
  Gait gait;
  gait.height = std::max(extent.max[1] - extent.min[1], 1e-6);
  gait.length = std::max(extent.max[0] - extent.min[0], extent.max[2] - extent.min[2]);
  gait.middleX = (extent.min[0] + extent.max[0]) / 2;
  gait.middleZ = (extent.min[2] + extent.max[2]) / 2;
  for (std::uint32_t clip = 0; clip < character.clipCount(); ++clip) {
    std::vector<Result<Points>> ticks(character.tickCount(clip), Points{});
    inParallel(ticks.size(), [&](std::size_t tick) {
      ticks[tick] = pointsAt(character, stand->parts, {clip, static_cast<std::uint32_t>(tick)});
    });
    std::vector<Points> points;
    for (Result<Points>& tick : ticks) {
      if (!tick) return tick.error();
      points.push_back(std::move(*tick));
    }
    gait.clips.push_back(gaitOf(points, gait.height));
  }
  return gait;
}

}  // namespace crowd
