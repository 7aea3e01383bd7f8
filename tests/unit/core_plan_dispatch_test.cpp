// plan: the dispatches of a batch, and that they do its work once.

#include "dermis/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "core_plan_simulation.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

// ---- The number of dispatches

TEST(Plan, OneThousandInstancesOfThreeMeshesInFourteenDispatches) {
  OwnedBatch batch;
  batch.addMesh(meshOf(300, 1, 4, true));
  batch.addMesh(meshOf(777, 4, 4, true));
  batch.addMesh(meshOf(64, 6, 4, true));
  for (std::uint32_t instance = 0; instance < 1000; ++instance) {
    batch.addPose(4, instance % 5 == 0 ? JointPromise::scaling : JointPromise::scaleIgnored);
  }
  for (std::uint32_t instance = 0; instance < 1000; ++instance) {
    batch.addJob(instance % 3, instance,
                 instance % 2 == 0 ? Method::linear : Method::dualQuaternion, instance % 7 != 0);
  }
  const Plan out = planned(batch);
  // The palettes that may scale, and those that do not; then, for both methods with and without
  // normals, a dispatch for each number of influences, and for joints that scale.
  EXPECT_LE(dispatchesOf(out).size(), 14u);
  EXPECT_EQ(out.instanceCount(), 1000u);
  // O(meshes) + O(instances) words: 4 a palette, 8 an instance; 12 a mesh, method, layout, and
  // whether joints may scale.
  EXPECT_LE(out.buffer(BufferRole::tables).size / 4, 500 * 4 + 1000 * 8 + 3 * (4 + 4) * 12u);
}

// However many instances and meshes there are: the palettes of each promise, then a dispatch for
// each form of the kernel.
TEST(Plan, OneMethodAndLayoutIsAFewDispatchesAfterThePalettes) {
  OwnedBatch batch = batchOfFiveMeshes();
  for (int repetition = 0; repetition < 20; ++repetition) {
    for (std::uint32_t mesh = 0; mesh < 5; ++mesh) {
      for (std::uint32_t palette = 0; palette < 4; ++palette) {
        batch.addJob(mesh, palette, Method::dualQuaternion, false);
      }
    }
  }
  const Plan out = planned(batch);
  EXPECT_EQ(dispatchesOf(out)[0].variant.kernel, Kernel::palette);
  // One, two, four, exactly four and eight influences; four with joints that scale.
  EXPECT_EQ(dispatchesOf(out).size(), 3u + 6u);
}

TEST(Plan, LinearBlendingNeedsNoPaletteDispatch) {
  OwnedBatch batch = batchOfFiveMeshes();
  batch.addJob(1, 2, Method::linear, false);
  const Plan out = planned(batch);
  ASSERT_EQ(dispatchesOf(out).size(), 1u);
  EXPECT_EQ(out.buffer(BufferRole::palettes).size, 0u);
  for (std::uint32_t palette = 0; palette < 4; ++palette) {
    EXPECT_EQ(out.statusOffset(palette), std::nullopt);
  }
}

TEST(Plan, PosesThatNoDualQuaternionJobUsesAreLeftOut) {
  OwnedBatch batch = batchOfFiveMeshes();
  batch.addJob(0, 3, Method::dualQuaternion, true);
  batch.addJob(0, 2, Method::linear, true);
  batch.addJob(0, 1, Method::dualQuaternion, true);
  batch.addJob(0, 1, Method::dualQuaternion, true);
  const Plan out = planned(batch);
  EXPECT_EQ(out.statusOffset(0), std::nullopt);
  EXPECT_EQ(out.statusOffset(2), std::nullopt);
  EXPECT_EQ(out.statusOffset(4), std::nullopt);  // there is none
  EXPECT_NE(out.statusOffset(1), std::nullopt);
  EXPECT_NE(out.statusOffset(3), out.statusOffset(1));
  // 9 joints that may scale take 64 bytes each, 7 that may not 32, and each status 16.
  EXPECT_EQ(out.buffer(BufferRole::palettes).size, 16 + 9 * 64 + 16 + 7 * 32u);
}

