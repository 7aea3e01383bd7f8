// One wrong byte in what the device wrote, of every kind that `verifyBatch` says it checks: each is
// found, alone, and said to be where it is.

#include "wrong_bytes.h"

#include <dlfcn.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <cstring>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "kit/device.h"
#include "kit/verification_product.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t vertexCount = 40, jointCount = 6;
constexpr std::size_t instanceCount = 3;

/// A device behind the layer, and what the layer is to do.
class WrongBytesTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    setenv("VK_LAYER_PATH", DERMIS_LAYER_FOLDER, 1);
    setenv("VK_INSTANCE_LAYERS", wrongBytesLayer, 1);
    samples::DeviceOptions options = testDeviceOptions();
    options.validation = false;
    Result<samples::OpenDevice> open = samples::openDevice(options);
    unsetenv("VK_LAYER_PATH");
    unsetenv("VK_INSTANCE_LAYERS");
    if (open) {
      open_ = std::make_unique<samples::OpenDevice>(std::move(*open));
    } else {
      why_ = open.error().message;
    }
    void* library = dlopen(DERMIS_LAYER, RTLD_NOW);
    ASSERT_NE(library, nullptr) << dlerror();
    setAfterWait_ = reinterpret_cast<SetAfterWait>(dlsym(library, setAfterWaitSymbol));
    ASSERT_NE(setAfterWait_, nullptr);
  }
  static void TearDownTestSuite() { open_.reset(); }

  void SetUp() override {
    if (open_ == nullptr) {
      ASSERT_FALSE(isContinuousIntegration()) << why_;
      GTEST_SKIP() << why_;
    }
    mesh_ = randomMesh(1, vertexCount, jointCount, 4);
    addTangents(mesh_, 2);
    Result<PackedMesh> packed = pack(mesh_.view(), jointCount);
    ASSERT_TRUE(packed.ok()) << packed.error().message;
    packed_ = std::make_unique<PackedMesh>(std::move(*packed));
    for (std::uint32_t pose = 0; pose < 2 * instanceCount; ++pose)
      poses_.push_back(randomPose(10 + pose, jointCount, Rigidity::rigid));
    for (const std::vector<JointMatrix>& pose : poses_)
      expected_.push_back(*reference::skin(mesh_.view(), pose, Method::dualQuaternion));
    output_.layout.tangents = VertexFormat::float32x4;
    output_.layout.motion = true;
    output_.layout.bounds = true;
    output_.layout.gap = 4;
  }
  void TearDown() override {
    if (setAfterWait_ != nullptr) setAfterWait_(nullptr);
  }

  /// What the layer finds in the memory of the host after a wait.
  struct Written {
    std::span<std::byte> output, results;
  };
  using Change = std::function<void(const Written&)>;

  /// Verifies the batch, and changes what stands in its buffers after the wait of that number, from
  /// 1. The frames of a batch are: before, now, settled.
  std::vector<samples::VerifiedInstance> verify(std::uint64_t wait, const Change& change,
                                                bool thorough = false) {
    std::uint64_t waits = 0;
    bool changed = false;
    const AfterWait afterWait = [&](std::span<const WrittenBuffer> buffers) {
      if (++waits != wait) return;
      Written written;
      for (const WrittenBuffer& buffer : buffers) {
        // Palettes and tables are used for more than storage; results are less than vertices.
        if (buffer.usage != VK_BUFFER_USAGE_STORAGE_BUFFER_BIT) continue;
        const bool isSmall = buffer.bytes.size() <= sizeof(InstanceResult) * instanceCount;
        (isSmall ? written.results : written.output) = buffer.bytes;
      }
      change(written);
      changed = true;
    };
    setAfterWait_(&afterWait);
    std::vector<samples::InstanceToVerify> instances(instanceCount);
    for (std::size_t index = 0; index < instanceCount; ++index) {
      instances[index].packed = packed_.get();
      instances[index].pose = poses_[index];
      instances[index].previousPose = poses_[instanceCount + index];
      instances[index].method = Method::dualQuaternion;
      instances[index].expected = &expected_[index];
      instances[index].expectedBefore = &expected_[instanceCount + index];
      instances[index].exemptions = exemptionsOf(*instances[index].expected);
      instances[index].exemptionsBefore = exemptionsOf(*instances[index].expectedBefore);
    }
    samples::VulkanTarget target(*open_->device, open_->context);
    Result<std::vector<samples::VerifiedInstance>> verified =
        samples::verifyBatch(target, instances, output_, thorough);
    setAfterWait_(nullptr);
    EXPECT_TRUE(verified.ok()) << (verified ? "" : verified.error().message);
    EXPECT_EQ(changed, wait != 0);
    return verified ? std::move(*verified) : std::vector<samples::VerifiedInstance>{};
  }

  /// Inverts bits of a byte of an attribute.
  Change invert(std::size_t instance, Stream stream, std::uint32_t vertex, std::uint32_t byte,
                unsigned bits) const {
    return [=, this](const Written& written) {
      std::vector<samples::SkinRequest> requests(instanceCount);
      for (samples::SkinRequest& request : requests) {
        request.mesh = packed_.get();
        request.pose = poses_[0];
      }
      const samples::BatchLayout layout = samples::layOutBatch(requests, output_.layout);
      const OutputAttribute& attribute = layout.jobs[instance].places[stream];
      const std::uint64_t place =
          attribute.offset + std::uint64_t{vertex} * attribute.stride + byte;
      ASSERT_LT(place, written.output.size());
      written.output[static_cast<std::size_t>(place)] ^= static_cast<std::byte>(bits);
    };
  }

  /// Changes what the device says of one instance.
  static Change changeResult(std::size_t instance, std::function<void(InstanceResult&)> change) {
    return [instance, change](const Written& written) {
      ASSERT_EQ(written.results.size(), sizeof(InstanceResult) * instanceCount);
      std::byte* place = written.results.data() + instance * sizeof(InstanceResult);
      InstanceResult result;
      std::memcpy(&result, place, sizeof(result));
      change(result);
      std::memcpy(place, &result, sizeof(result));
    };
  }

  /// That instance fails with that sentence, and all others pass.
  static void expectOnly(const std::vector<samples::VerifiedInstance>& verified,
                         std::size_t instance, const std::string& wrong) {
    ASSERT_EQ(verified.size(), instanceCount);
    for (std::size_t index = 0; index < instanceCount; ++index) {
      EXPECT_EQ(verified[index].passed(), index != instance) << index;
      EXPECT_EQ(verified[index].wrong.empty(), index != instance) << verified[index].wrong;
    }
    EXPECT_NE(verified[instance].wrong.find(wrong), std::string::npos) << verified[instance].wrong;
    EXPECT_EQ(verified[instance].comparison.failures, 0u);
  }

  static std::unique_ptr<samples::OpenDevice> open_;
  static std::string why_;
  static SetAfterWait setAfterWait_;
  OwnedMesh mesh_;
  std::unique_ptr<PackedMesh> packed_;
  std::vector<std::vector<JointMatrix>> poses_;
  std::vector<reference::SkinnedMesh> expected_;
  samples::OutputCase output_;
};

