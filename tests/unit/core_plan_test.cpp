// plan: the dispatches and tables of a batch. A stand-in for the kernels reads the tables as
// shaders/abi.h lays them out and marks what they would write.

#include "dermis/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <random>
#include <set>
#include <unordered_map>

#include "abi.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

PackedMesh meshOf(std::uint32_t vertices, std::uint32_t influences, std::uint32_t joints,
                  bool normals) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = influences;
  mesh.positions.assign(std::size_t{vertices} * 3, 1.0f);
  if (normals) mesh.normals.assign(std::size_t{vertices} * 3, 1.0f);
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      mesh.joints.push_back(joints - 1 - slot % joints);
      mesh.weights.push_back(1.0f / static_cast<float>(influences));
    }
  }
  Result<PackedMesh> packed = pack(mesh.view(), joints);
  EXPECT_TRUE(packed.ok());
  return std::move(*packed);
}

/// A batch that owns what it points to. Meshes and palettes are laid out one after another.
struct OwnedBatch {
  std::vector<PackedMesh> meshes;
  std::vector<std::uint64_t> meshOffsets;
  std::vector<Palette> palettes;
  std::vector<Job> jobs;
  std::uint64_t meshesSize = 0, matricesSize = 0, outputSize = 0;

  void addMesh(PackedMesh mesh) {
    meshOffsets.push_back(meshesSize);
    meshesSize += mesh.bytes().size();
    meshes.push_back(std::move(mesh));
  }
  void addPalette(std::uint32_t joints, bool mayScale) {
    palettes.push_back({joints, matricesSize, mayScale});
    matricesSize += std::uint64_t{joints} * 48;
  }
  /// Positions, and normals behind them, in a stretch of its own at the output's end.
  Job& addJob(std::uint32_t mesh, std::uint32_t palette, Method method, bool normals,
              std::uint32_t stride = 24) {
    Job job;
    job.mesh = meshes[mesh].info();
    job.meshOffset = meshOffsets[mesh];
    job.palette = palette;
    job.method = method;
    job.positions = {outputSize, stride};
    if (normals) job.normals = {outputSize + 12, stride};
    outputSize += std::uint64_t{meshes[mesh].vertexCount()} * stride;
    jobs.push_back(job);
    return jobs.back();
  }
  Batch batch() const { return {palettes, jobs, meshesSize, matricesSize, outputSize}; }
};

std::vector<std::uint32_t> tablesOf(const Plan& plan) {
  std::vector<std::uint32_t> words(plan.buffer(BufferRole::tables).size / 4);
  EXPECT_TRUE(writeTables(plan, std::as_writable_bytes(std::span(words))).ok());
  return words;
}

/// What the kernels would do with a plan; fails the test where that is not the batch's work, done
/// once.
class Simulation {
 public:
  Simulation(const OwnedBatch& batch, const DeviceLimits& limits, const Tuning& tuning,
             const Plan& plan)
      : batch_(batch), limits_(limits), tuning_(tuning), plan_(plan), tables_(tablesOf(plan)) {
    for (std::uint32_t index = 0; index < batch.jobs.size(); ++index) {
      const Job& job = batch.jobs[index];
      for (std::uint32_t vertex = 0; vertex < job.mesh.vertexCount; ++vertex) {
        places_[job.positions.offset + std::uint64_t{vertex} * job.positions.stride] = {index,
                                                                                        vertex};
      }
    }
  }

  void run() {
    bool palettesDone = false;
    std::vector<Variant> used;
    for (const Dispatch& dispatch : plan_.dispatches()) {
      ASSERT_NO_FATAL_FAILURE(checkDispatch(dispatch));
      if (std::find(used.begin(), used.end(), dispatch.variant) == used.end()) {
        used.push_back(dispatch.variant);
      }
      if (dispatch.variant.kernel == Kernel::palette) {
        ASSERT_FALSE(palettesDone) << "one dispatch for all palettes";
        palettesDone = true;
        ASSERT_FALSE(dispatch.afterPalettes);
        ASSERT_NO_FATAL_FAILURE(runPalettes(dispatch));
      } else {
        const bool needsPalettes = dispatch.variant.method == Method::dualQuaternion;
        ASSERT_EQ(dispatch.afterPalettes, needsPalettes);
        ASSERT_TRUE(palettesDone || !needsPalettes);
        ASSERT_NO_FATAL_FAILURE(runSkin(dispatch));
      }
    }
    // Every vertex of every instance, once: a second time would have failed above.
    ASSERT_EQ(written_.size(), places_.size());
    ASSERT_EQ(plan_.vertexCount(), places_.size());
    ASSERT_EQ(plan_.instanceCount(), batch_.jobs.size());
    ASSERT_TRUE(std::ranges::equal(plan_.variants(), used));
  }

 private:
  struct Place {
    std::uint32_t job, vertex;
  };

  std::uint32_t word(std::uint64_t index) const { return tables_.at(index); }

  void checkDispatch(const Dispatch& dispatch) {
    const std::uint64_t groups = std::uint64_t{dispatch.groupCountX} * dispatch.groupCountY;
    ASSERT_GE(dispatch.groupCountX, 1u);
    ASSERT_LE(dispatch.groupCountX, limits_.maxWorkgroupCountX);
    ASSERT_LE(dispatch.groupCountY, limits_.maxWorkgroupCountY);
    ASSERT_GE(groups, dispatch.constants.workgroupCount);
    // Hardly any workgroup is started in vain.
    ASSERT_LT(groups, std::uint64_t{dispatch.constants.workgroupCount} + dispatch.groupCountY);
    ASSERT_EQ(dispatch.variant.workgroupSize, tuning_.workgroupSize);
  }

