#include "comparison_tube.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <span>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "dermis/verify.h"

namespace dermis::cli {
namespace {

// The error of the volume decreases with the square of both.
constexpr std::uint32_t zoneRings = 129;  // odd: one is in the middle
constexpr std::uint32_t sides = 96;
constexpr std::uint32_t firstOfZone = 1;  // after one ring at the end of the tube
constexpr std::uint32_t rings = zoneRings + 2;
constexpr double tubeLength = 1;
constexpr double radius = 0.1;
constexpr double zoneBegin = 0.3;
constexpr double zoneEnd = 0.7;
const glm::dvec3 middle(tubeLength / 2, 0, 0);

double ringPlace(std::uint32_t ring) {
  if (ring == 0) return 0;
  if (ring == rings - 1) return tubeLength;
  return zoneBegin + (zoneEnd - zoneBegin) * (ring - firstOfZone) / (zoneRings - 1);
}

struct Tube {
  std::vector<float> positions, centers, weights;
  std::vector<std::uint32_t> joints;
  InfluenceSet influences;

  Tube() {
    for (std::uint32_t ring = 0; ring < rings; ++ring) {
      const double x = ringPlace(ring);
      const double second = std::clamp((x - zoneBegin) / (zoneEnd - zoneBegin), 0.0, 1.0);
      for (std::uint32_t side = 0; side < sides; ++side) {
        const double angle = 2 * std::numbers::pi * side / sides;
        for (const double value : {x, radius * std::cos(angle), radius * std::sin(angle)})
          positions.push_back(static_cast<float>(value));
        for (const double value : {x, 0.0, 0.0}) centers.push_back(static_cast<float>(value));
        for (const double value : {1 - second, second})
          weights.push_back(static_cast<float>(value));
        joints.insert(joints.end(), {0, 1});
      }
    }
    influences.joints = attributeView(joints.data(), rings * sides, 2);
    influences.weights = attributeView(weights.data(), rings * sides, 2);
  }
  Tube(const Tube&) = delete;
  Tube& operator=(const Tube&) = delete;

  MeshView view(const MethodShares& shares) const {
    MeshView mesh;
    mesh.name = "tube";
    mesh.vertexCount = rings * sides;
    mesh.positions = attributeView(positions.data(), mesh.vertexCount, 3);
    mesh.influenceSets = {&influences, 1};
    mesh.centersOfRotation = attributeView(centers.data(), mesh.vertexCount, 3);
    mesh.dualQuaternionWeight = static_cast<float>(shares.dualQuaternionWeight);
    mesh.bulgeStrength = static_cast<float>(shares.bulgeStrength);
    return mesh;
  }
};

/// A rotation about a line through the tube's middle, where the second joint is.
JointMatrix turnAboutMiddle(const glm::dmat3& turn) {
  const glm::dvec3 translation = middle - turn * middle;
  JointMatrix joint;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      joint.m[row][column] = static_cast<float>(turn[column][row]);
    joint.m[row][3] = static_cast<float>(translation[row]);
  }
  return joint;
}

glm::dmat3 twistBy(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {{1, 0, 0}, {0, c, s}, {0, -s, c}};
}

glm::dmat3 bendBy(double angle) {
  const double c = std::cos(angle), s = std::sin(angle);
  return {{c, s, 0}, {-s, c, 0}, {0, 0, 1}};
}

using Points = std::vector<glm::dvec3>;

const glm::dvec3& pointOf(const Points& points, std::uint32_t ring, std::uint32_t side) {
  return points[std::size_t{ring} * sides + side % sides];
}

glm::dvec3 ringMiddle(const Points& points, std::uint32_t ring) {
  glm::dvec3 sum(0);
  for (std::uint32_t side = 0; side < sides; ++side) sum += pointOf(points, ring, side);
  return sum / double{sides};
}

/// The area of the ring's projection onto the plane in which it is largest.
double ringArea(const Points& points, std::uint32_t ring) {
  const glm::dvec3 center = ringMiddle(points, ring);
  glm::dvec3 area(0);
  for (std::uint32_t side = 0; side < sides; ++side) {
    area +=
        glm::cross(pointOf(points, ring, side) - center, pointOf(points, ring, side + 1) - center) /
        2.0;
  }
  return glm::length(area);
}

/// Six times the signed volume of a tetrahedron whose apex is the tube's middle. The middle is
/// near, so little precision is lost.
double sixVolumes(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  return glm::dot(a - middle, glm::cross(b - middle, c - middle));
}

double zoneVolume(const Points& points) {
  double sum = 0;
  const std::uint32_t last = firstOfZone + zoneRings - 1;
  for (std::uint32_t side = 0; side < sides; ++side) {
    for (std::uint32_t ring = firstOfZone; ring < last; ++ring) {
      const glm::dvec3 &a = pointOf(points, ring, side), &b = pointOf(points, ring, side + 1),
                       &c = pointOf(points, ring + 1, side + 1),
                       &d = pointOf(points, ring + 1, side);
      // Average of both ways to split the quad, because neither should favor a direction of the
      // twist.
      sum +=
          (sixVolumes(a, c, b) + sixVolumes(a, d, c) + sixVolumes(a, d, b) + sixVolumes(b, d, c)) /
          2;
    }
    sum += sixVolumes(ringMiddle(points, firstOfZone), pointOf(points, firstOfZone, side),
                      pointOf(points, firstOfZone, side + 1));
    sum += sixVolumes(ringMiddle(points, last), pointOf(points, last, side + 1),
                      pointOf(points, last, side));
  }
  return sum / 6;
}

double distanceToSegment(const glm::dvec3& point, const glm::dvec3& from, const glm::dvec3& to) {
  const glm::dvec3 along = to - from;
  const double share = std::clamp(glm::dot(point - from, along) / glm::dot(along, along), 0.0, 1.0);
  return glm::distance(point, from + share * along);
}

Points pointsOf(const reference::SkinnedMesh& skinned) {
  Points points;
  for (const reference::Double3& p : skinned.positions) points.emplace_back(p[0], p[1], p[2]);
  return points;
}

TubeShape shapeOf(const Points& points, const Points& rest, const glm::dmat3& turn) {
  TubeShape shape;
  shape.volume = zoneVolume(points) / zoneVolume(rest);
  for (std::uint32_t ring = 0; ring < rings; ++ring)
    shape.leastSection =
        std::min(shape.leastSection, ringArea(points, ring) / ringArea(rest, ring));
  const glm::dvec3 end = middle + turn * glm::dvec3(tubeLength / 2, 0, 0);
  shape.reach = 0;
  for (const glm::dvec3& point : points) {
    shape.leastRadius = std::min(shape.leastRadius, std::hypot(point.y, point.z) / radius);
    const double distance = std::min(distanceToSegment(point, glm::dvec3(0), middle),
                                     distanceToSegment(point, middle, end));
    shape.reach = std::max(shape.reach, distance / radius);
  }
  return shape;
}

/// The tube in two poses, of all joints that move it.
Result<TubeShape> shapeOf(const MeshView& mesh, std::span<const JointMatrix> still,
                          std::span<const JointMatrix> turned, const glm::dmat3& turn,
                          Method method) {
  const Result<reference::SkinnedMesh> rest = reference::skin(mesh, still, method);
  if (!rest) return rest.error();
  const Result<reference::SkinnedMesh> skinned = reference::skin(mesh, turned, method);
  if (!skinned) return skinned.error();
  return shapeOf(pointsOf(*skinned), pointsOf(*rest), turn);
}

Result<TubeShape> turnTube(const Tube& tube, const glm::dmat3& turn, Method method,
                           const MethodShares& shares) {
  const std::array<JointMatrix, 2> still{}, turned{JointMatrix{}, turnAboutMiddle(turn)};
  return shapeOf(tube.view(shares), still, turned, turn, method);
}

}  // namespace

