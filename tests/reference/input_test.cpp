// How the reference reads a mesh: formats, strides, sets, slots of weight 0, weights as they come.

#include <cstring>
#include <limits>

#include "reference_rig.h"

namespace dermis::test {
namespace {

/// An attribute of type T with `stride` bytes from element to element, at an odd address.
template <typename T>
class Interleaved {
 public:
  Interleaved(std::span<const T> values, std::uint32_t components, ComponentType type,
              std::uint32_t gap)
      : stride_(components * static_cast<std::uint32_t>(sizeof(T)) + gap),
        count_(static_cast<std::uint32_t>(values.size()) / components),
        components_(components),
        type_(type) {
    bytes_.assign(1 + std::size_t{count_} * stride_, 0xee);
    for (std::size_t element = 0; element < count_; ++element) {
      std::memcpy(&bytes_[1 + element * stride_], &values[element * components],
                  components * sizeof(T));
    }
    // Nothing behind the last element belongs to the mesh.
    bytes_.resize(bytes_.size() - gap);
  }
  AttributeView view() const { return {bytes_.data() + 1, count_, stride_, type_, components_}; }

 private:
  std::vector<unsigned char> bytes_;
  std::uint32_t stride_, count_, components_;
  ComponentType type_;
};

struct InputTest : public ::testing::Test {
  InputTest() {
    RigRandom random(1);
    for (int joint = 0; joint < 12; ++joint) {
      pose.push_back(jointOf(rotationAbout(random.direction(), random.between(-2, 2)) *
                                 diagonalMatrix(1, random.between(0.5, 2), 1),
                             random.vector(1)));
    }
    plain = scatteredMesh(random, 200, 12, 4);
    for (float& weight : plain.weights) {  // integers, so that each format can hold them
      weight = static_cast<float>(random.below(3) == 0 ? 0 : random.below(256));
    }
  }

  void expectAsPlain(const MeshView& mesh, double tolerance) {
    for (const Method method : allMethods) {
      const reference::AnalyzedMesh expected = skinned(plain, pose, method);
      const Result<reference::AnalyzedMesh> result = reference::analyze(mesh, pose, method);
      ASSERT_TRUE(result.ok()) << result.error().message;
      for (std::size_t vertex = 0; vertex < plain.vertexCount(); ++vertex) {
        expectNear(toVector(result->positions[vertex]), toVector(expected.positions[vertex]),
                   tolerance);
        expectNear(toVector(result->normals[vertex]), toVector(expected.normals[vertex]),
                   tolerance * 100);
      }
    }
  }

  template <typename Joint, typename Weight>
  void expectFormat(ComponentType jointType, ComponentType weightType, double unit) {
    for (const std::uint32_t gap : {0u, 3u, 5u}) {
      std::vector<Joint> joints;
      std::vector<Weight> weights;
      for (const std::uint32_t joint : plain.joints) joints.push_back(static_cast<Joint>(joint));
      for (const float weight : plain.weights) {
        weights.push_back(static_cast<Weight>(static_cast<double>(weight) * unit));
      }
      const Interleaved<float> positions(plain.positions, 3, ComponentType::float32, gap);
      const Interleaved<float> normals(plain.normals, 3, ComponentType::float32, gap);
      const Interleaved<Joint> jointAttribute(joints, 4, jointType, gap);
      const Interleaved<Weight> weightAttribute(weights, 4, weightType, gap);
      const InfluenceSet set{jointAttribute.view(), weightAttribute.view()};
      MeshView mesh = plain.view();
      mesh.positions = positions.view();
      mesh.normals = normals.view();
      mesh.influenceSets = {&set, 1};
      expectAsPlain(mesh, 1e-14 * 4);
    }
  }

