#include "crowd.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace dermis::cli {
namespace {

/// A number in [0, 1) that depends only on the figure and the purpose (Wellons 2018, "Prospecting
/// for hash functions").
double chance(std::uint32_t figure, std::uint32_t purpose) {
  std::uint32_t bits = figure * 0x9e3779b9u + purpose * 0x85ebca6bu + 1;
  bits = (bits ^ (bits >> 16)) * 0x7feb352du;
  bits = (bits ^ (bits >> 15)) * 0x846ca68bu;
  return static_cast<double>(bits ^ (bits >> 16)) / 4294967296.0;
}

double durationOf(const gltf::Model& model, std::uint32_t clip) {
  return clip < model.clips.size() ? model.clips[clip].duration : 0;
}

}  // namespace

std::vector<Role> castCrowd(const gltf::Model& model, std::uint32_t clip, bool isVaried,
                            std::uint32_t figures) {
  std::vector<Role> roles{{clip, 0}};
  const auto clips = static_cast<std::uint32_t>(model.clips.size());
  for (std::uint32_t figure = 1; figure < figures; ++figure) {
    Role role{clip, 0};
    if (isVaried && clips > 1) role.clip = static_cast<std::uint32_t>(chance(figure, 0) * clips);
    role.phase = chance(figure, 1) * durationOf(model, role.clip);
    roles.push_back(role);
  }
  return roles;
}

double timeInClip(const gltf::Model& model, const Role& role, double time) {
  const double duration = durationOf(model, role.clip);
  if (!(duration > 0)) return 0;
  const double into = std::fmod(time + role.phase, duration);
  return into < 0 ? into + duration : into;
}

std::vector<JointMatrix> placeCrowd(const Box& extent, std::uint32_t figures) {
  std::vector<JointMatrix> places(figures);
  if (figures < 2) return places;
  const double middleX =
      (static_cast<double>(extent.min[0]) + static_cast<double>(extent.max[0])) / 2;
  const double middleZ =
      (static_cast<double>(extent.min[2]) + static_cast<double>(extent.max[2])) / 2;
  const double spacing = 1.2 * std::max(static_cast<double>(extent.max[0] - extent.min[0]),
                                        static_cast<double>(extent.max[2] - extent.min[2]));
  const auto columns = static_cast<std::uint32_t>(std::ceil(std::sqrt(0.8 * figures)));
  for (std::uint32_t figure = 0; figure < figures; ++figure) {
    const double row = figure / columns, column = figure % columns;
    // Every other row is visible between the heads of the row before.
    const double shift = static_cast<std::uint32_t>(row) % 2 == 0 ? 0.0 : 0.5;
    const double x = column + shift - columns / 2.0 + 0.24 * (chance(figure, 2) - 0.5);
    const double z = -row + 0.24 * (chance(figure, 3) - 0.5);
    const double yaw = 0.6 * (chance(figure, 4) - 0.5);
    const double cosine = std::cos(yaw), sine = std::sin(yaw);
    auto& m = places[figure].m;
    m[0][0] = m[2][2] = static_cast<float>(cosine);
    m[0][2] = static_cast<float>(sine);
    m[2][0] = static_cast<float>(-sine);
    m[0][3] = static_cast<float>(x * spacing - cosine * middleX - sine * middleZ);
    m[2][3] = static_cast<float>(z * spacing + sine * middleX - cosine * middleZ);
  }
  return places;
}

Box moved(const Box& box, const JointMatrix& transform) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  Box result{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
  for (unsigned corner = 0; corner < 8; ++corner) {
    const float point[3] = {(corner & 1) != 0 ? box.max[0] : box.min[0],
                            (corner & 2) != 0 ? box.max[1] : box.min[1],
                            (corner & 4) != 0 ? box.max[2] : box.min[2]};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float* row = transform.m[axis];
      const float place = row[0] * point[0] + row[1] * point[1] + row[2] * point[2] + row[3];
      result.min[axis] = std::min(result.min[axis], place);
      result.max[axis] = std::max(result.max[axis], place);
    }
  }
  return result;
}

}  // namespace dermis::cli