  void runPalettes(const Dispatch& dispatch) {
    std::set<std::uint32_t> wanted;
    for (const Job& job : batch_.jobs) {
      if (job.method == Method::dualQuaternion) wanted.insert(job.palette);
    }
    ASSERT_EQ(dispatch.constants.workgroupCount, wanted.size());
    ASSERT_EQ(dispatch.constants.recordCount, wanted.size());
    std::uint64_t end = 0;
    for (std::uint32_t number = 0; number < dispatch.constants.workgroupCount; ++number) {
      const std::uint64_t record = dispatch.constants.firstRecord + number * abi::PALETTE_WORDS;
      const std::uint64_t status = std::uint64_t{word(record + abi::PALETTE_OUTPUT)} * 16;
      const auto found = std::find_if(wanted.begin(), wanted.end(), [&](std::uint32_t palette) {
        return plan_.statusOffset(palette) == status;
      });
      ASSERT_NE(found, wanted.end());
      const Palette& palette = batch_.palettes[*found];
      wanted.erase(found);
      ASSERT_EQ(std::uint64_t{word(record + abi::PALETTE_MATRICES)} * 16, palette.matrixOffset);
      ASSERT_EQ(word(record + abi::PALETTE_JOINTS), palette.jointCount);
      ASSERT_EQ(word(record + abi::PALETTE_MAY_SCALE), palette.mayScale ? 1u : 0u);
      ASSERT_GE(status, end) << "palettes overlap";
      end = status + 16 + std::uint64_t{palette.jointCount} * (palette.mayScale ? 64 : 32);
      ASSERT_LE(end, plan_.buffer(BufferRole::palettes).size);
    }
    ASSERT_TRUE(wanted.empty());
    ASSERT_EQ(end, plan_.buffer(BufferRole::palettes).size);
  }

  void runSkin(const Dispatch& dispatch) {
    const DispatchConstants& constants = dispatch.constants;
    ASSERT_EQ(dispatch.variant.instancesPerInvocation, tuning_.instancesPerInvocation);
    ASSERT_EQ(dispatch.outputOffset, dispatch.outputWindow * outputWindowStep(limits_));
    ASSERT_EQ(dispatch.outputOffset % limits_.minStorageBufferOffsetAlignment, 0u);
    for (std::uint32_t number = 0; number < constants.workgroupCount; ++number) {
      // The first group whose end lies behind the workgroup's number.
      std::uint32_t index = 0, begin = 0, end = 0;
      for (;; ++index) {
        ASSERT_LT(index, constants.recordCount) << "workgroup " << number << " has no group";
        begin = end;
        end = word(std::uint64_t{constants.firstRecord} + index * abi::GROUP_WORDS +
                   abi::GROUP_WORKGROUP_END);
        ASSERT_GT(end, begin) << "an empty group";
        if (number < end) break;
      }
      ASSERT_NO_FATAL_FAILURE(
          runWorkgroup(dispatch, constants.firstRecord + index * abi::GROUP_WORDS, number - begin));
    }
  }

  void runWorkgroup(const Dispatch& dispatch, std::uint32_t group, std::uint32_t local) {
    const std::uint32_t vertexGroups = word(group + abi::GROUP_VERTEX_GROUPS);
    const std::uint32_t firstVertex = word(group + abi::GROUP_FIRST_VERTEX);
    const std::uint32_t instancesEach = dispatch.variant.instancesPerInvocation;
    const std::uint32_t firstInstance = local / vertexGroups * instancesEach;
    ASSERT_LT(firstInstance, word(group + abi::GROUP_INSTANCE_COUNT)) << "an idle workgroup";
    for (std::uint32_t lane = 0; lane < dispatch.variant.workgroupSize; ++lane) {
      const std::uint32_t vertex =
          firstVertex + local % vertexGroups * dispatch.variant.workgroupSize + lane;
      if (vertex >= word(group + abi::GROUP_VERTEX_END)) {
        ASSERT_GT(lane, 0u) << "an idle workgroup";
        break;
      }
      const std::uint32_t end =
          std::min(firstInstance + instancesEach, word(group + abi::GROUP_INSTANCE_COUNT));
      for (std::uint32_t instance = firstInstance; instance < end; ++instance) {
        const std::uint64_t record =
            std::uint64_t{dispatch.constants.instanceRecords} +
            (word(group + abi::GROUP_FIRST_INSTANCE) + instance) * abi::INSTANCE_WORDS;
        ASSERT_NO_FATAL_FAILURE(writeVertex(dispatch, group, record, vertex, vertex - firstVertex));
      }
    }
  }

  void writeVertex(const Dispatch& dispatch, std::uint32_t group, std::uint64_t record,
                   std::uint32_t vertex, std::uint32_t run) {
    const auto byteOf = [&](std::uint32_t firstWord, std::uint32_t stride) {
      return (word(firstWord) + std::uint64_t{run} * stride) * 4;
    };
    const std::uint64_t positions =
        byteOf(static_cast<std::uint32_t>(record) + abi::INSTANCE_POSITIONS,
               word(group + abi::GROUP_POSITION_STRIDE));
    const auto found = places_.find(dispatch.outputOffset + positions);
    ASSERT_NE(found, places_.end()) << "a write that no job asked for";
    ASSERT_EQ(found->second.vertex, vertex);
    ASSERT_TRUE(written_.insert(found->first).second) << "a vertex is skinned twice";
    const Job& job = batch_.jobs[found->second.job];
    ASSERT_EQ(dispatch.variant.method, job.method);
    ASSERT_EQ(std::uint64_t{word(group + abi::GROUP_MESH)} * 4, job.meshOffset);
    ASSERT_TRUE(dispatch.variant.influences == 0 ||
                dispatch.variant.influences >= job.mesh.maxInfluences);
    const Palette& palette = batch_.palettes[job.palette];
    ASSERT_EQ(word(record + abi::INSTANCE_JOINTS), palette.jointCount);
    ASSERT_EQ(
        std::uint64_t{word(record + abi::INSTANCE_PALETTE)} * 16,
        job.method == Method::linear ? palette.matrixOffset : plan_.statusOffset(job.palette));
    const std::uint64_t range =
        std::min(limits_.maxStorageBufferRange, batch_.outputSize - dispatch.outputOffset);
    ASSERT_LE(positions + 12, range) << "outside the output range";
    const bool normals = job.normals.stride != 0;
    ASSERT_EQ(dispatch.variant.normals, normals);
    if (!normals) return;
    const std::uint64_t normal = byteOf(static_cast<std::uint32_t>(record) + abi::INSTANCE_NORMALS,
                                        word(group + abi::GROUP_NORMAL_STRIDE));
    ASSERT_LE(normal + 12, range) << "outside the output range";
    ASSERT_EQ(dispatch.outputOffset + normal,
              job.normals.offset + std::uint64_t{vertex} * job.normals.stride);
  }

