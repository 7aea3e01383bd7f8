// plan: what is refused.

#include "dermis/plan.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <string>
#include <tuple>
#include <utility>

#include "core_plan_simulation.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

constexpr float notANumber = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();

/// A good batch of three jobs; a test breaks one rule of the second job or palette.
struct PlanErrors : public ::testing::Test {
  PlanErrors() {
    batch.addMesh(meshOf(10, 2, 7, MeshParts{true, true, 5}));
    batch.addMesh(meshOf(10, 2, 7, false));
    for (int palette = 0; palette < 3; ++palette) batch.addPose(8, JointPromise::scaling);
    for (std::uint32_t job = 0; job < 3; ++job) {
      batch.addJob(0, job, Method::dualQuaternion, true);
    }
    limits = richLimits();
  }
  Job& job() { return batch.jobs[1]; }

  void expectRefused(ErrorCode code, std::initializer_list<const char*> parts) {
    Plan out;
    const OwnedBatch other = randomRichBatch(1, 5, false);
    ASSERT_TRUE(makePlan(other.batch(), richLimits(), {}, out).ok());
    const Result<void> result = makePlan(batch.batch(), limits, tuning, out);
    ASSERT_FALSE(result.ok());
    EXPECT_EQ(result.error().code, code) << result.error().message;
    for (const char* part : parts) {
      EXPECT_NE(result.error().message.find(part), std::string::npos)
          << "'" << result.error().message << "' lacks '" << part << "'";
    }
    expectEmpty(out);
  }
  void expectInvalid(std::initializer_list<const char*> parts) {
    expectRefused(ErrorCode::invalidArgument, parts);
  }
  void expectGoodOnlyIf(bool good, ErrorCode code, std::initializer_list<const char*> parts) {
    if (good) {
      expectGood();
    } else {
      expectRefused(code, parts);
    }
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
  expectInvalid({"job 1", "meshOffset of 8 is not a multiple of 16"});
  job().meshOffset = batch.meshesSize - batch.meshes[0].bytes().size() + 16;
  expectInvalid({"job 1", "ends after the mesh buffer"});
  job().meshOffset = ~std::uint64_t{15};
  expectInvalid({"job 1", "ends after the mesh buffer"});
  job().meshOffset = 0;
  batch.meshesSize = batch.meshes[0].bytes().size();
  expectGood();
  --batch.meshesSize;
  expectInvalid({"job 0"});
}

// A kernel may store them together, so it would write the normals to the wrong buffer.
TEST_F(PlanErrors, NormalsBehindPositionsInAnotherBuffer) {
  batch.jobs.clear();
  batch.addMesh(meshOf(10, 2, 7, MeshParts{true, true, 0, false}));
  Job& only = batch.addJob(2, 1, Method::dualQuaternion, true);
  only.places[Stream::tangents] = {0, 16, VertexFormat::float32x4};
  batch.hasSeparateOutputs = true;
  batch.separateSizes = {{1000 + batch.outputSize, 1000 + batch.outputSize, 160, 0}};
  expectInvalid({"job 0", "isOneOutput"});
  only.places[Stream::normals].offset += 4;
  expectGood();
}

// The same on every device: an engine must not find out on the next one.
TEST_F(PlanErrors, PairsOfPositionsAndNormals) {
  for (const bool texels : {false, true}) {
    limits.texelBuffers = texels;
    batch.outputSize += 24;
    const Job whole = job();
    job().places[Stream::positions].offset += 4;
    job().places[Stream::normals].offset += 4;
    expectInvalid({"job 1", "multiple of 8"});
    job().places[Stream::normals].offset += 4;
    expectGood();
    job() = whole;
    batch.hasSeparateOutputs = true;
    batch.separateSizes = {{batch.outputSize, batch.outputSize, 0, 0}};
    expectInvalid({"job 0", "one buffer"});
    batch.hasSeparateOutputs = false;
    expectGood();
  }
}

TEST_F(PlanErrors, PoseIndices) {
  job().pose = 3;
  expectInvalid({"job 1", "pose 3", "3"});
  job().pose = 0xffffffffu;
  expectInvalid({"job 1", "4294967295"});
}

TEST_F(PlanErrors, PosesThatAreTooShortForTheMesh) {
  batch.poses[1].jointCount = 7;
  expectGood();
  batch.poses[1].jointCount = 6;
  expectInvalid({"job 1", "7 joints", "pose 1", "6"});
}

TEST_F(PlanErrors, PoseCounts) {
  batch.addPose(0, JointPromise::scaleIgnored);
  batch.posesSize += 65537 * 48;  // room enough
  expectInvalid({"pose 3", "0 joints", "65536"});
  batch.poses[3].jointCount = 65537;
  expectInvalid({"pose 3", "65537"});
  batch.poses[3].jointCount = 65536;
  expectGood();
}

TEST_F(PlanErrors, MatrixOffsets) {
  batch.poses[1].matrixOffset += 8;
  expectInvalid({"pose 1", "matrixOffset of 392 is not a multiple of 16"});
  batch.poses[1].matrixOffset = batch.posesSize - 8 * 48;
  expectGood();
  batch.poses[1].matrixOffset += 16;
  expectInvalid({"pose 1", "8 matrices", "end after the poses buffer"});
  batch.poses[1].matrixOffset = ~std::uint64_t{15};
  expectInvalid({"pose 1", "8 matrices", "end after the poses buffer"});
}

TEST_F(PlanErrors, UnknownMethods) {
  for (const std::size_t number : {allMethods.size(), std::size_t{200}, std::size_t{255}}) {
    job().method = static_cast<Method>(number);
    expectInvalid({"job 1", "method"});
  }
}

TEST_F(PlanErrors, MethodsWithACenterOfRotationForAMeshWithoutAny) {
  batch.addMesh(meshOf(10, 2, 7, MeshParts{true, true, 5, false}));
  EXPECT_FALSE(batch.meshes[2].info().hasCentersOfRotation);
  EXPECT_TRUE(batch.meshes[0].info().hasCentersOfRotation);
  for (const Method method : allMethods) {
    SCOPED_TRACE(methodName(method));
    job().mesh = batch.meshes[0].info();
    job().meshOffset = 0;
    job().method = method;
    expectGood();
    job().mesh = batch.meshes[2].info();
    job().meshOffset = batch.meshOffsets[2];
    const bool needs = method == Method::centerOfRotation || method == Method::bulgeControlled;
    EXPECT_EQ(needsCentersOfRotation(method), needs);
    if (!needs) {
      expectGood();
      continue;
    }
    const std::string sentence = "job 1: " + std::string(methodName(method)) +
                                 " needs centers of rotation, but its mesh has none";
    expectInvalid({sentence.c_str()});
  }
}

TEST_F(PlanErrors, NormalsOfAMeshWithoutAny) {
  job().mesh = batch.meshes[1].info();
  job().meshOffset = batch.meshOffsets[1];
  expectInvalid({"job 1", "normals"});
  job().places[Stream::normals] = {};
  expectGood();
}

TEST_F(PlanErrors, TangentsOfAMeshWithoutAny) {
  job().places[Stream::normals] = {};
  job().places[Stream::tangents] = {0, 16, VertexFormat::float32x4};
  expectGood();
  job().mesh = batch.meshes[1].info();
  job().meshOffset = batch.meshOffsets[1];
  expectInvalid({"job 1", "tangents"});
}

TEST_F(PlanErrors, OutputAttributes) {
  for (const Stream member : {Stream::positions, Stream::normals}) {
    const char* name = member == Stream::positions ? "positions" : "normals";
    const OutputAttribute good = job().places[member];
    OutputAttribute& attribute = job().places[member];
    for (const std::uint32_t stride : {0u, 4u, 8u, 11u}) {
      attribute.stride = stride;
      expectInvalid({"job 1", name, "stride"});
    }
    attribute.stride = 0xffffffffu;
    expectInvalid({"job 1", name, "output buffer"});
    // The last vertex' last byte is the output's last.
    attribute = good;
    attribute.offset = batch.outputSize - 9 * 24 - 12;
    expectGood();
    ++attribute.offset;
    expectInvalid({"job 1", name, "output buffer"});
    attribute.offset = ~std::uint64_t{3};
    expectInvalid({"job 1", name, "output buffer"});
    attribute = good;
    attribute.stride = 0xfffffffcu;
    expectInvalid({"job 1", name, "output buffer"});
    attribute = good;
  }
}

// Where each attribute has a buffer, each must lie in its own.
TEST_F(PlanErrors, OutputsOfDifferentSizes) {
  batch.jobs.clear();
  Job job = batch.jobOf(0, 0, Method::linear);
  job.places[Stream::normals].format = VertexFormat::float32x3;
  job.places[Stream::tangents].format = VertexFormat::float16x4;
  job.places[Stream::previousPositions].format = job.places[Stream::positions].format;
  for (int instance = 0; instance < 2; ++instance) batch.place(job, Arrangement::separate);
  const char* names[] = {"positions", "normals", "tangents", "previous positions"};
  const std::uint64_t sizes[] = {240, 240, 160, 240};
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    ASSERT_EQ(batch.separateSizes[stream], sizes[stream]);
    expectGood();
    --batch.separateSizes[stream];
    expectInvalid({"job 1", names[stream], std::to_string(sizes[stream] - 1).c_str()});
    ++batch.separateSizes[stream];
  }
}