std::unique_ptr<samples::OpenDevice> WrongBytesTest::open_;
std::string WrongBytesTest::why_;
SetAfterWait WrongBytesTest::setAfterWait_ = nullptr;

constexpr std::uint64_t before = 1, now = 2, settled = 3, again = 4, alone = 7;

TEST_F(WrongBytesTest, NothingIsFoundWhereNothingIsWrong) {
  for (const samples::VerifiedInstance& instance : verify(0, {}, true)) {
    EXPECT_TRUE(instance.passed()) << instance.wrong;
    EXPECT_EQ(instance.comparison.compared, vertexCount);
  }
}

TEST_F(WrongBytesTest, AWrongByteOfAnAttributeIsFoundAtItsVertex) {
  for (const Stream stream : {Stream::positions, Stream::normals, Stream::tangents}) {
    // The sign of z, and the highest bit of the mantissa of y.
    for (const auto& [byte, bits] : {std::pair{11u, 0x80u}, {6u, 0x40u}}) {
      const std::vector<samples::VerifiedInstance> verified =
          verify(now, invert(1, stream, 17, byte, bits));
      ASSERT_EQ(verified.size(), instanceCount);
      for (std::size_t index = 0; index < instanceCount; ++index)
        EXPECT_EQ(verified[index].passed(), index != 1);
      const Comparison& comparison = verified[1].comparison;
      EXPECT_EQ(comparison.failures, 1u);
      EXPECT_EQ(comparison.firstFailure, 17u);
      EXPECT_EQ(comparison.compared, vertexCount);
      EXPECT_GT(comparison.worstPosition, stream == Stream::positions ? 1 : 0);
      EXPECT_EQ(stream == Stream::positions, comparison.worstPosition > 1);
      EXPECT_EQ(stream == Stream::normals, comparison.worstNormal > 1);
      EXPECT_EQ(stream == Stream::tangents, comparison.worstTangent > 1);
    }
  }
}