  const OwnedBatch& batch_;
  const DeviceLimits& limits_;
  const Tuning& tuning_;
  const Plan& plan_;
  std::vector<std::uint32_t> tables_;
  std::unordered_map<std::uint64_t, Place> places_;
  std::set<std::uint64_t> written_;
};

void expectPlanned(const OwnedBatch& batch, const DeviceLimits& limits, const Tuning& tuning,
                   Plan& out) {
  const Result<void> result = makePlan(batch.batch(), limits, tuning, out);
  ASSERT_TRUE(result.ok()) << result.error().message;
  Simulation(batch, limits, tuning, out).run();
}

/// Meshes of awkward counts, with and without normals, with 1 to 8 influences.
void addMeshes(OwnedBatch& batch) {
  batch.addMesh(meshOf(1, 1, 3, true));
  batch.addMesh(meshOf(63, 2, 5, false));
  batch.addMesh(meshOf(64, 4, 5, true));
  batch.addMesh(meshOf(65, 8, 5, true));
  batch.addMesh(meshOf(1234, 3, 5, true));
}

void addPalettes(OwnedBatch& batch) {
  for (const std::uint32_t joints : {5u, 9u, 300u, 7u}) batch.addPalette(joints, joints % 2 == 1);
}

// ---- The number of dispatches

// The demand, counted.
TEST(Plan, OneThousandInstancesOfThreeMeshesInAtMostSixDispatches) {
  OwnedBatch batch;
  batch.addMesh(meshOf(300, 1, 4, true));
  batch.addMesh(meshOf(777, 4, 4, true));
  batch.addMesh(meshOf(64, 6, 4, true));
  for (std::uint32_t instance = 0; instance < 1000; ++instance) {
    batch.addPalette(4, instance % 5 == 0);
  }
  for (std::uint32_t instance = 0; instance < 1000; ++instance) {
    batch.addJob(instance % 3, instance,
                 instance % 2 == 0 ? Method::linear : Method::dualQuaternion, instance % 7 != 0);
  }
  Plan out;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
  EXPECT_LE(out.dispatches().size(), 6u);
  EXPECT_EQ(out.instanceCount(), 1000u);
  // O(meshes) + O(instances) words: 4 a palette, 4 an instance, 12 a mesh, method and layout.
  EXPECT_LE(out.buffer(BufferRole::tables).size / 4, 500 * 4 + 1000 * 4 + 12 * 12u);
}

TEST(Plan, OneMethodAndLayoutIsOneDispatchAfterThePalettes) {
  OwnedBatch batch;
  addMeshes(batch);
  addPalettes(batch);
  for (std::uint32_t mesh = 0; mesh < 5; ++mesh) {
    for (std::uint32_t palette = 0; palette < 4; ++palette) {
      batch.addJob(mesh, palette, Method::dualQuaternion, false);
    }
  }
  Plan out;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
  ASSERT_EQ(out.dispatches().size(), 2u);
  EXPECT_EQ(out.dispatches()[0].variant.kernel, Kernel::palette);
  EXPECT_EQ(out.dispatches()[1].variant.influences, 0);  // eight is any number
}

TEST(Plan, LinearBlendingNeedsNoPaletteDispatch) {
  OwnedBatch batch;
  addMeshes(batch);
  addPalettes(batch);
  batch.addJob(1, 2, Method::linear, false);
  Plan out;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
  ASSERT_EQ(out.dispatches().size(), 1u);
  EXPECT_EQ(out.buffer(BufferRole::palettes).size, 0u);
  for (std::uint32_t palette = 0; palette < 4; ++palette) {
    EXPECT_EQ(out.statusOffset(palette), Plan::noStatus);
  }
}

TEST(Plan, PalettesThatNoDualQuaternionJobUsesAreLeftOut) {
  OwnedBatch batch;
  addMeshes(batch);
  addPalettes(batch);
  batch.addJob(0, 3, Method::dualQuaternion, true);
  batch.addJob(0, 2, Method::linear, true);
  batch.addJob(0, 1, Method::dualQuaternion, true);
  batch.addJob(0, 1, Method::dualQuaternion, true);
  Plan out;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
  EXPECT_EQ(out.statusOffset(0), Plan::noStatus);
  EXPECT_EQ(out.statusOffset(2), Plan::noStatus);
  EXPECT_EQ(out.statusOffset(4), Plan::noStatus);  // there is none
  EXPECT_NE(out.statusOffset(1), Plan::noStatus);
  EXPECT_NE(out.statusOffset(3), out.statusOffset(1));
  // 9 joints that may scale, 7 joints that may: 64 bytes each, and a status of 16.
  EXPECT_EQ(out.buffer(BufferRole::palettes).size, 16 + 9 * 64 + 16 + 7 * 64u);
}

