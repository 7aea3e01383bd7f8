// The parts of dermis_viewer that need no window.

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <string>
#include <thread>

#include "dermis/verify/reference.h"
#include "error_check.h"
#include "joint_overlay.h"
#include "keys.h"
#include "orbit_camera.h"
#include "pace.h"
#include "playback.h"
#include "scene_loader.h"
#include "skeleton.h"
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

TEST(PlaybackTest, BeginsAnewAtTheEnd) {
  Playback playback;
  playback.begin(2);
  playback.advance(1.5);
  EXPECT_DOUBLE_EQ(playback.time(), 1.5);
  playback.advance(1);
  EXPECT_DOUBLE_EQ(playback.time(), 0.5);
  playback.setPlaying(false);
  playback.advance(1);
  EXPECT_DOUBLE_EQ(playback.time(), 0.5);
}

TEST(PlaybackTest, AStepStopsAndTheEndCanBeSeen) {
  Playback playback;
  playback.begin(1);
  playback.step(-0.25);
  EXPECT_FALSE(playback.isPlaying());
  EXPECT_DOUBLE_EQ(playback.time(), 0.75);
  playback.seek(7);
  EXPECT_DOUBLE_EQ(playback.time(), 1);
}

TEST(PlaybackTest, ARestPoseDoesNotPlay) {
  Playback playback;
  playback.begin(0);
  playback.setPlaying(true);
  playback.advance(1);
  playback.step(1);
  EXPECT_FALSE(playback.isPlaying());
  EXPECT_DOUBLE_EQ(playback.time(), 0);
}

const Box box{{-1, 0, -0.5f}, {1, 4, 0.5f}};

void expectAllSeen(const OrbitCamera& camera, float aspect) {
  const samples::render::Camera seen = camera.camera(box, aspect);
  for (int corner = 0; corner < 8; ++corner) {
    const glm::vec3 point((corner & 1) != 0 ? box.max[0] : box.min[0],
                          (corner & 2) != 0 ? box.max[1] : box.min[1],
                          (corner & 4) != 0 ? box.max[2] : box.min[2]);
    const glm::vec4 clip = seen.viewProjection * glm::vec4(point, 1);
    EXPECT_LT(std::abs(clip.x), clip.w);
    EXPECT_LT(std::abs(clip.y), clip.w);
    EXPECT_GT(clip.z, 0);
    EXPECT_LT(clip.z, clip.w);
  }
}

TEST(OrbitCameraTest, FramesABoxFromAllAround) {
  for (const float aspect : {0.4f, 1.0f, 2.5f}) {
    OrbitCamera camera;
    for (int step = 0; step < 12; ++step) {
      camera.frame(box, aspect);
      expectAllSeen(camera, aspect);
      camera.orbit(0.23f, step < 6 ? 0.05f : -0.15f);
    }
  }
}

TEST(OrbitCameraTest, MovesAsItIsTold) {
  OrbitCamera camera;
  camera.frame(box, 1);
  EXPECT_TRUE(camera.isFramed());
  const Area area{0, 0, 100, 100};
  const glm::vec3 middle(0, 2, 0);
  const auto before = project(camera.camera(box, 1), area, middle);
  camera.pan(0.25f, 0.125f);
  EXPECT_FALSE(camera.isFramed());
  const auto after = project(camera.camera(box, 1), area, middle);
  ASSERT_TRUE(before && after);
  // What is farther away than what it looks at moves less.
  EXPECT_NEAR((*after)[0] - (*before)[0], 25, 2);
  EXPECT_NEAR((*after)[1] - (*before)[1], 12.5, 2);
  const float distance = camera.camera(box, 1).distance;
  camera.zoom(3);
  EXPECT_LT(camera.camera(box, 1).distance, distance);
  camera.zoom(1e6f);
  EXPECT_GT(camera.camera(box, 1).distance, 0);
  camera.orbit(0, 100);
  EXPECT_LT(camera.camera(box, 1).towardsEye.y, 1);
}

TEST(SkeletonTest, HasEveryJointOnceAndParentsFirst) {
  const cli::Scene scene = figure();
  const std::vector<Joint> joints = jointsOf(scene);
  EXPECT_EQ(joints.size(), scene.model->skins[0].joints.size());
  std::size_t roots = 0;
  for (std::uint32_t index = 0; index < joints.size(); ++index) {
    EXPECT_FALSE(joints[index].name.empty());
    if (joints[index].parent == gltf::none) {
      ++roots;
    } else {
      EXPECT_LT(joints[index].parent, index);
    }
  }
  EXPECT_EQ(roots, 1u);
}

TEST(SkeletonTest, TheWeightsOfAllJointsAreOne) {
  const cli::Scene scene = figure();
  const std::vector<Joint> joints = jointsOf(scene);
  for (const cli::ScenePart& part : scene.parts) {
    std::vector<float> sums(part.primitive->vertexCount, 0.0f);
    for (const Joint& joint : joints) {
      const std::vector<float> weights = jointWeights(scene, part, joint.node);
      for (std::size_t vertex = 0; vertex < sums.size(); ++vertex) sums[vertex] += weights[vertex];
    }
    for (const float sum : sums) ASSERT_NEAR(sum, 1, 1e-5);
  }
}

