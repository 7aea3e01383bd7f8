// Acceleration structures that are built from skinned positions, and refitted from pose to pose, in
// the command buffer that skins; rays tell that they hold what was skinned.

#include "dermis/vulkan/drawing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <ostream>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "kit/buffer.h"
#include "random_rig.h"
#include "ray_tracing.h"
#include "test_device.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t triangleCount = 200, vertexCount = 3 * triangleCount, jointCount = 8;

/// How positions are stored.
struct PositionLayout {
  const char* name;
  OutputAttribute attribute;
  double tolerance;  ///< of a distance, by what the format rounds
};

void PrintTo(const PositionLayout& layout, std::ostream* stream) {
  *stream << layout.name;
}

using Triangle = std::array<reference::Double3, 3>;

reference::Double3 difference(const reference::Double3& a, const reference::Double3& b) {
  return {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

reference::Double3 cross(const reference::Double3& a, const reference::Double3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double length(const reference::Double3& v) {
  return std::hypot(v[0], v[1], v[2]);
}

/// At the center of the triangle, from a distance of 1.
Ray rayAt(const Triangle& triangle) {
  const reference::Double3 normal =
      cross(difference(triangle[1], triangle[0]), difference(triangle[2], triangle[0]));
  Ray ray;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double center = (triangle[0][axis] + triangle[1][axis] + triangle[2][axis]) / 3;
    const double unit = normal[axis] / length(normal);
    ray.origin[axis] = static_cast<float>(center + unit);
    ray.direction[axis] = static_cast<float>(-unit);
  }
  return ray;
}

/// Whether a small error in its corners moves where a ray meets it by a small distance only.
bool isWide(const Triangle& triangle) {
  const reference::Double3 a = difference(triangle[1], triangle[0]),
                           b = difference(triangle[2], triangle[0]),
                           c = difference(triangle[2], triangle[1]);
  return length(cross(a, b)) > 0.2 * std::max({length(a), length(b), length(c)});
}

/// A pose of the mesh: what it must look like, and what skins it.
struct BuiltPose {
  std::vector<JointMatrix> joints;
  std::vector<Triangle> triangles;
  std::vector<bool> certain;  ///< by triangle
  std::vector<Ray> rays;      ///< by triangle
  Box box;
  Plan plan;
  samples::MappedBuffer matrices, tables, palettes, results;
  std::optional<vulkan::Bindings> bindings;
};

/// Larger by a margin that is its own along every axis.
Box boxAround(const std::vector<reference::Double3>& positions) {
  Box box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto [low, high] = std::ranges::minmax(
        positions, {}, [&](const reference::Double3& position) { return position[axis]; });
    box.min[axis] = static_cast<float>(low[axis] - 0.1);
    box.max[axis] = static_cast<float>(high[axis] + 0.3 + 0.1 * static_cast<double>(axis));
  }
  return box;
}

void addExpectations(BuiltPose& pose, OwnedMesh& mesh) {
  const reference::SkinnedMesh expected =
      *reference::skin(mesh.view(), pose.joints, Method::dualQuaternion);
  pose.box = boxAround(expected.positions);
  for (std::size_t triangle = 0; triangle < triangleCount; ++triangle) {
    const std::size_t first = 3 * triangle;
    pose.triangles.push_back(
        {expected.positions[first], expected.positions[first + 1], expected.positions[first + 2]});
    const bool ambiguous =
        std::any_of(expected.bounds.begin() + static_cast<std::ptrdiff_t>(first),
                    expected.bounds.begin() + static_cast<std::ptrdiff_t>(first + 3),
                    [](const reference::VertexBounds& vertex) { return vertex.onlyFinite; });
    pose.certain.push_back(!ambiguous && isWide(pose.triangles.back()));
    pose.rays.push_back(rayAt(pose.triangles.back()));
  }
}

class AccelerationStructureTest : public DeviceTest,
                                  public ::testing::WithParamInterface<PositionLayout> {
 protected:
  /// Where the driver is known to trace rays, not to do so is a failure.
  static bool isRequired() { return std::getenv("DERMIS_REQUIRE_RAY_TRACING") != nullptr; }

  void SetUp() override {
    DeviceTest::SetUp();
    if (device_ == nullptr) return;
    if (!device().info().accelerationStructures) {
      ASSERT_FALSE(isRequired()) << device().info().name;
      GTEST_SKIP() << "device '" << device().info().name
                   << "' has no VK_KHR_acceleration_structure";
    }
    samples::DeviceOptions options = testDeviceOptions();
    options.rayTracing = true;
    Result<samples::OpenDevice> opened = samples::openDevice(options);
    ASSERT_TRUE(opened.ok()) << opened.error().message;
    opened_.emplace(std::move(*opened));
    device_ = &*opened_;
    functions_.emplace(device());
  }

  samples::MappedBuffer makeBuffer(std::uint64_t size, VkBufferUsageFlags usage) {
    Result<samples::MappedBuffer> buffer =
        samples::MappedBuffer::create(device(), size, usage, true);
    EXPECT_TRUE(buffer.ok()) << (buffer ? "" : buffer.error().message);
    return buffer ? std::move(*buffer) : samples::MappedBuffer{};
  }

  VkDeviceAddress address(const samples::MappedBuffer& buffer) {
    return addressOf(device(), *functions_, buffer);
  }

  void makeMesh() {
    mesh_ = randomMesh(1, vertexCount, jointCount, 4, false);
    packed_.emplace(*pack(mesh_.view(), jointCount));
    meshes_ = makeBuffer(packed_->bytes().size(), VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                                      VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT);
    std::memcpy(meshes_.bytes().data(), packed_->bytes().data(), packed_->bytes().size());
  }

  /// A plan for the pose, and the buffers that it needs; the output is the same for every pose.
  void preparePose(BuiltPose& pose, std::uint32_t seed) {
    pose.joints = randomPose(seed, jointCount, Rigidity::rigid);
    addExpectations(pose, mesh_);
    const PoseDescription palette{jointCount, 0, JointPromise::rigid};
    Job job;
    job.mesh = packed_->info();
    job.places[Stream::positions] = GetParam().attribute;
    job.box = pose.box;
    Batch batch;
    batch.poses = {&palette, 1};
    batch.jobs = {&job, 1};
    batch.meshesSize = meshes_.bytes().size();
    batch.posesSize = pose.joints.size() * sizeof(JointMatrix);
    batch.outputSizes.fill(job.places[Stream::positions].offset +
                           std::uint64_t{vertexCount} * job.places[Stream::positions].stride);
    const Result<void> planned = makePlan(batch, context().limits(), {}, pose.plan);
    ASSERT_TRUE(planned.ok()) << planned.error().message;
    ASSERT_TRUE(context().prepare(pose.plan.pipelines()).ok());
    makePoseBuffers(pose);
  }

  void makePoseBuffers(BuiltPose& pose) {
    const auto make = [&](BufferRole role, VkBufferUsageFlags more = 0) {
      const BufferRequirement requirement = pose.plan.buffer(role);
      return makeBuffer(requirement.size, requirement.usage | more);
    };
    pose.matrices = make(BufferRole::poses);
    pose.tables = make(BufferRole::tables);
    pose.palettes = make(BufferRole::palettes);
    pose.results = make(BufferRole::results);
    if (output_.bytes().empty()) output_ = make(BufferRole::positions, vulkan::buildInputUsage);
    std::memcpy(pose.matrices.bytes().data(), pose.joints.data(), pose.matrices.bytes().size());
    ASSERT_TRUE(writeTables(pose.plan, pose.tables.bytes()).ok());
    Result<vulkan::Bindings> bindings = context().createBindings(
        {meshes_.range(), pose.matrices.range(), pose.tables.range(), pose.palettes.range(),
         ByStream<vulkan::BufferRange>::all(output_.range()), pose.results.range()});
    ASSERT_TRUE(bindings.ok()) << bindings.error().message;
    pose.bindings.emplace(std::move(*bindings));
  }

  /// What an engine hands to its build.
  VkAccelerationStructureGeometryKHR geometry(const BuiltPose& pose) {
    const Result<VkAccelerationStructureGeometryTrianglesDataKHR> input =
        vulkan::buildInput(GetParam().attribute, vertexCount, address(output_));
    EXPECT_TRUE(input.ok()) << (input ? "" : input.error().message);
    if (!input) return {};
    VkAccelerationStructureGeometryTrianglesDataKHR triangles = *input;
    if (GetParam().attribute.format == VertexFormat::snorm16x4) {
      const VkTransformMatrixKHR transform = *vulkan::boxTransform(pose.box);
      transforms_.push_back(makeBuffer(sizeof(transform), vulkan::buildInputUsage));
      std::memcpy(transforms_.back().bytes().data(), &transform, sizeof(transform));
      triangles.transformData.deviceAddress = address(transforms_.back());
    }
    return geometryOf(triangles);
  }

  void barrier(Use before, Use after) { context().recordBarrier(commandBuffer_, before, after); }

  /// Between the engine's own uses of its acceleration structures and their scratch memory: builds,
  /// and rays where there are any.
  void structureBarrier() {
    VkPipelineStageFlags stages = VK_PIPELINE_STAGE_ACCELERATION_STRUCTURE_BUILD_BIT_KHR;
    if (device().info().rayQueries) stages |= VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT;
    constexpr VkAccessFlags write = VK_ACCESS_ACCELERATION_STRUCTURE_WRITE_BIT_KHR;
    const VkMemoryBarrier memory = vulkan::Barrier{
        stages, write, stages, write | VK_ACCESS_ACCELERATION_STRUCTURE_READ_BIT_KHR};
    device().functions().CmdPipelineBarrier(commandBuffer_, stages, stages, 0, 1, &memory, 0,
                                            nullptr, 0, nullptr);
  }

  void begin() {
    commandBuffer_ = device().allocateCommandBuffer();
    VkCommandBufferBeginInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    device().functions().BeginCommandBuffer(commandBuffer_, &info);
  }

  void submit() {
    barrier(Use::dermis, Use::hostRead);
    device().functions().EndCommandBuffer(commandBuffer_);
    const Result<void> done = device().submitAndWait(commandBuffer_);
    EXPECT_TRUE(done.ok()) << (done ? "" : done.error().message);
    device().freeCommandBuffer(commandBuffer_);
  }

  /// Skins, then builds or refits what rays see.
  void skinAndBuild(const BuiltPose& pose, VkBuildAccelerationStructureModeKHR mode,
                    AccelerationStructure& bottom, RayScene& scene) {
    const Result<void> recorded = context().record(commandBuffer_, pose.plan, *pose.bindings);
    ASSERT_TRUE(recorded.ok()) << recorded.error().message;
    barrier(Use::dermis, Use::accelerationStructureBuild);
    bottom.record(commandBuffer_, mode, geometry(pose));
    structureBarrier();
    scene.build(commandBuffer_);
    structureBarrier();
  }

  /// Triangles that are met where the pose has them, of those that are certain.
  std::pair<int, int> countHits(const BuiltPose& pose, const std::vector<float>& distances) const {
    int hits = 0, certain = 0;
    for (std::size_t triangle = 0; triangle < triangleCount; ++triangle) {
      if (!pose.certain[triangle]) continue;
      ++certain;
      if (std::abs(static_cast<double>(distances[triangle]) - 1) <= GetParam().tolerance) ++hits;
    }
    return {hits, certain};
  }

  std::optional<samples::OpenDevice> opened_;
  std::optional<RayTracingFunctions> functions_;
  OwnedMesh mesh_;
  std::optional<PackedMesh> packed_;
  samples::MappedBuffer meshes_, output_;
  std::vector<samples::MappedBuffer> transforms_;
  VkCommandBuffer commandBuffer_ = VK_NULL_HANDLE;
};

TEST_P(AccelerationStructureTest, HoldsWhatWasSkinnedWhenBuiltAndWhenRefitted) {
  if (!device().info().rayQueries) {
    ASSERT_FALSE(isRequired()) << device().info().name;
    GTEST_SKIP() << "without VK_KHR_ray_query nothing can look into an acceleration structure";
  }
  makeMesh();
  BuiltPose first, second;
  ASSERT_NO_FATAL_FAILURE(preparePose(first, 2));
  ASSERT_NO_FATAL_FAILURE(preparePose(second, 3));
  AccelerationStructure bottom(device(), *functions_,
                               VK_ACCELERATION_STRUCTURE_TYPE_BOTTOM_LEVEL_KHR, geometry(first),
                               triangleCount);
  RayScene scene(device(), *functions_, bottom);
  RayCaster caster(device(), *functions_, 3);

  begin();
  ASSERT_NO_FATAL_FAILURE(
      skinAndBuild(first, VK_BUILD_ACCELERATION_STRUCTURE_MODE_BUILD_KHR, bottom, scene));
  caster.record(commandBuffer_, scene, first.rays);
  barrier(Use::accelerationStructureBuild | Use::dermis, Use::dermis);
  structureBarrier();
  ASSERT_NO_FATAL_FAILURE(
      skinAndBuild(second, VK_BUILD_ACCELERATION_STRUCTURE_MODE_UPDATE_KHR, bottom, scene));
  caster.record(commandBuffer_, scene, second.rays);
  caster.record(commandBuffer_, scene, first.rays);
  submit();

  const auto [builtHits, builtCertain] = countHits(first, caster.distances(0));
  const auto [refittedHits, refittedCertain] = countHits(second, caster.distances(1));
  EXPECT_GT(std::min(builtCertain, refittedCertain), static_cast<int>(triangleCount) / 2);
  EXPECT_EQ(builtHits, builtCertain) << "after the build";
  EXPECT_EQ(refittedHits, refittedCertain) << "after the refit";
  // The rays tell one pose from another.
  EXPECT_LT(countHits(first, caster.distances(2)).first, builtCertain / 10);
}

TEST_P(AccelerationStructureTest, TheDeviceReadsTheFormat) {
  const VkFormat format = vulkan::buildInputFormat(GetParam().attribute.format);
  const auto getFormatProperties = reinterpret_cast<PFN_vkGetPhysicalDeviceFormatProperties>(
      device().description().getInstanceProcAddr(device().description().instance,
                                                 "vkGetPhysicalDeviceFormatProperties"));
  VkFormatProperties properties{};
  getFormatProperties(device().description().physicalDevice, format, &properties);
  EXPECT_NE(
      properties.bufferFeatures & VK_FORMAT_FEATURE_ACCELERATION_STRUCTURE_VERTEX_BUFFER_BIT_KHR,
      0u);
}

INSTANTIATE_TEST_SUITE_P(
    Layouts, AccelerationStructureTest,
    ::testing::Values(PositionLayout{"float32x3", {0, 12, VertexFormat::float32x3}, 1e-4},
                      PositionLayout{"float32x3Apart", {64, 28, VertexFormat::float32x3}, 1e-4},
                      PositionLayout{"float32x4", {16, 16, VertexFormat::float32x4}, 1e-4},
                      PositionLayout{"float16x4", {4, 12, VertexFormat::float16x4}, 4e-3},
                      PositionLayout{"snorm16x4", {0, 8, VertexFormat::snorm16x4}, 1e-3}),
    [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace dermis::test
