// The CPU path against the reference, and its bits: the same for every instruction set, range of
// vertices and company of instances.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "dermis/cpu.h"
#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "few_cases.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

using samples::OwnedMesh;
using samples::randomMesh;
using samples::randomPose;
using samples::Rigidity;

/// Enough for companies of sixteen and eight, for one with a lane left over, and for lone
/// instances.
constexpr std::uint32_t crowdJoints = 30, crowdSize = 23;
constexpr Box box{{-8, -8, -8}, {8, 8, 8}};

constexpr std::array everydayMethods{Method::linear, Method::dualQuaternion, Method::blended,
                                     Method::centerOfRotation, Method::bulgeControlled};

VertexLayout layoutOf(VertexFormat positions, VertexFormat normals, VertexFormat tangents,
                      bool motion = false, bool planar = false) {
  return {.positions = positions,
          .normals = normals,
          .tangents = tangents,
          .motion = motion,
          .planar = planar};
}
const VertexLayout plainLayout =
    layoutOf(VertexFormat::float32x3, VertexFormat::float32x3, VertexFormat::none);

cpu::Job jobOf(const cpu::Mesh& mesh, Method method, const VertexPlaces& places,
               std::span<const cpu::Instance> instances) {
  cpu::Job job;
  job.mesh = &mesh;
  job.method = method;
  job.places = places;
  job.instances = instances;
  return job;
}

/// What the bytes of outputs are before.
constexpr std::byte untouched{0x5a};

bool isUntouched(std::span<const std::byte> bytes) {
  return std::ranges::all_of(bytes, [](std::byte b) { return b == untouched; });
}

/// Instances of one mesh in poses of one kind, side by side in memory.
struct Crowd {
  Crowd(std::uint32_t vertexCount, std::uint32_t influences, Rigidity rigidity,
        const VertexLayout& wanted)
      : layout(wanted), source(randomMesh(influences, vertexCount, crowdJoints, influences)) {
    samples::addTangents(source, 3);
    samples::addMorphs(source, 5, 3);
    addDenseMorphs();
    mesh.emplace(cpu::Mesh::create(pack(source.view(), crowdJoints).value()).value());
    places = placeVertices(layout, vertexCount).value();
    output = before = std::vector<std::byte>(places.size * crowdSize, untouched);
    for (std::uint32_t i = 0; i < crowdSize; ++i) {
      poses.push_back(randomPose(40 + i, crowdJoints, rigidity));
      cpu::Instance instance;
      instance.pose = poses.back();
      instance.box = box;
      instances.push_back(instance);
    }
    place();
  }

  /// Targets 3 to 5 displace every vertex: positions, then also normals, then also tangents.
  /// Target 6 displaces vertices from 64 on, which is where the second block of masks begins.
  void addDenseMorphs() {
    for (std::size_t attributes = 1; attributes <= 4; ++attributes) {
      samples::OwnedMorph& morph = source.morphs.emplace_back();
      const bool isLate = attributes == 4;
      for (std::uint32_t vertex = isLate ? 64 : 0; vertex < source.vertexCount(); ++vertex) {
        if (isLate) morph.vertices.push_back(vertex);
        const float value = 0.001f * static_cast<float>(vertex % 50);
        const float all[3] = {value, 0.02f - value, 0.01f * static_cast<float>(attributes)};
        morph.positions.insert(morph.positions.end(), all, all + 3);
        if (attributes >= 2) morph.normals.insert(morph.normals.end(), all, all + 3);
        if (attributes == 3) morph.tangents.insert(morph.tangents.end(), all, all + 3);
      }
    }
  }
  void place() {
    for (std::size_t i = 0; i < instances.size(); ++i) {
      instances[i].pose = poses[i];
      instances[i].output.fill(output.data() + places.size * i);
    }
  }
  cpu::Job job(Method method, std::uint32_t firstVertex = 0,
               std::uint32_t vertexEnd = 0xffffffffu) const {
    cpu::Job job = jobOf(*mesh, method, places, instances);
    job.firstVertex = firstVertex;
    job.vertexEnd = vertexEnd;
    return job;
  }
  void skin(Method method) {
    output = before;
    const Result<void> done = cpu::skin(job(method));
    ASSERT_TRUE(done.ok()) << done.error().message;
  }
  Comparison compared(Method method, std::size_t i) {
    const auto viewOf = [&](const OutputAttribute& attribute) -> SkinnedAttribute {
      if (attribute.format == VertexFormat::none) return {};
      return {output.data() + places.size * i + attribute.offset, source.vertexCount(),
              attribute.stride, attribute.format};
    };
    const reference::SkinnedMesh expected =
        reference::skin(source.view(), poses[i], method, instances[i].morphs).value();
    return compareWithReference(expected,
                                {viewOf(places[Stream::positions]), viewOf(places[Stream::normals]),
                                 viewOf(places[Stream::tangents]), box})
        .value();
  }

  VertexLayout layout;
  OwnedMesh source;
  std::optional<cpu::Mesh> mesh;
  VertexPlaces places;
  std::vector<std::byte> before;  ///< what `skin` finds in the output
  std::vector<std::byte> output;
  std::vector<std::vector<JointMatrix>> poses;
  std::vector<cpu::Instance> instances;
};

class CpuSkinTest : public ::testing::Test {
 protected:
  ~CpuSkinTest() override { EXPECT_TRUE(cpu::setTarget({}).ok()); }
};

class CpuMethodTest : public CpuSkinTest,
                      public ::testing::WithParamInterface<std::tuple<Method, Rigidity>> {};

constexpr std::size_t comparedEach = hasFewCases ? 11 : 4;