TEST_F(PlanErrors, FormatsThatAnAttributeMayNotHave) {
  struct Allowed {
    VertexFormat format;
    bool positions, normals, tangents;
  };
  const Allowed table[] = {
      {VertexFormat::none, false, true, true},
      {VertexFormat::float32x3, true, true, false},
      {VertexFormat::float32x4, true, true, true},
      {VertexFormat::float16x3, true, true, false},
      {VertexFormat::float16x4, true, true, true},
      {VertexFormat::snorm16x3, true, true, false},
      {VertexFormat::snorm16x4, true, true, true},
      {VertexFormat::snorm8x3, false, true, false},
      {VertexFormat::snorm8x4, false, true, true},
      {VertexFormat::octahedral16x2, false, true, true},
      {VertexFormat::octahedral8x2, false, true, true},
      {static_cast<VertexFormat>(11), false, false, false},
      {static_cast<VertexFormat>(255), false, false, false},
  };
  const Job good = job();
  for (const Allowed& allowed : table) {
    SCOPED_TRACE(static_cast<int>(allowed.format));
    for (const auto& [member, isAllowed, name] :
         {std::tuple{Stream::positions, allowed.positions, "positions"},
          {Stream::normals, allowed.normals, "normals"},
          {Stream::tangents, allowed.tangents, "tangents"}}) {
      job() = good;
      job().box = {{0, 0, 0}, {1, 1, 1}};
      job().places[member] = {0, 24, allowed.format};
      const auto number = static_cast<std::size_t>(allowed.format);
      const std::string format = number <= allVertexFormats.size()
                                     ? std::string(formatName(allowed.format))
                                     : std::to_string(number);
      expectGoodOnlyIf(isAllowed && formatSize(allowed.format) % 4 == 0, ErrorCode::invalidArgument,
                       {"job 1", name, format.c_str()});
    }
  }
}

