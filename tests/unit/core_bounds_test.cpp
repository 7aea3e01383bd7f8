#include "bounds/joint_bounds_data.h"
#include "dermis/mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <random>
#include <span>
#include <string>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

#include "dermis/verify.h"
#include "few_cases.h"
#include "joint_of.h"
#include "random_rig.h"

namespace dermis {
namespace {

using test::jointOf;
using test::OwnedMesh;
using test::Rigidity;

constexpr float infinity = std::numeric_limits<float>::infinity();
constexpr double pi = std::numbers::pi;

JointBounds boundsOf(const MeshView& mesh, std::uint32_t jointCount) {
  Result<JointBounds> result = jointBounds(mesh, jointCount);
  EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
  return result ? std::move(*result) : JointBounds{};
}

/// How far a position sticks out of a box, at most; not positive where it is inside.
double overhang(const Box& box, const reference::Double3& position, double margin = 0) {
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    most = std::max({most, static_cast<double>(box.min[axis]) - (position[axis] - margin),
                     position[axis] + margin - static_cast<double>(box.max[axis])});
  }
  return most;
}

bool isFinite(const reference::Double3& p) {
  return std::isfinite(p[0]) && std::isfinite(p[1]) && std::isfinite(p[2]);
}

/// Those for which there is a proof; of the others the box is infinite.
constexpr std::array provenMethods{Method::linear, Method::dualQuaternion, Method::blended};

/// Every position of the reference, and every float32 position that the accuracy contract allows,
/// lies in the box.
void expectInside(OwnedMesh& mesh, std::span<const JointMatrix> pose, const std::string& what) {
  const JointBounds bounds = boundsOf(mesh.view(), static_cast<std::uint32_t>(pose.size()));
  for (const Method method : provenMethods) {
    const Box box = skinnedBounds(bounds, pose, method);
    const Result<reference::SkinnedMesh> skinned = reference::skin(mesh.view(), pose, method);
    ASSERT_TRUE(skinned.ok());
    for (std::size_t vertex = 0; vertex < skinned->positions.size(); ++vertex) {
      const reference::Double3& position = skinned->positions[vertex];
      ASSERT_TRUE(isFinite(position)) << what;
      const double margin = skinned->bounds[vertex].position;
      ASSERT_LE(overhang(box, position, margin), 0)
          << what << ", " << methodName(method) << ", vertex " << vertex;
    }
  }
}

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double normal() { return std::normal_distribution<double>()(engine_); }
  std::uint32_t below(std::uint32_t count) {
    return std::uniform_int_distribution<std::uint32_t>(0, count - 1)(engine_);
  }
  glm::dquat rotation() {
    return glm::normalize(glm::dquat(normal(), normal(), normal(), normal()));
  }
  glm::dvec3 vector(double reach) {
    return {between(-reach, reach), between(-reach, reach), between(-reach, reach)};
  }

 private:
  std::mt19937 engine_;
};

/// A turn about a point.
JointMatrix turnAbout(const glm::dvec3& axis, double angle, const glm::dvec3& point) {
  const glm::dmat3 rotation = glm::mat3_cast(glm::angleAxis(angle, glm::normalize(axis)));
  return jointOf(rotation, point - rotation * point);
}

constexpr std::array<std::uint32_t, 10> inOrder{0, 1, 2, 3, 4, 5, 6, 7, 8, 9};

OwnedMesh meshOf(std::uint32_t influencesPerVertex) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = influencesPerVertex;
  return mesh;
}

void addVertex(OwnedMesh& mesh, const glm::dvec3& position, std::span<const double> weights,
               std::span<const std::uint32_t> joints = inOrder) {
  for (int i = 0; i < 3; ++i) mesh.positions.push_back(static_cast<float>(position[i]));
  for (std::size_t slot = 0; slot < mesh.influencesPerVertex; ++slot) {
    mesh.joints.push_back(slot < weights.size() ? joints[slot] : 0);
    mesh.weights.push_back(slot < weights.size() ? static_cast<float>(weights[slot]) : 0.0f);
  }
}

TEST(Bounds, HoldRandomMeshesInRandomPoses) {
  std::uint32_t seed = 1;
  for (const std::uint32_t influences : {1u, 2u, 3u, 4u, 5u, 8u, 9u, 16u, 64u}) {
    for (const Rigidity rigidity : {Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                    Rigidity::mirrored, Rigidity::mirroredAlongOneAxis}) {
      const std::uint32_t repeats = test::fewer(influences > 8 ? 4u : 40u);
      for (std::uint32_t i = 0; i < repeats; ++i, ++seed) {
        const std::uint32_t joints = influences + seed % 5;
        OwnedMesh mesh = test::randomMesh(seed, 12, joints, influences, false);
        expectInside(mesh, test::randomPose(seed + 7, joints, rigidity, 0.1 * (seed % 20)),
                     "seed " + std::to_string(seed));
        if (testing::Test::HasFatalFailure()) return;
      }
    }
  }
}

