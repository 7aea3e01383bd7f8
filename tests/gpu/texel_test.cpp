// Reading through uniform texel buffers and through storage buffers: the same bits.

#include <gtest/gtest.h>

#include <cmath>
#include <initializer_list>
#include <limits>

#include "batch_runner.h"
#include "intercepted_device.h"
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
  layouts[2].motion = Motion::reskinned;
  layouts[2].bounds = true;
  layouts[3].motion = Motion::kept;
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
      request.previousPose = poses[(i + 1) % poses.size()];
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
    const Result<samples::BatchResult> texels = runOn(context(), rigs.requests, layout);
    const Result<samples::BatchResult> storage = runOn(other, rigs.requests, layout);
    ASSERT_TRUE(texels.ok() && storage.ok());
    expectSame(*texels, *storage);
  }
};

TEST_F(TexelTest, BothPathsGiveTheSameBits) {
  ASSERT_TRUE(context().limits().texelBuffers);
  Result<vulkan::Context> storage = contextWithoutTexels();
  ASSERT_TRUE(storage.ok());
  for (const Method method : allMethods) {
    SCOPED_TRACE(methodName(method));
    const Rigs rigs(method, {4, 7});
    // Every method with the first layout and one of the others in turn.
    for (const std::size_t layout : {std::size_t{0}, 1 + std::size_t(method) % 3})
      expectSameOn(*storage, rigs, layouts()[layout]);
  }
}

TEST_F(TexelTest, BothPathsGiveTheSameBitsForEveryLayoutAndNumberOfInfluences) {
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    Result<vulkan::Context> storage = contextWithoutTexels();
    ASSERT_TRUE(storage.ok());
    const Rigs rigs(Method::dualQuaternion, {1, 2, 4, 7});
    for (const samples::OutputLayout& layout : layouts()) expectSameOn(*storage, rigs, layout);
  }
}

// Read as unsigned integers, NaNs are what they were; the sums that they get into need not be.
TEST_F(TexelTest, NaNsComeThroughBothPaths) {
  Result<vulkan::Context> storage = contextWithoutTexels();
  ASSERT_TRUE(storage.ok());
  for (const Method method : {Method::linear, Method::dualQuaternion}) {
    Rigs rigs(method, {4});
    rigs.poses[7][3].m[1][1] = std::numeric_limits<float>::quiet_NaN();
    const Result<samples::BatchResult> a = runOn(context(), rigs.requests, {});
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
