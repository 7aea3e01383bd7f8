// plan: outputs that are larger than a storage buffer range, or lie in several buffers.

#include "dermis/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

#include "core_plan_simulation.h"
#include "plan/work.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

DeviceLimits limitsOf(std::uint64_t range, std::uint32_t alignment,
                      std::uint32_t storageBuffers = storageBuffersWanted) {
  DeviceLimits limits = richLimits();
  limits.maxStorageBufferRange = range;
  limits.minStorageBufferOffsetAlignment = alignment;
  limits.maxStorageBuffersPerStage = storageBuffers;
  return limits;
}

bool hasOneWindow(const PlannedDispatch& dispatch) {
  return std::ranges::all_of(std::array{1u, 2u, 3u}, [&](std::size_t stream) {
    return dispatch.outputPart(stream).offset == dispatch.outputPart(0).offset;
  });
}

TEST(Plan, OutputRangesStepByLessThanTheyAreLong) {
  for (const std::uint64_t range : {std::uint64_t{16384}, std::uint64_t{65536},
                                    std::uint64_t{1} << 27, (std::uint64_t{1} << 32) - 1}) {
    for (const std::uint32_t alignment : {4u, 16u, 64u, 256u}) {
      const DeviceLimits limits = limitsOf(range, alignment);
      const std::uint64_t step = outputWindowStep(limits);
      EXPECT_EQ(step % alignment, 0u);
      EXPECT_LT(step, range);
      EXPECT_GE(step, range * 3 / 4);
    }
  }
}

class PlanWindows : public ::testing::TestWithParam<std::tuple<std::uint64_t, std::uint32_t>> {};

TEST_P(PlanWindows, EveryWriteLiesInItsRange) {
  const auto [range, alignment] = GetParam();
  for (std::uint32_t seed = 1; seed <= 6; ++seed) {
    OwnedBatch batch = randomBatch(seed, 60);
    // Planar normals lie too far from their positions to share a range as short as these.
    std::erase_if(batch.jobs, [range = range](const Job& job) {
      return job.places[Stream::normals].stride != 0 &&
             job.places[Stream::normals].offset - job.places[Stream::positions].offset >
                 range / 16 / 2;
    });
    ASSERT_GT(batch.outputSize, range);
    Plan out;
    for (const std::uint32_t storageBuffers : {4u, 8u}) {
      const DeviceLimits limits = limitsOf(range, alignment, storageBuffers);
      ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, limits, {16, 3}, out));
      std::set<std::uint64_t> windows;
      for (const PlannedDispatch& dispatch : dispatchesOf(out)) {
        windows.insert(dispatch.outputPart(0).offset);
        EXPECT_TRUE(dispatch.variant.normals == VertexFormat::none ||
                    dispatch.outputPart(1).offset == dispatch.outputPart(0).offset)
            << "attributes that lie near to each other share a window";
      }
      EXPECT_GT(windows.size(), 1u);
      // One more dispatch a range of output and a variant.
      EXPECT_LE(dispatchesOf(out).size(),
                1 + out.pipelines().size() * (batch.outputSize / outputWindowStep(limits) + 1));
      EXPECT_EQ(out.instanceCount(), batch.jobs.size());
    }
  }
}

TEST_P(PlanWindows, SoDoesEveryWriteOfEveryFormatAndMotion) {
  const auto [range, alignment] = GetParam();
  for (const bool separate : {false, true}) {
    std::set<std::uint64_t> windows;
    bool differ = false;
    for (std::uint32_t seed = 1; seed <= 4; ++seed) {
      const OwnedBatch batch = randomRichBatch(seed, 80, separate);
      const Plan out = planned(batch, limitsOf(range, alignment), {32, 2});
      for (const PlannedDispatch& dispatch : dispatchesOf(out)) {
        windows.insert(dispatch.outputPart(0).offset);
        differ = differ || !hasOneWindow(dispatch);
      }
    }
    EXPECT_GT(windows.size(), 1u);
    EXPECT_TRUE(differ);
  }
}

INSTANTIATE_TEST_SUITE_P(Plan, PlanWindows,
                         ::testing::Combine(::testing::Values(130000u, 129916u, 147456u, 131072u),
                                            ::testing::Values(4u, 64u, 256u)));