TEST(Plan, TheInfluenceClassFitsTheMostInfluencedMesh) {
  const std::pair<std::uint32_t, int> classes[] = {{1, 1}, {2, 2}, {3, 4}, {4, 4}, {5, 0}, {8, 0}};
  for (const auto& [influences, expected] : classes) {
    OwnedBatch batch;
    batch.addMesh(meshOf(10, 1, 8, false));
    batch.addMesh(meshOf(10, influences, 8, false));
    batch.addPalette(8, false);
    batch.addJob(0, 0, Method::linear, false);
    batch.addJob(1, 0, Method::linear, false);
    batch.addJob(0, 0, Method::linear, false);
    Plan out;
    ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
    ASSERT_EQ(out.dispatches().size(), 1u);
    EXPECT_EQ(out.dispatches()[0].variant.influences, expected) << influences;
  }
}

TEST(Plan, AnEmptyBatchIsAnEmptyPlan) {
  Plan out;
  EXPECT_TRUE(out.dispatches().empty());
  EXPECT_EQ(out.buffer(BufferRole::tables).size, 0u);
  OwnedBatch batch;
  addMeshes(batch);
  addPalettes(batch);
  for (const Batch& empty : {Batch{}, batch.batch()}) {
    ASSERT_TRUE(makePlan(empty, {}, {}, out).ok());
    EXPECT_TRUE(out.dispatches().empty());
    EXPECT_TRUE(out.variants().empty());
    EXPECT_EQ(out.instanceCount(), 0u);
    EXPECT_EQ(out.vertexCount(), 0u);
    EXPECT_EQ(out.buffer(BufferRole::tables).size, 0u);
    EXPECT_EQ(out.buffer(BufferRole::palettes).size, 0u);
    EXPECT_EQ(out.statusOffset(0), Plan::noStatus);
    EXPECT_TRUE(writeTables(out, {}).ok());
  }
}

// ---- Random batches

OwnedBatch randomBatch(std::uint32_t seed, std::uint32_t jobs) {
  std::mt19937 engine(seed);
  OwnedBatch batch;
  addMeshes(batch);
  addPalettes(batch);
  // The same mesh may stand twice in the mesh buffer.
  batch.meshesSize += 16;
  batch.addMesh(meshOf(64, 4, 5, true));
  for (std::uint32_t index = 0; index < jobs; ++index) {
    batch.outputSize += engine() % 5 * 4;
    const auto mesh = static_cast<std::uint32_t>(engine() % batch.meshes.size());
    const bool normals = batch.meshes[mesh].hasNormals() && engine() % 3 != 0;
    const std::uint32_t stride = (normals ? 24 : 12) + static_cast<std::uint32_t>(engine() % 3) * 4;
    Job& job =
        batch.addJob(mesh, static_cast<std::uint32_t>(engine() % 4),
                     engine() % 2 == 0 ? Method::linear : Method::dualQuaternion, normals, stride);
    if (!normals || engine() % 2 == 0) continue;
    // Planar: first all positions, then all normals with a stride of their own.
    const std::uint32_t vertices = job.mesh.vertexCount;
    job.positions.stride = 12 + static_cast<std::uint32_t>(engine() % 2) * 4;
    job.normals.offset = job.positions.offset + std::uint64_t{vertices} * job.positions.stride;
    job.normals.stride = 12 + static_cast<std::uint32_t>(engine() % 3) * 4;
    batch.outputSize = job.normals.offset + std::uint64_t{vertices} * job.normals.stride;
  }
  return batch;
}

class PlanTuning : public ::testing::TestWithParam<std::tuple<std::uint32_t, std::uint32_t>> {};

TEST_P(PlanTuning, EveryVertexOfEveryInstanceIsSkinnedOnce) {
  const Tuning tuning{std::get<0>(GetParam()), std::get<1>(GetParam())};
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

INSTANTIATE_TEST_SUITE_P(Plan, PlanTuning,
                         ::testing::Combine(::testing::Values(8u, 16u, 64u, 128u),
                                            ::testing::Values(1u, 2u, 3u, 4u, 16u)));

TEST(Plan, Truth20_TheOrderOfJobsChangesNothingForThem) {
  OwnedBatch batch = randomBatch(5, 40);
  Plan out;
  std::mt19937 engine(1);
  for (int trial = 0; trial < 5; ++trial) {
    std::shuffle(batch.jobs.begin(), batch.jobs.end(), engine);
    ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
  }
}

// ---- Outputs larger than a storage buffer range

TEST(Plan, OutputRangesStepByLessThanTheyAreLong) {
  for (const std::uint64_t range : {std::uint64_t{16384}, std::uint64_t{65536},
                                    std::uint64_t{1} << 27, (std::uint64_t{1} << 32) - 1}) {
    for (const std::uint32_t alignment : {4u, 16u, 64u, 256u}) {
      const DeviceLimits limits{range, alignment, 65535, 65535};
      const std::uint64_t step = outputWindowStep(limits);
      EXPECT_EQ(step % alignment, 0u);
      EXPECT_LT(step, range);
      EXPECT_GE(step, range * 3 / 4);
    }
  }
}

class PlanWindows : public ::testing::TestWithParam<std::tuple<std::uint64_t, std::uint32_t>> {};

TEST_P(PlanWindows, EveryWriteLiesInItsRange) {
  const std::uint64_t range = std::get<0>(GetParam());
  const std::uint32_t alignment = std::get<1>(GetParam());
  const DeviceLimits limits{range, alignment, 65535, 65535};
  for (std::uint32_t seed = 1; seed <= 6; ++seed) {
    OwnedBatch batch = randomBatch(seed, 60);
    // Planar normals lie too far from their positions for ranges as short as these.
    std::erase_if(batch.jobs, [&](const Job& job) {
      return job.normals.stride != 0 && job.normals.offset - job.positions.offset > range / 16 / 2;
    });
    ASSERT_GT(batch.outputSize, range);
    Plan out;
    ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, limits, {16, 3}, out));
    std::set<std::uint32_t> windows;
    for (const Dispatch& dispatch : out.dispatches()) windows.insert(dispatch.outputWindow);
    EXPECT_GT(windows.size(), 1u);
    // One more dispatch a range of output and a combination of method and attributes.
    EXPECT_LE(out.dispatches().size(), 1 + 4 * (batch.outputSize / outputWindowStep(limits) + 1));
    EXPECT_EQ(out.instanceCount(), batch.jobs.size());
  }
}