// Dual quaternions serve all methods but one, which wants logarithms.
TEST(Plan, APoseIsConvertedOnceForEachFormThatIsRead) {
  OwnedBatch batch(meshOf(10, 2, 5, true), 5);
  batch.addPose(7, JointPromise::scaling);
  const auto sizeOf = [&](std::initializer_list<Method> methods, std::uint32_t palette) {
    batch.jobs.clear();
    batch.outputSize = 0;
    for (const Method method : methods) batch.addJob(0, palette, method, true);
    Plan out;
    EXPECT_TRUE(makePlan(batch.batch(), {}, {}, out).ok());
    expectPlanned(batch, {}, {}, out);
    return out.buffer(BufferRole::palettes).size;
  };
  // A status of 16 bytes; a joint is 32, its logarithm 48, scale and shear 32.
  const std::uint64_t dual = 16 + 5 * 32, logarithms = 16 + 5 * 48;
  const std::uint64_t dualScaled = 16 + 7 * 64, logarithmsScaled = 16 + 7 * 80;
  for (const Method method : allMethods) {
    const bool isLog = method == Method::logMatrix, isLinear = method == Method::linear;
    EXPECT_EQ(sizeOf({method}, 0), isLinear ? 0 : isLog ? logarithms : dual) << methodName(method);
    EXPECT_EQ(sizeOf({method, method}, 1), isLinear ? 0 : isLog ? logarithmsScaled : dualScaled);
    EXPECT_EQ(sizeOf({method, Method::dualQuaternion}, 0), isLog ? dual + logarithms : dual);
    EXPECT_EQ(sizeOf({Method::logMatrix, method}, 1),
              isLog || isLinear ? logarithmsScaled : dualScaled + logarithmsScaled);
  }
}

TEST(Plan, APoseInTwoFormsHasAStatusInEither) {
  OwnedBatch batch;
  batch.addMesh(meshOf(10, 2, 5, true));
  for (int palette = 0; palette < 4; ++palette)
    batch.addPose(5, palette % 2 == 0 ? JointPromise::scaling : JointPromise::rigid);
  batch.addJob(0, 0, Method::logMatrix, true);
  batch.addJob(0, 1, Method::logMatrix, true);
  batch.addJob(0, 1, Method::blended, true);
  batch.addJob(0, 2, Method::centerOfRotation, true);
  batch.addJob(0, 3, Method::linear, true);
  const Plan out = planned(batch);
  // As dual quaternions with and without scale, as logarithms likewise.
  const std::vector<PlannedDispatch> dispatches = dispatchesOf(out);
  std::uint32_t palettes = 0;
  for (const PlannedDispatch& dispatch : dispatches)
    palettes += dispatch.variant.kernel == Kernel::palette ? dispatch.workgroupCount : 0;
  EXPECT_EQ(palettes, 4u);
  std::set<std::uint64_t> offsets;
  for (const std::uint32_t palette : {0u, 1u, 2u}) {
    const std::uint64_t offset = out.statusOffset(palette).value();
    EXPECT_LT(offset, out.buffer(BufferRole::palettes).size);
    EXPECT_EQ(offset % 16, 0u);
    offsets.insert(offset);
  }
  EXPECT_EQ(offsets.size(), 3u);
  EXPECT_EQ(out.statusOffset(3), std::nullopt);
}

// A mesh runs in the kernel for its own influences, whatever else is in the batch.
TEST(Plan, TheInfluencesOfAKernelAreThoseOfTheMesh) {
  const std::pair<std::uint32_t, int> classes[] = {{1, 1}, {2, 2}, {3, 4}, {4, 4}, {5, 0}, {8, 0}};
  for (const auto& [influences, expected] : classes) {
    OwnedBatch batch;
    batch.addMesh(meshOf(10, 1, 8, false));
    batch.addMesh(meshOf(10, influences, 8, false));
    batch.addPose(8, JointPromise::scaleIgnored);
    batch.addJob(0, 0, Method::linear, false);
    batch.addJob(1, 0, Method::linear, false);
    batch.addJob(0, 0, Method::linear, false);
    const Plan out = planned(batch);
    const auto has = [&](int number) {
      const std::vector<PlannedDispatch> dispatches = dispatchesOf(out);
      return std::ranges::any_of(dispatches, [&](const PlannedDispatch& dispatch) {
        return dispatch.variant.influences == number;
      });
    };
    EXPECT_EQ(dispatchesOf(out).size(), influences == 1 ? 1u : 2u);
    EXPECT_TRUE(has(1) && has(expected)) << influences;
  }
}

