// plan: what it says of itself.

#include "dermis/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <optional>
#include <set>

#include "abi.h"
#include "core_plan_simulation.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

// ---- What a plan says of itself

TEST(Plan, BuffersAreDescribed) {
  const OwnedBatch batch = randomRichBatch(9, 20, true);
  DeviceLimits limits = richLimits();
  limits.minStorageBufferOffsetAlignment = 64;
  Plan out;
  ASSERT_TRUE(makePlan(batch.batch(), limits, {}, out).ok());
  ASSERT_GT(out.buffer(BufferRole::results).size, 0u);
  const std::uint32_t storage = 0x20, transferTarget = 0x02;  // VkBufferUsageFlagBits
  const struct {
    BufferRole role;
    std::uint64_t size;
    std::uint32_t usage;
  } expected[] = {{BufferRole::meshes, batch.meshesSize, storage | transferTarget},
                  {BufferRole::poses, batch.posesSize, storage},
                  {BufferRole::positions, batch.separateSizes[0], storage},
                  {BufferRole::normals, batch.separateSizes[1], storage},
                  {BufferRole::tangents, batch.separateSizes[2], storage},
                  {BufferRole::previousPositions, batch.separateSizes[3], storage},
                  {BufferRole::results, out.buffer(BufferRole::results).size, storage}};
  for (const auto& [role, size, usage] : expected) {
    const BufferRequirement buffer = out.buffer(role);
    EXPECT_EQ(buffer.size, size);
    EXPECT_EQ(buffer.alignment, 64u);
    EXPECT_EQ(buffer.usage & usage, usage);
  }
  EXPECT_EQ(out.buffer(BufferRole::palettes).usage & storage, storage);
  for (const BufferRole ofScene :
       {BufferRole::gpuPoses, BufferRole::readBack, BufferRole::visibility, BufferRole::history})
    EXPECT_EQ(out.buffer(ofScene).size, 0u);
}

TEST(Plan, StatusHasFourWords) {
  EXPECT_EQ(sizeof(PoseStatus), 16u);
  EXPECT_EQ(offsetof(PoseStatus, twoPhase), offsetof(abi::StatusRecord, twoPhase));
  EXPECT_EQ(offsetof(PoseStatus, nonRigidJoints), offsetof(abi::StatusRecord, nonRigidJoints));
  EXPECT_EQ(offsetof(PoseStatus, undeclaredScale), offsetof(abi::StatusRecord, undeclaredScale));
  EXPECT_EQ(offsetof(PoseStatus, nonFiniteJoints), offsetof(abi::StatusRecord, nonFiniteJoints));
}

TEST(Plan, ResultsAreLaidOutAsAbiHSays) {
  EXPECT_EQ(sizeof(InstanceResult), sizeof(abi::ResultRecord));
  EXPECT_EQ(offsetof(InstanceResult, orderedMin), offsetof(abi::ResultRecord, minX));
  EXPECT_EQ(offsetof(InstanceResult, clampedVertices),
            offsetof(abi::ResultRecord, clampedVertices));
  EXPECT_EQ(offsetof(InstanceResult, orderedMax), offsetof(abi::ResultRecord, maxX));
}

TEST(Plan, ResultsTurnIntoTheBoxOfTheirFloats) {
  EXPECT_FALSE(InstanceResult().box().has_value()) << "as the palette kernel clears it";
  // The order of floats: -inf, -2, -0.5, -0, 0, 1e-40, 0.5, 2, inf.
  const auto ordered = [](float value) {
    const auto bits = std::bit_cast<std::uint32_t>(value);
    return (bits & 0x80000000u) != 0 ? ~bits : bits | 0x80000000u;
  };
  const float infinity = std::numeric_limits<float>::infinity();
  const float values[] = {-infinity, -2.0f, -0.5f, 0.0f, 1e-40f, 0.5f, 2.0f, infinity};
  for (std::size_t i = 1; i < std::size(values); ++i) {
    EXPECT_LT(ordered(values[i - 1]), ordered(values[i]));
    InstanceResult result;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      result.orderedMin[axis] = ordered(values[i - 1]);
      result.orderedMax[axis] = ordered(values[i]);
    }
    const std::optional<Box> box = result.box();
    ASSERT_TRUE(box.has_value());
    EXPECT_EQ(box->min[1], values[i - 1]);
    EXPECT_EQ(box->max[2], values[i]);
  }
}

