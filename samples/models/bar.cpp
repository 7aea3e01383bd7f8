// The bar: a capped tube of two joints, to twist. It shows the candy wrapper of linear blending at
// its plainest.
#include "models.h"

#include <algorithm>

#include "weights.h"

namespace dermis::models {
namespace {

constexpr std::uint32_t ringCount = 65;  // 64 pieces between them
constexpr std::uint32_t sideCount = 48;
constexpr double length = 1.0;
constexpr double radius = 0.1;
constexpr double blendZone = 0.4;  // length of the zone where the weights go over, about the middle
constexpr double twistAngle =
    175.0 * degree;  // 180° is where a blend of two rotations has no answer
constexpr double twistDuration = 3.0;
constexpr int twistIntervals = 24;

const Vec3 darkStripe(0.080, 0.215, 0.470);
const Vec3 lightStripe(0.780, 0.800, 0.830);

WeightRow weightsAt(double x) {
  const double second = std::clamp((x - 0.5 * (length - blendZone)) / blendZone, 0.0, 1.0);
  return {1.0 - second, second};
}

// Stripes along the bar let the eye follow the twist.
Vec3 colorOf(std::uint32_t side) {
  return side / 6 % 2 == 0 ? darkStripe : lightStripe;
}

void addVertex(Mesh& mesh, const Vec3& position, const Vec3& normal, const Vec3& color) {
  mesh.positions.push_back(position);
  mesh.normals.push_back(normal);
  mesh.colors.push_back(color);
  mesh.influences.push_back(quantize(weightsAt(position.x)));
}

void addTriangle(Mesh& mesh, std::uint32_t a, std::uint32_t b, std::uint32_t c) {
  mesh.indices.insert(mesh.indices.end(), {a, b, c});
}

Vec3 directionOf(std::uint32_t side) {
  const double angle = 2.0 * pi * static_cast<double>(side) / static_cast<double>(sideCount);
  return {0.0, cosine(angle), sine(angle)};
}

void addTube(Mesh& mesh) {
  for (std::uint32_t ring = 0; ring < ringCount; ++ring) {
    const double x = length * static_cast<double>(ring) / static_cast<double>(ringCount - 1);
    for (std::uint32_t side = 0; side < sideCount; ++side) {
      const Vec3 direction = directionOf(side);
      addVertex(mesh, Vec3(x, 0.0, 0.0) + direction * radius, direction, colorOf(side));
    }
  }
  for (std::uint32_t ring = 0; ring + 1 < ringCount; ++ring) {
    for (std::uint32_t side = 0; side < sideCount; ++side) {
      const std::uint32_t here = ring * sideCount + side;
      const std::uint32_t beside = ring * sideCount + (side + 1) % sideCount;
      addTriangle(mesh, here, beside, here + sideCount);
      addTriangle(mesh, beside, beside + sideCount, here + sideCount);
    }
  }
}

// A cap has vertices of its own, because its normal differs from the tube's.
void addCap(Mesh& mesh, double x, double outward) {
  const Vec3 normal(outward, 0.0, 0.0);
  const auto center = static_cast<std::uint32_t>(mesh.positions.size());
  addVertex(mesh, {x, 0.0, 0.0}, normal, darkStripe);
  for (std::uint32_t side = 0; side < sideCount; ++side) {
    addVertex(mesh, Vec3(x, 0.0, 0.0) + directionOf(side) * radius, normal, darkStripe);
  }
  for (std::uint32_t side = 0; side < sideCount; ++side) {
    const std::uint32_t first = center + 1 + side;
    const std::uint32_t second = center + 1 + (side + 1) % sideCount;
    if (outward > 0.0) {
      addTriangle(mesh, center, first, second);
    } else {
      addTriangle(mesh, center, second, first);
    }
  }
}

}  // namespace

Model barModel() {
  Model model;
  model.name = "bar";
  const Vec3 axis(1.0, 0.0, 0.0);
  model.skeleton.add("joint0", noParent, {0.0, 0.0, 0.0}, axis);
  model.skeleton.add("joint1", 0, {0.5 * length, 0.0, 0.0}, axis);
  addTube(model.mesh);
  addCap(model.mesh, 0.0, -1.0);
  addCap(model.mesh, length, 1.0);
  model.clips.push_back(sampleCycle("twist", twistDuration, twistIntervals, [&](double phase) {
    const double angle = twistAngle * 0.5 * (1.0 - cosine(2.0 * pi * phase));
    return Pose{JointPose{}, JointPose{turn(axis, angle), Vec3(0.0)}};
  }));
  return model;
}

std::vector<std::byte> makeBar() {
  return writeGlb(barModel());
}

}  // namespace dermis::models
