// How attributes are rounded where they are stored: to the nearest, and exactly between two to the
// even one, bit for bit. The bounds of the accuracy contract would allow either.

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <limits>

#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"
#include "vertex_encoder.h"

namespace dermis::test {
namespace {

/// The number whose binary16 bits these are, for those that are finite.
float valueOf(std::uint32_t half) {
  const auto exponent = static_cast<int>(half >> 10 & 31);
  const auto mantissa = static_cast<float>(half & 1023);
  const float magnitude =
      exponent == 0 ? std::ldexp(mantissa, -24) : std::ldexp(1024 + mantissa, exponent - 25);
  return (half & 0x8000) != 0 ? -magnitude : magnitude;
}

/// Both neighbors of a float, and itself.
void addWithNeighbors(std::vector<float>& values, float value) {
  values.push_back(value);
  values.push_back(std::nextafter(value, -std::numeric_limits<float>::infinity()));
  values.push_back(std::nextafter(value, std::numeric_limits<float>::infinity()));
}

class RoundingTest : public DeviceTest {
 protected:
  /// The values as coordinates of positions that no joint moves, as a kernel stores them.
  std::vector<std::uint16_t> store(std::vector<float> values, VertexFormat format, const Box& box) {
    while (values.size() % 3 != 0) values.push_back(0);
    OwnedMesh mesh = randomMesh(1, static_cast<std::uint32_t>(values.size() / 3), 1, 1);
    mesh.positions = std::move(values);
    std::fill(mesh.weights.begin(), mesh.weights.end(), 0.0f);
    const Result<PackedMesh> packed = pack(mesh.view(), 1);
    EXPECT_TRUE(packed.ok());
    const std::vector<JointMatrix> pose(1);
    samples::SkinRequest request{&*packed, pose, JointPromise::scaling, Method::linear};
    request.box = box;
    samples::RunOptions options;
    options.output.positions = format;
    options.output.normals = VertexFormat::none;
    const Result<samples::BatchResult> result =
        samples::runBatch(device(), context(), {&request, 1}, options);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    if (!result) return {};
    const std::vector<std::byte>& bytes = result->instances[0].streams[0];
    std::vector<std::uint16_t> stored;
    for (std::size_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
      std::uint16_t components[4];
      std::memcpy(components, bytes.data() + vertex * sizeof(components), sizeof(components));
      stored.insert(stored.end(), components, components + 3);
    }
    return stored;
  }
};

// Between each two neighboring numbers, normal and subnormal, of either sign: the tie, and the
// floats on both sides of it, which are no ties.
TEST_F(RoundingTest, TiesOfHalvesGoToTheEvenOne) {
  std::vector<float> values;
  for (std::uint32_t half = 0; half < 0x7bff; ++half) {
    const float low = valueOf(half), high = valueOf(half + 1);
    const float tie = low + (high - low) / 2;
    ASSERT_EQ(double{tie} - double{low}, double{high} - double{tie});
    addWithNeighbors(values, half % 2 == 0 ? tie : -tie);
  }
  const std::vector<std::uint16_t> stored = store(values, VertexFormat::float16x4, {});
  ASSERT_GE(stored.size(), values.size());
  std::size_t wrong = 0, first = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (stored[i] == halfOf(double{values[i]})) continue;
    if (wrong++ == 0) first = i;
  }
  EXPECT_EQ(wrong, 0u) << "the first is " << values[first] << ", stored as " << stored[first];
  // That the encoder rounds to even is not taken on trust: each third value is a tie.
  for (std::size_t i = 0; i < values.size(); i += 3) ASSERT_EQ(stored[i] % 2, 0u) << values[i];
}

TEST_F(RoundingTest, HalvesBecomeInfiniteFromHalfAStepAboveTheLargest) {
  std::vector<float> values;
  addWithNeighbors(values, 65520);
  addWithNeighbors(values, -65520);
  const std::vector<std::uint16_t> stored = store(values, VertexFormat::float16x4, {});
  const std::vector<std::uint16_t> expected{0x7c00, 0x7bff, 0x7c00, 0xfc00, 0xfc00, 0xfbff};
  EXPECT_EQ(stored, expected);
}

// Of the size of a box with a side of 2 · 32767, a step of snorm16 is 1: halves are ties.
TEST_F(RoundingTest, TiesOfSnormGoToTheEvenOne) {
  if (context().limits().maxStorageBuffersPerStage < storageBuffersWanted)
    GTEST_SKIP() << "the device has too few storage buffers for snorm16 positions";
  constexpr float half = 32767;
  std::vector<float> values;
  std::vector<int> expected;
  for (int step = -32767; step < 32767; step += 7) {
    const float tie = static_cast<float>(step) + 0.5f;
    // What the kernel divides by has a rounding of its own: only ties that it leaves ties count.
    const float relative = tie * (1 / half);
    if (relative * half != tie) continue;
    values.push_back(tie);
    expected.push_back(static_cast<int>(std::nearbyint(tie)));
  }
  ASSERT_GT(values.size(), 1000u);
  const std::vector<std::uint16_t> stored =
      store(values, VertexFormat::snorm16x4, {{-half, -half, -half}, {half, half, half}});
  for (std::size_t i = 0; i < values.size(); ++i)
    ASSERT_EQ(static_cast<std::int16_t>(stored[i]), expected[i]) << values[i];
}

}  // namespace
}  // namespace dermis::test
