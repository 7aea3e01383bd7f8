// Reading through uniform texel buffers and through storage buffers, stores of one word, of two and
// of whole vertices, records that are read and records that are counted up: the same bits.

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>
#include <optional>
#include <utility>

#include "exhaustive.h"
#include "intercepted_device.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

std::vector<samples::OutputLayout> layouts() {
  using enum VertexFormat;
  std::vector<samples::OutputLayout> layouts(4);
  layouts[1].positions = float16x4;
  layouts[1].normals = octahedral16x2;
  layouts[1].tangents = snorm8x4;
  layouts[1].arrangement = samples::Arrangement::separate;
  layouts[2].positions = snorm16x4;
  layouts[2].tangents = float32x4;
  layouts[2].motion = true;
  layouts[2].bounds = true;
  layouts[3].motion = true;
  layouts[3].normals = none;
  layouts[3].arrangement = samples::Arrangement::planar;
  return layouts;
}

struct Rigs {
  std::vector<OwnedMesh> meshes;
  std::vector<PackedMesh> packed;
  std::vector<std::vector<JointMatrix>> poses;
  std::vector<MorphWeight> morphs{{0, 0.5f}, {2, -0.25f}};
  std::vector<samples::SkinRequest> requests;

  /// Meshes of these numbers of influences; poses of every kind.
  Rigs(Method method, std::initializer_list<std::uint32_t> classes) {
    for (const std::uint32_t influences : classes) {
      meshes.push_back(randomMesh(influences, 300 + influences, 20, influences));
      addTangents(meshes.back(), 5);
      addMorphs(meshes.back(), 6, 3);
    }
    for (OwnedMesh& mesh : meshes) packed.push_back(*pack(mesh.view(), 20));
    for (std::uint32_t i = 0; i < 24; ++i)
      poses.push_back(randomPose(i, 20, i % 3 == 0 ? Rigidity::shear : Rigidity::rigid));
    for (std::uint32_t i = 0; i < poses.size(); ++i) {
      samples::SkinRequest& request = requests.emplace_back();
      request.mesh = &packed[i % packed.size()];
      request.pose = poses[i];
      request.method = method;
      request.box = {{-4, -4, -4}, {4, 4, 4}};
      if (i % 2 == 0) request.morphs = morphs;
    }
  }
};

void expectSame(const samples::BatchResult& a, const samples::BatchResult& b) {
  ASSERT_EQ(a.instances.size(), b.instances.size());
  for (std::size_t i = 0; i < a.instances.size(); ++i)
    EXPECT_EQ(a.instances[i].streams, b.instances[i].streams) << "instance " << i;
}

class TexelTest : public DeviceTest {
 protected:
  void SetUp() override {
    DeviceTest::SetUp();
    if (device_ == nullptr) return;
    useTexels();
    if (!texels_->limits().texelBuffers) GTEST_SKIP() << "the device has too few texels";
  }
  void TearDown() override {
    texels_.reset();
    DeviceTest::TearDown();
  }
  void useTexels() {
    vulkan::DeviceDescription description = device().description();
    description.texelBuffers = true;
    Result<vulkan::Context> made = vulkan::Context::create(description);
    ASSERT_TRUE(made.ok());
    texels_.emplace(std::move(*made));
  }
  Result<samples::BatchResult> runOn(vulkan::Context& context,
                                     std::span<const samples::SkinRequest> requests,
                                     const samples::OutputLayout& output) {
    samples::RunOptions options;
    options.output = output;
    options.tuning = context.tuning();
    return samples::runBatch(device(), context, requests, options);
  }
  Result<vulkan::Context> contextWithoutTexels() {
    vulkan::DeviceDescription description = device().description();
    description.texelBuffers = false;
    return vulkan::Context::create(description);
  }
  void expectSameOn(vulkan::Context& other, const Rigs& rigs, const samples::OutputLayout& layout) {
    const Result<samples::BatchResult> texels = runOn(*texels_, rigs.requests, layout);
    const Result<samples::BatchResult> storage = runOn(other, rigs.requests, layout);
    ASSERT_TRUE(texels.ok() && storage.ok());
    expectSame(*texels, *storage);
  }

  std::optional<vulkan::Context> texels_;  ///< reads through them, whatever the device's default
};

TEST_F(TexelTest, BothPathsGiveTheSameBits) {
  Result<vulkan::Context> storage = contextWithoutTexels();
  ASSERT_TRUE(storage.ok());
  for (const Method method : allMethods) {
    SCOPED_TRACE(methodName(method));
    const Rigs rigs(method, {4, 7});
    for (std::size_t layout = 0; layout < layouts().size(); ++layout) {
      // Every method with one of the layouts in turn.
      if (isExhaustive || layout == std::size_t(method) % layouts().size())
        expectSameOn(*storage, rigs, layouts()[layout]);
    }
  }
}

TEST_F(TexelTest, BothPathsGiveTheSameBitsForEveryLayoutAndNumberOfInfluences) {
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    useTexels();
    Result<vulkan::Context> storage = contextWithoutTexels();
    ASSERT_TRUE(storage.ok());
    const Rigs rigs(Method::dualQuaternion, {1, 2, 4, 7});
    for (const samples::OutputLayout& layout : layouts()) {
      // Other descriptors make a difference only where there are more buffers.
      if (isExhaustive || pushDescriptors || layout.bounds ||
          layout.arrangement == samples::Arrangement::separate)
        expectSameOn(*storage, rigs, layout);
    }
  }
}

