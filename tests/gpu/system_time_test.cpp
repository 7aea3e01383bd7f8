// How long a frame took: the GPU's time by timestamps, and the CPU's by a clock.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>

#include "intercepted_device.h"
#include "system_test.h"

namespace dermis::test {
namespace {

class Stopwatch {
 public:
  double seconds() const {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

/// What the pretended GPU wrote: the ticks at which each frame slot began and ended.
std::array<std::array<std::uint64_t, 2>, 2> slotTicks;
std::uint32_t resultCalls = 0;

VkResult VKAPI_CALL giveTicks(VkDevice, VkQueryPool, std::uint32_t first, std::uint32_t count,
                              std::size_t size, void* data, VkDeviceSize stride,
                              VkQueryResultFlags flags) {
  ++resultCalls;
  EXPECT_EQ(count, 2u);
  EXPECT_EQ(size, 2 * sizeof(std::uint64_t));
  EXPECT_EQ(stride, sizeof(std::uint64_t));
  EXPECT_EQ(flags, static_cast<VkQueryResultFlags>(VK_QUERY_RESULT_64_BIT));
  if (first % 2 != 0 || first / 2 >= slotTicks.size()) return VK_ERROR_UNKNOWN;
  std::copy(slotTicks[first / 2].begin(), slotTicks[first / 2].end(),
            static_cast<std::uint64_t*>(data));
  return VK_SUCCESS;
}

struct WrittenTimestamp {
  VkPipelineStageFlagBits stage;
  std::uint32_t query;
};
std::vector<WrittenTimestamp> written;
PFN_vkCmdWriteTimestamp realWriteTimestamp = nullptr;

void VKAPI_CALL writeTimestamp(VkCommandBuffer commandBuffer, VkPipelineStageFlagBits stage,
                               VkQueryPool pool, std::uint32_t query) {
  written.push_back({stage, query});
  realWriteTimestamp(commandBuffer, stage, pool, query);
}

class SystemTimeTest : public SystemTest {
 protected:
  vulkan::SceneRecorderDescription measured() {
    vulkan::SceneRecorderDescription description = this->description();
    description.measuresGpuTime = true;
    return description;
  }
};

// Ticks of 2.5 ns, whose numbers here are exact in a double: 400 of them are a microsecond. Both
// timestamps of a frame stand behind everything before them, so that all of its work lies between.
TEST_F(SystemTimeTest, TheGpusTimeIsTicksTimesTheirPeriod) {
  InterceptedDevice intercepted(device().description());
  intercepted.changeLimits([](VkPhysicalDeviceLimits& limits) { limits.timestampPeriod = 2.5f; });
  intercepted.replace("vkGetQueryPoolResults", giveTicks);
  realWriteTimestamp = reinterpret_cast<PFN_vkCmdWriteTimestamp>(
      device().functions().GetDeviceProcAddr(device().handle(), "vkCmdWriteTimestamp"));
  intercepted.replace("vkCmdWriteTimestamp", writeTimestamp);
  vulkan::Context context = must(vulkan::Context::create(intercepted.description()));
  vulkan::SceneRecorderDescription system = measured();
  SingleInstance one(device(), context, system, plainLayout());
  const auto measure = [&](std::uint32_t pose) {
    one.engine.writePose(one.description.pose, systemPose(pose));
    written.clear();
    one.engine.submit();
    one.engine.begin();
    EXPECT_EQ(one.engine->statistics().lastCompletedFrame.frame, pose);
    return one.engine.recorder().statistics().gpuSeconds;
  };
  constexpr std::uint64_t late = std::uint64_t{1} << 40;
  slotTicks = {{{late, late + 400}, {late, late + 4'000'000'000}}};
  std::multiset<double> seconds;
  for (std::uint32_t frame = 1; frame <= 4; ++frame) {
    seconds.insert(measure(frame).value_or(-1));
    ASSERT_EQ(written.size(), 2u);
    EXPECT_EQ(written[0].query % 2, 0u);
    EXPECT_EQ(written[1].query, written[0].query + 1);
    for (const WrittenTimestamp& timestamp : written)
      EXPECT_EQ(timestamp.stage, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT);
  }
  const std::vector<double> expected{1e-6, 1e-6, 10, 10};  // each of the two slots twice
  ASSERT_EQ(seconds.size(), expected.size());
  EXPECT_TRUE(std::ranges::equal(seconds, expected,
                                 [](double a, double b) { return std::abs(a - b) <= 1e-15 * b; }))
      << *seconds.begin() << " to " << *seconds.rbegin();
  // Ticks that run backwards, as where a counter of few bits begins again, are no time.
  slotTicks = {{{1000, 999}, {1000, 999}}};
  EXPECT_FALSE(measure(5).has_value());
  EXPECT_EQ(resultCalls, 5u);
  one.engine.submit();
}

// The real driver's ticks: more than nothing, and less than the wait for the fence.
TEST_F(SystemTimeTest, TheGpusTimeIsAPartOfTheWait) {
  SingleInstance one(device(), context(), measured(), plainLayout(), 20000);
  one.engine.submit();
  one.engine.begin();
  one.engine.writePose(one.description.pose, systemPose(2));
  const Stopwatch wait;
  one.engine.submit();
  one.engine.finish();
  const double waited = wait.seconds();
  one.engine.begin();
  EXPECT_EQ(one.engine->statistics().lastCompletedFrame.frame, 2u);
  const std::optional<double> seconds = one.engine.recorder().statistics().gpuSeconds;
  ASSERT_TRUE(seconds.has_value());
  EXPECT_GT(*seconds, 0.0);
  EXPECT_LE(*seconds, waited);
  one.engine.submit();
}

TEST_F(SystemTimeTest, TimeThatIsNotMeasuredIsNotKnown) {
  SingleInstance one(device(), context(), description(), plainLayout());
  one.engine.submit();
  one.engine.begin();
  EXPECT_EQ(one.engine->statistics().lastCompletedFrame.frame, 1u);
  EXPECT_FALSE(one.engine.recorder().statistics().gpuSeconds.has_value());
  one.engine.submit();
}

// Planning and recording are what `record` does: both take some time, together no more than the
// call, and, in a frame in which nobody interrupts it, most of it.
TEST_F(SystemTimeTest, PlanningAndRecordingAreThePartsOfTheCall) {
  SingleInstance one(device(), context(), description(), plainLayout(), 8);
  for (int i = 0; i < 3000; ++i) must(one.engine->addInstance(one.description));
  Stopwatch call;
  double called = 0;
  one.engine.beforeRecord = [&](VkCommandBuffer) { call = {}; };
  one.engine.afterRecord = [&](VkCommandBuffer) { called = call.seconds(); };
  double largestPart = 0;
  for (std::uint32_t frame = 0; frame < 10; ++frame) {
    one.engine.writePose(one.description.pose, systemPose(frame));
    one.engine.submit();
    const LastFrame statistics = one.engine.lastFrame();
    EXPECT_GT(statistics.planSeconds, 0.0);
    EXPECT_GT(statistics.recordSeconds, 0.0);
    EXPECT_LE(statistics.planSeconds + statistics.recordSeconds, called);
    largestPart =
        std::max(largestPart, (statistics.planSeconds + statistics.recordSeconds) / called);
    one.engine.begin();
  }
  one.engine.submit();
  EXPECT_GT(largestPart, 0.5);
}

}  // namespace
}  // namespace dermis::test