TEST(Plan, AnEmptyBatchIsAnEmptyPlan) {
  Plan out;
  expectEmpty(out);
  OwnedBatch batch = batchOfFiveMeshes();
  for (const Batch& empty : {Batch{}, batch.batch()}) {
    ASSERT_TRUE(makePlan(empty, {}, {}, out).ok());
    expectEmpty(out);
    EXPECT_TRUE(writeTables(out, {}).ok());
  }
}
// ---- Formats, morph targets, motion

/// One mesh with everything, one palette, and jobs that share a layout.
struct PlanFeatures : public ::testing::Test {
  PlanFeatures() {
    batch.addMesh(meshOf(100, 2, 4, MeshParts{true, true, 4}));
    batch.addPose(4, JointPromise::scaleIgnored);
    batch.addPose(4, JointPromise::scaleIgnored);
  }
  Job& add(Job job) { return batch.place(job, Arrangement::separate); }
  Job linear() const { return batch.jobOf(0, 0, Method::linear); }

  OwnedBatch batch;
  Plan out;
};

TEST_F(PlanFeatures, JobsOfDifferentFormatsGoToDifferentDispatches) {
  for (const VertexFormat format : {VertexFormat::float32x3, VertexFormat::float16x4}) {
    for (const VertexFormat normals : {VertexFormat::octahedral16x2, VertexFormat::snorm8x4}) {
      for (int twice = 0; twice < 2; ++twice) {
        Job job = linear();
        job.places[Stream::positions].format = format;
        job.places[Stream::normals].format = normals;
        add(job);
      }
    }
  }
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  EXPECT_EQ(dispatchesOf(out).size(), 4u);
}

TEST_F(PlanFeatures, JobsOfDifferentStoresGoToDifferentDispatches) {
  DeviceLimits limits = richLimits();
  limits.texelBuffers = true;
  for (const std::uint32_t gap : {0u, 4u, 0u, 12u}) {
    Job job = linear();
    job.places[Stream::normals].format = VertexFormat::float16x4;
    batch.place(job, Arrangement::separate, gap);
  }
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, limits, {}, out));
  ASSERT_EQ(dispatchesOf(out).size(), 2u);
  EXPECT_NE(dispatchesOf(out)[0].variant.wide, dispatchesOf(out)[1].variant.wide);
}

TEST_F(PlanFeatures, JobsWithAndWithoutActiveMorphTargetsGoToDifferentDispatches) {
  add(linear()).morphs = batch.keep({{2, 0.5f}});
  add(linear()).morphs = batch.keep({{2, 0.0f}, {1, -0.0f}});
  add(linear()).morphs = batch.keep({{0, -1.0f}, {1, 0.0f}});
  add(linear());
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  ASSERT_EQ(dispatchesOf(out).size(), 2u);
  EXPECT_NE(dispatchesOf(out)[0].variant.morphs, dispatchesOf(out)[1].variant.morphs);
}

TEST_F(PlanFeatures, TheOrderOfMorphTargetsAndThoseOfWeightZeroChangeNothing) {
  add(linear()).morphs = batch.keep({{0, 0.5f}, {1, 0.25f}, {3, 2.0f}});
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  const std::vector<std::uint32_t> tables = tablesOf(out);
  batch.jobs[0].morphs = batch.keep({{3, 2.0f}, {2, 0.0f}, {0, 0.5f}, {1, 0.25f}});
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  EXPECT_EQ(tablesOf(out), tables);
  batch.jobs[0].morphs = batch.keep({{3, 2.0f}, {0, 0.5f}, {1, 0.26f}});
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  EXPECT_NE(tablesOf(out), tables);
}

