// The figure's walk: its feet neither sink into the ground nor slide over it.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "figure.h"
#include "models.h"
#include "walk_leg.h"

namespace {

using namespace dermis::models;

struct Rigid {
  Quat rotation;
  Vec3 translation;
};

// What each joint does to a vertex that stands in rest.
std::vector<Rigid> palette(const Skeleton& skeleton, const Pose& pose) {
  std::vector<Rigid> globals;
  std::vector<Rigid> result;
  for (std::size_t joint = 0; joint < skeleton.joints.size(); ++joint) {
    const Joint& self = skeleton.joints[joint];
    const LocalTransform local = localTransform(skeleton, joint, pose[joint]);
    Rigid global{local.rotation, local.translation};
    if (self.parent != noParent) {
      const Rigid& parent = globals[static_cast<std::size_t>(self.parent)];
      global = {parent.rotation * local.rotation,
                parent.translation + parent.rotation * local.translation};
    }
    globals.push_back(global);
    const Quat rotation = global.rotation * glm::conjugate(self.rotation);
    result.push_back({rotation, global.translation - rotation * self.position});
  }
  return result;
}

std::vector<Vec3> skinLinearly(const Model& model, const Pose& pose) {
  const std::vector<Rigid> joints = palette(model.skeleton, pose);
  std::vector<Vec3> positions;
  for (std::size_t vertex = 0; vertex < model.mesh.positions.size(); ++vertex) {
    const Influences& influences = model.mesh.influences[vertex];
    Vec3 sum(0.0);
    for (std::size_t influence = 0; influence < 4; ++influence) {
      const Rigid& joint = joints[influences.joints[influence]];
      sum += (joint.rotation * model.mesh.positions[vertex] + joint.translation) *
             static_cast<double>(influences.weights[influence]);
    }
    positions.push_back(sum);
  }
  return positions;
}

class FigureWalk : public testing::Test {
 protected:
  const Model model_ = figureModel();
  const Clip& walk_ = model_.clips.front();
};

TEST_F(FigureWalk, IsTheFirstClip) {
  EXPECT_EQ(walk_.name, "walk");
  EXPECT_NEAR(walk_.times.back(), 1.1, 1e-12);
}

TEST_F(FigureWalk, StaysAboveTheGroundAndTouchesIt) {
  for (std::size_t key = 0; key < walk_.poses.size(); ++key) {
    double lowest = std::numeric_limits<double>::max();
    for (const Vec3& position : skinLinearly(model_, walk_.poses[key])) {
      lowest = std::min(lowest, position.y);
    }
    EXPECT_GT(lowest, -0.005) << "key " << key;
    EXPECT_LT(lowest, 0.005) << "key " << key;
  }
}

TEST_F(FigureWalk, SolesMoveWithTheGround) {
  // From a flat foot to where the heel rises: the soles' vertices go back at walking speed.
  std::vector<std::size_t> sole;
  for (std::size_t vertex = 0; vertex < model_.mesh.positions.size(); ++vertex) {
    const Vec3& position = model_.mesh.positions[vertex];
    if (position.x > 0.0 && position.y < 0.002) sole.push_back(vertex);
  }
  ASSERT_GT(sole.size(), 20U);
  const auto keyAt = [&](double phase) {
    return static_cast<std::size_t>(phase * static_cast<double>(walk_.poses.size() - 1));
  };
  const std::size_t first = keyAt(0.12);
  const std::size_t last = keyAt(0.26);
  const std::vector<Vec3> before = skinLinearly(model_, walk_.poses[first]);
  const std::vector<Vec3> after = skinLinearly(model_, walk_.poses[last]);
  const double passed = walkingSpeed() * (walk_.times[last] - walk_.times[first]);
  for (const std::size_t vertex : sole) {
    const Vec3 slip = after[vertex] + Vec3(0.0, 0.0, passed) - before[vertex];
    EXPECT_LT(glm::length(slip), 0.004) << "vertex " << vertex;
  }
}

TEST_F(FigureWalk, LegsAreLongEnough) {
  const Vec3 pelvis = model_.skeleton.joints[indexOf(Bone::hips)].position;
  for (std::size_t key = 0; key + 1 < walk_.poses.size(); ++key) {
    const JointPose& hips = walk_.poses[key][indexOf(Bone::hips)];
    const Vec3 hip = pelvis + hips.offset + hips.turn * (hipPoint - pelvis);
    const double phase = static_cast<double>(key) / static_cast<double>(walk_.poses.size() - 1);
    EXPECT_LT(overreach(hip, footAt(phase)), 0.0) << "key " << key;
  }
}

}  // namespace
