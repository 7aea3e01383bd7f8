// Meshes that are bound to the joints along a chain.
#include <gtest/gtest.h>

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/rig.h"

namespace dermis::test {
namespace {

/// Joints 0 to 2 along x at 0, 1 and 3, one beside them, and three driven ones for four segments of
/// length 0.75.
class BendChain : public ::testing::Test {
 protected:
  static constexpr std::uint32_t other = 3, firstDriven = 4;

  BendChain() {
    joints_[1].bind.m[0][3] = 1;
    joints_[2].bind.m[0][3] = 3;
  }

  /// The influences of each vertex of a bent mesh, by joint. Vertices have two influences.
  std::vector<std::map<std::uint32_t, float>> bend(const std::vector<float>& positions,
                                                   const std::vector<std::uint32_t>& joints,
                                                   const std::vector<float>& weights) {
    const auto count = static_cast<std::uint32_t>(positions.size() / 3);
    const InfluenceSet set{{joints.data(), count, 8, ComponentType::uint32, 2},
                           attributeView(weights.data(), count, 2)};
    MeshView mesh;
    mesh.vertexCount = count;
    mesh.positions = attributeView(positions.data(), count, 3);
    mesh.influenceSets = {&set, 1};
    const Result<RepairedMesh> bent = bendChain(mesh, joints_, chain_);
    EXPECT_TRUE(bent.ok()) << bent.error().message;
    std::vector<std::map<std::uint32_t, float>> all(count);
    if (!bent) return all;
    const InfluenceSet& found = bent->view().influenceSets.front();
    const auto* const ofJoints = static_cast<const std::uint32_t*>(found.joints.data);
    const auto* const ofWeights = static_cast<const float*>(found.weights.data);
    const std::uint32_t slots = found.weights.components;
    for (std::uint32_t i = 0; i < count * slots; ++i) {
      if (ofWeights[i] != 0) all[i / slots][ofJoints[i]] += ofWeights[i];
    }
    return all;
  }

  std::array<RigJoint, 7> joints_{};
  std::array<std::uint32_t, 3> chainJoints_{0, 1, 2};
  ChainDriver chain_{.joints = chainJoints_, .firstDriven = firstDriven, .segments = 4};
};

using Influences = std::map<std::uint32_t, float>;

void expectNear(const Influences& found, const Influences& expected) {
  ASSERT_EQ(found.size(), expected.size());
  for (const auto& [joint, weight] : expected) {
    ASSERT_TRUE(found.contains(joint)) << joint;
    EXPECT_NEAR(found.at(joint), weight, 1e-5f) << joint;
  }
}

/// A row of joints is a straight curve, along which its parameter is not the length: a vertex at a
/// joint of the chain is 1/3 along it.
TEST_F(BendChain, VerticesFollowTheEndsOfTheirSegment) {
  const auto bent =
      bend({-1, 0, 0, 0, 0.5f, 0, 1, 0, 0.25f, 3, 0, 0, 9, 1, 0}, {0, 1, 0, 1, 1, 2, 2, 1, 2, 0},
           {1, 0, 0.5f, 0.5f, 0.25f, 0.75f, 1, 0, 1, 0});
  expectNear(bent[0], {{0, 1}});  // before the chain
  expectNear(bent[1], {{0, 1}});
  expectNear(bent[2], {{firstDriven, 2 / 3.0f}, {firstDriven + 1, 1 / 3.0f}});  // 1 / 0.75
  expectNear(bent[3], {{2, 1}});
  expectNear(bent[4], {{2, 1}});  // behind it
}

TEST_F(BendChain, WeightsOfOtherJointsStay) {
  const auto bent = bend({1, 0, 0, 2, 0, 0}, {other, 1, other, other}, {0.25f, 0.75f, 0.5f, 0.5f});
  expectNear(bent[0], {{other, 0.25f}, {firstDriven, 0.5f}, {firstDriven + 1, 0.25f}});
  expectNear(bent[1], {{other, 1}});
}

/// In bind pose a vertex on the curve is between its two joints, wherever it is.
TEST_F(BendChain, WeightsAreContinuousAlongTheCurve) {
  chainJoints_ = {0, 1, 2};
  joints_[1].bind.m[1][3] = 0.5f;
  std::vector<float> positions, weights;
  std::vector<std::uint32_t> joints;
  constexpr int steps = 400;
  for (int i = 0; i <= steps; ++i) {
    positions.insert(positions.end(), {3.0f * static_cast<float>(i) / steps, 0.2f, 0.1f});
    joints.insert(joints.end(), {1, 1});
    weights.insert(weights.end(), {1, 0});
  }
  const auto bent = bend(positions, joints, weights);
  for (std::size_t i = 1; i < bent.size(); ++i) {
    for (const std::uint32_t joint : {0u, 2u, firstDriven, firstDriven + 1, firstDriven + 2}) {
      const auto weightOf = [joint](const Influences& of) {
        const auto found = of.find(joint);
        return found != of.end() ? found->second : 0.0f;
      };
      EXPECT_NEAR(weightOf(bent[i]), weightOf(bent[i - 1]), 0.05f) << i << ' ' << joint;
    }
  }
}

TEST_F(BendChain, WhatIsNoChainIsRefused) {
  const float position[3]{};
  const std::uint32_t joint = 0;
  const float weight = 1;
  const InfluenceSet set{{&joint, 1, 4, ComponentType::uint32, 1}, attributeView(&weight, 1, 1)};
  MeshView mesh;
  mesh.vertexCount = 1;
  mesh.positions = attributeView(position, 1, 3);
  mesh.influenceSets = {&set, 1};
  const auto messageOf = [&](auto change) {
    const ChainDriver sound = chain_;
    change();
    const Result<RepairedMesh> bent = bendChain(mesh, joints_, chain_);
    chain_ = sound;
    return bent ? std::string() : bent.error().message;
  };
  EXPECT_EQ(messageOf([&] { chain_.segments = 1; }),
            "bendChain: a chain has 2 to 65536 segments, not 1");
  EXPECT_EQ(messageOf([&] { chain_.firstDriven = 5; }),
            "bendChain: the chain drives joints up to 7, which do not exist");
  EXPECT_EQ(messageOf([&] { chain_.joints = chain_.joints.first(1); }),
            "bendChain: a chain has at least two joints");
  EXPECT_EQ(messageOf([&] { chainJoints_[2] = 70; }), "bendChain: joint 70 does not exist");
  chainJoints_[2] = 2;
  EXPECT_EQ(messageOf([&] { chainJoints_[2] = 0; }),
            "bendChain: it turns back by 180 degrees at joint 1");
  chainJoints_[2] = 2;
  mesh.vertexCount = 0;
  EXPECT_EQ(bendChain(mesh, joints_, chain_).error().code, ErrorCode::invalidMesh);
}

}  // namespace
}  // namespace dermis::test