TEST_F(PlanFeatures, MorphWeightsAreCopied) {
  std::vector<MorphWeight> weights{{1, 0.5f}};
  add(linear()).morphs = weights;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  const std::vector<std::uint32_t> tables = tablesOf(out);
  weights[0] = {99, 7.0f};
  EXPECT_EQ(tablesOf(out), tables);
}

TEST_F(PlanFeatures, InstancesThatRestartOrSettleShareADispatchWithTheOthers) {
  for (const bool restarts : {false, true}) {
    for (const bool settles : {false, true}) {
      Job job = linear();
      job.places[Stream::previousPositions].format = job.places[Stream::positions].format;
      job.restartsMotion = restarts;
      job.settles = settles;
      add(job);
    }
  }
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  EXPECT_EQ(dispatchesOf(out).size(), 1u);
}

// ---- Results

TEST_F(PlanFeatures, ResultsOfLinearJobsAloneAreCleared) {
  Job job = linear();
  add(job);
  job.bounds = true;
  add(job);
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  ASSERT_EQ(dispatchesOf(out).size(), 3u);
  EXPECT_EQ(dispatchesOf(out)[0].variant.kernel, Kernel::clear);
  EXPECT_EQ(dispatchesOf(out)[0].clearPush().resultCount, 1u);
  EXPECT_EQ(dispatchesOf(out)[0].clearPush().workgroupCount, 1u);
  EXPECT_EQ(out.buffer(BufferRole::palettes).size, 0u);
  for (const PlannedDispatch& dispatch : dispatchesOf(out)) {
    EXPECT_EQ(dispatch.isAfterBarrier,
              dispatch.variant.kernel == Kernel::skin && dispatch.variant.bounds);
  }
}

TEST_F(PlanFeatures, ResultsStandInTheOrderOfTheirJobsWithoutGaps) {
  Job plain = linear(), bounded = linear(), snorm = linear();
  bounded.bounds = true;
  snorm.places[Stream::positions].format = VertexFormat::snorm16x4;
  snorm.box = {{0, 0, 0}, {1, 1, 1}};
  for (const Job& job : {plain, snorm, bounded, plain, bounded, snorm}) add(job);
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {}, out));
  EXPECT_EQ(out.resultOffset(0), std::nullopt);
  EXPECT_EQ(out.resultOffset(1), 0u);
  EXPECT_EQ(out.resultOffset(2), 32u);
  EXPECT_EQ(out.resultOffset(3), std::nullopt);
  EXPECT_EQ(out.resultOffset(4), 64u);
  EXPECT_EQ(out.resultOffset(5), 96u);
  EXPECT_EQ(out.buffer(BufferRole::results).size, 128u);
}

TEST_F(PlanFeatures, EnoughWorkgroupsClearTheResults) {
  for (const std::uint32_t size : {8u, 64u, 128u}) {
    for (const std::uint32_t count : {1u, 8u, 9u, 64u, 65u, 200u}) {
      batch.jobs.clear();
      Job job = batch.jobOf(0, 0, Method::dualQuaternion);
      job.bounds = true;
      for (std::uint32_t instance = 0; instance < count; ++instance) add(job);
      ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), {size, 4}, out));
      ASSERT_EQ(dispatchesOf(out)[1].variant.kernel, Kernel::clear);
      EXPECT_EQ(dispatchesOf(out)[1].workgroupCount, (count + size - 1) / size);
    }
  }
}

// ---- Random batches

class PlanTuning
    : public ::testing::TestWithParam<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>> {};