TEST_F(PlanErrors, PreviousPositionsHaveTheFormatOfPositions) {
  OutputAttribute& previous = job().places[Stream::previousPositions];
  for (const VertexFormat format : allVertexFormats) {
    previous = {0, 24, format};
    expectGoodOnlyIf(format == job().places[Stream::positions].format, ErrorCode::invalidArgument,
                     {"job 1", "previous positions", "float32x3"});
  }
  previous = {0, 24, static_cast<VertexFormat>(11)};
  expectInvalid({"job 1", "previous positions", "11", "VertexFormat"});
  previous = {0, 11, VertexFormat::float32x3};
  expectInvalid({"job 1", "previous positions", "size 12"});
}

// ---- Runs of attributes

/// Bytes from the beginning of a vertex, and the format.
struct Part {
  std::uint64_t place = 0;
  VertexFormat format = VertexFormat::none;
};

struct RunErrors : public PlanErrors {
  /// Vertices of `stride` bytes, the first at byte 8.
  void place(std::uint32_t stride, Part positions, Part normals = {}, Part tangents = {}) {
    job().places[Stream::positions] = {8 + positions.place, stride, positions.format};
    job().places[Stream::normals] = {8 + normals.place, stride, normals.format};
    job().places[Stream::tangents] = {8 + tangents.place, stride, tangents.format};
    job().box = {{0, 0, 0}, {1, 1, 1}};
  }
  /// On every device.
  void expectRefusedRun(std::initializer_list<const char*> parts) {
    for (const std::uint32_t buffers : {4u, 8u}) {
      limits.maxStorageBuffersPerStage = buffers;
      for (const bool texels : {false, true}) {
        limits.texelBuffers = texels;
        expectInvalid(parts);
      }
    }
    EXPECT_FALSE(pipelines(job(), limits, tuning).ok());
  }
};

