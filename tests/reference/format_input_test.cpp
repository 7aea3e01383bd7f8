// Every type that an attribute of a mesh may have: the reference reads what the type's definition
// says, and knows what float32 makes of it.

#include <cstring>
#include <string>
#include <utility>

#include "reference_rig.h"
#include "vertex_encoder.h"

namespace dermis::test {
namespace {

constexpr double u = 1.0 / 16777216.0;  // 2^-24

/// Elements of small integers as bytes, with a gap behind each.
struct Elements {
  std::vector<unsigned char> bytes;
  AttributeView view;
};

/// `values` hold the bits of each component.
Elements elementsOf(std::span<const int> values, std::uint32_t components, ComponentType type,
                    std::uint32_t gap) {
  Elements elements;
  const std::uint32_t size = componentSize(type);
  elements.bytes.push_back(0xee);  // an odd address
  for (std::size_t i = 0; i < values.size(); ++i) {
    appendBits(elements.bytes, static_cast<std::uint32_t>(values[i]), size);
    const bool last = i + 1 == values.size();
    if (i % components == components - 1 && !last) {
      elements.bytes.insert(elements.bytes.end(), gap, 0xee);
    }
  }
  elements.view = {elements.bytes.data() + 1,
                   static_cast<std::uint32_t>(values.size() / components), components * size + gap,
                   type, components};
  return elements;
}

/// What the bits of one component stand for.
struct Stored {
  int bits;
  double value;
};

const std::vector<Stored> halfValues{{0x3c00, 1},       {0xc100, -2.5}, {0x0001, 0x1p-24},
                                     {0x7bff, 65504},   {0x8000, 0},    {0x3555, 1365.0 / 4096},
                                     {0x8400, -0x1p-14}};
const std::vector<Stored> snorm8Values{{127, 1}, {-127, -1},     {-128, -1},
                                       {0, 0},   {5, 5 / 127.0}, {-64, -64 / 127.0}};
const std::vector<Stored> snorm16Values{
    {32767, 1}, {-32767, -1}, {-32768, -1}, {0, 0}, {12345, 12345 / 32767.0}, {-2, -2 / 32767.0}};
const std::vector<Stored> unorm16Values{
    {65535, 1}, {0, 0}, {32768, 32768 / 65535.0}, {1, 1 / 65535.0}};

struct FormatInputTest : public ::testing::Test {
  /// One vertex a triple of values, without weight: it comes out as it was read.
  MeshView freeMesh(std::size_t vertices) {
    mesh = {};
    mesh.vertexCount = static_cast<std::uint32_t>(vertices);
    zeroPositions.assign(3 * vertices, 0.0f);
    joints.assign(vertices, 0);
    weights.assign(vertices, 0.0f);
    mesh.positions = attributeView(zeroPositions.data(), mesh.vertexCount, 3);
    set.joints = {joints.data(), mesh.vertexCount, 4, ComponentType::uint32, 1};
    set.weights = attributeView(weights.data(), mesh.vertexCount, 1);
    mesh.influenceSets = {&set, 1};
    return mesh;
  }

  /// Every three values that follow each other, as a vertex of `components`; the fourth is 99.
  static std::vector<int> windows(const std::vector<Stored>& values, std::uint32_t components) {
    std::vector<int> bits;
    for (std::size_t first = 0; first < values.size(); ++first) {
      for (std::size_t i = 0; i < components; ++i) {
        bits.push_back(i == 3 ? 99 : values[(first + i) % values.size()].bits);
      }
    }
    return bits;
  }
  static glm::dvec3 window(const std::vector<Stored>& values, std::size_t first) {
    return {values[first].value, values[(first + 1) % values.size()].value,
            values[(first + 2) % values.size()].value};
  }

  reference::AnalyzedMesh skinnedFree(const MeshView& view) {
    return skinned(view, std::array{JointMatrix{}}, Method::dualQuaternion);
  }