// ---- Variants

/// Collects IDs; two variants that differ must not share one.
struct Ids {
  std::set<PipelineId> ids;
  std::size_t count = 0;

  void add(const Variant& variant) {
    ids.insert(variant.id());
    ++count;
    ASSERT_EQ(variantOf(variant.id()), variant);
  }
};

TEST(Plan, VariantsOfAllFormatsAndStoresHaveDifferentIds) {
  Ids ids;
  Variant variant;
  std::vector<VertexFormat> formats(allVertexFormats.begin(), allVertexFormats.end());
  formats.push_back(VertexFormat::none);
  for (const VertexFormat positions : formats) {
    variant.positions = positions;
    for (const VertexFormat normals : formats) {
      variant.normals = normals;
      for (const VertexFormat tangents : formats) {
        variant.tangents = tangents;
        for (unsigned wide = 0; wide < 16; ++wide) {
          for (std::size_t stream = 0; stream < streamCount; ++stream)
            variant.wide[stream] = (wide >> stream & 1) != 0;
          ids.add(variant);
        }
      }
    }
  }
  EXPECT_EQ(ids.ids.size(), ids.count);
}

TEST(Plan, VariantsOfAllOtherMembersHaveDifferentIds) {
  Ids ids;
  Variant variant;
  using Bytes = std::initializer_list<std::uint8_t>;
  using Shorts = std::initializer_list<std::uint16_t>;
  const auto addForms = [&] {
    for (int flags = 0; flags < 4; ++flags) {
      for (const std::uint8_t bytes : Bytes{0, 8, 12, 16, 24, 32}) {
        variant.staged = flags % 2 != 0;
        variant.fullInfluences = flags / 2 != 0;
        variant.recordBytes = bytes;
        ids.add(variant);
      }
    }
  };
  for (const Kernel kernel : {Kernel::palette, Kernel::skin}) {
    for (const Method method : allMethods) {
      for (const bool motion : {false, true}) {
        for (int flags = 0; flags < 32; ++flags) {
          for (const std::uint8_t influences : Bytes{0, 1, 2, 4}) {
            for (const std::uint8_t instances : Bytes{1, 3, 32}) {
              for (const std::uint16_t size : Shorts{8, 64, 128}) {
                variant.kernel = kernel;
                variant.method = method;
                variant.motion = motion;
                variant.morphs = flags % 2 != 0;
                variant.bounds = flags / 2 % 2 != 0;
                variant.scales = flags / 4 % 2 != 0;
                variant.texels = flags / 8 % 2 != 0;
                variant.pairs = flags / 16 != 0;
                variant.influences = influences;
                variant.instancesPerInvocation = instances;
                variant.workgroupSize = size;
                addForms();
              }
            }
          }
        }
      }
    }
  }
  EXPECT_EQ(ids.ids.size(), ids.count);
}

// ---- Which variants there are