using enum VertexFormat;

TEST_F(RunErrors, RunsOfWholeWordsAreGood) {
  for (const std::uint32_t buffers : {4u, 8u}) {
    limits.maxStorageBuffersPerStage = buffers;
    for (const auto& [positions, normals, tangents] : {std::array{float16x3, octahedral8x2, none},
                                                       {float16x3, float16x3, none},
                                                       {float16x3, none, octahedral8x2},
                                                       {float32x3, octahedral8x2, octahedral8x2},
                                                       {float16x3, snorm16x3, float32x4},
                                                       {float16x3, float16x4, octahedral8x2},
                                                       {float16x4, float16x3, octahedral8x2},
                                                       {float32x4, octahedral8x2, octahedral8x2}}) {
      const std::uint32_t first = formatSize(positions), second = first + formatSize(normals);
      for (const std::uint32_t stride : {32u, 36u}) {
        place(stride, {0, positions}, {first, normals}, {second, tangents});
        expectGood();
        EXPECT_TRUE(pipelines(job(), limits, tuning).ok());
      }
    }
    // The directions of a vertex in an array of their own.
    place(12, {0, float32x3});
    job().places[Stream::normals] = {200, 4, octahedral8x2};
    job().places[Stream::tangents] = {202, 4, octahedral8x2};
    expectGood();
    // Only the first run has the gap.
    place(24, {0, float16x3}, {6, octahedral8x2}, {12, octahedral16x2});
    expectGood();
  }
}

// The message says which format fits.
TEST_F(RunErrors, RunsOfOtherLengths) {
  place(8, {0, float16x3});
  expectRefusedRun(
      {"job 1: its positions as float16x3 are in a run of 6 bytes, which is not a "
       "multiple of 4; use float16x4"});
  place(8, {0, float16x3}, {8, octahedral16x2});
  job().places[Stream::normals].stride = 12;
  expectRefusedRun({"positions as float16x3", "6 bytes"});
  place(16, {0, float32x3}, {12, octahedral8x2});
  expectRefusedRun({"normals as octahedral8x2", "14 bytes", "use octahedral16x2"});
  place(16, {0, float32x3}, {12, snorm8x3});
  expectRefusedRun({"normals as snorm8x3", "15 bytes", "use snorm8x4"});
  place(24, {0, float32x3}, {12, snorm8x3}, {15, octahedral16x2});
  expectRefusedRun({"normals as snorm8x3", "19 bytes", "use snorm8x4"});
  place(16, {0, float16x3}, {6, float16x3}, {12, octahedral8x2});
  expectRefusedRun({"tangents as octahedral8x2", "14 bytes", "use octahedral16x2"});
  place(16, {0, float16x4}, {8, snorm16x3}, {14, octahedral16x2});
  expectRefusedRun({"normals as snorm16x3", "18 bytes", "use snorm16x4"});
  // They would be whole words without the gap.
  place(12, {0, float16x3}, {8, octahedral8x2});
  expectRefusedRun({"positions as float16x3", "6 bytes", "use float16x4"});
  place(20, {0, float32x3}, {12, octahedral8x2}, {16, octahedral8x2});
  expectRefusedRun({"normals as octahedral8x2", "14 bytes"});
  // The same, since strides differ.
  place(8, {0, snorm16x3}, {6, octahedral8x2});
  job().places[Stream::normals].stride = 12;
  limits.maxStorageBuffersPerStage = 8;
  expectInvalid({"positions as snorm16x3", "6 bytes", "use snorm16x4"});
  // Previous positions are never part of another run.
  place(16, {0, float16x3}, {6, octahedral8x2});
  for (const std::uint64_t offset : {16u, 400u}) {
    job().places[Stream::previousPositions] = {offset, 16, float16x3};
    expectRefusedRun({"previous positions as float16x3", "6 bytes", "use float16x4"});
  }
}