TEST(Plan, AnInstanceLongerThanARangeIsCutByVertices) {
  OwnedBatch batch(meshOf(800, 1, 1, true), 1);
  Job& job = batch.addJob(0, 0, Method::dualQuaternion, true, 800);
  job.places[Stream::normals].offset += 100;
  const DeviceLimits limits = limitsOf(65536, 256);
  ASSERT_GT(batch.outputSize, 9 * limits.maxStorageBufferRange);
  const Plan out = planned(batch, limits, {64, 4});
  EXPECT_EQ(out.instanceCount(), 1u);
  EXPECT_EQ(out.vertexCount(), 800u);
  EXPECT_GE(dispatchesOf(out).size(), 1 + 9u);
}

// One result, one extension's morph targets and one palette, however many pieces there are.
TEST(Plan, TheInstanceThatIsCutHasOneResult) {
  OwnedBatch batch(meshOf(800, 1, 1, MeshParts{true, false, 2}), 1);
  Job& job = batch.addJob(0, 0, Method::dualQuaternion, true, 800);
  job.bounds = true;
  job.morphs = batch.keep({{1, 0.5f}, {0, 0.25f}});
  const Plan out = planned(batch, limitsOf(65536, 256), {64, 4});
  EXPECT_EQ(out.buffer(BufferRole::results).size, sizeof(InstanceResult));
  EXPECT_GE(dispatchesOf(out).size(), 1 + 9u);
}

// With storage buffers for each attribute, however far apart a vertex' attributes lie, they fit;
// with one for all they fit or are refused.
TEST(Plan, AttributesThatLieFarApartFitOrAreRefused) {
  OwnedBatch batch(meshOf(400, 1, 1, true), 1);
  Job& job = batch.addJob(0, 0, Method::linear, true, 512);
  batch.outputSize += 65536;
  int good = 0, refused = 0, differ = 0;
  for (std::uint64_t apart = 12; apart < 65536; apart += apart < 10000 ? 332 : 7332) {
    SCOPED_TRACE(apart);
    job.places[Stream::normals].offset = job.places[Stream::positions].offset + apart;
    Plan out = planned(batch, limitsOf(65536, 256), {64, 4});
    const std::vector<PlannedDispatch> dispatches = dispatchesOf(out);
    const bool sharesWindows =
        std::all_of(dispatches.begin(), dispatches.end(), [](const PlannedDispatch& dispatch) {
          return dispatch.outputPart(0).offset == dispatch.outputPart(1).offset;
        });
    differ += sharesWindows ? 0 : 1;
    const DeviceLimits few = limitsOf(65536, 256, 4);
    const Result<void> result = makePlan(batch.batch(), few, {64, 4}, out);
    EXPECT_EQ(result.ok(), sharesWindows);
    EXPECT_TRUE(result.ok() || apart > 65536 / 32) << "attributes that lie near share a window";
    if (result) {
      ++good;
      ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, few, {64, 4}, out));
    } else {
      ++refused;
      ASSERT_EQ(result.error().code, ErrorCode::limitExceeded);
      ASSERT_NE(result.error().message.find("job 0"), std::string::npos);
    }
  }
  EXPECT_GT(good, 5);
  EXPECT_GT(refused, 5);
  EXPECT_EQ(differ, refused);
}

// A 32nd of a range is near, wherever the windows begin and however the vertices are cut.
TEST(Plan, AttributesThatLieNearShareAWindow) {
  OwnedBatch batch(meshOf(400, 1, 1, true), 1);
  const DeviceLimits limits = limitsOf(65536, 256, 4);
  for (const std::uint32_t stride : {128u, 500u, 512u, 1000u, 4096u}) {
    for (std::uint64_t offset = 2048; offset < 8000; offset += 100) {
      for (const std::uint64_t apart : {std::uint64_t{2048}, ~std::uint64_t{2047}}) {
        batch.jobs.clear();
        batch.outputSize = offset;
        Job& job = batch.addJob(0, 0, Method::linear, true, stride);
        job.places[Stream::normals].offset =
            job.places[Stream::positions].offset + apart;  // before or after
        batch.outputSize += 4096;
        Plan out;
        const Result<void> result = makePlan(batch.batch(), limits, {64, 4}, out);
        ASSERT_TRUE(result.ok()) << stride << ", " << offset << ": " << result.error().message;
      }
    }
  }
}