TEST(JointOverlayTest, FindsTheJointUnderTheMouse) {
  const cli::Scene scene = figure();
  const std::vector<Joint> joints = jointsOf(scene);
  const std::vector<glm::vec3> positions = jointPositions(scene, joints, 0, 0.3);
  OrbitCamera orbit;
  orbit.frame(Box{{-1, 0, -1}, {1, 2, 1}}, 1);
  const samples::render::Camera camera = orbit.camera(Box{{-1, 0, -1}, {1, 2, 1}}, 1);
  const Area area{100, 0, 2000, 2000};
  for (std::uint32_t index = 0; index < positions.size(); ++index) {
    const auto place = project(camera, area, positions[index]);
    ASSERT_TRUE(place);
    const auto found = jointAt(positions, camera, area, (*place)[0], (*place)[1]);
    ASSERT_TRUE(found);
    EXPECT_LT(glm::distance(positions[*found], positions[index]), 0.01f);
  }
  EXPECT_FALSE(jointAt(positions, camera, area, 101, 1));
}

/// What the reference itself has, one vertex of it moved.
CheckRequest movedBy(const cli::Scene& scene, float distance) {
  CheckRequest request;
  request.clip = 0;
  request.time = 0.3;
  request.pose = cli::scenePose(scene, 0, 0.3);
  SkinnedFigure& skinned = request.figures.emplace_back();
  for (std::size_t index = 0; index < scene.parts.size(); ++index) {
    const cli::ScenePart& part = scene.parts[index];
    const Result<reference::SkinnedMesh> expected =
        reference::skin(part.mesh->view(), request.pose.pose(part), skinned.method);
    EXPECT_TRUE(expected);
    std::vector<float>& positions = skinned.positions.emplace_back();
    for (const reference::Double3& position : expected->positions) {
      for (const double value : position) positions.push_back(static_cast<float>(value));
    }
  }
  skinned.positions[1][3 * 7] += distance;
  return request;
}

TEST(ErrorCheckTest, FindsTheVertexThatIsOff) {
  const cli::Scene scene = figure();
  const Result<CheckResult> right = checkErrors(scene, movedBy(scene, 0));
  const Result<CheckResult> wrong = checkErrors(scene, movedBy(scene, 0.5f));
  ASSERT_TRUE(right && wrong);
  EXPECT_LT(right->figures[0].greatest, 2e-7);
  EXPECT_LT(right->figures[0].greatestPartOfBound, 1);
  EXPECT_NEAR(wrong->figures[0].greatest, 0.5, 1e-6);
  EXPECT_GT(wrong->figures[0].greatestPartOfBound, 1000);
  EXPECT_NEAR(wrong->figures[0].errors[1][7], 0.5, 1e-6);
  EXPECT_LT(wrong->figures[0].errors[1][8], 2e-7);
}

TEST(ErrorCheckTest, WorksOnAThreadOfItsOwn) {
  const cli::Scene scene = figure();
  ErrorCheck check(scene);
  check.begin(movedBy(scene, 0.5f));
  EXPECT_TRUE(check.isBusy());
  std::optional<Result<CheckResult>> result;
  while (!(result = check.poll())) std::this_thread::yield();
  EXPECT_FALSE(check.isBusy());
  ASSERT_TRUE(*result);
  EXPECT_NEAR((**result).figures[0].greatest, 0.5, 1e-6);
  EXPECT_FALSE(check.poll());
}

TEST(SceneLoaderTest, ForgetsWhatIsNoLongerWanted) {
  SceneLoader loader;
  const std::string folder = sampleModels;
  for (const char* name : {"/figure.glb", "/bar.glb", "/arm.glb"}) loader.load({folder + name});
  std::optional<LoadedScene> loaded;
  while (!(loaded = loader.poll())) std::this_thread::yield();
  EXPECT_TRUE(loaded->request.path.ends_with("arm.glb"));
  EXPECT_TRUE(loaded->scene);
  EXPECT_EQ(loader.current(), nullptr);
}

TEST(SceneLoaderTest, SaysWhatIsWrong) {
  SceneLoader loader;
  loader.load({"nowhere.glb"});
  std::optional<LoadedScene> loaded;
  while (!(loaded = loader.poll())) std::this_thread::yield();
  ASSERT_FALSE(loaded->scene);
  EXPECT_NE(loaded->scene.error().message.find("nowhere.glb"), std::string::npos);
}

TEST(PaceTest, KeepsUpAndGetsBetterAgain) {
  Pace pace(false);
  EXPECT_FALSE(pace.hasTwo());
  EXPECT_EQ(pace.moving().scale, 1);
  for (int picture = 0; picture < 20; ++picture) pace.measured(0.5);
  EXPECT_LT(pace.moving().scale, 1);
  EXPECT_EQ(pace.still().scale, 1);
  EXPECT_TRUE(pace.hasTwo());
  for (int picture = 0; picture < 20; ++picture) pace.measured(0.001);
  EXPECT_FALSE(pace.hasTwo());
}

void press(State& state, SDL_Keycode key, Uint16 modifiers = KMOD_NONE) {
  SDL_KeyboardEvent event{};
  event.type = SDL_KEYDOWN;
  event.keysym.sym = key;
  event.keysym.mod = modifiers;
  handleKey(event, nullptr, state);
}

TEST(KeysTest, EscapeClosesWhatIsOpenFirst) {
  State state;
  state.error = "broken";
  press(state, SDLK_F1);
  EXPECT_TRUE(state.showsHelp);
  press(state, SDLK_ESCAPE);
  EXPECT_FALSE(state.showsHelp);
  EXPECT_FALSE(state.error.empty());
  press(state, SDLK_ESCAPE);
  EXPECT_TRUE(state.error.empty());
  EXPECT_FALSE(state.quits);
  press(state, SDLK_ESCAPE);
  EXPECT_TRUE(state.quits);
}

TEST(KeysTest, LeavesOtherPeoplesKeysAlone) {
  State state;
  press(state, SDLK_q, KMOD_LCTRL);
  EXPECT_FALSE(state.quits);
  press(state, SDLK_q);
  EXPECT_TRUE(state.quits);
}

}  // namespace
}  // namespace dermis::test