TEST_F(RunErrors, RunsThatDoNotBeginAtWords) {
  place(32, {0, float32x3}, {12, octahedral8x2}, {14, octahedral8x2});
  job().places[Stream::previousPositions] = {400, 12, float32x3};
  expectGood();
  const auto expectNamed = [&](OutputAttribute& attribute, const char* name) {
    const Job good = job();
    for (const std::uint32_t moved : {1u, 2u, 3u}) {
      attribute.offset += moved;
      expectRefusedRun({"job 1: offset", name, "must be multiples of 4"});
      attribute.offset -= moved;
      attribute.stride += moved;
      expectRefusedRun({"job 1: offset", name, "must be multiples of 4"});
      job() = good;
    }
  };
  expectNamed(job().places[Stream::previousPositions], "previous positions");
  place(32, {0, float32x3}, {12, octahedral16x2}, {20, octahedral16x2});
  expectNamed(job().places[Stream::positions], "positions");
  expectNamed(job().places[Stream::normals], "normals");
  expectNamed(job().places[Stream::tangents], "tangents");
  // A vertex of the whole run.
  job().places[Stream::previousPositions] = {};
  place(18, {0, float16x3}, {6, octahedral8x2});
  expectRefusedRun({"stride 18"});
}

// A word that two attributes share is stored in the buffer of the second.
TEST_F(RunErrors, RunsWithSharedWordsInTwoBuffers) {
  batch.jobs.erase(batch.jobs.begin() + 2);
  batch.jobs.erase(batch.jobs.begin());
  Job& only = batch.jobs[0];
  only.places[Stream::positions] = {0, 12, float32x3};
  only.places[Stream::normals] = {0, 8, octahedral16x2};
  only.places[Stream::tangents] = {4, 8, octahedral16x2};
  batch.hasSeparateOutputs = true;
  batch.separateSizes = {{120, 80, 80, 0}};
  expectGood();
  only.places[Stream::normals].format = octahedral8x2;
  only.places[Stream::tangents] = {2, 8, octahedral8x2};
  expectInvalid({"job 0", "isOneOutput"});
  only.places[Stream::normals].offset += 120;
  only.places[Stream::tangents].offset += 120;
  batch.hasSeparateOutputs = false;
  batch.outputSize = 200;
  expectGood();
}

// ---- Devices with four storage buffers per stage

TEST_F(PlanErrors, FewStorageBuffersMeanNoResults) {
  job().box = {{0, 0, 0}, {1, 1, 1}};
  for (const std::uint32_t buffers : {4u, 7u, 8u}) {
    limits.maxStorageBuffersPerStage = buffers;
    const std::string count = std::to_string(buffers) + " storage buffers";
    const Job good = job();
    expectGood();
    job().bounds = true;
    expectGoodOnlyIf(buffers == 8, ErrorCode::limitExceeded, {"job 1", "bounds", count.c_str()});
    job() = good;
    job().places[Stream::positions] = {0, 8, VertexFormat::snorm16x4};
    expectGoodOnlyIf(buffers == 8, ErrorCode::limitExceeded, {"job 1", "snorm16", count.c_str()});
    job() = good;
  }
}

TEST_F(PlanErrors, MethodsForComparisonMayBeLeftOutOfTheLibrary) {
  limits.comparisonMethods = false;
  for (const Method method : allMethods) {
    job().method = method;
    if (isForComparison(method)) {
      expectRefused(ErrorCode::missingFeature, {"job 1", "DERMIS_COMPARISON_METHODS",
                                                std::string(methodName(method)).c_str()});
    } else {
      expectGood();
    }
  }
}