TEST_F(WrongBytesTest, AWrongPreviousPositionIsFound) {
  const auto wrong = invert(2, Stream::previousPositions, 5, 3, 0x80);
  expectOnly(verify(before, wrong), 2,
             "when motion restarts, previous positions are not the current");
  expectOnly(verify(now, wrong), 2, "previous positions are not those of the frame before");
  expectOnly(verify(now, wrong), 2,
             "1 previous positions are outside their bound; the first is vertex 5");
  expectOnly(verify(settled, wrong), 2, "after settling, previous positions are not the current");
  expectOnly(verify(settled, invert(2, Stream::positions, 5, 3, 0x80)), 2,
             "after settling, previous positions are not the current");
}

TEST_F(WrongBytesTest, ATouchedNeighborIsFound) {
  // Behind the last attribute of vertex 3 there are four bytes that are nobody's.
  const auto behind = [](std::uint32_t byte) { return 12u + byte; };
  for (const std::uint64_t frame : {before, now, settled}) {
    for (const std::uint32_t byte : {0u, 3u}) {
      const std::vector<samples::VerifiedInstance> verified =
          verify(frame, invert(0, Stream::previousPositions, 3, behind(byte), 1));
      // Positions, normals and tangents, and previous positions: 52 bytes, and the gap.
      const std::string place = "byte " + std::to_string(3 * 56 + 52 + byte) + " of the positions'";
      expectOnly(verified, 0, "1 bytes between attributes were changed; the first is " + place);
    }
  }
}

TEST_F(WrongBytesTest, AWrongBoxIsFound) {
  const std::string wrong = "the box is not that of the positions";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto low = [axis](InstanceResult& result) { --result.orderedMin[axis]; };
    const auto high = [axis](InstanceResult& result) { ++result.orderedMax[axis]; };
    expectOnly(verify(now, changeResult(1, low)), 1, wrong);
    expectOnly(verify(now, changeResult(1, high)), 1, wrong);
  }
  const auto none = [](InstanceResult& result) { result.orderedMin[1] = 0xffffffffu; };
  expectOnly(verify(now, changeResult(2, none)), 2, "there is no box of the positions");
  // A box of positions that are not float32 is held against the reference's.
  output_.layout.positions = VertexFormat::float16x4;
  const auto far = [](InstanceResult& result) { result.orderedMax[0] += 1 << 16; };
  expectOnly(verify(now, changeResult(0, far)), 0, wrong);
  // With a vertex whose place is a matter of rounding it may be larger, but not smaller.
  for (reference::SkinnedMesh& expected : expected_) expected.bounds[3].onlyFinite = true;
  for (const samples::VerifiedInstance& instance : verify(now, changeResult(0, far))) {
    EXPECT_TRUE(instance.passed()) << instance.wrong;
    EXPECT_EQ(instance.comparison.exempt, (Exemptions{1, 0}));
    EXPECT_EQ(instance.comparison.compared, vertexCount - 1);
  }
  const auto small = [](InstanceResult& result) { result.orderedMax[0] -= 1 << 19; };
  expectOnly(verify(now, changeResult(0, small)), 0, wrong);
}

TEST_F(WrongBytesTest, AWrongCountOfClampedVerticesIsFound) {
  output_.layout.positions = VertexFormat::snorm16x4;
  for (const samples::VerifiedInstance& instance : verify(0, {}))
    EXPECT_TRUE(instance.passed()) << instance.wrong;
  for (const std::size_t instance : {0u, 1u}) {
    const auto more = [](InstanceResult& result) { result.clampedVertices += 1; };
    expectOnly(verify(now, changeResult(instance, more)), instance,
               "vertices were counted as clamped");
  }
  // Of the second the box is too small.
  const auto less = [](InstanceResult& result) { result.clampedVertices -= 1; };
  expectOnly(verify(now, changeResult(1, less)), 1, "vertices were counted as clamped");
}

TEST_F(WrongBytesTest, WhatIsNotTwiceTheSameIsFound) {
  // Thorough: all frames again, over another poison, and each instance by itself.
  const auto last = invert(1, Stream::normals, 39, 0, 1);
  expectOnly(verify(again + now - 1, last, true), 1,
             "a byte of an attribute was not written, or two runs wrote different values");
  const auto ofTheFirst = invert(0, Stream::normals, 39, 0, 1);
  expectOnly(verify(alone + now - 1, ofTheFirst, true), 0,
             "skinned alone, the instance has different bits");
}

}  // namespace
}  // namespace dermis::test