/// Every plan of one job with this layout and method, whatever its mesh, palette and morph targets;
/// removes from `unused` what they need.
void planEverything(const Job& layout, const DeviceLimits& limits, const Tuning& tuning,
                    const std::vector<Variant>& all, std::set<PipelineId>& unused) {
  for (const std::uint32_t influences : {1u, 2u, 3u, 4u, 5u}) {
    OwnedBatch batch;
    batch.addMesh(meshOf(10, influences, 8, MeshParts{true, true, 2}));
    batch.addPose(8, JointPromise::scaleIgnored);
    batch.addPose(8, JointPromise::scaling);
    batch.addPose(8, JointPromise::rigid);
    for (const float weight : {0.0f, 1.0f}) {
      for (const std::uint32_t choice : {0u, 1u, 2u, 3u, 4u, 5u}) {
        const std::uint32_t palette = choice / 2;
        batch.jobs = {layout};
        batch.jobs[0].mesh = batch.jobOf(0, palette, layout.method).mesh;
        batch.jobs[0].mesh.minInfluences = choice % 2 == 0 ? influences : 0;
        batch.jobs[0].pose = palette;
        batch.jobs[0].morphs = batch.keep({{1, weight}});
        batch.outputSize = 10000;
        for (const std::uint64_t moved :
             {0u, 8u}) {  // wide stores, where there are, and narrow ones
          Job& job = batch.jobs[0];
          for (OutputAttribute& attribute : job.places.attributes) attribute.offset += moved;
          const Plan out = planned(batch, limits, tuning);
          for (const Variant& variant : variantsOf(out.pipelines())) {
            EXPECT_NE(std::find(all.begin(), all.end(), variant), all.end());
            unused.erase(variant.id());
          }
        }
      }
    }
  }
}

/// Skin kernels for a method: see `pipelines`.
std::size_t formsOf(Method method) {
  if (method == Method::linear || method == Method::dualQuaternion) return 7;
  return isForComparison(method) ? 3 : 4;
}

/// Whether some of its attributes can be stored at once, where they stand at multiples of 12.
bool isWide(const Job& layout) {
  return layout.places[Stream::positions].stride % 12 == 0;
}

std::vector<Job> variedLayouts() {
  std::vector<Job> layouts(4);
  layouts[0].places[Stream::positions] = {0, 12, VertexFormat::float32x3};
  layouts[1].places[Stream::positions] = {0, 24, VertexFormat::float32x3};
  layouts[1].places[Stream::normals] = {12, 24, VertexFormat::float32x3};
  layouts[1].bounds = true;
  layouts[2].places[Stream::positions] = {1004, 20, VertexFormat::snorm16x4};
  layouts[2].box = {{0, 0, 0}, {1, 1, 1}};
  layouts[2].places[Stream::previousPositions] = {0, 20, VertexFormat::snorm16x4};
  layouts[3].places[Stream::positions] = {0, 40, VertexFormat::float16x3};
  layouts[3].places[Stream::normals] = {6, 40, VertexFormat::octahedral8x2};
  layouts[3].places[Stream::tangents] = {5000, 4, VertexFormat::octahedral16x2};
  return layouts;
}

TEST(Plan, EveryVariantHasWhatAnyPlanNeedsAndNoMore) {
  DeviceLimits texelLimits = richLimits();
  texelLimits.texelBuffers = true;
  for (const auto& [limits, tuning] : {std::pair{richLimits(), Tuning{}},
                                       {richLimits(), Tuning{8, 1}},
                                       {texelLimits, Tuning{128, 16}}}) {
    for (const Job& layout : variedLayouts()) {
      for (const Method method : allMethods) {
        Job job = layout;
        job.method = method;
        const std::vector<Variant> all = *everyVariant(job, limits, tuning);
        std::set<PipelineId> unused;
        for (const Variant& variant : all) unused.insert(variant.id());
        EXPECT_EQ(unused.size(), all.size()) << "one stands twice";
        const auto isHelper = [](const Variant& variant) { return variant.kernel != Kernel::skin; };
        EXPECT_EQ(all.size() - static_cast<std::size_t>(std::ranges::count_if(all, isHelper)),
                  formsOf(method) * (limits.texelBuffers && isWide(job) ? 2 : 1))
            << methodName(method);
        ASSERT_NO_FATAL_FAILURE(planEverything(job, limits, tuning, all, unused));
        EXPECT_TRUE(unused.empty()) << "one that no plan needs: " << methodName(method);
      }
    }
  }
}

