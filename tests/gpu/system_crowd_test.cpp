// A thousand instances: each as if it were alone, in whatever order they came.

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>
#include <random>

#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t meshCount = 20;

/// A thousand instances of twenty meshes, of every method that needs no special mesh, each with a
/// pose of its own but for some that share one.
class SystemCrowdTest : public SystemTest {
 protected:
  void SetUp() override {
    SystemTest::SetUp();
    if (device_ == nullptr) return;
    for (std::uint32_t mesh = 0; mesh < meshCount; ++mesh)
      meshes_.push_back(systemMesh(mesh, 16 + mesh * 5, 8, 1 + mesh % 6));
  }

  vulkan::SceneRecorderDescription crowdDescription() {
    vulkan::SceneRecorderDescription crowd = description();
    crowd.scene.outputCapacity = Capacity::fixed(8 << 20);
    crowd.scene.jointCapacity = Capacity::fixed(16384);
    return crowd;
  }
  static Method methodOf(std::uint32_t member) {
    const Method methods[] = {Method::linear, Method::dualQuaternion, Method::blended};
    return methods[member % 7 % 3];
  }
  static std::uint32_t poseOf(std::uint32_t member) { return member % 10 == 9 ? 9 : member; }

  /// Member `member` of the crowd.
  InstanceHandle add(SystemEngine& engine, const std::vector<MeshHandle>& meshes,
                     std::uint32_t member) {
    InstanceDescription instance;
    instance.mesh = meshes[member % meshCount];
    instance.pose = engine.addPose(systemPose(poseOf(member)));
    instance.method = methodOf(member);
    instance.layout = plainLayout();
    return engine.addInstance(instance);
  }
  std::vector<MeshHandle> addMeshes(SystemEngine& engine) const {
    std::vector<MeshHandle> handles;
    for (const PackedMesh& mesh : meshes_) handles.push_back(engine.addMesh(mesh));
    return handles;
  }
  const Streams& expected(std::uint32_t member) {
    Streams& streams = expected_[member];
    if (streams[positionStream].empty()) {
      InstanceDescription instance;
      instance.method = methodOf(member);
      instance.layout = plainLayout();
      streams = alone(meshes_[member % meshCount], systemPose(poseOf(member)), instance);
    }
    return streams;
  }
  void expectCrowd(SystemEngine& engine, const std::map<std::uint32_t, InstanceHandle>& crowd) {
    const std::vector<std::byte> bytes = engine.readOutput();
    for (const auto& [member, instance] : crowd) {
      SCOPED_TRACE(member);
      expectSkinned(engine.read(bytes, instance), expected(member));
    }
  }

  std::vector<PackedMesh> meshes_;
  std::map<std::uint32_t, Streams> expected_;
};

TEST_F(SystemCrowdTest, AThousandInstancesInAnyOrderAreAsIfEachWereAlone) {
  std::vector<std::uint32_t> order(1000);
  std::iota(order.begin(), order.end(), 0u);
  for (const std::uint32_t seed : {0u, 1u}) {
    if (seed != 0) std::shuffle(order.begin(), order.end(), std::mt19937(seed));
    SystemEngine engine(device(), context(), crowdDescription());
    engine.begin();
    const std::vector<MeshHandle> meshes = addMeshes(engine);
    std::map<std::uint32_t, InstanceHandle> crowd;
    for (const std::uint32_t member : order) crowd[member] = add(engine, meshes, member);
    engine.submit();
    EXPECT_EQ(engine.lastFrame().skinnedInstances, 1000u);
    expectCrowd(engine, crowd);
  }
}

TEST_F(SystemCrowdTest, WhatCameAndWentBeforeChangesNoBit) {
  SystemEngine engine(device(), context(), crowdDescription());
  engine.begin();
  const std::vector<MeshHandle> meshes = addMeshes(engine);
  std::map<std::uint32_t, InstanceHandle> crowd;
  std::mt19937 random(1);
  for (std::uint32_t round = 0; round < 8; ++round) {
    if (round != 0) engine.begin(round % 2);
    for (std::uint32_t member = 0; member < 300; ++member) {
      if (random() % 3 != 0) continue;
      if (const auto present = crowd.find(member); present != crowd.end()) {
        must(engine->removeInstance(present->second));
        crowd.erase(present);
      } else {
        crowd[member] = add(engine, meshes, member);
      }
    }
    engine.submit();
    expectCrowd(engine, crowd);
  }
}

}  // namespace
}  // namespace dermis::test