/// Any kind of joint that a file may have, and what makes answers jump: half turns, joints that are
/// flat, lines, points, all but singular, or just on this or that side of rigid.
JointMatrix awkwardJoint(Random& random) {
  glm::dmat3 rotation = glm::mat3_cast(random.rotation());
  if (random.below(2) == 0) {
    // One of 64 turns by quarters, exactly.
    rotation = glm::dmat3(1.0);
    for (int axis = 0; axis < 3; ++axis) {
      glm::dmat3 quarter(0.0);
      quarter[axis][axis] = 1;
      quarter[(axis + 1) % 3][(axis + 2) % 3] = 1;
      quarter[(axis + 2) % 3][(axis + 1) % 3] = -1;
      for (std::uint32_t turns = random.below(4); turns > 0; --turns) rotation = quarter * rotation;
    }
  }
  glm::dvec3 scale(1.0);
  switch (random.below(9)) {
    case 0:
      scale = glm::dvec3(random.between(0.01, 50));
      break;
    case 1:
      scale = {random.between(0.2, 3), random.between(0.2, 3), random.between(0.2, 3)};
      break;
    case 2:
      scale = {1, 1, -1};
      break;
    case 3:
      scale = {1, 1, 0};
      break;
    case 4:
      scale = {1, 0, 0};
      break;
    case 5:
      scale = glm::dvec3(0.0);
      break;
    case 6:
      scale = glm::dvec3(1 + random.between(-8e-6, 8e-6));
      break;
    case 7:
      scale = {1, random.between(0.5, 1),
               std::pow(10.0, random.between(-9, -3)) * (random.below(2) == 0 ? -1 : 1)};
      break;
    default:
      break;
  }
  const glm::dmat3 stretch(glm::dvec3(scale.x, 0, 0), glm::dvec3(0, scale.y, 0),
                           glm::dvec3(0, 0, scale.z));
  const glm::dmat3 frame =
      random.below(2) == 0 ? glm::dmat3(1.0) : glm::mat3_cast(random.rotation());
  return jointOf(rotation * frame * stretch * glm::transpose(frame), random.vector(2));
}

TEST(Bounds, HoldMeshesOfAwkwardJoints) {
  for (std::uint32_t seed = 1; seed <= test::fewer(1500u); ++seed) {
    Random random(seed);
    const std::uint32_t joints = 2 + random.below(6);
    const std::uint32_t influences = std::min(joints, 2 + random.below(4));
    OwnedMesh mesh = test::randomMesh(seed, 8, joints, influences, false);
    std::vector<JointMatrix> pose;
    for (std::uint32_t i = 0; i < joints; ++i) pose.push_back(awkwardJoint(random));
    expectInside(mesh, pose, "seed " + std::to_string(seed));
    if (testing::Test::HasFatalFailure()) return;
  }
}

/// One vertex, whose weights, place and joints a climber changes to get it out of its own box.
struct Climber {
  std::vector<double> weights;
  std::vector<glm::dquat> rotations;
  std::vector<glm::dvec3> translations;
  std::vector<glm::dvec3> scales;
  glm::dvec3 position{0.0};

  void step(Random& random, double size, bool scaled) {
    for (double& weight : weights) {
      weight = std::clamp(weight * std::exp(size * random.normal()), 1e-4, 1.0);
    }
    for (glm::dquat& q : rotations) {
      q = glm::normalize(
          q +
          glm::dquat(random.normal(), random.normal(), random.normal(), random.normal()) * size);
    }
    for (glm::dvec3& t : translations) t += size * random.vector(1);
    if (scaled) {
      for (glm::dvec3& s : scales) s += size * random.vector(1);
    }
    position += size * random.vector(1);
  }

  /// By how much of the distance between the joints' points the vertex sticks out.
  double escape(Method method) const {
    OwnedMesh mesh = meshOf(static_cast<std::uint32_t>(weights.size()));
    std::vector<JointMatrix> pose;
    for (std::uint32_t i = 0; i < weights.size(); ++i) {
      glm::dmat3 linear = glm::mat3_cast(rotations[i]);
      for (int column = 0; column < 3; ++column) linear[column] *= scales[i][column];
      pose.push_back(jointOf(linear, translations[i]));
    }
    addVertex(mesh, position, weights);
    const JointBounds bounds = boundsOf(mesh.view(), static_cast<std::uint32_t>(pose.size()));
    const Box box = skinnedBounds(bounds, pose, method);
    const Result<reference::SkinnedMesh> skinned = reference::skin(mesh.view(), pose, method);
    const double size = skinned->bounds[0].scale;
    return overhang(box, skinned->positions[0]) / size;
  }
};

TEST(Bounds, CannotBeEscapedByClimbing) {
  for (std::uint32_t seed = 1; seed <= test::fewer(60u); ++seed) {
    for (const std::uint32_t influences : {2u, 3u, 4u, 6u, 10u}) {
      Random random(1000 * influences + seed);
      const bool scaled = seed % 3 == 0;
      Climber best;
      for (std::uint32_t i = 0; i < influences; ++i) {
        best.weights.push_back(random.between(0.05, 1));
        best.rotations.push_back(random.rotation());
        best.translations.push_back(random.vector(1));
        best.scales.emplace_back(1.0);
      }
      best.position = random.vector(1);
      double highest = best.escape(Method::dualQuaternion);
      for (int step = 0; step < 150; ++step) {
        Climber next = best;
        next.step(random, step < 75 ? 0.1 : 0.01, scaled);
        ASSERT_LE(next.escape(Method::linear), 0) << "seed " << seed;
        ASSERT_LE(next.escape(Method::blended), 0) << "seed " << seed;
        const double escape = next.escape(Method::dualQuaternion);
        ASSERT_LE(escape, 0) << "seed " << seed << ", " << influences << " influences";
        if (escape > highest) {
          highest = escape;
          best = next;
        }
      }
    }
  }
}

