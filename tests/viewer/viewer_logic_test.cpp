// The parts of dermis_viewer that need no window.

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <string>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include "dermis/verify.h"
#include "interface.h"
#include "scene_view.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using namespace viewer;

cli::Scene figure() {
  cli::MeshPreparation preparation;
  Result<cli::Scene> scene = cli::loadScene(std::string(sampleModels) + "/figure.glb", preparation);
  EXPECT_TRUE(scene) << scene.error().message;
  return std::move(*scene);
}

TEST(RepeatedTimeTest, BeginsAnewAfterTheEndAndBeforeTheBeginning) {
  EXPECT_DOUBLE_EQ(repeatedTime(1.5, 2), 1.5);
  EXPECT_DOUBLE_EQ(repeatedTime(2.5, 2), 0.5);
  EXPECT_DOUBLE_EQ(repeatedTime(-0.25, 1), 0.75);
  EXPECT_DOUBLE_EQ(repeatedTime(1, 1), 1) << "the end can be seen";
  EXPECT_DOUBLE_EQ(repeatedTime(1, 0), 0) << "a rest pose";
}

const Box box{{-1, 0, -0.5f}, {1, 4, 0.5f}};

TEST(OrbitCameraTest, FramesABoxFromAllAround) {
  for (int place = 0; place < 36; ++place) {
    OrbitCamera camera;
    camera.orbit(0.23f * static_cast<float>(place), 0.3f - 0.05f * static_cast<float>(place % 12));
    const float aspect = place < 12 ? 0.4f : place < 24 ? 1.0f : 2.5f;
    camera.frame(box, aspect);
    for (int corner = 0; corner < 8; ++corner) {
      const glm::vec3 point((corner & 1) != 0 ? box.max[0] : box.min[0],
                            (corner & 2) != 0 ? box.max[1] : box.min[1],
                            (corner & 4) != 0 ? box.max[2] : box.min[2]);
      const glm::vec4 clip = camera.camera(box, aspect).viewProjection * glm::vec4(point, 1);
      EXPECT_TRUE(std::abs(clip.x) < clip.w && std::abs(clip.y) < clip.w) << place;
      EXPECT_TRUE(clip.z > 0 && clip.z < clip.w) << place;
    }
  }
}

TEST(OrbitCameraTest, MovesAsItIsTold) {
  OrbitCamera camera;
  camera.frame(box, 1);
  EXPECT_FALSE(camera.isMoved());
  const auto place = [&] {
    const glm::vec4 clip = camera.camera(box, 1).viewProjection * glm::vec4(0, 2, 0, 1);
    return glm::vec2(clip) / clip.w * 0.5f;  // in parts of the picture
  };
  const glm::vec2 before = place();
  camera.pan(0.25f, 0.125f);
  EXPECT_TRUE(camera.isMoved());
  const glm::vec2 moved = place() - before;
  // What is farther away than what it looks at moves less.
  EXPECT_NEAR(moved.x, 0.25, 0.02);
  EXPECT_NEAR(moved.y, 0.125, 0.02);
  const float distance = camera.camera(box, 1).distance;
  camera.zoom(3);
  EXPECT_LT(camera.camera(box, 1).distance, distance);
  camera.zoom(1e6f);
  EXPECT_GT(camera.camera(box, 1).distance, 0);
  camera.orbit(0, 100);
  EXPECT_LT(camera.camera(box, 1).towardsEye.y, 1);
}

TEST(ViewerJointsTest, HasEveryJointOnceBelowOneRoot) {
  const cli::Scene scene = figure();
  const std::vector<Joint> joints = jointsOf(scene);
  EXPECT_EQ(joints.size(), scene.model->skins[0].joints.size());
  std::set<std::uint32_t> nodes;
  for (const Joint& joint : joints) {
    EXPECT_FALSE(joint.name.empty());
    nodes.insert(joint.node);
    if (&joint == joints.data()) continue;  // the root
    ASSERT_NE(joint.parent, noIndex);
    EXPECT_EQ(joints[joint.parent].node, scene.model->nodes[joint.node].parent);
  }
  EXPECT_EQ(nodes.size(), joints.size());
}

TEST(ViewerJointsTest, TheWeightsOfAllJointsAreOne) {
  const cli::Scene scene = figure();
  const std::vector<Joint> joints = jointsOf(scene);
  for (const cli::ScenePart& part : scene.parts) {
    std::vector<float> sums(part.primitive->vertexCount, 0.0f);
    for (const Joint& joint : joints) {
      const Result<std::vector<float>> weights = jointWeights(scene, part, joint.node);
      ASSERT_TRUE(weights);
      for (std::size_t vertex = 0; vertex < sums.size(); ++vertex)
        sums[vertex] += (*weights)[vertex];
    }
    for (const float sum : sums) ASSERT_NEAR(sum, 1, 1e-5);
  }
}

/// The errors if the device has skinned like the reference, but moved one vertex by a distance.
Result<PositionErrors> errorsOfMoved(float distance) {
  const cli::Scene scene = figure();
  const cli::ScenePose pose = cli::scenePose(scene, 0, 0.3);
  std::vector<std::vector<float>> positions;
  for (const cli::ScenePart& part : scene.parts) {
    const Result<reference::SkinnedMesh> expected =
        reference::skin(part.mesh->view(), pose.pose(part), Method::dualQuaternion);
    EXPECT_TRUE(expected);
    std::vector<float>& own = positions.emplace_back();
    for (const reference::Double3& position : expected->positions) {
      for (const double value : position) own.push_back(static_cast<float>(value));
    }
  }
  positions[1][3 * 7] += distance;
  return positionErrors(scene, pose, Method::dualQuaternion, positions);
}

TEST(PositionErrorsTest, FindsTheVertexThatIsOff) {
  const Result<PositionErrors> right = errorsOfMoved(0), wrong = errorsOfMoved(0.5f);
  ASSERT_TRUE(right && wrong);
  EXPECT_LT(right->greatest, 2e-7);
  EXPECT_LT(right->greatestPartOfBound, 1);
  EXPECT_NEAR(wrong->greatest, 0.5, 1e-6);
  EXPECT_GT(wrong->greatestPartOfBound, 1000);
  EXPECT_NEAR(wrong->errors[1][7], 0.5, 1e-6);
  EXPECT_LT(wrong->errors[1][8], 2e-7);
}

}  // namespace
}  // namespace dermis::test