TEST_P(PlanTuning, EveryVertexOfEveryInstanceIsSkinnedOnce) {
  const Tuning tuning{std::get<0>(GetParam()), std::get<1>(GetParam()), std::get<2>(GetParam())};
  Plan out;
  for (const std::uint32_t jobs : {1u, 2u, 17u, 60u}) {
    const OwnedBatch batch = randomBatch(jobs * 31 + tuning.workgroupSize, jobs);
    ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, tuning, out));
    // Folded into y, so that hardly anything is left in x.
    DeviceLimits narrow;
    for (const std::uint32_t count : {1u, 3u, 7u, 64u}) {
      narrow.maxWorkgroupCountX = count;
      ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, narrow, tuning, out));
    }
  }
}

TEST_P(PlanTuning, SoItIsInEveryFormatWithMotionMorphTargetsAndBounds) {
  const Tuning tuning{std::get<0>(GetParam()), std::get<1>(GetParam()), std::get<2>(GetParam())};
  Plan out;
  for (const std::uint32_t jobs : {1u, 30u, 200u}) {
    for (const bool separate : {false, true}) {
      const OwnedBatch batch = randomRichBatch(jobs * 31 + tuning.workgroupSize, jobs, separate);
      ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, richLimits(), tuning, out));
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Plan, PlanTuning,
                         ::testing::Combine(::testing::Values(8u, 16u, 64u, 128u),
                                            ::testing::Values(1u, 2u, 3u, 4u, 16u),
                                            ::testing::Values(0u, 100u)));

TEST(Plan, InvocationsWithFewInstancesSkinSeveralVertices) {
  DeviceLimits limits;
  limits.texelBuffers = true;
  Plan out;
  std::set<std::uint32_t> used;
  for (const std::uint32_t size : {8u, 64u}) {
    for (const std::uint32_t instances : {1u, 4u, 24u}) {
      for (const std::uint32_t vertices : {1u, 2u, 8u, 16u}) {
        for (const std::uint32_t jobs : {1u, 20u, 60u}) {
          const OwnedBatch batch = randomBatch(jobs, jobs);
          ASSERT_NO_FATAL_FAILURE(
              expectPlanned(batch, limits, {size, instances, 0, vertices}, out));
          for (const PlannedDispatch& dispatch : dispatchesOf(out)) {
            if (dispatch.variant.kernel == Kernel::skin)
              used.insert(dispatch.skinPush().verticesPerInvocation);
          }
        }
      }
    }
  }
  EXPECT_EQ(used, (std::set<std::uint32_t>{1, 2, 4, 8, 16}));
}

TEST(Plan, InstancesWithDifferentBoxesAreNotCountedUp) {
  const auto isEven = [](float size) {
    OwnedBatch batch = batchOfFiveMeshes();
    for (std::uint32_t number = 0; number < 5; ++number) {
      Job job = batch.jobOf(0, 0, Method::dualQuaternion);
      job.places[Stream::positions].format = VertexFormat::snorm16x4;
      job.box = {{-1, -1, -1}, {1, number == 3 ? size : 1, 1}};
      batch.place(job, Arrangement::interleaved);
    }
    Plan out;
    expectPlanned(batch, richLimits(), {}, out);
    const PlannedDispatch skin = dispatchesOf(out).back();
    const auto group = abi::load<abi::GroupRecord>(tablesOf(out), skin.skinPush().groups);
    return (group.instancesEach & abi::EVENLY_SPACED) != 0;
  };
  EXPECT_TRUE(isEven(1));
  EXPECT_FALSE(isEven(2));
}

TEST(Plan, Truth20_TheOrderOfJobsChangesNothingForThem) {
  OwnedBatch batch = randomBatch(5, 40);
  Plan out;
  std::mt19937 engine(1);
  for (int trial = 0; trial < 5; ++trial) {
    std::shuffle(batch.jobs.begin(), batch.jobs.end(), engine);
    ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
  }
  OwnedBatch rich = randomRichBatch(5, 40, true);
  for (int trial = 0; trial < 5; ++trial) {
    std::shuffle(rich.jobs.begin(), rich.jobs.end(), engine);
    ASSERT_NO_FATAL_FAILURE(expectPlanned(rich, richLimits(), {}, out));
  }
}

}  // namespace
}  // namespace dermis::test