INSTANTIATE_TEST_SUITE_P(Plan, PlanWindows,
                         ::testing::Combine(::testing::Values(80000u, 81916u, 98304u, 131072u),
                                            ::testing::Values(4u, 64u, 256u)));

TEST(Plan, AnInstanceLongerThanARangeIsCutByVertices) {
  OwnedBatch batch;
  batch.addMesh(meshOf(1234, 1, 1, true));
  batch.addPalette(1, false);
  Job& job = batch.addJob(0, 0, Method::dualQuaternion, true, 512);
  job.normals.offset += 100;
  const DeviceLimits limits{65536, 256, 65535, 65535};
  ASSERT_GT(batch.outputSize, 9 * limits.maxStorageBufferRange);
  Plan out;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, limits, {64, 4}, out));
  EXPECT_EQ(out.instanceCount(), 1u);
  EXPECT_EQ(out.vertexCount(), 1234u);
  EXPECT_GE(out.dispatches().size(), 1 + 9u);
}

// However far apart a vertex' attributes lie: what is not refused fits.
TEST(Plan, AttributesThatLieFarApartFitOrAreRefused) {
  OwnedBatch batch;
  batch.addMesh(meshOf(400, 1, 1, true));
  batch.addPalette(1, false);
  Job& job = batch.addJob(0, 0, Method::linear, true, 512);
  batch.outputSize += 65536;
  const DeviceLimits limits{65536, 256, 65535, 65535};
  int good = 0, refused = 0;
  for (std::uint64_t apart = 12; apart < 65536; apart += apart < 10000 ? 332 : 7332) {
    SCOPED_TRACE(apart);
    job.normals.offset = job.positions.offset + apart;
    Plan out;
    const Result<void> result = makePlan(batch.batch(), limits, {64, 4}, out);
    if (result) {
      ++good;
      ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, limits, {64, 4}, out));
    } else {
      ++refused;
      ASSERT_EQ(result.error().code, ErrorCode::limitExceeded);
      ASSERT_NE(result.error().message.find("job 0"), std::string::npos);
    }
  }
  EXPECT_GT(good, 5);
  EXPECT_GT(refused, 5);
}

TEST(Plan, AnOutputOfExactlyOneRangeIsNotCut) {
  OwnedBatch batch;
  batch.addMesh(meshOf(1234, 1, 1, true));
  batch.addPalette(1, false);
  batch.addJob(0, 0, Method::linear, true, 64);
  const DeviceLimits limits{1234 * 64, 256, 65535, 65535};
  Plan out;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, limits, {}, out));
  EXPECT_EQ(out.dispatches().size(), 1u);
  batch.outputSize += 4;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, limits, {}, out));
  EXPECT_GT(out.dispatches().size(), 1u);
}

// Farther into the output than 32 bits can count.
TEST(Plan, OutputOffsetsHave64Bits) {
  OwnedBatch batch;
  batch.addMesh(meshOf(100, 1, 1, true));
  batch.addPalette(1, false);
  for (const std::uint64_t offset :
       {std::uint64_t{0}, std::uint64_t{5} << 32, (std::uint64_t{7} << 40) + 12}) {
    batch.outputSize = offset;
    batch.addJob(0, 0, Method::linear, true);
  }
  Plan out;
  ASSERT_NO_FATAL_FAILURE(expectPlanned(batch, {}, {}, out));
  EXPECT_EQ(out.dispatches().size(), 3u);
}

// ---- What a plan says of itself

TEST(Plan, BuffersAreDescribed) {
  const OwnedBatch batch = randomBatch(9, 20);
  DeviceLimits limits;
  limits.minStorageBufferOffsetAlignment = 64;
  Plan out;
  ASSERT_TRUE(makePlan(batch.batch(), limits, {}, out).ok());
  const std::uint32_t storage = 0x20, transferTarget = 0x02;  // VkBufferUsageFlagBits
  const struct {
    BufferRole role;
    std::uint64_t size;
    std::uint32_t usage;
    bool perFrame, hostWritten;
  } expected[] = {{BufferRole::meshes, batch.meshesSize, storage | transferTarget, false, true},
                  {BufferRole::matrices, batch.matricesSize, storage, true, true},
                  {BufferRole::output, batch.outputSize, storage, false, false}};
  for (const auto& [role, size, usage, perFrame, hostWritten] : expected) {
    const BufferRequirement buffer = out.buffer(role);
    EXPECT_EQ(buffer.size, size);
    EXPECT_EQ(buffer.alignment, 64u);
    EXPECT_EQ(buffer.usage & usage, usage);
    EXPECT_EQ(buffer.perFrame, perFrame);
    EXPECT_EQ(buffer.hostWritten, hostWritten);
  }
  EXPECT_TRUE(out.buffer(BufferRole::tables).perFrame);
  EXPECT_TRUE(out.buffer(BufferRole::tables).hostWritten);
  EXPECT_TRUE(out.buffer(BufferRole::palettes).perFrame);
  EXPECT_FALSE(out.buffer(BufferRole::palettes).hostWritten);
  EXPECT_EQ(out.buffer(BufferRole::palettes).usage & storage, storage);
}