  void expectPositions(const std::vector<Stored>& values, ComponentType type) {
    for (const std::uint32_t components : {3u, 4u}) {
      for (const std::uint32_t gap : {0u, 1u, 5u}) {
        const Elements elements = elementsOf(windows(values, components), components, type, gap);
        MeshView view = freeMesh(values.size());
        view.positions = elements.view;
        const reference::AnalyzedMesh plain = skinnedFree(view);
        view.positionScale = {0.5f, 3, -7.25f};
        view.positionOffset = {100, -0.75f, 0};
        const reference::AnalyzedMesh scaled = skinnedFree(view);
        ASSERT_EQ(plain.positions.size(), values.size());
        for (std::size_t vertex = 0; vertex < values.size(); ++vertex) {
          const glm::dvec3 expected = window(values, vertex);
          EXPECT_EQ(toVector(plain.positions[vertex]), expected);
          expectNear(toVector(scaled.positions[vertex]),
                     expected * glm::dvec3(0.5, 3, -7.25) + glm::dvec3(100, -0.75, 0), 1e-10);
        }
      }
    }
  }

  void expectDirections(const std::vector<Stored>& values, ComponentType type) {
    for (const std::uint32_t components : {3u, 4u}) {
      const Elements elements = elementsOf(windows(values, components), components, type, 3);
      MeshView view = freeMesh(values.size());
      view.normals = elements.view;
      if (components == 4) view.tangents = elements.view;
      const reference::AnalyzedMesh result = skinnedFree(view);
      for (std::size_t vertex = 0; vertex < values.size(); ++vertex) {
        const glm::dvec3 expected = glm::normalize(window(values, vertex));
        expectNear(toVector(result.normals[vertex]), expected, 1e-15);
        if (components == 3) continue;
        const reference::Double4& t = result.tangents[vertex];
        expectNear({t[0], t[1], t[2]}, expected, 1e-15);
        EXPECT_EQ(t[3], 1);
      }
    }
  }