Result<TubeComparison> compareTube(Method method, const MethodShares& shares) {
  const Tube tube;
  constexpr double degree = std::numbers::pi / 180;
  const Result<TubeShape> twisted =
      turnTube(tube, twistBy(tubeTwistDegrees * degree), method, shares);
  if (!twisted) return twisted.error();
  const Result<TubeShape> bent = turnTube(tube, bendBy(tubeBendDegrees * degree), method, shares);
  if (!bent) return bent.error();
  return TubeComparison{*twisted, *bent};
}

Result<CurvedTube> makeCurvedTube() {
  constexpr std::uint32_t jointCount = 3 + tubeSegments - 1;
  std::array<RigJoint, jointCount> joints{};
  joints[1].bind.m[0][3] = static_cast<float>(middle.x);
  joints[2].bind.m[0][3] = static_cast<float>(tubeLength);
  constexpr std::array<std::uint32_t, 3> along{0, 1, 2};
  const ChainDriver chain{along, 3, tubeSegments};
  RigView view;
  view.joints = joints;
  view.writtenJoints = 3;
  view.chains = {&chain, 1};
  Result<PackedRig> rig = packRig(view);
  if (!rig) return rig.error();
  const Tube tube;
  const Result<RepairedMesh> bound = bendChain(tube.view({}), joints, chain);
  if (!bound) return bound.error();
  Result<PackedMesh> mesh = pack(bound->view(), jointCount);
  if (!mesh) return mesh.error();
  Result<PackedMesh> straight = pack(tube.view({}), 2);
  if (!straight) return straight.error();

  const auto shape = [&](const glm::dmat3& turn) -> Result<TubeShape> {
    const std::array<JointMatrix, jointCount> still{};
    std::array<JointMatrix, jointCount> turned{};
    turned[1] = turned[2] = turnAboutMiddle(turn);
    const Result<void> done =
        evaluateRig(*rig, std::span(turned).first<3>(), {}, std::span(turned).subspan<3>(), {});
    if (!done) return done.error();
    return shapeOf(bound->view(), still, turned, turn, Method::dualQuaternion);
  };
  constexpr double degree = std::numbers::pi / 180;
  const Result<TubeShape> twisted = shape(twistBy(tubeTwistDegrees * degree));
  if (!twisted) return twisted.error();
  const Result<TubeShape> bent = shape(bendBy(tubeBendDegrees * degree));
  if (!bent) return bent.error();
  return CurvedTube{std::move(*rig), std::move(*mesh), std::move(*straight), {*twisted, *bent}};
}

}  // namespace dermis::cli