TEST(Plan, StatusHasFourWords) {
  EXPECT_EQ(sizeof(PaletteStatus), 16u);
  EXPECT_EQ(offsetof(PaletteStatus, twoPhase), abi::STATUS_TWO_PHASE * 4);
  EXPECT_EQ(offsetof(PaletteStatus, nonRigidJoints), abi::STATUS_NON_RIGID * 4);
  EXPECT_EQ(offsetof(PaletteStatus, undeclaredScale), abi::STATUS_UNDECLARED_SCALE * 4);
  EXPECT_EQ(offsetof(PaletteStatus, nonFiniteJoints), abi::STATUS_NON_FINITE * 4);
}

TEST(Plan, PushConstantsStandInTheOrderOfAbiH) {
  EXPECT_EQ(offsetof(DispatchConstants, firstRecord), abi::PUSH_FIRST_RECORD * 4);
  EXPECT_EQ(offsetof(DispatchConstants, recordCount), abi::PUSH_RECORD_COUNT * 4);
  EXPECT_EQ(offsetof(DispatchConstants, workgroupCount), abi::PUSH_WORKGROUP_COUNT * 4);
  EXPECT_EQ(offsetof(DispatchConstants, instanceRecords), abi::PUSH_INSTANCE_RECORDS * 4);
  EXPECT_EQ(sizeof(DispatchConstants), abi::PUSH_WORDS * 4);
}

TEST(Plan, VariantKeysAreAllDifferent) {
  std::set<std::uint64_t> keys;
  std::size_t count = 0;
  for (const Kernel kernel : {Kernel::palette, Kernel::skin}) {
    for (const Method method : allMethods) {
      for (const bool normals : {false, true}) {
        for (const std::uint8_t influences : std::initializer_list<std::uint8_t>{0, 1, 2, 4, 255}) {
          for (const std::uint8_t instances :
               std::initializer_list<std::uint8_t>{1, 2, 3, 4, 16, 255}) {
            for (const std::uint16_t size :
                 std::initializer_list<std::uint16_t>{8, 64, 128, 65535}) {
              keys.insert(Variant{kernel, method, normals, influences, instances, size}.key());
              ++count;
            }
          }
        }
      }
    }
  }
  EXPECT_EQ(keys.size(), count);
}

TEST(Plan, EveryVariantHasWhatAnyPlanNeeds) {
  for (const Tuning& tuning : {Tuning{}, Tuning{8, 1}, Tuning{128, 16}}) {
    const std::vector<Variant> all = everyVariant(tuning);
    std::set<std::uint64_t> keys;
    for (const Variant& variant : all) keys.insert(variant.key());
    EXPECT_EQ(keys.size(), all.size()) << "one stands twice";
    // Each method, with and without normals, for 1, 2, 4 and any number of influences; palettes.
    EXPECT_EQ(all.size(), 2 * 2 * 4 + 1u);
    for (const std::uint32_t influences : {1u, 2u, 3u, 4u, 5u}) {
      for (const Method method : allMethods) {
        for (const bool normals : {false, true}) {
          OwnedBatch batch;
          batch.addMesh(meshOf(10, influences, 8, true));
          batch.addPalette(8, false);
          batch.addJob(0, 0, method, normals);
          Plan out;
          ASSERT_TRUE(makePlan(batch.batch(), {}, tuning, out).ok());
          for (const Variant& variant : out.variants()) {
            EXPECT_NE(std::find(all.begin(), all.end(), variant), all.end());
            keys.erase(variant.key());
          }
        }
      }
    }
    EXPECT_TRUE(keys.empty()) << "one that no plan needs";
  }
}

bool samePlan(const Plan& a, const Plan& b) {
  const auto sameDispatch = [](const Dispatch& x, const Dispatch& y) -> bool {
    return x.variant == y.variant && x.groupCountX == y.groupCountX &&
           x.groupCountY == y.groupCountY &&
           std::memcmp(&x.constants, &y.constants, sizeof(x.constants)) == 0 &&
           x.afterPalettes == y.afterPalettes && x.outputOffset == y.outputOffset &&
           x.outputWindow == y.outputWindow;
  };
  return tablesOf(a) == tablesOf(b) &&
         std::ranges::equal(a.dispatches(), b.dispatches(), sameDispatch) &&
         std::ranges::equal(a.variants(), b.variants()) && a.instanceCount() == b.instanceCount() &&
         a.vertexCount() == b.vertexCount() &&
         a.buffer(BufferRole::palettes).size == b.buffer(BufferRole::palettes).size;
}

TEST(Plan, AReusedObjectIsAsGoodAsANewOne) {
  Plan reused;
  const DeviceLimits narrow{81920, 64, 50, 65535};
  for (const std::uint32_t seed : {1u, 2u, 3u, 4u}) {
    OwnedBatch batch = randomBatch(seed, seed * 11);
    for (const DeviceLimits& limits : {DeviceLimits{}, narrow}) {
      std::erase_if(batch.jobs, [&](const Job& job) {
        return job.normals.stride != 0 && job.normals.offset - job.positions.offset > 2048;
      });
      Plan fresh;
      ASSERT_TRUE(makePlan(batch.batch(), limits, {}, fresh).ok());
      ASSERT_TRUE(makePlan(batch.batch(), limits, {}, reused).ok());
      EXPECT_TRUE(samePlan(fresh, reused)) << seed;
      for (std::uint32_t palette = 0; palette < 5; ++palette) {
        EXPECT_EQ(fresh.statusOffset(palette), reused.statusOffset(palette));
      }
    }
  }
}