TEST(Bounds, HoldVerticesOfJointsInOppositeHemispheres) {
  // Rotations of 0°, 140° and 220°: no signs bring their quaternions into one hemisphere.
  for (int tilt = 0; tilt < 40; ++tilt) {
    OwnedMesh mesh = meshOf(3);
    Random random(static_cast<std::uint32_t>(tilt));
    for (int i = 0; i < 20; ++i) {
      const std::array weights{random.between(0.3, 0.36), random.between(0.3, 0.36),
                               random.between(0.3, 0.36)};
      addVertex(mesh, random.vector(1), weights);
    }
    const glm::dvec3 axis(1, 0.02 * tilt, 0);
    const std::array pose{turnAbout(axis, 0, {0, 0, 0}),
                          turnAbout(axis, 140 * pi / 180, {0, 0.3, 0}),
                          turnAbout(axis, (180 + tilt) * pi / 180, {0, 0, 0.3})};
    expectInside(mesh, pose, "tilt " + std::to_string(tilt));
  }
}

/// Of the joints `rotated`, in the box of the joints `scaled` if their scale is ignored.
void expectInsideWithoutScale(OwnedMesh& mesh, std::span<const JointMatrix> scaled,
                              std::span<const JointMatrix> rotated, const std::string& what) {
  const JointBounds bounds = boundsOf(mesh.view(), static_cast<std::uint32_t>(scaled.size()));
  for (const Method method : provenMethods) {
    const Box box = skinnedBounds(bounds, scaled, method, JointPromise::scaleIgnored);
    const bool scales = method == Method::linear;
    const Result<reference::SkinnedMesh> skinned =
        reference::skin(mesh.view(), scales ? scaled : rotated, method);
    ASSERT_TRUE(skinned.ok());
    for (std::size_t vertex = 0; vertex < skinned->positions.size(); ++vertex) {
      ASSERT_LE(overhang(box, skinned->positions[vertex], skinned->bounds[vertex].position), 0)
          << what << ", " << methodName(method) << ", vertex " << vertex;
    }
  }
}

TEST(Bounds, HoldMeshesWhoseScaleIsIgnored) {
  for (std::uint32_t seed = 1; seed <= test::fewer(60u); ++seed) {
    Random random(seed);
    OwnedMesh mesh = test::randomMesh(seed, 200, 6, 1 + seed % 5);
    std::vector<JointMatrix> scaled, rotated;
    for (int i = 0; i < 6; ++i) {
      const glm::dmat3 rotation = glm::mat3_cast(random.rotation());
      const glm::dmat3 axes = glm::mat3_cast(random.rotation());
      glm::dmat3 scale(0);
      for (int axis = 0; axis < 3; ++axis)
        scale[axis][axis] = random.between(0.05, seed % 2 == 0 ? 2 : 0.5);
      if (seed % 3 == 0) scale *= -1;
      const glm::dvec3 translation = random.vector(1);
      scaled.push_back(jointOf(rotation * axes * scale * glm::transpose(axes), translation));
      rotated.push_back(jointOf(rotation, translation));
    }
    expectInsideWithoutScale(mesh, scaled, rotated, "seed " + std::to_string(seed));
    // The rotation of a joint of rank 1 may be any: one that moves vertices alone, if seed % 5 = 0.
    const glm::dvec3 u = random.vector(1), v = random.vector(1);
    const glm::dvec3 translation(rotated[2].m[0][3], rotated[2].m[1][3], rotated[2].m[2][3]);
    scaled[2] = jointOf(glm::outerProduct(u, v), translation);
    for (int turn = 0; turn < 8; ++turn) {
      rotated[2] = jointOf(glm::mat3_cast(random.rotation()), translation);
      expectInsideWithoutScale(mesh, scaled, rotated, "rank 1, seed " + std::to_string(seed));
    }
  }
}

double widest(const Box& box) {
  return std::max({box.max[0] - box.min[0], box.max[1] - box.min[1], box.max[2] - box.min[2]});
}

/// The largest side that the box adds to the true one, over the largest true side.
double excess(OwnedMesh& mesh, std::span<const JointMatrix> pose, Method method) {
  const JointBounds bounds = boundsOf(mesh.view(), static_cast<std::uint32_t>(pose.size()));
  const Box box = skinnedBounds(bounds, pose, method);
  const Result<reference::SkinnedMesh> skinned = reference::skin(mesh.view(), pose, method);
  double most = 0, largest = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double low = infinity, high = -infinity;
    for (const reference::Double3& p : skinned->positions) {
      low = std::min(low, p[axis]);
      high = std::max(high, p[axis]);
    }
    most = std::max(most, static_cast<double>(box.max[axis]) - static_cast<double>(box.min[axis]) -
                              (high - low));
    largest = std::max(largest, high - low);
  }
  return most / largest;
}