TEST_F(PlanErrors, FewStorageBuffersMeanOneWindow) {
  limits.maxStorageBufferRange = 65536;
  batch.outputSize = 10 * 65536;
  job().places[Stream::tangents] = {100, 16, VertexFormat::float32x4};
  job().places[Stream::previousPositions] = {200, 12, VertexFormat::float32x3};
  for (const std::uint32_t buffers : {4u, 8u}) {
    limits.maxStorageBuffersPerStage = buffers;
    expectGood();
    for (const auto& [member, name] : {std::pair{Stream::positions, "positions"},
                                       {Stream::normals, "normals"},
                                       {Stream::tangents, "tangents"},
                                       {Stream::previousPositions, "previous positions"}}) {
      const Job good = job();
      job().places[member].offset = 9 * 65536;
      if (buffers == 8) {
        expectGood();
      } else {
        expectRefused(ErrorCode::limitExceeded, {"job 1", "too far", "4 storage buffers"});
        // What lies far from the positions is named; far positions are far from anything.
        if (member != Stream::positions) expectRefused(ErrorCode::limitExceeded, {name});
      }
      job() = good;
    }
  }
}

// ---- Morph targets, motion, boxes

TEST_F(PlanErrors, MorphTargetsThatTheMeshLacks) {
  job().morphs = batch.keep({{4, 1.0f}, {0, 1.0f}});
  expectGood();
  job().morphs = batch.keep({{0, 1.0f}, {5, 1.0f}});
  expectInvalid({"job 1", "morph target 5", "5"});
  job().morphs = batch.keep({{0xffffffffu, 0.0f}});  // even with weight 0
  expectInvalid({"job 1", "morph target 4294967295"});
}

TEST_F(PlanErrors, MorphTargetsThatStandTwice) {
  job().morphs = batch.keep({{1, 1.0f}, {1, 1.0f}});
  expectInvalid({"job 1", "morph target 1", "twice"});
  job().morphs = batch.keep({{3, 1.0f}, {1, 1.0f}, {2, 1.0f}, {3, 0.5f}});
  expectInvalid({"job 1", "morph target 3", "twice"});
  job().morphs = batch.keep({{0, 1.0f}, {1, 1.0f}, {4, 1.0f}, {0, 0.5f}});
  expectInvalid({"job 1", "morph target 0", "twice"});
}

TEST_F(PlanErrors, MorphWeightsThatAreNotFinite) {
  for (const float bad : {notANumber, infinity, -infinity}) {
    job().morphs = batch.keep({{0, 1.0f}, {3, bad}});
    expectInvalid({"job 1", "morph target 3", "finite"});
  }
}

TEST_F(PlanErrors, SettlingAndRestartingNeedPreviousPositions) {
  for (bool Job::*flag : {&Job::settles, &Job::restartsMotion}) {
    job().*flag = true;
    job().places[Stream::previousPositions] = {};
    expectInvalid({"job 1", "previous positions"});
    job().places[Stream::previousPositions] = {0, 12, VertexFormat::float32x3};
    expectGood();
    job().*flag = false;
  }
}

TEST_F(PlanErrors, BoxesOfSnormPositions) {
  const Box good{{-1, 0, 5}, {-0.5f, 1e-6f, 1e6f}};
  for (const VertexFormat format : {VertexFormat::snorm16x4, VertexFormat::snorm16x3}) {
    job().places[Stream::positions] = {0, 8, format};
    job().places[Stream::normals] = {};
    if (format == VertexFormat::snorm16x3)
      job().places[Stream::normals] = {6, 8, VertexFormat::octahedral8x2};
    job().box = good;
    expectGood();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      for (const float bad : {notANumber, infinity, -infinity}) {
        job().box.min[axis] = bad;
        expectInvalid({"job 1", "box"});
        job().box = good;
        job().box.max[axis] = bad;
        expectInvalid({"job 1", "box"});
        job().box = good;
      }
      job().box.max[axis] = job().box.min[axis];  // empty
      expectInvalid({"job 1", "box"});
      job().box.max[axis] = job().box.min[axis] - 1;  // upside down
      expectInvalid({"job 1", "box"});
      job().box = good;
    }
  }
  job().places[Stream::positions].format = VertexFormat::float16x3;
  job().box = {{notANumber, notANumber, notANumber}, {0, 0, 0}};
  expectGood();
}

// ---- Sizes and limits

