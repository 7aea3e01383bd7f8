// The bits of the CPU path, and of poses from clips and rigs, are the same on every processor:
// those that were recorded here, on x86-64 and on arm64. What goes in is made without a
// mathematical library, which may round as it likes.

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "dermis/cpu.h"
#include "dermis/mesh.h"
#include "played_clips.h"
#include "rigged.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t vertexCount = 403, jointCount = 21, instanceCount = 5;

/// Numbers from -1 to 1 (Steele and Vigna 2021: a linear congruential generator).
class Numbers {
 public:
  float next() {
    state_ = state_ * 0xd1342543de82ef95u + 1;
    return static_cast<float>(static_cast<std::int32_t>(state_ >> 32) >> 8) * 0x1p-23f;
  }
  std::uint32_t below(std::uint32_t count) {
    state_ = state_ * 0xd1342543de82ef95u + 1;
    return static_cast<std::uint32_t>(state_ >> 33) % count;
  }

 private:
  std::uint64_t state_ = 1;
};

/// Everything that a method or a layout may want.
PackedMesh mesh(Numbers& numbers) {
  std::vector<float> positions, normals, tangents, centers, weights, shares, strengths;
  std::vector<std::uint32_t> joints;
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    for (int axis = 0; axis < 3; ++axis) {
      positions.push_back(numbers.next());
      normals.push_back(numbers.next());
      tangents.push_back(numbers.next());
      centers.push_back(numbers.next());
    }
    tangents.push_back(vertex % 2 == 0 ? 1.0f : -1.0f);
    const std::uint32_t used = vertex % 5;  // some have no influence
    for (std::uint32_t slot = 0; slot < 4; ++slot) {
      joints.push_back((vertex / 20 + slot * 3) % jointCount);
      weights.push_back(slot < used ? std::abs(numbers.next()) + 0.01f : 0.0f);
    }
    shares.push_back(std::abs(numbers.next()));
    strengths.push_back(std::abs(numbers.next()));
  }
  InfluenceSet set;
  set.joints = {joints.data(), vertexCount, 16, ComponentType::uint32, 4};
  set.weights = attributeView(weights.data(), vertexCount, 4);
  MeshView view;
  view.vertexCount = vertexCount;
  view.positions = attributeView(positions.data(), vertexCount, 3);
  view.normals = attributeView(normals.data(), vertexCount, 3);
  view.tangents = attributeView(tangents.data(), vertexCount, 4);
  view.centersOfRotation = attributeView(centers.data(), vertexCount, 3);
  view.dualQuaternionWeights = attributeView(shares.data(), vertexCount, 1);
  view.bulgeStrengths = attributeView(strengths.data(), vertexCount, 1);
  view.influenceSets = {&set, 1};
  return pack(view, jointCount).value();
}

/// Rigid, or with any 3×3 part.
std::vector<JointMatrix> pose(Numbers& numbers, bool scales) {
  std::vector<JointMatrix> joints(jointCount);
  for (JointMatrix& joint : joints) {
    double q[4], square = 0;
    for (double& component : q) {
      component = static_cast<double>(numbers.next());
      square += component * component;
    }
    for (double& component : q) component /= std::sqrt(square);
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                            {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                            {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        joint.m[row][column] = scales ? numbers.next() : static_cast<float>(r[row][column]);
      joint.m[row][3] = numbers.next();
    }
  }
  return joints;
}

/// FNV-1a.
std::uint64_t hashOf(const std::vector<std::byte>& bytes, std::uint64_t hash) {
  for (const std::byte byte : bytes)
    hash = (hash ^ std::to_integer<std::uint64_t>(byte)) * 0x100000001b3u;
  return hash;
}

std::uint64_t hashOfMethod(Method method) {
  using enum VertexFormat;
  Numbers numbers;
  const cpu::Mesh made = cpu::Mesh::create(mesh(numbers)).value();
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const VertexLayout& layout :
       {VertexLayout{.normals = float32x3},
        {.normals = float32x3, .tangents = float32x4, .motion = true},
        {.positions = snorm16x4, .normals = octahedral8x2, .tangents = octahedral16x2},
        {.positions = float16x4, .normals = snorm8x4, .tangents = snorm16x4}}) {
    for (const bool scales : {false, true}) {
      cpu::Job job;
      job.mesh = &made;
      job.method = method;
      job.places = placeVertices(layout, vertexCount).value();
      std::vector<std::byte> output(job.places.size * instanceCount);
      std::vector<std::vector<JointMatrix>> poses;
      std::vector<cpu::Instance> instances(instanceCount);
      for (std::size_t i = 0; i < instanceCount; ++i) {
        poses.push_back(pose(numbers, scales && i != 2));
        instances[i].pose = poses[i];
        instances[i].output.fill(output.data() + job.places.size * i);
        instances[i].box = {{-3, -3, -3}, {3, 3, 3}};
        instances[i].restartsMotion = layout.motion;
      }
      job.instances = instances;
      EXPECT_TRUE(cpu::skin(job).ok());
      hash = hashOf(output, hash);
    }
  }
  return hash;
}

TEST(CpuProcessorTest, BitsAreThoseThatWereRecorded) {
  for (const std::string_view target : cpu::targetNames()) {
    SCOPED_TRACE(target);
    ASSERT_TRUE(cpu::setTarget(target).ok());
    EXPECT_EQ(hashOfMethod(Method::linear), 0xc78f89eff9154d4fu);
    EXPECT_EQ(hashOfMethod(Method::dualQuaternion), 0xf7dba9cbcd0d651u);
    EXPECT_EQ(hashOfMethod(Method::blended), 0x43fe59c02544f8b2u);
    EXPECT_EQ(hashOfMethod(Method::centerOfRotation), 0xc24801d93c2c8c61u);
    EXPECT_EQ(hashOfMethod(Method::bulgeControlled), 0x25159bb4c2ae5193u);
  }
  EXPECT_TRUE(cpu::setTarget({}).ok());
}

template <typename Number>
std::uint64_t hashOf(std::span<const Number> numbers, std::uint64_t hash) {
  const std::span<const std::byte> bytes = std::as_bytes(numbers);
  return hashOf(std::vector<std::byte>(bytes.begin(), bytes.end()), hash);
}

TEST(CpuProcessorTest, PosesOfClipsHaveTheBitsThatWereRecorded) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (std::uint32_t play = 0; play < playCount; ++play) {
    for (std::uint32_t skin = 0; skin < playedClips().skinCount(); ++skin)
      hash = hashOf(std::span<const JointMatrix>(playedPose(play, skin)), hash);
  }
  EXPECT_EQ(hashOf(playedClips().bytes(), 0xcbf29ce484222325u), 0x1a6de4d4f063391eu);
  EXPECT_EQ(hash, 0xf68ce5ea81661f64u);
}

TEST(CpuProcessorTest, WhatRigsDriveHasTheBitsThatWereRecorded) {
  Numbers numbers;
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (int count = 0; count < 20; ++count) {
    const std::vector<JointMatrix> written = pose(numbers, count % 2 != 0);
    const Driven driven = evaluated(smallRig(), std::span(written).first(smallWritten), {});
    hash = hashOf(std::span<const JointMatrix>(driven.joints), hash);
  }
  EXPECT_EQ(hash, 0x5614b89a653204a4u);
}

}  // namespace
}  // namespace dermis::test