// With every format and instruction set, and as many influences as have a way of their own.
TEST_P(CpuMethodTest, EveryVertexIsInsideItsBound) {
  const auto [method, rigidity] = GetParam();
  const std::vector<MorphWeight> morphs{{0, 0.5f}, {2, -1},   {3, 0.3f},
                                        {4, -1},   {5, 0.7f}, {6, 1.5f}};
  std::vector<VertexLayout> layouts{plainLayout};
  for (const VertexFormat format : allVertexFormats) {
    layouts.push_back(layoutOf(isPositionFormat(format) ? format : VertexFormat::float32x3,
                               isNormalFormat(format) ? format : VertexFormat::none,
                               isTangentFormat(format) ? format : VertexFormat::none, false,
                               layouts.size() % 2 == 0));
  }
  // As many bytes a vertex as positions and normals in float32.
  layouts.push_back(
      layoutOf(VertexFormat::float32x3, VertexFormat::octahedral16x2, VertexFormat::float16x4));
  layouts.push_back(
      layoutOf(VertexFormat::float32x3, VertexFormat::snorm16x4, VertexFormat::snorm8x4));
  for (std::size_t number = 0; number < layouts.size(); ++number) {
    const auto influences = static_cast<std::uint32_t>(number % 6 + 1);
    SCOPED_TRACE(std::string(formatName(layouts[number].positions)) + ", " +
                 std::string(formatName(layouts[number].normals)) + ", " +
                 std::to_string(influences) + " influences");
    Crowd crowd(203, influences, rigidity, layouts[number]);
    for (const bool isMorphed : {false, true}) {
      if (isMorphed) {
        for (cpu::Instance& instance : crowd.instances) instance.morphs = morphs;
      }
      for (const std::string_view target : cpu::targetNames()) {
        ASSERT_TRUE(cpu::setTarget(target).ok());
        crowd.skin(method);
        for (std::size_t i = 0; i < crowdSize; i += comparedEach) {
          const Comparison comparison = crowd.compared(method, i);
          EXPECT_TRUE(comparison.passed())
              << target << ", instance " << i << ", vertex " << comparison.firstFailure << ": "
              << comparison.worstPosition << ", " << comparison.worstNormal << ", "
              << comparison.worstTangent << " of the bounds";
        }
      }
    }
  }
}