// Jobs that an engine places by hand need no other pipelines than one placed elsewhere.
TEST(Plan, EveryVariantIsForAnyOffset) {
  DeviceLimits limits = richLimits();
  limits.texelBuffers = true;
  const auto idsOf = [](std::span<const Variant> variants) {
    std::set<PipelineId> ids;
    for (const Variant& variant : variants) ids.insert(variant.id());
    return ids;
  };
  std::size_t wide = 0, narrow = 0;
  for (std::uint32_t seed = 0; seed < 40; ++seed) {
    OwnedBatch batch = randomRichBatch(seed, 20, false);
    batch.outputSize += 96;
    for (const Job& job : batch.jobs) {
      const std::vector<Variant> all = *everyVariant(job, limits, {});
      for (std::uint64_t moved = 0; moved < 96; moved += 8) {
        Job elsewhere = job;
        for (OutputAttribute& attribute : elsewhere.places.attributes) attribute.offset += moved;
        EXPECT_EQ(idsOf(*everyVariant(elsewhere, limits, {})), idsOf(all));
        Batch alone = batch.batch();
        alone.jobs = {&elsewhere, 1};
        Plan plan;
        ASSERT_TRUE(makePlan(alone, limits, {}, plan).ok());
        const Variant variant = variantOf(plan.pipelines().back());
        EXPECT_TRUE(idsOf(all).contains(variant.id()));
        const ByStream<OutputAttribute>& attributes = elsewhere.places.attributes;
        const std::uint64_t record = std::max<std::uint64_t>(variant.recordBytes, 1);
        EXPECT_EQ(attributes[0].offset % record, 0u);
        for (std::size_t stream = 0; stream < streamCount; ++stream) {
          if (attributes[stream].format == VertexFormat::none) continue;
          // Attributes that are part of the record only need the alignment of the record.
          if (attributes[stream].offset - attributes[0].offset < variant.recordBytes) continue;
          if (!variant.wide[stream]) continue;
          EXPECT_EQ(attributes[stream].offset % formatSize(attributes[stream].format), 0u);
        }
        ++(variant.recordBytes > 8 || variant.wide[0] ? wide : narrow);
      }
    }
  }
  EXPECT_GT(wide, 100u);
  EXPECT_GT(narrow, 100u);
}

// Two jobs that differ in nothing but the distance between their attributes, by what all stores
// divide.
TEST(Plan, AttributesThatStandApartAreNotStoredTogether) {
  DeviceLimits limits = richLimits();
  limits.texelBuffers = true;
  OwnedBatch batch = batchOfFiveMeshes();
  const Job together = batch.addJob(0, 0, Method::dualQuaternion, true);
  Job apart = together;
  apart.places[Stream::positions].offset += 96 * 1000;
  apart.places[Stream::normals].offset += 96 * 2000;
  batch.jobs.push_back(apart);
  batch.outputSize = 96 * 4000;
  Plan plan;
  ASSERT_TRUE(makePlan(batch.batch(), limits, {}, plan).ok());
  ASSERT_EQ(plan.pipelines().size(), 3u);  // the first is the palette kernel
  EXPECT_NE(variantOf(plan.pipelines()[1]).recordBytes, variantOf(plan.pipelines()[2]).recordBytes);
}

// A pipeline follows from the job alone: its neighbors do not change it.
TEST(Plan, AJobRunsInTheSameVariantWhateverElseIsInTheBatch) {
  const OwnedBatch batch = randomRichBatch(3, 60, false);
  const auto skinnedBy = [&](std::span<const Job> jobs) {
    Batch part = batch.batch();
    part.jobs = jobs;
    Plan out;
    EXPECT_TRUE(makePlan(part, richLimits(), {}, out).ok());
    std::set<PipelineId> ids;
    for (const Variant& variant : variantsOf(out.pipelines())) {
      if (variant.kernel == Kernel::skin) ids.insert(variant.id());
    }
    return ids;
  };
  std::set<PipelineId> alone;
  for (const Job& job : batch.jobs) {
    const std::set<PipelineId> own = skinnedBy({&job, 1});
    EXPECT_EQ(own.size(), 1u);
    alone.insert(own.begin(), own.end());
  }
  EXPECT_EQ(skinnedBy(batch.jobs), alone);
}