TEST(Plan, MovesWithItsContents) {
  const OwnedBatch batch = randomBatch(2, 10);
  Plan first, second;
  ASSERT_TRUE(makePlan(batch.batch(), {}, {}, first).ok());
  ASSERT_TRUE(makePlan(batch.batch(), {}, {}, second).ok());
  const Plan moved = std::move(first);
  EXPECT_TRUE(samePlan(moved, second));
}

TEST(Plan, TablesAreWrittenWhereThereIsRoom) {
  const OwnedBatch batch = randomBatch(3, 10);
  Plan out;
  ASSERT_TRUE(makePlan(batch.batch(), {}, {}, out).ok());
  const std::size_t size = out.buffer(BufferRole::tables).size;
  std::vector<std::byte> bytes(size + 16, std::byte{0xab});
  ASSERT_TRUE(writeTables(out, bytes).ok());
  for (std::size_t i = size; i < bytes.size(); ++i) EXPECT_EQ(bytes[i], std::byte{0xab});
  const Result<void> result = writeTables(out, std::span(bytes).first(size - 1));
  ASSERT_FALSE(result.ok());
  EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(result.error().message.find(std::to_string(size)), std::string::npos);
}

// ---- What is refused

/// A good batch of three jobs; a test breaks one rule of the second job or palette.
struct PlanErrors : public ::testing::Test {
  PlanErrors() {
    batch.addMesh(meshOf(10, 2, 7, true));
    batch.addMesh(meshOf(10, 2, 7, false));
    for (int palette = 0; palette < 3; ++palette) batch.addPalette(8, true);
    for (std::uint32_t job = 0; job < 3; ++job) {
      batch.addJob(0, job, Method::dualQuaternion, true);
    }
  }
  Job& job() { return batch.jobs[1]; }

  void expectRefused(ErrorCode code, std::initializer_list<const char*> parts) {
    Plan out;
    ASSERT_TRUE(makePlan(randomBatch(1, 5).batch(), {}, {}, out).ok());
    const Result<void> result = makePlan(batch.batch(), limits, tuning, out);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, code) << result.error().message;
    for (const char* part : parts) {
      EXPECT_NE(result.error().message.find(part), std::string::npos)
          << "'" << result.error().message << "' lacks '" << part << "'";
    }
    EXPECT_TRUE(out.dispatches().empty());
    EXPECT_TRUE(out.variants().empty());
    EXPECT_EQ(out.instanceCount(), 0u);
    EXPECT_EQ(out.vertexCount(), 0u);
    EXPECT_EQ(out.buffer(BufferRole::tables).size, 0u);
    EXPECT_EQ(out.statusOffset(0), Plan::noStatus);
  }
  void expectInvalid(std::initializer_list<const char*> parts) {
    expectRefused(ErrorCode::invalidArgument, parts);
  }
  void expectGood() {
    Plan out;
    const Result<void> result = makePlan(batch.batch(), limits, tuning, out);
    EXPECT_TRUE(result.ok()) << result.error().message;
  }

  OwnedBatch batch;
  DeviceLimits limits;
  Tuning tuning;
};

TEST_F(PlanErrors, TheBatchIsGoodBeforeItIsBroken) {
  expectGood();
}

TEST_F(PlanErrors, NoMesh) {
  job().mesh = {};
  expectInvalid({"job 1", "mesh"});
}

TEST_F(PlanErrors, MeshOffsets) {
  job().meshOffset = 8;
  expectInvalid({"job 1", "byte 8"});
  job().meshOffset = batch.meshesSize - batch.meshes[0].bytes().size() + 16;
  expectInvalid({"job 1"});
  job().meshOffset = ~std::uint64_t{15};
  expectInvalid({"job 1"});
  job().meshOffset = 0;
  batch.meshesSize = batch.meshes[0].bytes().size();
  expectGood();
  --batch.meshesSize;
  expectInvalid({"job 0"});
}

TEST_F(PlanErrors, PaletteIndices) {
  job().palette = 3;
  expectInvalid({"job 1", "palette 3", "3"});
  job().palette = 0xffffffffu;
  expectInvalid({"job 1", "4294967295"});
}

TEST_F(PlanErrors, PalettesThatAreTooShortForTheMesh) {
  batch.palettes[1].jointCount = 7;
  expectGood();
  batch.palettes[1].jointCount = 6;
  expectInvalid({"job 1", "7 joints", "palette 1", "6"});
}

TEST_F(PlanErrors, PaletteCounts) {
  batch.addPalette(0, false);
  batch.matricesSize += 65537 * 48;  // room enough
  expectInvalid({"palette 3", "0 joints", "65536"});
  batch.palettes[3].jointCount = 65537;
  expectInvalid({"palette 3", "65537"});
  batch.palettes[3].jointCount = 65536;
  expectGood();
}

TEST_F(PlanErrors, MatrixOffsets) {
  batch.palettes[1].matrixOffset += 8;
  expectInvalid({"palette 1", "8 matrices"});
  batch.palettes[1].matrixOffset = batch.matricesSize - 8 * 48;
  expectGood();
  batch.palettes[1].matrixOffset += 16;
  expectInvalid({"palette 1"});
  batch.palettes[1].matrixOffset = ~std::uint64_t{15};
  expectInvalid({"palette 1"});
}

TEST_F(PlanErrors, UnknownMethods) {
  job().method = static_cast<Method>(2);
  expectInvalid({"job 1", "method"});
}

