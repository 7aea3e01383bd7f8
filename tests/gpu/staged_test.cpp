// Vertices that are stored 16 or 8 bytes at a time, or through workgroup memory, have the bits that
// they have without, and nothing beside them is touched.

#include <gtest/gtest.h>

#include <algorithm>
#include <initializer_list>

#include "exhaustive.h"
#include "intercepted_device.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

/// Meshes that end within a workgroup, at the end of one, and before the first is full.
struct StagedCrowd {
  std::vector<OwnedMesh> meshes{randomMesh(1, 331, 20, 4), randomMesh(2, 256, 20, 2),
                                randomMesh(3, 5, 20, 7)};
  std::vector<PackedMesh> packed;
  std::vector<std::vector<JointMatrix>> poses;
  std::vector<MorphWeight> morphs{{0, 0.5f}};
  std::vector<samples::SkinRequest> requests;

  explicit StagedCrowd(Method method) {
    for (OwnedMesh& mesh : meshes) {
      addTangents(mesh, 5);
      addMorphs(mesh, 6, 1);
      packed.push_back(*pack(mesh.view(), 20));
    }
    for (std::uint32_t i = 0; i < 30; ++i)
      poses.push_back(randomPose(i, 20, i % 4 == 0 ? Rigidity::shear : Rigidity::rigid));
    for (std::uint32_t i = 0; i < poses.size(); ++i) {
      requests.push_back({&packed[i % 3], poses[i],
                          i % 2 == 0 ? JointPromise::scaling : JointPromise::scaleIgnored, method});
      if (i % 5 == 0) requests.back().morphs = morphs;
    }
  }
};

class StagedTest : public DeviceTest {
 protected:
  Result<vulkan::Context> contextOf(vulkan::DeviceDescription description, bool staged) {
    description.texelBuffers = false;
    description.stagedStores = staged;
    return vulkan::Context::create(description);
  }
  Result<samples::BatchResult> run(vulkan::Context& context, const StagedCrowd& crowd,
                                   const samples::OutputLayout& layout, const Tuning& tuning) {
    samples::RunOptions options;
    options.output = layout;
    options.tuning = tuning;
    return samples::runBatch(device(), context, crowd.requests, options);
  }
  void expectSame(const samples::BatchResult& staged, const samples::BatchResult& plain) {
    EXPECT_EQ(staged.untouchedBytesChanged, 0u) << staged.firstChanged;
    ASSERT_EQ(staged.instances.size(), plain.instances.size());
    for (std::size_t i = 0; i < staged.instances.size(); ++i)
      EXPECT_EQ(staged.instances[i].streams, plain.instances[i].streams) << i;
  }
};

samples::OutputLayout layoutOf(VertexFormat positions, VertexFormat normals,
                               VertexFormat tangents) {
  samples::OutputLayout layout;
  layout.positions = positions;
  layout.normals = normals;
  layout.tangents = tangents;
  return layout;
}

// Records of 8, 12, 16, 24 and 32 bytes, at multiples of 16, 8 and 4 bytes; those of 12 begin
// anywhere within 16 bytes. Each once, and exhaustive_test has more of the same size.
TEST_F(StagedTest, EveryRecordHasTheSameBits) {
  using enum VertexFormat;
  Result<vulkan::Context> staged = contextOf(device().description(), true);
  Result<vulkan::Context> plain = contextOf(device().description(), false);
  ASSERT_TRUE(staged.ok() && plain.ok());
  ASSERT_TRUE(staged->limits().stagedStores);
  // By linear blending the first of them: each takes a pipeline and more.
  for (const Method method : {Method::linear, Method::dualQuaternion}) {
    const StagedCrowd crowd(method);
    int count = 0;
    for (samples::OutputLayout layout :
         {layoutOf(float32x3, none, none), layoutOf(float16x3, octahedral8x2, none),
          layoutOf(float16x4, octahedral16x2, octahedral16x2), layoutOf(float32x4, float32x4, none),
          layoutOf(float32x3, float32x3, none), layoutOf(float32x3, octahedral16x2, none),
          layoutOf(float32x3, octahedral8x2, octahedral8x2), layoutOf(float16x4, none, none)}) {
      if (!isExhaustive && ++count > 5) break;
      SCOPED_TRACE(std::string(methodName(method)) + ", " +
                   std::string(formatName(layout.positions)) + ", " +
                   std::string(formatName(layout.normals)) + ", " +
                   std::string(formatName(layout.tangents)));
      for (const std::uint32_t before : {0u, 4u, 8u}) {
        if (!isExhaustive && method == Method::linear && before != 0) break;
        // Vertices of 24 bytes begin at multiples of 8 bytes only.
        if (layout.normals == float32x3 && before == 4) continue;
        layout.before = before;
        const Result<samples::BatchResult> a = run(*staged, crowd, layout, {64, 4});
        const Result<samples::BatchResult> b = run(*plain, crowd, layout, {64, 4});
        ASSERT_TRUE(a.ok() && b.ok()) << (a ? b : a).error().message;
        expectSame(*a, *b);
      }
      if (method == Method::linear) break;
    }
  }
}

TEST_F(StagedTest, AnyTuningGivesTheSameBits) {
  const StagedCrowd crowd(Method::dualQuaternion);
  const samples::OutputLayout layout =
      layoutOf(VertexFormat::float32x3, VertexFormat::none, VertexFormat::none);
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    Result<vulkan::Context> staged = contextOf(device().description(), true);
    Result<vulkan::Context> plain = contextOf(device().description(), false);
    ASSERT_TRUE(staged.ok() && plain.ok());
    const Result<samples::BatchResult> expected = run(*plain, crowd, layout, {64, 4});
    ASSERT_TRUE(expected.ok());
    for (const Tuning& tuning : {Tuning{8, 1}, Tuning{32, 5, 1000}, Tuning{128, 32}}) {
      // One where other descriptors are all that is new.
      if (!isExhaustive && !pushDescriptors && tuning.workgroupSize != 32) continue;
      SCOPED_TRACE(tuning.workgroupSize);
      const Result<samples::BatchResult> result = run(*staged, crowd, layout, tuning);
      ASSERT_TRUE(result.ok());
      expectSame(*result, *expected);
    }
  }
}

// Instances are cut where a range ends: records begin at any word, and the last workgroup of one
// piece stands before the first of the next.
TEST_F(StagedTest, OutputInSeveralRangesHasTheSameBits) {
  const StagedCrowd crowd(Method::dualQuaternion);
  Result<vulkan::Context> plain = contextOf(device().description(), false);
  ASSERT_TRUE(plain.ok());
  InterceptedDevice small(device().description());
  small.changeLimits(
      [](VkPhysicalDeviceLimits& limits) { limits.maxStorageBufferRange = 68 << 10; });
  Result<vulkan::Context> staged = contextOf(small.description(), true);
  ASSERT_TRUE(staged.ok());
  for (const VertexFormat normals : {VertexFormat::octahedral16x2, VertexFormat::none}) {
    const samples::OutputLayout layout =
        layoutOf(VertexFormat::float32x3, normals, VertexFormat::none);
    const Result<samples::BatchResult> expected = run(*plain, crowd, layout, {64, 4});
    const Result<samples::BatchResult> result = run(*staged, crowd, layout, {64, 4});
    ASSERT_TRUE(expected.ok());
    ASSERT_TRUE(result.ok()) << result.error().message;
    EXPECT_GT(result->dispatches, expected->dispatches);
    expectSame(*result, *expected);
  }
}

}  // namespace
}  // namespace dermis::test