// A kernel leaves the two-phase path out if no palette that it reads may scale.
TEST(Plan, AJobScalesIfAPoseThatItReadsMay) {
  OwnedBatch batch(meshOf(10, 4, 8, MeshParts{true, false, 0}), 8);
  batch.addPose(8, JointPromise::scaling);
  const auto scales = [&](const Job& job) {
    batch.jobs = {job};
    Plan out;
    EXPECT_TRUE(makePlan(batch.batch(), richLimits(), {}, out).ok());
    EXPECT_EQ(dispatchesOf(out).back().variant.kernel, Kernel::skin);
    return dispatchesOf(out).back().variant.scales;
  };
  for (const Method method : allMethods) {
    const Job rigid = batch.addJob(0, 0, method, true);
    EXPECT_FALSE(scales(rigid)) << methodName(method);
    const Job scaling = batch.addJob(0, 1, method, true);
    EXPECT_TRUE(scales(scaling)) << methodName(method);
  }
}

// ---- Plans as objects

bool samePlan(const Plan& a, const Plan& b) {
  const auto sameDispatch = [](const PlannedDispatch& x, const PlannedDispatch& y) -> bool {
    return x.variant == y.variant && x.groupCountX == y.groupCountX &&
           x.groupCountY == y.groupCountY &&
           std::memcmp(&x.constants, &y.constants, sizeof(x.constants)) == 0 &&
           x.isAfterBarrier == y.isAfterBarrier &&
           std::ranges::equal(x.bindings, y.bindings,
                              [](const Binding& v, const Binding& w) -> bool {
                                return v.slot == w.slot && v.isTexelBuffer == w.isTexelBuffer &&
                                       v.part.buffer == w.part.buffer &&
                                       v.part.offset == w.part.offset && v.part.size == w.part.size;
                              });
  };
  return tablesOf(a) == tablesOf(b) &&
         std::ranges::equal(dispatchesOf(a), dispatchesOf(b), sameDispatch) &&
         std::ranges::equal(a.pipelines(), b.pipelines()) &&
         a.instanceCount() == b.instanceCount() && a.vertexCount() == b.vertexCount() &&
         a.limits() == b.limits() &&
         a.buffer(BufferRole::results).size == b.buffer(BufferRole::results).size &&
         a.buffer(BufferRole::palettes).size == b.buffer(BufferRole::palettes).size;
}

TEST(Plan, AReusedObjectIsAsGoodAsANewOne) {
  Plan reused;
  DeviceLimits narrow = richLimits();
  narrow.maxStorageBufferRange = 163840;
  narrow.minStorageBufferOffsetAlignment = 64;
  narrow.maxWorkgroupCountX = 50;
  for (const std::uint32_t seed : {1u, 2u, 3u, 4u}) {
    for (const bool rich : {false, true}) {
      const OwnedBatch batch =
          rich ? randomRichBatch(seed, seed * 11, seed % 2 == 0) : randomBatch(seed, seed * 11);
      for (const DeviceLimits& limits : {richLimits(), narrow}) {
        Plan fresh;
        ASSERT_TRUE(makePlan(batch.batch(), limits, {}, fresh).ok());
        ASSERT_TRUE(makePlan(batch.batch(), limits, {}, reused).ok());
        EXPECT_TRUE(samePlan(fresh, reused)) << seed;
        for (std::uint32_t palette = 0; palette < 5; ++palette)
          EXPECT_EQ(fresh.statusOffset(palette), reused.statusOffset(palette));
        for (std::uint32_t job = 0; job <= batch.jobs.size(); ++job)
          EXPECT_EQ(fresh.resultOffset(job), reused.resultOffset(job));
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

}  // namespace
}  // namespace dermis::test
