// Which vertices are stored 16 or 8 bytes at a time (`DeviceLimits::stagedStores`).

#include <gtest/gtest.h>

#include <algorithm>

#include "core_plan_simulation.h"
#include "dermis/plan.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

DeviceLimits stagingLimits() {
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  limits.stagedStores = true;
  return limits;
}

/// The skin kernel of one job: positions and normals, float32x4, but for what `change` changes.
template <typename Change>
Variant variantOf(Change change) {
  OwnedBatch batch(meshOf(100, 4, 4, MeshParts{true, true, 0}), 4);
  Job& job = batch.addJob(0, 0, Method::dualQuaternion, true);
  job.places[Stream::positions] = {0, 32, VertexFormat::float32x4};
  job.places[Stream::normals] = {16, 32, VertexFormat::float32x4};
  batch.outputSize = 1 << 20;
  DeviceLimits limits = stagingLimits();
  change(batch.jobs[0], limits);
  Plan plan;
  const Result<void> planned = makePlan(batch.batch(), limits, {}, plan);
  EXPECT_TRUE(planned.ok()) << (planned ? "" : planned.error().message);
  return planned ? dermis::variantOf(plan.pipelines().back()) : Variant{};
}

TEST(PlanStaged, EverydayVerticesWithoutGapsAreStaged) {
  const Variant usual = variantOf([](Job&, DeviceLimits&) {});
  EXPECT_TRUE(usual.staged);
  EXPECT_EQ(usual.recordBytes, 32);
  EXPECT_TRUE(variantOf([](Job& job, DeviceLimits&) { job.method = Method::linear; }).staged);
  EXPECT_TRUE(variantOf([](Job& job, DeviceLimits&) {
                job.places[Stream::positions].offset += 8;
                job.places[Stream::normals].offset += 8;
              }).staged);
  const Variant alone = variantOf([](Job& job, DeviceLimits&) {
    job.places[Stream::positions] = {0, 12, VertexFormat::float32x3};
    job.places[Stream::normals] = {};
  });
  EXPECT_TRUE(alone.staged && alone.recordBytes == 12);
  const Variant floats = variantOf([](Job& job, DeviceLimits&) {
    job.places[Stream::positions] = {0, 24, VertexFormat::float32x3};
    job.places[Stream::normals] = {12, 24, VertexFormat::float32x3};
  });
  EXPECT_TRUE(floats.staged && floats.recordBytes == 24);
  const Variant halves = variantOf([](Job& job, DeviceLimits&) {
    job.places[Stream::positions] = {job.places[Stream::positions].offset, 8,
                                     VertexFormat::float16x3};
    job.places[Stream::normals] = {job.places[Stream::positions].offset + 6, 8,
                                   VertexFormat::octahedral8x2};
  });
  EXPECT_TRUE(halves.staged && halves.recordBytes == 8);
}

TEST(PlanStaged, OthersAreNot) {
  using Limits = DeviceLimits;
  const auto isStaged = [](auto change) { return variantOf(change).staged; };
  EXPECT_FALSE(isStaged([](Job&, Limits& limits) { limits.stagedStores = false; }));
  EXPECT_FALSE(isStaged([](Job&, Limits& limits) { limits.texelBuffers = true; }));
  EXPECT_FALSE(isStaged([](Job&, Limits& limits) { limits.maxStorageBuffersPerStage = 4; }));
  EXPECT_FALSE(isStaged([](Job& job, Limits&) { job.method = Method::blended; }));
  EXPECT_FALSE(isStaged([](Job& job, Limits&) { job.method = Method::logMatrix; }));
  EXPECT_FALSE(isStaged([](Job& job, Limits&) { job.bounds = true; }));
  EXPECT_FALSE(isStaged([](Job& job, Limits&) {
    job.places[Stream::previousPositions] = {1 << 19, 16, VertexFormat::float32x4};
  }));
  EXPECT_FALSE(isStaged([](Job& job, Limits&) {  // a gap
    job.places[Stream::positions].stride = job.places[Stream::normals].stride = 36;
  }));
  EXPECT_FALSE(isStaged([](Job& job, Limits&) {  // planar
    job.places[Stream::positions].stride = job.places[Stream::normals].stride = 16;
    job.places[Stream::normals].offset = 1 << 19;
  }));
  EXPECT_FALSE(isStaged([](Job& job, Limits&) {  // 20 bytes
    job.places[Stream::positions] = {0, 20, VertexFormat::float32x3};
    job.places[Stream::normals] = {12, 20, VertexFormat::float16x4};
  }));
}

// As many pipelines as without: a job at any offset of whole words uses one of them.
TEST(PlanStaged, NeedNoFurtherPipelines) {
  DeviceLimits limits = stagingLimits();
  const auto count = [&limits] {
    return everyVariant(PipelineNeeds{.layout = {.positions = VertexFormat::float32x4,
                                                 .normals = VertexFormat::float32x4}},
                        limits, {})
        ->size();
  };
  const std::size_t staged = count();
  limits.stagedStores = false;
  EXPECT_EQ(count(), staged);

  Job job;
  job.places[Stream::positions] = {0, 32, VertexFormat::float32x4};
  job.places[Stream::normals] = {16, 32, VertexFormat::float32x4};
  const std::vector<Variant> all = *everyVariant(job, stagingLimits(), {});
  for (std::uint64_t moved = 0; moved < 96; moved += 4) {
    job.places[Stream::positions].offset = moved;
    job.places[Stream::normals].offset = moved + 16;
    EXPECT_EQ(*everyVariant(job, stagingLimits(), {}), all) << moved;
  }
}

}  // namespace
}  // namespace dermis::test
