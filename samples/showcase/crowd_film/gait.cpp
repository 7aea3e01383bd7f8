#include "gait.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <span>

#include <glm/common.hpp>
#include <glm/vec3.hpp>

#include "dermis/verify.h"
#include "kit/in_parallel.h"
#include "kit/program.h"

using namespace dermis;
using samples::Character;
using samples::Part;
using samples::PoseKey;

namespace crowd_film {
namespace {

struct Extent {
  glm::dvec3 min{HUGE_VAL}, max{-HUGE_VAL};

  void add(const glm::dvec3& point) {
    min = glm::min(min, point);
    max = glm::max(max, point);
  }
};

std::vector<glm::dvec3> pointsAt(const Character& character, const Part& part, PoseKey pose) {
  const reference::SkinnedMesh skinned = samples::must(reference::skin(
      part.primitive.mesh(), character.pose(pose, part.skin), Method::dualQuaternion));
  std::vector<glm::dvec3> points;
  for (const reference::Double3& point : skinned.positions)
    points.emplace_back(point[0], point[1], point[2]);
  return points;
}

double median(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::ranges::nth_element(values, middle);
  return *middle;
}

/// `ticks` has the points near the ground. A point that touches the ground in two consecutive ticks
/// does not slide. So its displacement in the clip, reversed, is the movement of the character.
ClipGait gaitOf(std::span<const std::vector<glm::dvec3>> ticks, double height) {
  ClipGait gait;
  gait.ground = HUGE_VAL;
  for (const std::vector<glm::dvec3>& points : ticks) {
    for (const glm::dvec3& point : points) gait.ground = std::min(gait.ground, point.y);
  }
  const double touches = gait.ground + 0.012 * height;
  std::vector<double> movedX, movedZ;
  for (std::size_t tick = 0; tick < ticks.size(); ++tick) {
    const std::vector<glm::dvec3>& now = ticks[tick];
    const std::vector<glm::dvec3>& next = ticks[(tick + 1) % ticks.size()];
    for (std::size_t i = 0; i < now.size(); ++i) {
      if (now[i].y > touches || next[i].y > touches) continue;
      movedX.push_back(next[i].x - now[i].x);
      movedZ.push_back(next[i].z - now[i].z);
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

Gait measureGait(const Character& character) {
  Extent extent;
  std::vector<double> lowest;  // by part, in the first tick of the first clip
  for (const Part& part : character.parts()) {
    Extent own;
    for (const glm::dvec3& point : pointsAt(character, part, {})) own.add(point);
    lowest.push_back(own.min.y);
    extent.add(own.min);
    extent.add(own.max);
  }
  Gait gait;
  gait.height = std::max(extent.max.y - extent.min.y, 1e-6);
  gait.length = std::max(extent.max.x - extent.min.x, extent.max.z - extent.min.z);
  gait.middleX = (extent.min.x + extent.max.x) / 2;
  gait.middleZ = (extent.min.z + extent.max.z) / 2;
  for (std::uint32_t clip = 0; clip < character.clipCount(); ++clip) {
    std::vector<std::vector<glm::dvec3>> ticks(character.tickCount(clip));
    samples::inParallel(ticks.size(), [&](std::size_t tick) {
      const PoseKey pose{clip, static_cast<std::uint32_t>(tick)};
      for (std::size_t part = 0; part < lowest.size(); ++part) {
        // Only parts that touch the ground: all vertices of the others are far above it.
        if (lowest[part] > extent.min.y + 0.05 * gait.height) continue;
        const auto points = pointsAt(character, character.parts()[part], pose);
        ticks[tick].insert(ticks[tick].end(), points.begin(), points.end());
      }
    });
    gait.clips.push_back(gaitOf(ticks, gait.height));
  }
  return gait;
}

}  // namespace crowd_film