TEST_F(PlanErrors, NormalsOfAMeshWithoutAny) {
  job().mesh = batch.meshes[1].info();
  job().meshOffset = batch.meshOffsets[1];
  expectInvalid({"job 1", "normals"});
  job().normals = {};
  expectGood();
}

TEST_F(PlanErrors, OutputAttributes) {
  for (OutputAttribute Job::*member : {&Job::positions, &Job::normals}) {
    const char* name = member == &Job::positions ? "positions" : "normals";
    const OutputAttribute good = job().*member;
    OutputAttribute& attribute = job().*member;
    for (const std::uint32_t off : {1u, 2u, 3u}) {
      attribute.offset = good.offset + off;
      expectInvalid({"job 1", name, "multiples of 4"});
    }
    attribute = good;
    for (const std::uint32_t stride : {4u, 8u, 11u, 13u, 14u, 0xffffffffu}) {
      attribute.stride = stride;
      expectInvalid({"job 1", name});
    }
    // The last vertex' last byte is the output's last.
    attribute = good;
    attribute.offset = batch.outputSize - 9 * 24 - 12;
    expectGood();
    attribute.offset += 4;
    expectInvalid({"job 1", name, "output buffer"});
    attribute.offset = ~std::uint64_t{3};
    expectInvalid({"job 1", name});
    attribute = good;
    attribute.stride = 0xfffffffcu;
    expectInvalid({"job 1", name});
    attribute = good;
  }
  job().positions.stride = 0;
  expectInvalid({"job 1", "positions"});
}

TEST_F(PlanErrors, Tunings) {
  for (const std::uint32_t size : {8u, 16u, 32u, 64u, 128u}) {
    tuning.workgroupSize = size;
    expectGood();
  }
  for (const std::uint32_t size : {0u, 1u, 4u, 9u, 65u, 96u, 256u, 0x80000000u}) {
    tuning.workgroupSize = size;
    expectInvalid({"tuning", "workgroup"});
  }
  tuning = {};
  for (const std::uint32_t instances : {1u, 5u, 16u}) {
    tuning.instancesPerInvocation = instances;
    expectGood();
  }
  for (const std::uint32_t instances : {0u, 17u, 256u, 257u}) {
    tuning.instancesPerInvocation = instances;
    expectInvalid({"tuning", "instances"});
  }
}

TEST_F(PlanErrors, TooManyWorkgroups) {
  limits.maxWorkgroupCountX = 2;
  limits.maxWorkgroupCountY = 1;
  expectRefused(ErrorCode::limitExceeded, {"workgroups", "3"});
  limits.maxWorkgroupCountY = 2;
  expectGood();
}

TEST_F(PlanErrors, BuffersLargerThanARange) {
  limits.maxStorageBufferRange = batch.meshesSize;
  ASSERT_GT(batch.meshesSize, batch.matricesSize);
  expectGood();
  limits.maxStorageBufferRange = batch.meshesSize - 16;
  expectRefused(ErrorCode::limitExceeded, {"range"});
  limits.maxStorageBufferRange = batch.meshesSize;
  batch.matricesSize = batch.meshesSize + 16;
  expectRefused(ErrorCode::limitExceeded, {"range"});
}

TEST_F(PlanErrors, PalettesLargerThanARange) {
  // 48 bytes a matrix become 64 where a joint may scale.
  batch.addPalette(1000, true);
  batch.jobs[2].palette = 3;
  limits.maxStorageBufferRange = 63000;
  expectRefused(ErrorCode::limitExceeded, {"range"});
  batch.palettes[3].mayScale = false;
  expectGood();
}

TEST_F(PlanErrors, TablesLargerThanARange) {
  const Job good = job();
  batch.jobs.clear();
  batch.outputSize = 0;
  for (int instance = 0; instance < 2000; ++instance) {
    batch.jobs.push_back(good);
    batch.jobs.back().positions.offset = batch.jobs.back().normals.offset = 0;
    batch.jobs.back().method = Method::linear;
  }
  batch.outputSize = 240;
  limits.maxStorageBufferRange = 31000;  // 16 bytes an instance
  expectRefused(ErrorCode::limitExceeded, {"tables"});
  batch.jobs.resize(1800);
  expectGood();
}

TEST_F(PlanErrors, AVertexWhoseAttributesLieFartherApartThanARange) {
  limits.maxStorageBufferRange = 65536;
  batch.outputSize = 10 * 65536;
  expectGood();
  job().normals.offset = 9 * 65536;
  expectRefused(ErrorCode::limitExceeded, {"job 1", "positions and normals", "apart"});
  std::swap(job().normals.offset, job().positions.offset);
  expectRefused(ErrorCode::limitExceeded, {"job 1"});
}

// An engine that forgot to fill the limits gets an error, not a division by zero.
TEST_F(PlanErrors, LimitsThatNoDeviceHas) {
  GTEST_FLAG_SET(death_test_style, "threadsafe");
  const auto planned = [&](const DeviceLimits& bad) {
    Plan out;
    const Result<void> result = makePlan(batch.batch(), bad, {}, out);
    std::exit(result.ok() ? 1 : 0);
  };
  DeviceLimits bad;
  bad.maxWorkgroupCountX = 0;
  EXPECT_EXIT(planned(bad), ::testing::ExitedWithCode(0), "");
  bad = {};
  bad.maxStorageBufferRange = 0;
  EXPECT_EXIT(planned(bad), ::testing::ExitedWithCode(0), "");
  batch.outputSize = std::uint64_t{1} << 30;
  for (const std::uint32_t alignment : {1u << 27, 1u << 28, 1u << 30}) {
    bad = {};
    bad.minStorageBufferOffsetAlignment = alignment;
    EXPECT_EXIT(planned(bad), ::testing::ExitedWithCode(0), "") << alignment;
  }
}

}  // namespace
}  // namespace dermis::test