// Stores of all of a vertex or of an attribute, against stores of words, by a device
// without scalarBlockLayout.
TEST_F(TexelTest, StoresOfAnyWidthGiveTheSameBits) {
  using enum VertexFormat;
  struct Case {
    VertexFormat positions, normals, tangents;
    bool motion = false;
  };
  Rigs rigs(Method::dualQuaternion, {4});
  for (samples::SkinRequest& request : rigs.requests) {
    request.promise = JointPromise::scaleIgnored;
    request.morphs = {};
  }
  VkPhysicalDeviceFeatures2 integers{};
  integers.sType = VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2;
  integers.features.shaderInt64 = VK_TRUE;
  vulkan::DeviceDescription description = device().description();
  description.texelBuffers = true;
  description.enabledFeatures = &integers;
  Result<vulkan::Context> narrow = vulkan::Context::create(description);
  ASSERT_TRUE(narrow.ok());
  ASSERT_FALSE(narrow->limits().texelBuffers);
  for (const Case& formats :
       {Case{float32x3, float32x3, none}, Case{float32x3, octahedral16x2, none},
        Case{float16x4, octahedral16x2, none}, Case{snorm16x4, snorm8x4, snorm8x4},
        Case{float32x4, float32x4, none}, Case{float32x4, float32x4, float32x4},
        Case{float32x3, float32x3, none, true}, Case{float16x4, none, none},
        Case{float16x3, octahedral8x2, none}, Case{float16x3, octahedral8x2, octahedral16x2},
        Case{snorm16x3, octahedral8x2, none}, Case{float16x3, snorm16x3, octahedral16x2},
        Case{float32x3, octahedral8x2, octahedral8x2, true},
        Case{float16x3, float16x4, octahedral8x2}}) {
    samples::OutputLayout layout;
    layout.positions = formats.positions;
    layout.normals = formats.normals;
    layout.tangents = formats.tangents;
    layout.motion = formats.motion;
    expectSameOn(*narrow, rigs, layout);
  }
}

// Poses in the order of their instances are evenly spaced in the palettes, others are not; some
// scale, which other loops skin.
TEST_F(TexelTest, EvenlySpacedInstancesGetTheSameBits) {
  for (const Method method : {Method::linear, Method::dualQuaternion}) {
    Rigs even(method, {4});
    for (const bool scales : {true, false}) {
      for (samples::SkinRequest& request : even.requests) {
        request.promise = scales ? JointPromise::scaling : JointPromise::scaleIgnored;
        request.morphs = {};
      }
      // The second has extensions, and previous poses.
      for (const samples::OutputLayout& layout : {samples::OutputLayout{}, layouts()[2]}) {
        if (layout.bounds && method == Method::linear) continue;
        const Result<samples::BatchResult> together = runOn(*texels_, even.requests, layout);
        ASSERT_TRUE(together.ok());
        for (std::size_t i = 0; i < even.requests.size(); i += 5) {
          const Result<samples::BatchResult> alone =
              runOn(*texels_, std::span(even.requests).subspan(i, 1), layout);
          ASSERT_TRUE(alone.ok());
          EXPECT_EQ(together->instances[i].streams, alone->instances[0].streams) << i;
        }
        // Some of them again, in an order without an even step.
        std::vector<samples::SkinRequest> mixed;
        std::vector<std::size_t> order{3, 0, 7, 7, 20, 1, 2, 4, 23, 22, 5};
        for (const std::size_t i : order) mixed.push_back(even.requests[i]);
        const Result<samples::BatchResult> others = runOn(*texels_, mixed, layout);
        ASSERT_TRUE(others.ok());
        for (std::size_t i = 0; i < order.size(); ++i)
          EXPECT_EQ(others->instances[i].streams, together->instances[order[i]].streams) << i;
      }
    }
  }
}

// Where no joint scales, the promise changes nothing: directions are scaled by powers of two.
TEST_F(TexelTest, LinearDirectionsHaveTheSameBitsWhetherJointsMayScaleOrNot) {
  Rigs rigs(Method::linear, {1, 4, 7});
  samples::OutputLayout layout;
  layout.tangents = VertexFormat::float32x4;
  const Result<samples::BatchResult> may = runOn(*texels_, rigs.requests, layout);
  for (samples::SkinRequest& request : rigs.requests) request.promise = JointPromise::scaleIgnored;
  const Result<samples::BatchResult> mayNot = runOn(*texels_, rigs.requests, layout);
  ASSERT_TRUE(may.ok() && mayNot.ok());
  expectSame(*may, *mayNot);
}

// Read as unsigned integers, NaNs are what they were; the sums that they get into need not be.
TEST_F(TexelTest, NaNsComeThroughBothPaths) {
  Result<vulkan::Context> storage = contextWithoutTexels();
  ASSERT_TRUE(storage.ok());
  for (const Method method : {Method::linear, Method::dualQuaternion}) {
    Rigs rigs(method, {4});
    rigs.poses[7][3].m[1][1] = std::numeric_limits<float>::quiet_NaN();
    const Result<samples::BatchResult> a = runOn(*texels_, rigs.requests, {});
    const Result<samples::BatchResult> b = runOn(*storage, rigs.requests, {});
    ASSERT_TRUE(a.ok() && b.ok());
    std::size_t count = 0;
    for (std::size_t i = 0; i < rigs.requests.size(); ++i) {
      const std::vector<float>& left = a->instances[i].positions;
      const std::vector<float>& right = b->instances[i].positions;
      ASSERT_EQ(left.size(), right.size());
      for (std::size_t place = 0; place < left.size(); ++place) {
        if (std::isnan(left[place])) ++count;
        EXPECT_TRUE(left[place] == right[place] ||
                    (std::isnan(left[place]) && std::isnan(right[place])));
      }
    }
    EXPECT_GT(count, 0u);
  }
}

}  // namespace
}  // namespace dermis::test