  MeshView mesh;
  std::vector<float> zeroPositions, weights;
  std::vector<std::uint32_t> joints;
  InfluenceSet set;
};

TEST_F(FormatInputTest, PositionsInFloat16) {
  expectPositions(halfValues, ComponentType::float16);
}
TEST_F(FormatInputTest, PositionsInSnorm16) {
  expectPositions(snorm16Values, ComponentType::snorm16);
}
TEST_F(FormatInputTest, PositionsInUnorm16) {
  expectPositions(unorm16Values, ComponentType::unorm16);
}
TEST_F(FormatInputTest, DirectionsInFloat16) {
  expectDirections(halfValues, ComponentType::float16);
}
TEST_F(FormatInputTest, DirectionsInSnorm8) {
  expectDirections(snorm8Values, ComponentType::snorm8);
}
TEST_F(FormatInputTest, DirectionsInSnorm16) {
  expectDirections(snorm16Values, ComponentType::snorm16);
}

TEST_F(FormatInputTest, AFourthComponentOfFloatsIsNotRead) {
  const std::array values{1.0f, 2.0f, 3.0f, 77.0f, 4.0f, 5.0f, 6.0f, 88.0f};
  MeshView view = freeMesh(2);
  view.positions = view.normals = attributeView(values.data(), 2, 4);
  const reference::AnalyzedMesh result = skinnedFree(view);
  EXPECT_EQ(result.positions[1], (reference::Double3{4, 5, 6}));
  expectNear(toVector(result.normals[1]), glm::normalize(glm::dvec3(4, 5, 6)), 1e-15);
}

// Negative or not, whatever else it is.
TEST_F(FormatInputTest, HandednessOfEveryType) {
  const auto handedness = [&](ComponentType type, std::initializer_list<int> fourth) {
    std::vector<int> bits;
    for (const int w : fourth) {
      for (const int component : {1, 0, 0, w}) bits.push_back(component);
    }
    const Elements elements = elementsOf(bits, 4, type, 0);
    MeshView view = freeMesh(fourth.size());
    view.tangents = elements.view;
    std::vector<double> signs;
    for (const reference::Double4& tangent : skinnedFree(view).tangents) {
      signs.push_back(tangent[3]);
    }
    return signs;
  };
  const std::vector<double> expected{1, -1, 1, -1};
  EXPECT_EQ(handedness(ComponentType::snorm8, {127, -127, 0, -1}), expected);
  EXPECT_EQ(handedness(ComponentType::snorm16, {3, -32768, 0, -1}), expected);
  EXPECT_EQ(handedness(ComponentType::float16, {0x3c00, 0xbc00, 0x8000, 0x8001}), expected);
  const auto floatBits = [](float value) {
    int bits;
    std::memcpy(&bits, &value, sizeof(bits));
    return bits;
  };
  EXPECT_EQ(handedness(ComponentType::float32,
                       {floatBits(0.1f), floatBits(-1.0f), floatBits(-0.0f), floatBits(-1e-30f)}),
            expected);
}

TEST_F(FormatInputTest, OnlyWhatIsNoFloat32IsRounded) {
  MeshView view = freeMesh(2);
  const auto conditioning = [&](std::size_t vertex) {
    return skinnedFree(view).conditioning[vertex];
  };
  const std::array floats{0.1f, -0.7f, 1e30f, 3.0f, 0.3f, 0.1f};
  view.positions = view.normals = attributeView(floats.data(), 2, 3);
  EXPECT_EQ(conditioning(0).positionRounding, 0);
  EXPECT_EQ(conditioning(0).normalRounding, 0);
  const Elements halves = elementsOf(std::vector<int>{0x3c01, 0x0001, 0x7bff, 0x1234, 0, 0}, 3,
                                     ComponentType::float16, 0);
  view.positions = view.normals = halves.view;
  EXPECT_EQ(conditioning(0).positionRounding, 0) << "every half is a float32";
  view.positionScale = {1, 1, 0.1f};
  EXPECT_NEAR(conditioning(0).positionRounding,
              glm::length(toVector(skinnedFree(view).positions[0])), 1e-10);
  EXPECT_EQ(conditioning(0).normalRounding, 0) << "the scale is that of positions";
  view.positionScale = {1, 1, 1};
  view.positionOffset = {0, 1e-9f, 0};
  EXPECT_GT(conditioning(0).positionRounding, 65504);
  view.positionOffset = {0, 0, 0};

  const Elements snorm =
      elementsOf(std::vector<int>{1, 0, 0, 32767, 0, -32768}, 3, ComponentType::snorm16, 0);
  view.positions = view.normals = snorm.view;
  EXPECT_DOUBLE_EQ(conditioning(0).positionRounding, 1 / 32767.0);
  EXPECT_DOUBLE_EQ(conditioning(0).normalRounding, 1) << "relative";
  EXPECT_EQ(conditioning(1).positionRounding, 0);
  EXPECT_EQ(conditioning(1).normalRounding, 0);
}

// pack stores the nearest float32: what it loses must be inside what the reference allows for.
TEST_F(FormatInputTest, RoundingToFloat32IsInsideWhatIsAllowedFor) {
  RigRandom random(1);
  std::vector<int> bits;
  for (int i = 0; i < 3 * 20000; ++i) bits.push_back(static_cast<int>(random.below(65536)));
  const Elements elements = elementsOf(bits, 3, ComponentType::unorm16, 0);
  MeshView view = freeMesh(20000);
  view.positions = elements.view;
  view.positionScale = {1.7f, 0.03f, 9.1f};
  view.positionOffset = {-0.2f, 5.5f, -4.4f};
  const reference::AnalyzedMesh result = skinnedFree(view);
  double worst = 0;
  for (std::size_t vertex = 0; vertex < 20000; ++vertex) {
    const glm::dvec3 p = toVector(result.positions[vertex]);
    const double error = glm::length(glm::dvec3(glm::vec3(p)) - p);
    worst = std::max(worst, error / (u * result.conditioning[vertex].positionRounding));
  }
  EXPECT_LE(worst, 1);
  EXPECT_GT(worst, 0.7);
}

}  // namespace
}  // namespace dermis::test