TEST(Bounds, AreExactForOneVertexOfOneJoint) {
  OwnedMesh mesh = meshOf(1);
  addVertex(mesh, {0.5, -0.25, 2}, std::array{1.0});
  const std::array pose{turnAbout({1, 2, 3}, 1.1, {1, 1, 0})};
  const JointBounds bounds = boundsOf(mesh.view(), 1);
  EXPECT_LE(widest(skinnedBounds(bounds, pose, Method::linear)), 8e-6f);
  EXPECT_LE(widest(skinnedBounds(bounds, pose, Method::dualQuaternion)), 8e-5f);
  expectInside(mesh, pose, "one vertex");
}

TEST(Bounds, AddNothingWhereAllJointsMoveAlike) {
  OwnedMesh mesh = test::randomMesh(3, 300, 6, 4, false);
  for (const Rigidity rigidity : {Rigidity::rigid, Rigidity::uniformScale}) {
    JointMatrix joint = test::randomPose(5, 1, rigidity)[0];
    // Quarter turns keep boxes boxes.
    const float scale = rigidity == Rigidity::rigid ? 1.0f : 100.0f;
    const float turn[3][3] = {{0, -scale, 0}, {scale, 0, 0}, {0, 0, scale}};
    for (int row = 0; row < 3; ++row) std::copy_n(turn[row], 3, joint.m[row]);
    const std::vector<JointMatrix> pose(6, joint);
    OwnedMesh weighted = mesh;  // without the vertices that stay in bind pose
    for (std::size_t i = 0; i < weighted.weights.size(); i += 4) {
      if (weighted.weights[i] == 0) weighted.weights[i] = 1;
    }
    EXPECT_LE(excess(weighted, pose, Method::linear), 1e-5);
    EXPECT_LE(excess(weighted, pose, Method::dualQuaternion), 5e-5);
  }
}

TEST(Bounds, AddTheArcOfATurn) {
  // A vertex halfway between two joints that turn against each other by 90° stands on the arc; the
  // box of one such vertex ends there.
  OwnedMesh mesh = meshOf(2);
  addVertex(mesh, {1, 0, 0}, std::array{0.5, 0.5});
  const std::array pose{turnAbout({0, 0, 1}, -pi / 4, {0, 0, 0}),
                        turnAbout({0, 0, 1}, pi / 4, {0, 0, 0})};
  const JointBounds bounds = boundsOf(mesh.view(), 2);
  const Box box = skinnedBounds(bounds, pose, Method::dualQuaternion);
  EXPECT_NEAR(static_cast<double>(box.max[0]), 1, 1e-4);
  EXPECT_NEAR(static_cast<double>(box.max[1]), 0, 1e-4);
  EXPECT_NEAR(static_cast<double>(skinnedBounds(bounds, pose, Method::linear).max[0]),
              std::sqrt(0.5), 1e-4);
}

/// A creature: a trunk and six limbs of three joints each, every limb a tube, weights smooth over
/// two to four joints.
struct Creature {
  OwnedMesh mesh;
  std::vector<glm::dvec3> origins;  ///< of the joints, in bind pose
  std::vector<std::uint32_t> parents;

  Creature() {
    mesh.influencesPerVertex = 4;
    addJoint({0, 0, 0}, 0);
    addTube({0, -0.3, 0}, {0, 0.3, 0}, 0.18, 0);
    for (int limb = 0; limb < 6; ++limb) {
      const double angle = limb * pi / 3 + 0.3;
      const glm::dvec3 way(std::cos(angle), std::sin(angle), 0.3 * std::sin(3 * angle));
      std::uint32_t parent = 0;
      for (int segment = 0; segment < 3; ++segment) {
        const glm::dvec3 start = (0.2 + 0.3 * segment) * way;
        parent = addJoint(start, parent);
        addTube(start, start + 0.3 * way, 0.07 - 0.015 * segment, parent);
      }
    }
  }

  std::uint32_t addJoint(const glm::dvec3& origin, std::uint32_t parent) {
    origins.push_back(origin);
    parents.push_back(parent);
    return static_cast<std::uint32_t>(origins.size() - 1);
  }

  void addTube(const glm::dvec3& from, const glm::dvec3& to, double radius, std::uint32_t joint) {
    const glm::dvec3 way = glm::normalize(to - from);
    const glm::dvec3 side = glm::normalize(glm::cross(way, glm::dvec3(0.3, 0.2, 1)));
    const glm::dvec3 up = glm::cross(way, side);
    for (int ring = 0; ring <= 8; ++ring) {
      const double along = ring / 8.0;
      for (int i = 0; i < 12; ++i) {
        const double angle = i * pi / 6;
        const glm::dvec3 position =
            from + along * (to - from) + radius * (std::cos(angle) * side + std::sin(angle) * up);
        addSmooth(position, joint, joint == 0 ? 1 : along);
      }
    }
  }

  /// Near its start a segment follows its parent too, and a little its parent's parent.
  void addSmooth(const glm::dvec3& position, std::uint32_t joint, double along) {
    const double blend = std::max(0.0, 0.5 - 1.25 * along);
    const std::uint32_t parent = parents[joint];
    const std::array joints{joint, parent, parents[parent]};
    const std::array weights{1 - blend, 0.9 * blend, 0.1 * blend};
    const std::size_t count = blend == 0 ? 1 : parent == parents[parent] ? 2 : 3;
    addVertex(mesh, position, std::span(weights).first(count), joints);
  }

