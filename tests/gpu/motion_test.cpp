// Previous positions over many frames: first frames, teleports, and instances that are not updated
// every frame.

#include <gtest/gtest.h>

#include <algorithm>

#include "kit/batch_runner.h"
#include "random_rig.h"
#include "test_device.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t movingJoints = 8;
constexpr auto positions = static_cast<std::size_t>(Stream::positions);
constexpr auto previous = static_cast<std::size_t>(Stream::previousPositions);

/// Two instances of one mesh, moving from frame to frame into the same outputs.
class MotionTest : public DeviceTest {
 protected:
  void SetUp() override {
    DeviceTest::SetUp();
    if (device_ == nullptr) return;
    samples::RunOptions options;
    options.output.motion = true;
    runner_ = samples::VulkanTarget(device(), context()).runner(options);
    for (std::uint32_t pose = 0; pose < 40; ++pose)
      poses_.push_back(randomPose(pose, movingJoints, Rigidity::rigid));
  }

  samples::SkinRequest request(std::size_t pose) const {
    samples::SkinRequest request;
    request.mesh = &packed_;
    request.pose = poses_[pose];
    return request;
  }

  std::vector<samples::SkinnedVertices> frame(const std::vector<samples::SkinRequest>& requests) {
    Result<samples::BatchResult> result = runner_->run(requests);
    EXPECT_TRUE(result.ok()) << (result ? "" : result.error().message);
    return result ? std::move(result->instances) : std::vector<samples::SkinnedVertices>(2);
  }

  OwnedMesh mesh_ = randomMesh(1, 200, movingJoints, 4);
  PackedMesh packed_ = *pack(mesh_.view(), movingJoints);
  std::vector<std::vector<JointMatrix>> poses_;
  std::unique_ptr<samples::BatchRunner> runner_;
};

TEST_F(MotionTest, EveryFrameSeesThePositionsOfTheFrameBefore) {
  std::vector<samples::SkinRequest> requests{request(0), request(20)};
  for (samples::SkinRequest& first : requests) first.restartsMotion = true;
  std::vector<samples::SkinnedVertices> before = frame(requests);
  for (const samples::SkinnedVertices& instance : before)
    EXPECT_EQ(instance.streams[previous], instance.streams[positions]) << "on the first frame";
  for (std::size_t number = 1; number < 10; ++number) {
    const std::vector<samples::SkinnedVertices> now =
        frame({request(number), request(20 + number)});
    for (std::size_t instance = 0; instance < 2; ++instance) {
      EXPECT_EQ(now[instance].streams[previous], before[instance].streams[positions]) << number;
      EXPECT_NE(now[instance].streams[previous], now[instance].streams[positions]) << number;
    }
    before = now;
  }
}

// For engines whose output does not persist (docs/integration.md).
TEST_F(MotionTest, AJobWithTheLastPoseGivesTheSamePreviousPositions) {
  frame({request(0), request(20)});
  const std::vector<samples::SkinnedVertices> now = frame({request(1), request(21)});
  samples::RunOptions options;
  options.output.normals = VertexFormat::none;
  runner_ = samples::VulkanTarget(device(), context()).runner(options);
  const std::vector<samples::SkinnedVertices> last = frame({request(0), request(20)});
  for (std::size_t instance = 0; instance < 2; ++instance)
    EXPECT_EQ(last[instance].streams[positions], now[instance].streams[previous]);
}

TEST_F(MotionTest, ATeleportLeavesNoMotionBehind) {
  frame({request(0), request(20)});
  std::vector<samples::SkinRequest> requests{request(1), request(21)};
  requests[0].restartsMotion = true;
  const std::vector<samples::SkinnedVertices> now = frame(requests);
  EXPECT_EQ(now[0].streams[previous], now[0].streams[positions]);
  EXPECT_NE(now[1].streams[previous], now[1].streams[positions]) << "the other one moved on";
}

// The first instance is updated in frames 1 and 4 only, the second in each.
TEST_F(MotionTest, AnInstanceThatIsNotUpdatedStandsStillAndThenMovesFromWhereItWas) {
  std::vector<samples::SkinnedVertices> before = frame({request(0), request(20)});
  std::vector<samples::SkinnedVertices> now = frame({request(1), request(21)});
  EXPECT_EQ(now[0].streams[previous], before[0].streams[positions]);
  const std::vector<std::byte> standing = now[0].streams[positions];
  for (std::size_t number = 2; number < 4; ++number) {
    samples::SkinRequest still = request(1);
    still.settles = true;
    before = now;
    now = frame({still, request(20 + number)});
    EXPECT_EQ(now[0].streams[positions], standing);
    EXPECT_EQ(now[0].streams[previous], standing) << "it does not move";
    EXPECT_EQ(now[1].streams[previous], before[1].streams[positions]);
  }
  now = frame({request(4), request(24)});
  EXPECT_EQ(now[0].streams[previous], standing);
  EXPECT_NE(now[0].streams[positions], standing);
}

}  // namespace
}  // namespace dermis::test