TEST_F(PlanErrors, Tunings) {
  const struct {
    std::uint32_t Tuning::*member;
    const char* name;
    std::vector<std::uint32_t> good, bad;
  } cases[] = {{&Tuning::workgroupSize,
                "Tuning::workgroupSize",
                {8, 16, 32, 64, 128},
                {0, 1, 4, 9, 65, 96, 256, 0x80000000u}},
               {&Tuning::instancesPerInvocation,
                "Tuning::instancesPerInvocation",
                {1, 5, 32},
                {0, 33, 256, 257}},
               {&Tuning::verticesPerInvocation,
                "Tuning::verticesPerInvocation",
                {1, 2, 16},
                {0, 3, 32, 0x80000000u}}};
  for (const auto& [member, name, good, bad] : cases) {
    tuning = {};
    for (const std::uint32_t value : good) {
      tuning.*member = value;
      expectGood();
    }
    for (const std::uint32_t value : bad) {
      tuning.*member = value;
      expectInvalid({name});
    }
  }
}

TEST_F(PlanErrors, TooManyWorkgroups) {
  limits.maxWorkgroupCountX = 2;
  limits.maxWorkgroupCountY = 1;
  expectRefused(ErrorCode::limitExceeded, {"workgroups", "3"});
  limits.maxWorkgroupCountY = 2;
  expectGood();
}

// However many the device can count, kernels count in 32 bits, and round up.
TEST_F(PlanErrors, MoreWorkgroupsThanKernelsCount) {
  limits.maxStorageBufferRange = 0xfffffffc;
  limits.maxWorkgroupCountX = limits.maxWorkgroupCountY = 0xffffffff;
  tuning = {8, 1};
  batch.outputSize = limits.maxStorageBufferRange;
  batch.jobs.resize(1);
  Job& first = batch.jobs[0];
  first.mesh = {.byteSize = batch.meshesSize = (1ull << 29) + 96, .vertexCount = 1u << 25};
  first.places[Stream::positions].offset = 0;
  first.places[Stream::positions].stride = 12;
  first.places[Stream::normals] = {};
  const Job large = first;  // 2^22 workgroups
  batch.jobs.assign(512, large);
  expectGood();
  batch.jobs.push_back(large);
  expectRefused(ErrorCode::limitExceeded, {"workgroups", "2151677952"});
}

TEST_F(PlanErrors, BuffersLargerThanARange) {
  batch.addMesh(meshOf(30, 1, 1, true));
  limits.maxStorageBufferRange = batch.meshesSize;
  ASSERT_GT(batch.meshesSize, batch.posesSize);
  expectGood();
  limits.maxStorageBufferRange = batch.meshesSize - 16;
  expectRefused(ErrorCode::limitExceeded, {"range"});
  limits.maxStorageBufferRange = batch.meshesSize;
  batch.posesSize = batch.meshesSize + 16;
  expectRefused(ErrorCode::limitExceeded, {"range"});
}

TEST_F(PlanErrors, PosesLargerThanARange) {
  // 48 bytes a matrix become 64 where a joint may scale.
  batch.addPose(1000, JointPromise::scaling);
  batch.jobs[2].pose = 3;
  limits.maxStorageBufferRange = 63000;
  expectRefused(ErrorCode::limitExceeded, {"range"});
  batch.poses[3].promise = JointPromise::scaleIgnored;
  expectGood();
}

TEST_F(PlanErrors, TablesLargerThanARange) {
  const Job good = job();
  batch.jobs.clear();
  batch.outputSize = 0;
  for (int instance = 0; instance < 2000; ++instance) {
    batch.jobs.push_back(good);
    batch.jobs.back().places[Stream::positions].offset =
        batch.jobs.back().places[Stream::normals].offset = 0;
    batch.jobs.back().method = Method::linear;
  }
  batch.outputSize = 240;
  limits.maxStorageBufferRange = 62000;  // 32 bytes an instance
  expectRefused(ErrorCode::limitExceeded, {"tables"});
  batch.jobs.resize(1800);
  expectGood();
}

// An engine that forgot to fill the limits gets an error, not a division by zero.
TEST_F(PlanErrors, LimitsThatNoDeviceHas) {
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