TEST(Plan, PlanarAttributesOfOneHugeOutputLieInDifferentWindows) {
  OwnedBatch batch(meshOf(1000, 1, 1, MeshParts{true, true, 0}), 1);
  Job job = batch.jobOf(0, 0, Method::linear);
  job.places[Stream::normals].format = VertexFormat::octahedral16x2;
  job.places[Stream::tangents].format = VertexFormat::snorm8x4;
  const std::uint64_t gigabyte = std::uint64_t{1} << 30;
  batch.outputSize = 4 * gigabyte;
  job.places[Stream::positions] = {3 * gigabyte, 12, VertexFormat::float32x3};
  job.places[Stream::normals] = {gigabyte, 4, VertexFormat::octahedral16x2};
  job.places[Stream::tangents] = {0, 4, VertexFormat::snorm8x4};
  job.places[Stream::previousPositions] = {4 * gigabyte - 12000, 12, VertexFormat::float32x3};
  batch.jobs.push_back(job);
  const Plan out = planned(batch, richLimits());
  ASSERT_EQ(dispatchesOf(out).size(), 1u);
  const std::uint64_t step = outputWindowStep(richLimits());
  const PlannedDispatch dispatch = dispatchesOf(out)[0];
  EXPECT_EQ(dispatch.outputPart(0).offset, 3 * gigabyte / step * step);
  EXPECT_EQ(dispatch.outputPart(1).offset, gigabyte / step * step);
  EXPECT_EQ(dispatch.outputPart(2).offset, 0u);
  EXPECT_GT(dispatch.outputPart(3).offset, dispatch.outputPart(0).offset);
}

TEST(Plan, ABufferWithinARangeHasNoWindowsBesideOneThatIsLarger) {
  OwnedBatch batch(meshOf(900, 1, 1, MeshParts{true, false, 0, false}), 1);
  batch.hasSeparateOutputs = true;
  for (std::uint64_t instance = 0; instance < 3; ++instance) {
    Job job = batch.jobOf(0, 0, Method::linear);
    job.places[Stream::positions] = {instance * 1000 * 64, 64, VertexFormat::float32x3};
    job.places[Stream::normals] = {instance * 1000 * 16, 16, VertexFormat::octahedral16x2};
    batch.jobs.push_back(job);
  }
  batch.separateSizes = {{3 * 1000 * 64, 3 * 1000 * 16, 0, 0}};
  const DeviceLimits limits = limitsOf(3 * 1000 * 16, 4);
  const Plan out = planned(batch, limits);
  std::set<std::uint64_t> positions, normals;
  for (const PlannedDispatch& dispatch : dispatchesOf(out)) {
    positions.insert(dispatch.outputPart(0).offset);
    normals.insert(dispatch.outputPart(1).offset);
  }
  EXPECT_GT(positions.size(), 2u);
  EXPECT_EQ(normals, std::set<std::uint64_t>{0});
}

// What lies in one range is not cut; what does not is, and only that.
TEST(Plan, OnlyWhatLiesInTwoRangesIsCut) {
  OwnedBatch batch(meshOf(1234, 1, 1, true), 1);
  Job& job = batch.addJob(0, 0, Method::linear, true, 68);
  const DeviceLimits limits = limitsOf(1234 * 68, 256);
  const auto runs = [&] {
    Plan out;
    expectPlanned(batch, limits, {}, out);
    return dispatchesOf(out)[0].skinPush().groupCount;
  };
  EXPECT_EQ(runs(), 1u);
  batch.outputSize += 68;
  EXPECT_EQ(runs(), 1u);
  job.places[Stream::positions].offset += 68;
  job.places[Stream::normals].offset += 68;
  EXPECT_GT(runs(), 16u);
}

// Farther into the output than 32 bits can count.
TEST(Plan, OutputOffsetsHave64Bits) {
  OwnedBatch batch(meshOf(100, 1, 1, true), 1);
  for (const std::uint64_t offset :
       {std::uint64_t{0}, std::uint64_t{5} << 32, (std::uint64_t{7} << 40) + 12}) {
    batch.outputSize = offset;
    batch.addJob(0, 0, Method::linear, true);
  }
  const Plan out = planned(batch);
  EXPECT_EQ(dispatchesOf(out).size(), 3u);
}

}  // namespace
}  // namespace dermis::test