  std::vector<JointMatrix> pose(Random& random, double mostAngle) const {
    std::vector<glm::dmat3> rotations;
    std::vector<glm::dvec3> translations;
    std::vector<JointMatrix> result;
    for (std::size_t joint = 0; joint < origins.size(); ++joint) {
      const glm::dvec3 axis = glm::normalize(random.vector(1));
      const glm::dmat3 turn =
          glm::mat3_cast(glm::angleAxis(random.between(-mostAngle, mostAngle), axis));
      const std::size_t parent = parents[joint];
      const bool root = parent == joint;
      const glm::dmat3 base = root ? glm::dmat3(1.0) : rotations[parent];
      const glm::dvec3 place =
          root ? glm::dvec3(0, 1, 0) : base * origins[joint] + translations[parent];
      rotations.push_back(base * turn);
      translations.push_back(place - rotations.back() * origins[joint]);
      result.push_back(jointOf(rotations.back(), translations.back()));
    }
    return result;
  }
};

constexpr int creaturePoses = test::fewer(40);

TEST(Bounds, AreTightForACreature) {
  Creature creature;
  Random random(11);
  for (const Method method : provenMethods) {
    for (const auto& [angle, mean, most] :
         {std::array{30.0, 0.02, 0.06}, std::array{60.0, 0.04, 0.12},
          std::array{90.0, 0.1, 0.25}}) {
      double sum = 0, worst = 0;
      for (int i = 0; i < creaturePoses; ++i) {
        const std::vector<JointMatrix> pose = creature.pose(random, angle * pi / 180);
        expectInside(creature.mesh, pose, "a creature");
        const double added = excess(creature.mesh, pose, method);
        sum += added;
        worst = std::max(worst, added);
      }
      EXPECT_LE(sum / creaturePoses, mean) << methodName(method) << " at " << angle << " degrees";
      EXPECT_LE(worst, most) << methodName(method) << " at " << angle << " degrees";
    }
  }
}

TEST(Bounds, StayTightWhereAJointScales) {
  // A limb's end made half as large again about its own origin, far from that of the mesh, and
  // bent.
  Creature creature;
  Random random(12);
  double sum = 0;
  for (int i = 0; i < creaturePoses; ++i) {
    std::vector<JointMatrix> pose = creature.pose(random, 30 * pi / 180);
    const std::size_t joint = 3 * (1 + random.below(6));
    const glm::dvec3 origin = creature.origins[joint];
    for (auto& row : pose[joint].m) {
      const glm::dvec3 axis(row[0], row[1], row[2]);
      row[3] -= static_cast<float>(0.5 * glm::dot(axis, origin));
      for (int column = 0; column < 3; ++column) row[column] *= 1.5f;
    }
    expectInside(creature.mesh, pose, "a creature with a large hand");
    sum += excess(creature.mesh, pose, Method::dualQuaternion);
  }
  EXPECT_LE(sum / creaturePoses, 0.03);
}

TEST(Bounds, KeepVerticesWithoutWeightInBindPose) {
  OwnedMesh mesh = meshOf(1);
  addVertex(mesh, {5, 0, 0}, std::array{0.0});
  addVertex(mesh, {0, 0, 0}, std::array{1.0});
  const std::array pose{jointOf(glm::dmat3(1.0), {0, 3, 0})};
  expectInside(mesh, pose, "a vertex without weight");
  const JointBounds bounds = boundsOf(mesh.view(), 1);
  const Box box = skinnedBounds(bounds, pose, Method::linear);
  EXPECT_NEAR(static_cast<double>(box.max[0]), 5, 1e-5);
  EXPECT_NEAR(static_cast<double>(box.min[1]), 0, 1e-5);

  OwnedMesh still = meshOf(1);
  addVertex(still, {5, 6, 7}, std::array{0.0});
  const JointBounds stillBounds = boundsOf(still.view(), 1);
  EXPECT_EQ(JointBoundsData::of(stillBounds).requiredJoints, 0u);
  const Box point = skinnedBounds(stillBounds, {}, Method::dualQuaternion);
  EXPECT_NEAR(static_cast<double>(point.min[2]), 7, 3e-5);
  EXPECT_LE(point.min[2], 7);
  EXPECT_GE(point.max[2], 7);
}

TEST(Bounds, LookOnlyAtJointsThatMoveVertices) {
  OwnedMesh mesh = test::randomMesh(9, 50, 3, 2, false);
  const JointBounds bounds = boundsOf(mesh.view(), 8);
  EXPECT_EQ(JointBoundsData::of(bounds).joints.size(), 3u);
  EXPECT_EQ(JointBoundsData::of(bounds).requiredJoints, 3u);
  std::vector<JointMatrix> pose = test::randomPose(9, 8, Rigidity::rigid);
  for (const Method method : allMethods) {
    std::vector<JointMatrix> other = pose;
    const Box expected = skinnedBounds(bounds, other, method);
    for (std::size_t joint = 3; joint < 8; ++joint) {
      for (auto& row : other[joint].m) std::fill_n(row, 4, std::nanf(""));
    }
    const Box box = skinnedBounds(bounds, other, method);
    EXPECT_TRUE(std::equal(box.min, box.min + 3, expected.min));
    EXPECT_TRUE(std::equal(box.max, box.max + 3, expected.max));
    const std::span<const JointMatrix> shorter = std::span(pose).first(3);
    EXPECT_EQ(skinnedBounds(bounds, shorter, method).max[0], expected.max[0]);
  }
}