  std::vector<JointMatrix> pose;
  OwnedMesh plain;
};

TEST_F(InputTest, JointsOf8BitsWeightsOf8Bits) {
  expectFormat<std::uint8_t, std::uint8_t>(ComponentType::uint8, ComponentType::unorm8, 1);
}
TEST_F(InputTest, JointsOf16BitsWeightsOf16Bits) {
  expectFormat<std::uint16_t, std::uint16_t>(ComponentType::uint16, ComponentType::unorm16, 257);
}
TEST_F(InputTest, JointsOf32BitsWeightsInFloat) {
  expectFormat<std::uint32_t, float>(ComponentType::uint32, ComponentType::float32, 1.0 / 256);
}
TEST_F(InputTest, JointsInFloatWeightsOf8Bits) {
  expectFormat<float, std::uint8_t>(ComponentType::float32, ComponentType::unorm8, 1);
}

TEST_F(InputTest, InfluencesMayBeSpreadOverSetsOfDifferentFormats) {
  // Slots 0 and 1 as unorm8 with 8-bit joints; 2 as unorm16; 3 as float: all parts of 255.
  std::vector<std::uint8_t> joints8, weights8;
  std::vector<std::uint16_t> joints16, weights16;
  std::vector<std::uint32_t> joints32;
  std::vector<float> weightsFloat;
  for (std::size_t vertex = 0; vertex < plain.vertexCount(); ++vertex) {
    const std::size_t slot = vertex * 4;
    for (const std::size_t i : {slot, slot + 1}) {
      joints8.push_back(static_cast<std::uint8_t>(plain.joints[i]));
      weights8.push_back(static_cast<std::uint8_t>(plain.weights[i]));
    }
    joints16.push_back(static_cast<std::uint16_t>(plain.joints[slot + 2]));
    weights16.push_back(static_cast<std::uint16_t>(plain.weights[slot + 2] * 257));
    joints32.push_back(plain.joints[slot + 3]);
    weightsFloat.push_back(plain.weights[slot + 3] / 255);
  }
  const auto count = plain.vertexCount();
  const InfluenceSet sets[] = {{{joints8.data(), count, 2, ComponentType::uint8, 2},
                                {weights8.data(), count, 2, ComponentType::unorm8, 2}},
                               {{joints32.data(), count, 4, ComponentType::uint32, 1},
                                {weightsFloat.data(), count, 4, ComponentType::float32, 1}},
                               {{joints16.data(), count, 2, ComponentType::uint16, 1},
                                {weights16.data(), count, 2, ComponentType::unorm16, 1}}};
  MeshView mesh = plain.view();
  mesh.influenceSets = sets;
  expectAsPlain(mesh, 2e-6);  // the quotients in float are rounded
}

TEST_F(InputTest, TheOrderOfSlotsDoesNotMatter) {
  OwnedMesh turned = plain;
  for (std::size_t vertex = 0; vertex < plain.vertexCount(); ++vertex) {
    for (std::size_t slot = 0; slot < 4; ++slot) {
      turned.joints[vertex * 4 + slot] = plain.joints[vertex * 4 + 3 - slot];
      turned.weights[vertex * 4 + slot] = plain.weights[vertex * 4 + 3 - slot];
    }
  }
  expectAsPlain(turned.view(), 0);
}

TEST_F(InputTest, AJointThatStandsTwiceHasTheSumOfItsWeights) {
  OwnedMesh twice = plain;
  twice.influencesPerVertex = 8;
  twice.joints.clear();
  twice.weights.clear();
  for (std::size_t slot = 0; slot < plain.joints.size(); ++slot) {
    for (const float part : {0.25f, 0.75f}) {
      twice.joints.push_back(plain.joints[slot]);
      twice.weights.push_back(plain.weights[slot] * part);
    }
  }
  expectAsPlain(twice.view(), 1e-15);
}

TEST_F(InputTest, Truth14_ASlotOfWeightZeroHasNoEffectInAnyBit) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  std::vector<JointMatrix> spoiled = pose;
  for (const float bad : {nan, infinity, -infinity, 1e38f}) {
    JointMatrix joint;
    for (auto& row : joint.m) {
      for (float& entry : row) entry = bad;
    }
    spoiled.push_back(joint);  // joints 12 to 15: no vertex uses them
  }
  const std::uint32_t anything[] = {12, 13, 14, 15, 16, 4096, 65535, 0xffffffffu};
  OwnedMesh padded = plain;
  padded.influencesPerVertex = 7;
  padded.joints.clear();
  padded.weights.clear();
  std::size_t next = 0;
  const auto addNothing = [&](float zero) {
    padded.joints.push_back(anything[next++ % 8]);
    padded.weights.push_back(zero);
  };
  for (std::size_t slot = 0; slot < plain.joints.size(); ++slot) {
    if (slot % 4 == 0) addNothing(0.0f);
    if (slot % 4 == 2) addNothing(-0.0f);
    const bool used = plain.weights[slot] != 0;
    padded.joints.push_back(used ? plain.joints[slot] : anything[next++ % 8]);
    padded.weights.push_back(plain.weights[slot]);
    if (slot % 4 == 3) addNothing(0.0f);
  }
  for (const Method method : allMethods) {
    const reference::AnalyzedMesh expected = skinned(plain, pose, method);
    const reference::AnalyzedMesh result = skinned(padded, spoiled, method);
    EXPECT_EQ(result.positions, expected.positions);
    EXPECT_EQ(result.normals, expected.normals);
    for (std::size_t vertex = 0; vertex < plain.vertexCount(); ++vertex) {
      EXPECT_EQ(result.conditioning[vertex].scale, expected.conditioning[vertex].scale);
      EXPECT_EQ(result.conditioning[vertex].degenerate, expected.conditioning[vertex].degenerate);
    }
  }
}

TEST_F(InputTest, Truth05_UnnormalizedWeightsAreNormalized) {
  OwnedMesh scaled = plain;
  for (float& weight : scaled.weights) weight *= 1024;
  expectAsPlain(scaled.view(), 0);
  for (float& weight : scaled.weights) weight *= std::ldexp(1.0f, -100);
  expectAsPlain(scaled.view(), 0);
}

TEST_F(InputTest, RefusesWhatPackRefuses) {
  const auto refused = [&](OwnedMesh mesh, std::string_view part) {
    for (const Method method : allMethods) {
      const Result<reference::AnalyzedMesh> result = reference::analyze(mesh.view(), pose, method);
      ASSERT_FALSE(result.ok());
      EXPECT_EQ(result.error().code, ErrorCode::invalidMesh);
      EXPECT_NE(result.error().message.find(part), std::string::npos) << result.error().message;
    }
  };
  OwnedMesh mesh = plain;
  mesh.joints[17 * 4] = 12;
  mesh.weights[17 * 4] = 1;
  refused(mesh, "vertex 17: joint 12 is outside the pose of 12 joints");
  mesh = plain;
  mesh.weights[3 * 4 + 1] = -1;
  refused(mesh, "vertex 3");
  mesh = plain;
  mesh.weights[3 * 4 + 1] = std::numeric_limits<float>::quiet_NaN();
  refused(mesh, "vertex 3");
  mesh = plain;
  mesh.positions[3 * 5] = std::numeric_limits<float>::infinity();
  refused(mesh, "vertex 5");
  refused(OwnedMesh{}, "no vertices");
}

}  // namespace
}  // namespace dermis::test