// Instances that differ in scale, size, morph targets, motion and results are skinned together.
TEST_P(CpuMethodTest, NoBitDependsOnInstructionSetRangeOrCompany) {
  using enum VertexFormat;
  const auto [method, rigidity] = GetParam();
  const std::vector<MorphWeight> morphs{{0, 0.5f}, {2, -1},   {3, 0.3f},
                                        {4, -1},   {5, 0.7f}, {6, 1.5f}};
  for (const VertexLayout& layout :
       {plainLayout, layoutOf(snorm16x3, octahedral16x2, octahedral8x2),
        layoutOf(float16x4, snorm8x4, float32x4), layoutOf(float32x3, float32x3, float32x4),
        layoutOf(float32x3, float32x3, none, true), layoutOf(float16x3, none, none, true),
        layoutOf(float16x4, octahedral16x2, none, true), layoutOf(float32x4, octahedral16x2, none),
        layoutOf(float32x3, snorm8x4, float16x4), layoutOf(float32x3, none, none, false, true)}) {
    Crowd crowd(333, 5, rigidity, layout);
    std::vector<InstanceResult> results(crowdSize);
    // Companies with results pass through all stages; those without may be stored directly.
    constexpr std::array<std::size_t, 5> withResults{1, 7, 9, 11, 13};
    for (const std::size_t i : withResults) crowd.instances[i].result = &results[i];
    // Some together, each with other weights, and without another target.
    std::vector<std::vector<MorphWeight>> ownMorphs(12, morphs);
    for (std::size_t i = 2; i < ownMorphs.size(); ++i) {
      for (MorphWeight& morph : ownMorphs[i]) morph.weight *= 0.1f * static_cast<float>(i);
      ownMorphs[i].erase(ownMorphs[i].begin() + static_cast<std::ptrdiff_t>(i % morphs.size()));
      crowd.instances[i].morphs = ownMorphs[i];
    }
    for (const std::size_t i : {5u, 17u}) crowd.instances[i].restartsMotion = layout.motion;
    crowd.poses[3] = randomPose(5, crowdJoints, Rigidity::shear);
    for (JointMatrix& joint : crowd.poses[4]) {
      for (auto& row : joint.m) {
        for (float& entry : row) entry *= 0x1p-20f;  // not moderate
      }
    }
    crowd.place();
    for (std::size_t byte = 0; byte < crowd.before.size(); ++byte)
      crowd.before[byte] = static_cast<std::byte>(byte * 131 + byte / 256);
    crowd.skin(method);
    const std::vector<std::byte> first = crowd.output;
    for (std::size_t i = 0; layout.motion && i < crowdSize; ++i) {
      const OutputAttribute &to = crowd.places[Stream::previousPositions],
                            &from = crowd.places[Stream::positions];
      const std::vector<std::byte>& kept =
          crowd.instances[i].restartsMotion ? crowd.output : crowd.before;
      for (std::size_t vertex = 0; vertex < 333; ++vertex) {
        const std::size_t place = crowd.places.size * i + vertex * to.stride;
        ASSERT_EQ(std::memcmp(crowd.output.data() + place + to.offset,
                              kept.data() + place + from.offset, formatSize(from.format)),
                  0)
            << "instance " << i << ", vertex " << vertex;
      }
    }
    const std::vector<InstanceResult> found = results;
    const auto expectSame = [&](const std::string& what) {
      EXPECT_TRUE(crowd.output == first) << what;
      for (std::size_t i = 0; i < crowdSize; ++i) {
        EXPECT_TRUE(std::ranges::equal(results[i].orderedMin, found[i].orderedMin) &&
                    std::ranges::equal(results[i].orderedMax, found[i].orderedMax))
            << what << ", instance " << i;
        EXPECT_EQ(results[i].clampedVertices, found[i].clampedVertices) << what;
      }
    };
    for (const std::string_view target : cpu::targetNames()) {
      ASSERT_TRUE(cpu::setTarget(target).ok());
      crowd.skin(method);
      expectSame(std::string(target));
      crowd.output = crowd.before;
      std::vector<InstanceResult> all(crowdSize);
      std::uint32_t begin = 0;
      for (const std::uint32_t end : {13u, 15u, 100u, 104u, 250u, 0xffffffffu}) {
        std::size_t i = 0;
        for (const std::size_t count : {1u, 3u, 12u, 7u}) {
          cpu::Job job = crowd.job(method, begin, end);
          job.instances = job.instances.subspan(i, count);
          ASSERT_TRUE(cpu::skin(job).ok());
          i += count;
        }
        EXPECT_EQ(i, crowdSize);
        for (const std::size_t number : withResults) cpu::addResult(all[number], results[number]);
        begin = end;
      }
      results.swap(all);
      expectSame(std::string(target) + ", in ranges");
      results.swap(all);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(
    Cpu, CpuMethodTest,
    ::testing::Combine(::testing::ValuesIn(everydayMethods),
                       ::testing::Values(Rigidity::rigid, Rigidity::uniformScale, Rigidity::shear,
                                         Rigidity::mirrored, Rigidity::mirroredAlongOneAxis)));

// Were they added with weight 0, -0 would become 0.
TEST_F(CpuSkinTest, TargetsOfOtherInstancesChangeNoBit) {
  OwnedMesh source = randomMesh(1, 8, 1, 1);
  for (std::size_t i = 0; i < source.normals.size(); ++i)
    source.normals[i] = i % 3 == 1 ? 1.0f : -0.0f;
  for (const std::uint32_t first : {0u, 4u}) {
    samples::OwnedMorph& morph = source.morphs.emplace_back();
    morph.vertices = {first, first + 1, first + 2, first + 3};
    morph.normals.assign(12, 1);
  }
  const cpu::Mesh mesh = cpu::Mesh::create(pack(source.view(), 1).value()).value();
  const VertexPlaces places = placeVertices(plainLayout, 8).value();
  JointMatrix pose;
  pose.m[1][2] = -0.0f;  // so that x remains -0
  const std::array<MorphWeight, 2> morphs{{{0, 1}, {1, 1}}};
  for (const std::string_view target : cpu::targetNames()) {
    ASSERT_TRUE(cpu::setTarget(target).ok());
    std::vector<std::byte> output(places.size * 16);
    std::vector<cpu::Instance> instances(16);
    for (std::size_t i = 0; i < instances.size(); ++i) {
      instances[i].pose = {&pose, 1};
      instances[i].morphs = {&morphs[i % 2], 1};
      instances[i].output.fill(output.data() + places.size * i);
    }
    ASSERT_TRUE(cpu::skin(jobOf(mesh, Method::linear, places, instances)).ok());
    for (std::size_t i = 0; i < instances.size(); ++i) {
      for (std::size_t vertex = 0; vertex < 8; ++vertex) {
        float x;
        std::memcpy(&x, output.data() + places.size * i + vertex * 24 + 12, sizeof(x));
        const bool isDisplaced = vertex / 4 == i % 2;
        EXPECT_EQ(x > 0, isDisplaced) << target;
        EXPECT_NE(std::signbit(x), isDisplaced) << target;
      }
    }
  }
}

// A direction without length in another lane is normalized in another way.
TEST_F(CpuSkinTest, ATinyComponentHasTheSameBitsBesideAnyOtherVertex) {
  OwnedMesh source = randomMesh(1, 8, 1, 1);
  for (std::size_t vertex = 0; vertex < 8; ++vertex) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      source.normals[vertex * 3 + axis] = axis == 0 && vertex != 5 ? 1.0f : 0.0f;
  }
  const cpu::Mesh mesh = cpu::Mesh::create(pack(source.view(), 1).value()).value();
  const VertexPlaces places = placeVertices(plainLayout, 8).value();
  JointMatrix pose;
  pose.m[0][1] = -1.2345e-39f;
  std::vector<std::byte> first;
  for (const std::string_view target : cpu::targetNames()) {
    ASSERT_TRUE(cpu::setTarget(target).ok());
    for (const std::size_t count : {1u, 3u, 7u, 16u}) {
      std::vector<std::byte> output(places.size * count);
      std::vector<cpu::Instance> instances(count);
      for (std::size_t i = 0; i < count; ++i) {
        instances[i].pose = {&pose, 1};
        instances[i].output.fill(output.data() + places.size * i);
      }
      ASSERT_TRUE(cpu::skin(jobOf(mesh, Method::linear, places, instances)).ok());
      if (first.empty()) first.assign(output.begin(), output.begin() + 24);
      for (std::size_t i = 0; i < count; ++i) {
        for (const std::size_t vertex : {0u, 1u, 4u, 7u}) {
          const std::byte* const normal = output.data() + places.size * i + vertex * 24 + 12;
          EXPECT_EQ(std::memcmp(normal, first.data() + 12, 12), 0)
              << target << ", " << count << " instances, vertex " << vertex;
        }
      }
    }
  }
}

TEST_F(CpuSkinTest, TheInstructionSetsOfThisProcessorAreThere) {
  const std::vector<std::string_view> names = cpu::targetNames();
  ASSERT_FALSE(names.empty());
#if defined(__x86_64__)
  const auto has = [&](std::string_view name) { return std::ranges::count(names, name) == 1; };
  EXPECT_EQ(has("SSE4"), __builtin_cpu_supports("sse4.2") != 0);
#ifndef DERMIS_CPU_ONLY_SSE4
  // The baseline is EMU128 with Highway 1.0 and SSE2 with 1.2.
  EXPECT_TRUE(names.back() == "EMU128" || names.back() == "SSE2") << names.back();
  EXPECT_EQ(has("AVX2"), __builtin_cpu_supports("avx2") != 0);
  EXPECT_EQ(has("AVX3"), __builtin_cpu_supports("avx512bw") != 0);
#endif
#endif
  const Result<void> none = cpu::setTarget("AVX9");
  ASSERT_FALSE(none.ok());
  EXPECT_NE(none.error().message.find("'AVX9'"), std::string::npos);
  EXPECT_NE(none.error().message.find(names.back()), std::string::npos) << none.error().message;
}

#if defined(__x86_64__) && !defined(DERMIS_CPU_ONLY_SSE4)
// Every test that goes through the instruction sets leaves out those that the processor lacks. No
// emulator of Debian's has AVX-512, so only a processor can run that code.
TEST_F(CpuSkinTest, The512BitCodeIsRun) {
  if (std::ranges::count(cpu::targetNames(), "AVX3") == 0)
    GTEST_SKIP() << "NOT TESTED: the 512-bit code, because this processor has no AVX-512";
  EXPECT_TRUE(cpu::setTarget("AVX3").ok());
}
#endif

// For linear blending, matrices with such entries leave the fast path.
TEST_F(CpuSkinTest, MatricesAtTheEdgesOfFloat32StayInsideTheBounds) {
  for (const auto& [even, odd] :
       {std::pair{1e-30f, 1e-30f}, {1e18f, 1e18f}, {1e6f, 1e-6f}, {1e13f, 1}}) {
    Crowd crowd(203, 4, Rigidity::shear, plainLayout);
    for (std::vector<JointMatrix>& pose : crowd.poses) {
      for (std::size_t joint = 0; joint < pose.size(); ++joint) {
        for (auto& row : pose[joint].m) {
          for (float& entry : row) entry *= joint % 2 == 0 ? even : odd;
        }
      }
    }
    for (const Method method : everydayMethods) {
      crowd.skin(method);
      for (std::size_t i = 0; i < crowdSize; ++i) {
        const Comparison comparison = crowd.compared(method, i);
        EXPECT_TRUE(comparison.passed())
            << even << ", " << odd << ", " << methodName(method) << ", vertex "
            << comparison.firstFailure << ": " << comparison.worstPosition << " and "
            << comparison.worstNormal << " of the bounds";
        EXPECT_GE(comparison.compared, 190u);
      }
    }
  }
}

// Four threads skin a quarter each, at the same time.
TEST_F(CpuSkinTest, ThreadsShareTheVerticesOfOneInstance) {
  Crowd crowd(5000, 4, Rigidity::shear, plainLayout);
  crowd.skin(Method::bulgeControlled);
  const std::vector<std::byte> first = crowd.output;
  std::ranges::fill(crowd.output, std::byte{0});
  std::vector<std::thread> threads;
  for (std::uint32_t part = 0; part < 4; ++part) {
    threads.emplace_back([&crowd, part] {
      EXPECT_TRUE(
          cpu::skin(crowd.job(Method::bulgeControlled, part * 1250, (part + 1) * 1250)).ok());
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_TRUE(crowd.output == first);
}

// Joints and pairs by the thousand: the mesh has several sections, and runs of few vertices.
TEST_F(CpuSkinTest, MeshesOfManyJointsAreSkinnedInSections) {
  constexpr std::uint32_t many = 3000;
  OwnedMesh source = randomMesh(9, 4001, many, 6);
  const cpu::Mesh mesh = cpu::Mesh::create(pack(source.view(), many).value()).value();
  const std::vector<JointMatrix> pose = randomPose(1, many, Rigidity::rigid);
  for (const Method method : everydayMethods) {
    std::vector<float> output(4001 * 6);
    cpu::Instance instance;
    instance.pose = pose;
    instance.output.fill(output.data());
    const VertexPlaces places = placeVertices(plainLayout, 4001).value();
    ASSERT_TRUE(cpu::skin(jobOf(mesh, method, places, {&instance, 1})).ok());
    const reference::SkinnedMesh expected = reference::skin(source.view(), pose, method).value();
    // Random numbers differ between standard libraries, and with them whether rotations of a vertex
    // are antipodal.
    const Exemptions exemptions = exemptionsOf(expected);
    EXPECT_LE(exemptions.onlyFinite, 4u);
    EXPECT_EQ(exemptions.skipped, 0u);
    const Comparison comparison =
        compareWithReference(expected,
                             {{output.data(), 4001, 24, VertexFormat::float32x3},
                              {output.data() + 3, 4001, 24, VertexFormat::float32x3},
                              {},
                              {}},
                             exemptions)
            .value();
    EXPECT_TRUE(comparison.passed())
        << methodName(method) << ": " << comparison.worstPosition << " and "
        << comparison.worstNormal << " of the bounds, " << exemptions.onlyFinite << " exempt";
  }
}

TEST_F(CpuSkinTest, BoundsAreThoseOfThePositions) {
  Crowd crowd(203, 4, Rigidity::rigid, plainLayout);
  std::vector<InstanceResult> results(crowdSize), parts(crowdSize, {{0, 0, 0}, {~0u, ~0u, ~0u}, 9});
  const auto expectBounds = [&](const InstanceResult& result, std::size_t i, std::uint32_t begin,
                                std::uint32_t end) {
    const Box found = result.box().value();
    for (std::size_t axis = 0; axis < 3; ++axis) {
      float least = 1e9f, greatest = -1e9f;
      for (std::uint32_t vertex = begin; vertex < end; ++vertex) {
        float p[3];
        std::memcpy(p, crowd.output.data() + crowd.places.size * i + std::size_t{vertex} * 24, 12);
        least = std::min(least, p[axis]);
        greatest = std::max(greatest, p[axis]);
      }
      EXPECT_EQ(found.min[axis], least) << begin;
      EXPECT_EQ(found.max[axis], greatest) << begin;
    }
  };
  for (std::size_t i = 0; i < crowdSize; ++i) crowd.instances[i].result = &results[i];
  crowd.skin(Method::dualQuaternion);
  for (std::size_t i = 0; i < crowdSize; ++i) expectBounds(results[i], i, 0, 203);
  // By parts; what the results were before does not matter.
  std::vector<InstanceResult> sums(crowdSize);
  for (std::size_t i = 0; i < crowdSize; ++i) crowd.instances[i].result = &parts[i];
  std::uint32_t begin = 0;
  for (const std::uint32_t end : {77u, 79u, 203u}) {
    ASSERT_TRUE(cpu::skin(crowd.job(Method::dualQuaternion, begin, end)).ok());
    for (std::size_t i = 0; i < crowdSize; ++i) {
      expectBounds(parts[i], i, begin, end);
      cpu::addResult(sums[i], parts[i]);
    }
    begin = end;
  }
  EXPECT_EQ(std::memcmp(sums.data(), results.data(), sizeof(InstanceResult) * crowdSize), 0);
}

TEST_F(CpuSkinTest, PositionsOutsideTheBoxAreClampedAndCounted) {
  Crowd crowd(203, 4, Rigidity::rigid,
              layoutOf(VertexFormat::snorm16x4, VertexFormat::none, VertexFormat::none));
  InstanceResult result;
  crowd.instances[0].box = {{-0.25f, -8, -8}, {0.25f, 8, 8}};
  crowd.instances[0].result = &result;
  crowd.skin(Method::dualQuaternion);
  const reference::SkinnedMesh expected =
      reference::skin(crowd.source.view(), crowd.poses[0], Method::dualQuaternion).value();
  std::uint32_t outside = 0;
  for (const reference::Double3& position : expected.positions)
    outside += std::abs(position[0]) > 0.25 ? 1u : 0u;
  EXPECT_EQ(result.clampedVertices, outside);
  EXPECT_GT(outside, 10u);
}

// NaN in one component: the others count, by every instruction set.
TEST_F(CpuSkinTest, VerticesWithNanOutsideTheBoxAreCountedAlike) {
  Crowd crowd(203, 4, Rigidity::rigid,
              layoutOf(VertexFormat::snorm16x4, VertexFormat::none, VertexFormat::none));
  for (int nan = 0; nan < 3; ++nan) {
    for (int far = 0; far < 3; ++far) {
      if (far == nan) continue;
      for (JointMatrix& joint : crowd.poses[0]) {
        joint = {};
        joint.m[far][3] = 100;
        joint.m[nan][3] = std::numeric_limits<float>::quiet_NaN();
      }
      crowd.place();
      for (const std::string_view target : cpu::targetNames()) {
        ASSERT_TRUE(cpu::setTarget(target).ok());
        InstanceResult result;
        crowd.instances[0].result = &result;
        crowd.skin(Method::linear);
        const reference::SkinnedMesh still =
            reference::skin(crowd.source.view(), crowd.poses[0], Method::linear).value();
        const auto moved = std::ranges::count_if(still.positions, [](const auto& position) {
          return std::isnan(position[0] + position[1] + position[2]);
        });
        EXPECT_EQ(result.clampedVertices, moved) << target << ' ' << nan << ' ' << far;
      }
    }
  }
}

// No rule of GPUs.
TEST_F(CpuSkinTest, AttributesMayStandAnywhere) {
  Crowd aligned(203, 4, Rigidity::rigid, plainLayout), other(203, 4, Rigidity::rigid, plainLayout);
  aligned.skin(Method::dualQuaternion);
  std::vector<std::byte> output(203 * 32);
  cpu::Job job = other.job(Method::dualQuaternion);
  job.places[Stream::positions] = {4, 32, VertexFormat::float32x3};
  job.places[Stream::normals] = {16, 32, VertexFormat::float32x3};
  other.instances[0].output.fill(output.data());
  job.instances = std::span(other.instances).first(1);
  const Result<void> done = cpu::skin(job);
  ASSERT_TRUE(done.ok()) << done.error().message;
  for (std::size_t vertex = 0; vertex < 203; ++vertex) {
    EXPECT_EQ(std::memcmp(output.data() + vertex * 32 + 4, aligned.output.data() + vertex * 24, 24),
              0);
  }
}

TEST_F(CpuSkinTest, PreviousPositionsAreKeptRestartedAndSettled) {
  Crowd crowd(203, 4, Rigidity::shear,
              layoutOf(VertexFormat::float16x4, VertexFormat::none, VertexFormat::none, true));
  const std::vector<MorphWeight> before{{1, 0.5f}}, now{{0, 1}};
  const auto streamOf = [&](std::size_t i, const OutputAttribute& attribute) {
    std::vector<std::byte> bytes;
    for (std::uint32_t vertex = 0; vertex < 203; ++vertex) {
      const std::byte* from = crowd.output.data() + crowd.places.size * i + attribute.offset +
                              std::size_t{vertex} * attribute.stride;
      bytes.insert(bytes.end(), from, from + 8);
    }
    return bytes;
  };
  const OutputAttribute& positions = crowd.places[Stream::positions];
  OutputAttribute previous = crowd.places[Stream::previousPositions];
  for (cpu::Instance& instance : crowd.instances) {
    instance.restartsMotion = true;
    instance.morphs = before;
  }
  crowd.skin(Method::dualQuaternion);
  std::vector<std::vector<std::byte>> old;
  for (std::size_t i = 0; i < crowdSize; ++i) {
    old.push_back(streamOf(i, positions));
    EXPECT_TRUE(streamOf(i, previous) == old.back()) << "restarted";
  }
  for (std::size_t i = 0; i < crowdSize; ++i) {
    crowd.poses[i] = randomPose(70 + static_cast<std::uint32_t>(i), crowdJoints, Rigidity::rigid);
    crowd.instances[i].restartsMotion = false;
    crowd.instances[i].morphs = now;
  }
  crowd.place();
  ASSERT_TRUE(cpu::skin(crowd.job(Method::dualQuaternion)).ok());
  for (std::size_t i = 0; i < crowdSize; ++i) {
    EXPECT_TRUE(streamOf(i, previous) == old[i]);
    EXPECT_FALSE(streamOf(i, positions) == old[i]);
    crowd.instances[i].settles = true;
  }
  ASSERT_TRUE(cpu::skin(crowd.job(Method::dualQuaternion)).ok());
  for (std::size_t i = 0; i < crowdSize; ++i)
    EXPECT_TRUE(streamOf(i, previous) == streamOf(i, positions)) << "settled";
}

// What the CPU path may not read or write is not there.
TEST_F(CpuSkinTest, BytesBetweenAndBehindAttributesStay) {
  VertexLayout layout =
      layoutOf(VertexFormat::float16x3, VertexFormat::octahedral8x2, VertexFormat::none);
  layout.stride = 20;
  Crowd crowd(203, 4, Rigidity::rigid, layout);
  crowd.skin(Method::dualQuaternion);
  for (std::size_t byte = 0; byte < crowd.output.size(); ++byte) {
    if (byte % 20 >= 8) {
      ASSERT_EQ(crowd.output[byte], untouched) << byte;
    }
  }
  // The plain way, into memory that begins at odd addresses too.
  Crowd plain(203, 4, Rigidity::rigid, plainLayout);
  plain.skin(Method::dualQuaternion);
  std::vector<std::byte> odd(plain.places.size + 2, untouched);
  cpu::Instance instance = plain.instances[0];
  instance.output.fill(odd.data() + 1);
  cpu::Job job = plain.job(Method::dualQuaternion);
  job.instances = {&instance, 1};
  ASSERT_TRUE(cpu::skin(job).ok());
  EXPECT_TRUE(std::equal(odd.begin() + 1, odd.end() - 1, plain.output.begin()));
  EXPECT_EQ(odd.front(), untouched);
  EXPECT_EQ(odd.back(), untouched);
}

// The CPU path has no rule for runs of attributes.
TEST_F(CpuSkinTest, AnyFormatMayBeAtAnyByte) {
  using enum VertexFormat;
  constexpr std::uint32_t vertexCount = 203, stride = 41;
  for (const auto& [positions, normals, tangents] : {std::array{float16x3, snorm8x3, octahedral8x2},
                                                     {snorm16x3, float16x3, snorm8x4},
                                                     {float32x3, octahedral8x2, octahedral16x2}}) {
    Crowd crowd(vertexCount, 4, Rigidity::rigid,
                layoutOf(positions, normals, tangents, false, true));
    crowd.skin(Method::dualQuaternion);
    std::vector<std::byte> odd(vertexCount * stride, untouched);
    cpu::Instance instance = crowd.instances[0];
    instance.output.fill(odd.data());
    cpu::Job job = crowd.job(Method::dualQuaternion);
    job.instances = {&instance, 1};
    std::uint32_t end = 1;
    for (OutputAttribute* attribute : {&job.places[Stream::positions], &job.places[Stream::normals],
                                       &job.places[Stream::tangents]}) {
      attribute->offset = end;
      attribute->stride = stride;
      end += formatSize(attribute->format);
    }
    ASSERT_TRUE(cpu::skin(job).ok());
    for (std::size_t vertex = 0; vertex < vertexCount; ++vertex) {
      const std::span<std::byte> bytes = std::span(odd).subspan(vertex * stride, stride);
      for (const auto& [here, there] :
           {std::pair{&job.places[Stream::positions], &crowd.places[Stream::positions]},
            {&job.places[Stream::normals], &crowd.places[Stream::normals]},
            {&job.places[Stream::tangents], &crowd.places[Stream::tangents]}}) {
        const std::size_t size = formatSize(here->format);
        EXPECT_EQ(std::memcmp(bytes.data() + here->offset,
                              crowd.output.data() + there->offset + vertex * size, size),
                  0)
            << vertex;
      }
      EXPECT_TRUE(isUntouched(bytes.first(1)) && isUntouched(bytes.subspan(end))) << vertex;
    }
  }
}

// An array for each attribute, as programs without a GPU like it.
TEST_F(CpuSkinTest, AttributesMayGoToArraysOfTheirOwn) {
  const VertexLayout layout =
      layoutOf(VertexFormat::float32x3, VertexFormat::float32x3, VertexFormat::float32x4, true);
  Crowd together(100, 4, Rigidity::rigid, layout);
  for (cpu::Instance& instance : together.instances) instance.restartsMotion = true;
  together.skin(Method::dualQuaternion);
  Crowd apart(100, 4, Rigidity::rigid, layout);
  cpu::Job job = apart.job(Method::dualQuaternion);
  job.places[Stream::positions] =
      job.places[Stream::previousPositions] = {0, 12, VertexFormat::float32x3};
  job.places[Stream::normals] = {0, 12, VertexFormat::float32x3};
  job.places[Stream::tangents] = {4, 20, VertexFormat::float32x4};
  for (std::size_t i = 0; i < crowdSize; ++i) {
    std::vector<float> positions(300), normals(300), tangents(501), previous(300);
    apart.instances[i].output = {positions.data(), normals.data(), tangents.data(),
                                 previous.data()};
    apart.instances[i].restartsMotion = true;
    job.instances = std::span(apart.instances).subspan(i, 1);
    const Result<void> done = cpu::skin(job);
    ASSERT_TRUE(done.ok()) << done.error().message;
    const auto expectSame = [&](const float* floats, std::size_t stride, std::size_t count,
                                const OutputAttribute& attribute) {
      for (std::size_t vertex = 0; vertex < 100; ++vertex) {
        EXPECT_EQ(std::memcmp(floats + vertex * stride,
                              together.output.data() + together.places.size * i + attribute.offset +
                                  vertex * attribute.stride,
                              count * 4),
                  0);
      }
    };
    expectSame(positions.data(), 3, 3, together.places[Stream::positions]);
    expectSame(normals.data(), 3, 3, together.places[Stream::normals]);
    expectSame(tangents.data() + 1, 5, 4, together.places[Stream::tangents]);
    expectSame(previous.data(), 3, 3, together.places[Stream::previousPositions]);
    EXPECT_EQ(tangents[0], 0.0f);
    EXPECT_EQ(tangents[5], 0.0f);
  }
  apart.instances[0].output = {apart.output.data(), nullptr, apart.output.data(),
                               apart.output.data()};
  job.instances = {&apart.instances[0], 1};
  const Result<void> refused = cpu::skin(job);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("no output for its normals"), std::string::npos);
}

TEST_F(CpuSkinTest, VerticesOutsideTheRangeStay) {
  for (const VertexLayout& layout :
       {plainLayout, layoutOf(VertexFormat::float16x4, VertexFormat::none, VertexFormat::none)}) {
    Crowd crowd(203, 4, Rigidity::rigid, layout);
    const std::uint32_t stride = crowd.places[Stream::positions].stride;
    for (const auto& [begin, end] : {std::pair{13u, 101u},
                                     {16u, 19u},
                                     {5u, 5u},
                                     {200u, 203u},
                                     // inside one block, not at its begin; at the output's end, too
                                     {18u, 21u},
                                     {201u, 203u}}) {
      for (const std::size_t count : {std::size_t{crowdSize}, std::size_t{1}}) {
        std::ranges::fill(crowd.output, untouched);
        cpu::Job job = crowd.job(Method::dualQuaternion, begin, end);
        job.instances = job.instances.first(count);
        ASSERT_TRUE(cpu::skin(job).ok());
        for (std::size_t byte = 0; byte < crowd.output.size(); byte += stride) {
          const std::size_t vertex = byte % crowd.places.size / stride;
          const bool isWritten = !isUntouched(std::span(crowd.output).subspan(byte, stride));
          ASSERT_EQ(isWritten, byte / crowd.places.size < count && vertex >= begin && vertex < end)
              << vertex;
        }
      }
    }
  }
}

// With every method, scaling joints and morph targets.
TEST_F(CpuSkinTest, SomeVerticesAreWhereTheyAreInTheWhole) {
  const std::vector<MorphWeight> morphs{{0, 0.5f}, {2, -1},   {3, 0.3f},
                                        {4, -1},   {5, 0.7f}, {6, 1.5f}};
  const std::vector<std::uint32_t> vertices{200, 3, 4, 4, 150, 77, 0, 9, 101, 202};
  for (const auto& [rigidity, promise] : {std::pair(Rigidity::rigid, JointPromise::scaling),
                                          std::pair(Rigidity::shear, JointPromise::scaling),
                                          std::pair(Rigidity::shear, JointPromise::scaleIgnored)}) {
    Crowd crowd(203, 5, rigidity, plainLayout);
    for (cpu::Instance& instance : crowd.instances) {
      instance.morphs = morphs;
      instance.promise = promise;
    }
    for (const Method method : everydayMethods) {
      crowd.skin(method);
      std::vector<float> positions(vertices.size() * 3);
      const Result<void> done =
          cpu::skinVertices(*crowd.mesh, method, crowd.instances[1], vertices, positions);
      ASSERT_TRUE(done.ok()) << done.error().message;
      for (std::size_t i = 0; i < vertices.size(); ++i) {
        float expected[3];
        std::memcpy(expected,
                    crowd.output.data() + crowd.places.size + std::size_t{vertices[i]} * 24,
                    sizeof(expected));
        for (std::size_t axis = 0; axis < 3; ++axis) {
          EXPECT_EQ(positions[i * 3 + axis], expected[axis])
              << methodName(method) << ", vertex " << vertices[i];
        }
      }
    }
    const auto isDone = [&](Method method, std::span<const std::uint32_t> some, std::size_t room) {
      std::vector<float> positions(room * 3);
      return cpu::skinVertices(*crowd.mesh, method, crowd.instances[0], some, positions).ok();
    };
    EXPECT_FALSE(isDone(Method::linear, std::array{203u}, 1)) << "outside";
    EXPECT_FALSE(isDone(Method::linear, vertices, 1)) << "too little room";
    EXPECT_FALSE(isDone(Method::logMatrix, std::array{200u}, 1)) << "a method for comparison";
    EXPECT_TRUE(isDone(Method::linear, {}, 0)) << "none";
    EXPECT_FALSE(isDone(Method::logMatrix, {}, 0)) << "none, by a method for comparison";
    EXPECT_FALSE(cpu::skinVertices(*crowd.mesh, Method::linear, {}, {}, {}).ok()) << "no pose";
  }
}

TEST_F(CpuSkinTest, JobsThatMakeNoSenseAreRefusedAndNothingIsWritten) {
  Crowd crowd(203, 4, Rigidity::rigid, plainLayout);
  const auto expectRefused = [&](cpu::Job job, const std::string& text) {
    const Result<void> done = cpu::skin(job);
    ASSERT_FALSE(done.ok()) << text;
    EXPECT_EQ(done.error().code, ErrorCode::invalidArgument) << done.error().message;
    EXPECT_NE(done.error().message.find(text), std::string::npos) << done.error().message;
    EXPECT_TRUE(isUntouched(crowd.output));
  };
  const cpu::Job good = crowd.job(Method::dualQuaternion);
  cpu::Job bad = good;
  bad.mesh = nullptr;
  expectRefused(bad, "the job has no mesh");
  for (const Method method : allMethods) {
    if (!isForComparison(method)) continue;
    bad = good;
    bad.method = method;
    expectRefused(bad, std::string(methodName(method)) + " is a method for comparison");
  }
  bad = good;
  bad.firstVertex = 204;
  expectRefused(bad, "firstVertex of 204 is after its last vertex");
  bad = good;
  bad.places[Stream::normals].format = static_cast<VertexFormat>(99);
  expectRefused(bad, "normals");
  bad = good;
  bad.places[Stream::positions].stride = 4;
  expectRefused(bad, "positions");

  const auto expectBadInstance = [&](const auto& change, const std::string& text) {
    std::vector<cpu::Instance> instances = crowd.instances;
    change(instances[2]);
    cpu::Job job = good;
    job.instances = instances;
    expectRefused(job, "instance 2" + text);
  };
  const MorphWeight unknown{9, 1};
  const std::array<MorphWeight, 2> falling{{{2, 1}, {1, 1}}};
  expectBadInstance([](cpu::Instance& i) { i.output = {}; }, " has no output for its positions");
  expectBadInstance([](cpu::Instance& i) { i.pose = i.pose.first(3); }, ": its pose has 3 joints");
  expectBadInstance([&](cpu::Instance& i) { i.morphs = {&unknown, 1}; }, "");
  expectBadInstance([&](cpu::Instance& i) { i.morphs = falling; },
                    ": its morph targets are not in ascending order");
  expectBadInstance([](cpu::Instance& i) { i.settles = true; },
                    " settles or restarts its motion, but has no previous positions");
  expectBadInstance([](cpu::Instance& i) { i.restartsMotion = true; },
                    " settles or restarts its motion, but has no previous positions");
  EXPECT_TRUE(cpu::skin(good).ok());
}

// Every vertex of a block has another pivot, so the block has 4,096 pairs: the most that 16-bit
// numbers allow.
TEST_F(CpuSkinTest, VerticesOf512InfluencesAndNoMore) {
  const std::uint32_t joints = 600, vertices = 8;
  for (const std::uint32_t influences : {512u, 513u}) {
    const std::size_t all = std::size_t{vertices} * influences;
    std::vector<std::uint32_t> numbers(all);
    std::vector<float> weights(all, 1), positions(vertices * 3, 3);
    for (std::size_t i = 0; i < all; ++i) numbers[i] = static_cast<std::uint32_t>(i % influences);
    for (std::uint32_t vertex = 0; vertex < vertices; ++vertex)
      weights[std::size_t{vertex} * influences + vertex] = 2;
    InfluenceSet set;
    set.joints = {numbers.data(), vertices, influences * 4, ComponentType::uint32, influences};
    set.weights = attributeView(weights.data(), vertices, influences);
    MeshView view;
    view.vertexCount = vertices;
    view.positions = attributeView(positions.data(), vertices, 3);
    view.influenceSets = {&set, 1};
    const Result<cpu::Mesh> mesh = cpu::Mesh::create(pack(view, joints).value());
    EXPECT_EQ(mesh.ok(), influences == 512);
    if (!mesh) continue;
    std::vector<JointMatrix> pose(joints);
    for (std::uint32_t joint = 0; joint < joints; ++joint)
      pose[joint].m[0][3] = static_cast<float>(joint);
    std::vector<float> skinned(positions.size());
    cpu::Instance instance;
    instance.pose = pose;
    instance.output.fill(skinned.data());
    const VertexPlaces places = placeVertices({}, vertices).value();
    ASSERT_TRUE(cpu::skin(jobOf(*mesh, cpu::Job{}.method, places, {&instance, 1})).ok());
    const float sum = 512 * 511 / 2;
    for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
      EXPECT_NEAR(skinned[vertex * 3], 3 + (sum + static_cast<float>(vertex)) / 513, 1e-3);
      EXPECT_NEAR(skinned[vertex * 3 + 2], 3, 1e-5);
    }
  }
}

}  // namespace
}  // namespace dermis::test