TEST(Bounds, AreInfiniteForAJointThatIsNotFiniteOrMissing) {
  OwnedMesh mesh = test::randomMesh(9, 50, 3, 2, false);
  const JointBounds bounds = boundsOf(mesh.view(), 3);
  const std::vector<JointMatrix> pose = test::randomPose(9, 3, Rigidity::rigid);
  const auto expectInfinite = [](const Box& box) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(box.min[axis], -infinity);
      EXPECT_EQ(box.max[axis], infinity);
    }
  };
  for (const Method method : allMethods) {
    for (const float bad : {std::nanf(""), infinity, -infinity}) {
      std::vector<JointMatrix> other = pose;
      other[1].m[2][3] = bad;
      expectInfinite(skinnedBounds(bounds, other, method));
    }
    expectInfinite(skinnedBounds(bounds, std::span(pose).first(2), method));
  }
}

TEST(Bounds, NeverHaveANaN) {
  for (const float size : {1e-45f, 1e-30f, 1e10f, 1e30f, 3e38f}) {
    for (std::uint32_t seed = 1; seed < 40; ++seed) {
      OwnedMesh mesh = test::randomMesh(seed, 6, 4, 3, false);
      if (seed % 3 == 0) {
        for (float& x : mesh.positions) x *= size;
      }
      std::vector<JointMatrix> pose = test::randomPose(seed, 4, Rigidity::shear);
      if (seed % 3 != 1) {
        for (auto& row : pose[seed % 4].m) {
          for (float& value : row) value = std::clamp(value, -1.0f, 1.0f) * size;
        }
      }
      const JointBounds bounds = boundsOf(mesh.view(), 4);
      for (const Method method : allMethods) {
        const Box box = skinnedBounds(bounds, pose, method);
        const Result<reference::SkinnedMesh> skinned = reference::skin(mesh.view(), pose, method);
        for (int axis = 0; axis < 3; ++axis) {
          EXPECT_LE(box.min[axis], box.max[axis]) << "size " << size << ", seed " << seed;
        }
        for (const reference::Double3& position : skinned->positions) {
          if (!isFinite(position)) continue;
          EXPECT_LE(overhang(box, position), 0) << size << " " << seed;
        }
      }
    }
  }
}

// Kernels take such a mirror for flat, the reference does not.
TEST(Bounds, ContainBothResultsOfAMirrorBelowTheRange) {
  for (std::uint32_t seed = 1; seed < 20; ++seed) {
    OwnedMesh mesh = test::randomMesh(seed, 50, 2, 2, false);
    for (std::size_t slot = 0; slot < mesh.joints.size(); ++slot) {
      mesh.joints[slot] = static_cast<std::uint32_t>(slot % 2);
      mesh.weights[slot] = 0.5f;
    }
    std::vector<JointMatrix> mirrored = test::randomPose(seed, 2, Rigidity::rigid);
    for (int column = 0; column < 3; ++column) mirrored[1].m[2][column] *= -0x1p-105f;
    std::vector<JointMatrix> flat = mirrored;
    for (int column = 0; column < 3; ++column) flat[1].m[2][column] = 0;
    const Box box = skinnedBounds(boundsOf(mesh.view(), 2), mirrored, Method::dualQuaternion);
    for (const std::vector<JointMatrix>& pose : {mirrored, flat}) {
      const auto skinned = reference::skin(mesh.view(), pose, Method::dualQuaternion);
      for (const reference::Double3& position : skinned->positions)
        EXPECT_LE(overhang(box, position), 0) << seed;
    }
  }
}

bool isProven(Method method) {
  return std::find(provenMethods.begin(), provenMethods.end(), method) != provenMethods.end();
}

TEST(Bounds, AreInfiniteForMethodsWithoutAProof) {
  OwnedMesh mesh = test::randomMesh(31, 50, 3, 2, false);
  const JointBounds bounds = boundsOf(mesh.view(), 3);
  const std::vector<JointMatrix> pose = test::randomPose(32, 3, Rigidity::rigid);
  for (const Method method : allMethods) {
    const Box box = skinnedBounds(bounds, pose, method);
    for (int axis = 0; axis < 3; ++axis) {
      if (isProven(method)) {
        EXPECT_TRUE(std::isfinite(box.min[axis]) && std::isfinite(box.max[axis]))
            << methodName(method);
      } else {
        EXPECT_EQ(box.min[axis], -infinity) << methodName(method);
        EXPECT_EQ(box.max[axis], infinity) << methodName(method);
      }
    }
  }
}

// Whatever the share, the position lies between the two: the box holds both, and hardly more.
TEST(Bounds, OfBlendedAreThoseOfBothThatAreBlended) {
  for (std::uint32_t seed = 1; seed < 30; ++seed) {
    OwnedMesh mesh = test::randomMesh(seed, 30, 4, 3, false);
    const std::vector<JointMatrix> pose =
        test::randomPose(seed + 50, 4, seed % 2 == 0 ? Rigidity::rigid : Rigidity::shear);
    const JointBounds bounds = boundsOf(mesh.view(), 4);
    const Box linear = skinnedBounds(bounds, pose, Method::linear);
    const Box dual = skinnedBounds(bounds, pose, Method::dualQuaternion);
    const Box blended = skinnedBounds(bounds, pose, Method::blended);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_LE(blended.min[axis], std::min(linear.min[axis], dual.min[axis]));
      EXPECT_GE(blended.max[axis], std::max(linear.max[axis], dual.max[axis]));
      EXPECT_NEAR(blended.min[axis], std::min(linear.min[axis], dual.min[axis]), 1e-3);
      EXPECT_NEAR(blended.max[axis], std::max(linear.max[axis], dual.max[axis]), 1e-3);
    }
  }
}

TEST(Bounds, OfNoMeshHoldNothing) {
  const Box box = skinnedBounds(JointBounds{}, {}, Method::linear);
  EXPECT_GT(box.min[0], box.max[0]);
}

TEST(Bounds, GrowByWhatMorphTargetsDisplace) {
  OwnedMesh mesh = test::randomMesh(21, 40, 4, 3, false);
  const std::vector<JointMatrix> pose = test::randomPose(22, 4, Rigidity::rigid);
  Random random(23);
  std::vector<float> all, some;
  for (std::uint32_t i = 0; i < 3 * mesh.vertexCount(); ++i) {
    all.push_back(static_cast<float>(random.between(-0.5, 0.5)));
  }
  const std::array<std::uint32_t, 2> vertices{3, 17};
  for (int i = 0; i < 6; ++i) some.push_back(static_cast<float>(random.between(-2, 2)));
  std::array<MorphTargetView, 3> targets;
  targets[0].positions = attributeView(all.data(), mesh.vertexCount(), 3);
  targets[1].vertices = vertices;
  targets[1].positions = attributeView(some.data(), 2, 3);
  targets[1].positionScale = {1, 2, 1};
  MeshView view = mesh.view();
  view.morphTargets = targets;
  const std::array<float, 2> wide[] = {{-1, 2}, {0.5f, 0.5f}, {0, 1}};

  for (const bool withRanges : {false, true}) {
    const Result<JointBounds> bounds =
        withRanges ? jointBounds(view, 4, wide) : jointBounds(view, 4);
    ASSERT_TRUE(bounds.ok());
    for (int i = 0; i < 50; ++i) {
      const double first = withRanges ? random.between(-1, 2) : random.between(0, 1);
      const double second = withRanges ? 0.5 : random.between(0, 1);
      OwnedMesh morphed = mesh;
      for (std::size_t j = 0; j < all.size(); ++j) {
        morphed.positions[j] += static_cast<float>(first * static_cast<double>(all[j]));
      }
      for (std::size_t j = 0; j < 6; ++j) {
        morphed.positions[3 * vertices[j / 3] + j % 3] +=
            static_cast<float>(second * static_cast<double>(some[j]) * (j % 3 == 1 ? 2 : 1));
      }
      for (const Method method : allMethods) {
        const Box box = skinnedBounds(*bounds, pose, method);
        const Result<reference::SkinnedMesh> skinned =
            reference::skin(morphed.view(), pose, method);
        for (const reference::Double3& position : skinned->positions) {
          ASSERT_LE(overhang(box, position), 0);
        }
      }
    }
  }
}

TEST(Bounds, RefuseWhatPackRefuses) {
  OwnedMesh mesh = test::randomMesh(1, 10, 4, 2, false);
  EXPECT_EQ(jointBounds(mesh.view(), 0).error().code, ErrorCode::invalidArgument);
  EXPECT_EQ(jointBounds(mesh.view(), maxPoseJoints + 1).error().code, ErrorCode::invalidArgument);
  EXPECT_EQ(jointBounds(mesh.view(), 1).error().code, ErrorCode::invalidMesh);
  EXPECT_EQ(jointBounds(MeshView{}, 1).error().code, ErrorCode::invalidMesh);
  const std::array<float, 2> one[] = {{0, 1}};
  EXPECT_EQ(jointBounds(mesh.view(), 4, one).error().code, ErrorCode::invalidArgument);

  MorphTargetView target;
  MeshView view = mesh.view();
  view.morphTargets = {&target, 1};
  EXPECT_TRUE(jointBounds(view, 4).ok());  // displaces nothing
  const std::array<float, 2> backward[] = {{1, 0}};
  EXPECT_EQ(jointBounds(view, 4, backward).error().code, ErrorCode::invalidArgument);
  const std::array<float, 3> displacement{1, 2, 3};
  target.positions = attributeView(displacement.data(), 1, 3);
  EXPECT_EQ(jointBounds(view, 4).error().code, ErrorCode::invalidMesh);
  const std::array<std::uint32_t, 1> outside{10};
  target.vertices = outside;
  EXPECT_EQ(jointBounds(view, 4).error().code, ErrorCode::invalidMesh);
}

TEST(Bounds, ReadEveryStoredForm) {
  const std::array<float, 6> positions{0, 0, 0, 1, 1, 1};
  const std::array<std::uint8_t, 4> joints{1, 0, 0, 1};
  const std::array<std::uint8_t, 4> weights{255, 0, 128, 127};
  MeshView mesh;
  mesh.vertexCount = 2;
  mesh.positions = attributeView(positions.data(), 2, 3);
  const InfluenceSet set{{joints.data(), 2, 2, ComponentType::uint8, 2},
                         {weights.data(), 2, 2, ComponentType::unorm8, 2}};
  mesh.influenceSets = {&set, 1};
  mesh.positionScale = {2, 3, 4};
  mesh.positionOffset = {10, 0, 0};
  const JointBounds ofBytes = boundsOf(mesh, 2);
  const JointBoundsData& bounds = JointBoundsData::of(ofBytes);
  ASSERT_EQ(bounds.pairs.size(), 1u);
  EXPECT_EQ(bounds.pairs[0].influences, 2u);
  EXPECT_FLOAT_EQ(bounds.pairs[0].firstOverSecond[0], 128.0f / 127);
  EXPECT_EQ(bounds.pairs[0].extent.reach[0], 12);
  EXPECT_EQ(bounds.pairs[0].extent.reach[1], -12);
  EXPECT_EQ(bounds.pairs[0].extent.reach[18], 12 + 3 + 4);
  EXPECT_TRUE(bounds.joints[0].alone.empty());
  EXPECT_EQ(bounds.joints[1].alone.reach[0], 10);
  EXPECT_TRUE(bounds.trios.empty());
  const std::array<float, 4> floats{1, 0, 0, 1};
  const InfluenceSet ofFloats{attributeView(floats.data(), 2, 2), set.weights};
  mesh.influenceSets = {&ofFloats, 1};
  EXPECT_EQ(boundsOf(mesh, 2).bytes(), ofBytes.bytes());
}

// ---- As they are stored

/// Bounds with joints alone, pairs, trios and vertices without weight.
JointBounds storedBounds() {
  OwnedMesh mesh = test::randomMesh(7, 300, 9, 4);
  for (std::uint32_t slot = 0; slot < mesh.influencesPerVertex; ++slot) mesh.weights[slot] = 0;
  return boundsOf(mesh.view(), 9);
}

TEST(Bounds, ComeBackAsTheyWereStored) {
  const JointBounds bounds = storedBounds(), none;
  const JointBoundsData& data = JointBoundsData::of(bounds);
  ASSERT_FALSE(data.pairs.empty() || data.trios.empty() || data.joints.empty());
  for (const JointBounds* stored : {&bounds, &none}) {
    const Result<JointBounds> read = JointBounds::fromBytes(stored->bytes());
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(read->bytes(), stored->bytes());
    const JointBoundsData &a = JointBoundsData::of(*read), &b = JointBoundsData::of(*stored);
    EXPECT_EQ(a.joints.size(), b.joints.size());
    EXPECT_EQ(a.requiredJoints, b.requiredJoints);
  }
  const std::vector<JointMatrix> pose = test::randomPose(1, 9, Rigidity::shear);
  const Box a = skinnedBounds(bounds, pose, Method::dualQuaternion);
  const Box b =
      skinnedBounds(*JointBounds::fromBytes(bounds.bytes()), pose, Method::dualQuaternion);
  EXPECT_EQ(std::memcmp(&a, &b, sizeof(a)), 0);
}

TEST(Bounds, DamagedBytesAreRefused) {
  const std::vector<std::byte> good = storedBounds().bytes();
  for (std::size_t place = 0; place < good.size(); ++place) {
    std::vector<std::byte> damaged = good;
    damaged[place] ^= std::byte{16};
    EXPECT_FALSE(JointBounds::fromBytes(damaged).ok()) << place;
  }
  for (const std::size_t size : {std::size_t{0}, std::size_t{3}, std::size_t{55}, good.size() - 4})
    EXPECT_FALSE(JointBounds::fromBytes(std::span(good).first(size)).ok()) << size;
}

// What only a program that knows the checksum can write.
TEST(Bounds, WhatBreaksARuleIsRefused) {
  const JointBounds stored = storedBounds();
  const JointBoundsData& good = JointBoundsData::of(stored);
  const auto refused = [&](auto change) {
    JointBoundsData bounds = good;
    change(bounds);
    const Result<JointBounds> read = JointBounds::fromBytes(bounds.bytes());
    return !read && read.error().code == ErrorCode::invalidData;
  };
  const float nan = std::nanf("");
  const auto count = static_cast<std::uint32_t>(good.joints.size());
  EXPECT_FALSE(refused([](JointBoundsData&) {}));
  EXPECT_TRUE(refused([](JointBoundsData& b) { ++b.requiredJoints; }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { b.joints.back().joint = 65536; }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { std::swap(b.joints[0], b.joints[1]); }));
  EXPECT_TRUE(refused([&](JointBoundsData& b) { b.joints[2].alone.reach[25] = nan; }));
  EXPECT_TRUE(refused([&](JointBoundsData& b) { b.pairs[0].second = count; }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { b.pairs[0].second = b.pairs[0].first; }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { std::swap(b.pairs[0], b.pairs[1]); }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { b.pairs[0].influences = 1; }));
  EXPECT_TRUE(refused([&](JointBoundsData& b) { b.pairs[0].extent.reach[0] = nan; }));
  EXPECT_TRUE(refused([&](JointBoundsData& b) { b.pairs[0].minSum = nan; }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { b.pairs[0].firstOverSecond[0] = -1; }));
  EXPECT_TRUE(refused([&](JointBoundsData& b) { b.trios.back()[2] = count; }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { std::swap(b.trios[0][0], b.trios[0][1]); }));
  EXPECT_TRUE(refused([](JointBoundsData& b) { std::swap(b.trios[0], b.trios[1]); }));
  EXPECT_TRUE(refused([&](JointBoundsData& b) { b.unweighted.max[1] = nan; }));
}

}  // namespace
}  // namespace dermis
