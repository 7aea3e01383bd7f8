// What a SceneRecorder asks of a driver for memory, and what it records around the commands of a
// plan.

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "abi.h"
#include "dermis/vulkan/scene_recorder.h"
#include "mock_batch.h"
#include "scene_meshes.h"

namespace dermis::test {
namespace {

using vulkan::SceneRecorder;
using vulkan::SceneRecorderDescription;

const VkBuffer visibility = reinterpret_cast<VkBuffer>(std::uintptr_t{1} << 22);

constexpr VkPipelineStageFlags copies = VK_PIPELINE_STAGE_TRANSFER_BIT,
                               computeOrCopy = VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | copies;
constexpr VkAccessFlags writes = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
constexpr VkAccessFlags reads = VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_TRANSFER_READ_BIT;

class MockSystemTest : public MockContextTest {
 protected:
  /// Small, and may grow.
  SceneRecorderDescription small() {
    SceneRecorderDescription description;
    description.scene.meshCapacity = {1024};
    description.scene.jointCapacity = {64};
    description.scene.outputCapacity = {480};
    description.scene.instanceCapacity = {16};
    description.scene.boundsCapacity = {1};
    return description;
  }
  /// Creates the system; the context must be there.
  void make(const SceneRecorderDescription& description) {
    system.emplace(must(SceneRecorder::create(*context, description)));
  }
  Scene& scene() { return system->scene(); }
  InstanceHandle add(InstanceDescription description) {
    description.mesh = must(scene().addMesh(packed));
    description.pose = must(scene().addPose(8));
    must(system->prepare(description));
    return must(scene().addInstance(description));
  }
  /// One more, with all frames before it complete.
  void begin() {
    ++frame;
    must(scene().beginFrame(frame, frame - 1));
  }
  void record() {
    mock.commands.clear();
    mock.copies.clear();
    mock.memoryBarriers.clear();
    mock.dispatches.clear();
    must(system->record(commandBuffer, {visibility, 0, scene().visibilityCount() * 4}));
  }

  PackedMesh packed = systemMesh(1, 40);
  std::optional<SceneRecorder> system;
  std::uint64_t frame = 0;
};

// The driver could not give an address to a buffer elsewhere; all other memory needs none.
TEST_F(MockSystemTest, OnlyBuffersWithAnAddressLieInMemoryWithOne) {
  ASSERT_NO_FATAL_FAILURE(create());
  SceneRecorderDescription description = small();
  description.outputUsage |= VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT;
  make(description);
  add({});
  begin();
  record();
  std::map<bool, int> buffers;
  for (const auto& [handle, buffer] : mock.buffers) {
    const bool hasAddress = (buffer.usage & VK_BUFFER_USAGE_SHADER_DEVICE_ADDRESS_BIT) != 0;
    EXPECT_EQ(mock.memories.at(buffer.memory).hasAddress, hasAddress);
    ++buffers[hasAddress];
  }
  EXPECT_EQ(buffers[true], 1) << "the output";
  EXPECT_GT(buffers[false], 5);
}

TEST_F(MockSystemTest, WhereABlockFindsNoMemoryABufferAloneDoes) {
  ASSERT_NO_FATAL_FAILURE(create());
  mock.largestAllocation = 30'000;
  make(small());
  add({});
  begin();
  record();
  EXPECT_EQ(system->statistics().deviceMemory, mock.memoryBytes());
  EXPECT_LT(mock.memoryBytes(), 128u << 10);
}

TEST_F(MockSystemTest, AMisalignedOrSmallVisibilityBufferIsRefused) {
  ASSERT_NO_FATAL_FAILURE(create());
  make(small());
  InstanceDescription culled;
  culled.culledOnGpu = true;
  add(culled);
  begin();
  const std::uint32_t alignment = context->limits().minStorageBufferOffsetAlignment;
  ASSERT_GT(alignment, 4u);
  const std::uint64_t size = scene().visibilityCount() * 4;
  const auto expectRefused = [&](const vulkan::BufferRange& range, const std::string& message) {
    const Result<void> refused = system->record(commandBuffer, range);
    ASSERT_FALSE(refused.ok()) << message;
    EXPECT_NE(refused.error().message.find(message), std::string::npos) << refused.error().message;
  };
  expectRefused({visibility, 4, size}, "visibility.offset is 4,");
  expectRefused({visibility, alignment, size - 4}, "visibility has " + std::to_string(size - 4));
  expectRefused({VK_NULL_HANDLE, 0, size}, "visibility has 0");
  EXPECT_TRUE(mock.commands.empty());
  must(system->record(commandBuffer, {visibility, alignment, size}));
}

/// A GPU in a PC: device memory, host memory, a little that is both, and a type that needs a
/// feature.
struct PretendedHeaps {
  static constexpr std::uint32_t deviceType = 0, hostType = 1, mappedDeviceType = 2, oddType = 3;
  static constexpr VkDeviceSize plenty = VkDeviceSize{1} << 30;

  explicit PretendedHeaps(MockVulkan& vulkan) : mock(vulkan) {
    constexpr VkMemoryPropertyFlags local = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT,
                                    mapped = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT |
                                             VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
    VkPhysicalDeviceMemoryProperties& types = mock.memoryTypes;
    types.memoryTypeCount = types.memoryHeapCount = 4;
    types.memoryTypes[deviceType] = {local, 0};
    types.memoryTypes[hostType] = {mapped, 1};
    types.memoryTypes[mappedDeviceType] = {local | mapped, 2};
    types.memoryTypes[oddType] = {local | mapped | VK_MEMORY_PROPERTY_DEVICE_COHERENT_BIT_AMD, 3};
  }
  VkDeviceSize taken(std::uint32_t type) const {
    VkDeviceSize bytes = 0;
    for (const auto& [handle, memory] : mock.memories)
      bytes += memory.type == type ? memory.bytes.size() : 0;
    return bytes;
  }

  MockVulkan& mock;
};

// Where the mapped memory of the device is full, or fills up, host memory serves as well.
TEST_F(MockSystemTest, AFullHeapLeavesTheOthers) {
  using Heaps = PretendedHeaps;
  for (const std::uint32_t mapped : {0u, 400u << 10, 1u << 30}) {
    SCOPED_TRACE(mapped);
    const Heaps heaps(mock);
    mock.freeMemory = {Heaps::plenty, Heaps::plenty, mapped, Heaps::plenty};
    ASSERT_NO_FATAL_FAILURE(create());
    make(small());
    const PackedMesh large = systemMesh(1, 2000);
    frame = 0;
    for (int mesh = 0; mesh < 10; ++mesh) must(scene().addMesh(large));
    begin();
    record();
    EXPECT_GT(heaps.taken(Heaps::deviceType), large.bytes().size() * 10);
    EXPECT_EQ(heaps.taken(Heaps::mappedDeviceType) != 0, mapped != 0) << "preferred for uploads";
    EXPECT_EQ(heaps.taken(Heaps::hostType) != 0, mapped != 1u << 30);
    EXPECT_EQ(heaps.taken(Heaps::oddType), 0u);
    system.reset();
  }
}

TEST_F(MockSystemTest, WhereEveryHeapIsFullTheDriversErrorIsGivenOn) {
  const PretendedHeaps heaps(mock);
  mock.freeMemory = {PretendedHeaps::plenty, 0, 0, PretendedHeaps::plenty};
  ASSERT_NO_FATAL_FAILURE(create());
  const Result<SceneRecorder> made = SceneRecorder::create(*context, small());
  ASSERT_FALSE(made.ok());
  EXPECT_EQ(made.error().code, ErrorCode::vulkanError);
  EXPECT_EQ(made.error().vulkanResult, VK_ERROR_OUT_OF_DEVICE_MEMORY);
  EXPECT_EQ(mock.alive["Memory"], 0);
  EXPECT_EQ(mock.alive["Buffer"], 0);
}

TEST_F(MockSystemTest, AnUploadsMemoryIsFreedOnceItsFrameIsComplete) {
  ASSERT_NO_FATAL_FAILURE(create());
  SceneRecorderDescription description = small();
  description.scene.meshCapacity = {4 << 20};
  make(description);
  begin();
  record();
  const VkDeviceSize bytes = mock.memoryBytes();
  must(scene().addMesh(systemMesh(1, 20000)));  // needs another block
  begin();
  record();
  EXPECT_GT(mock.memoryBytes(), bytes + (640u << 10));
  begin();
  EXPECT_LT(mock.memoryBytes(), bytes + (256u << 10));
  EXPECT_EQ(system->statistics().deviceMemory, mock.memoryBytes());
}

TEST_F(MockSystemTest, ABufferThatCannotBeBoundTakesNoMemory) {
  ASSERT_NO_FATAL_FAILURE(create());
  make(small());
  const int buffers = mock.alive["Buffer"];
  const VkDeviceSize bytes = mock.memoryBytes();
  mock.failing = "vkBindBufferMemory";
  for (int times = 0; times < 100; ++times) {
    const Result<PoseHandle> pose = scene().addPose(100);
    ASSERT_FALSE(pose.ok());
    EXPECT_NE(pose.error().message.find("vkBindBufferMemory"), std::string::npos);
  }
  EXPECT_EQ(mock.alive["Buffer"], buffers);
  EXPECT_EQ(mock.memoryBytes(), bytes);
}

// Bytes of all that the engine's allocator has created and not destroyed.
// A device allows few allocations: in Vulkan at least 4,096.
TEST_F(MockSystemTest, BlocksBecomeLargerWithTheScene) {
  ASSERT_NO_FATAL_FAILURE(create());
  make(small());
  const PackedMesh large = systemMesh(1, 400);
  for (int mesh = 0; mesh < 200; ++mesh) {
    must(scene().addMesh(large));
    must(scene().addPose(100));
  }
  EXPECT_GT(mock.memoryBytes(), 200 * large.bytes().size());
  EXPECT_LT(mock.memories.size(), 10u);
}

TEST_F(MockSystemTest, BuffersThatAreDestroyedDoNotCount) {
  ASSERT_NO_FATAL_FAILURE(create());
  SceneRecorderDescription description = small();
  description.scene.meshCapacity = {1 << 20};
  static std::vector<std::byte> mapped(1 << 20);
  description.buffers = {
      nullptr,
      [](void*, const VkBufferCreateInfo&, vulkan::BufferUse,
         const char*) -> Result<vulkan::CreatedBuffer> {
        return vulkan::CreatedBuffer{bufferOf(BufferRole::meshes), mapped.data(), nullptr};
      },
      [](void*, const vulkan::CreatedBuffer&) {}};
  make(description);
  begin();
  record();
  const std::uint64_t bytes = system->statistics().deviceMemory;
  const PackedMesh large = systemMesh(1, 1000);
  must(scene().addMesh(large));
  begin();
  record();
  EXPECT_EQ(system->statistics().deviceMemory, bytes + large.bytes().size());
  begin();
  EXPECT_EQ(system->statistics().deviceMemory, bytes);
}

TEST_F(MockSystemTest, AMeshThatIsRemovedIsNotUploaded) {
  ASSERT_NO_FATAL_FAILURE(create());
  make(small());
  const MeshHandle gone = must(scene().addMesh(packed));
  add({});
  must(scene().removeMesh(gone));
  begin();
  record();
  std::size_t uploads = 0;
  for (const MockCopy& copy : mock.copies) uploads += copy.regions[0].size == packed.bytes().size();
  EXPECT_EQ(uploads, 1u);
}

// What frames in flight use is copied after they have written it, and uploads wait for their reads.
TEST_F(MockSystemTest, GrowthAndUploadsHaveTheirBarriers) {
  ASSERT_NO_FATAL_FAILURE(create());
  make(small());
  InstanceDescription instance;
  instance.bounds = true;
  add(instance);
  begin();
  record();
  const VkDeviceSize results = sizeof(InstanceResult);
  add(instance);
  begin();
  record();
  const std::vector<std::string> begin(mock.commands.begin(), mock.commands.begin() + 8);
  EXPECT_EQ(begin, (std::vector<std::string>{"barrier", "copy", "copy", "copy",  //
                                             "barrier", "copy", "copy", "barrier"}))
      << "meshes, outputs and results; tables and a mesh";
  ASSERT_GE(mock.memoryBarriers.size(), 3u);
  expectBarrier(mock.memoryBarriers[0], {computeOrCopy | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT,
                                         writes, computeOrCopy, reads | writes});
  expectBarrier(mock.memoryBarriers[1],
                {copies, VK_ACCESS_TRANSFER_WRITE_BIT, copies,
                 VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_TRANSFER_WRITE_BIT});
  expectBarrier(mock.memoryBarriers[2],
                {copies, VK_ACCESS_TRANSFER_WRITE_BIT, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT,
                 VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT});
  const MockCopy& copy = mock.copies[2];
  ASSERT_EQ(copy.regions.size(), 1u);
  EXPECT_EQ(copy.regions[0].size, results);
  EXPECT_EQ(copy.regions[0].srcOffset, 0u);
  EXPECT_EQ(copy.regions[0].dstOffset, 0u);
  EXPECT_NE(copy.from, copy.to);
}

// Each frame slot has a set for the kernel that chooses what is visible; a set is not rewritten
// while a frame in flight reads it.
TEST_F(MockSystemTest, TheVisibilityKernelSeesTheSameBuffersWithoutPushedDescriptors) {
  std::vector<std::vector<std::vector<VkDeviceSize>>> seen;  // by push, dispatch and binding
  for (const bool push : {true, false}) {
    ASSERT_NO_FATAL_FAILURE(create(push));
    make(small());
    frame = 0;
    InstanceDescription instance;
    instance.culledOnGpu = true;
    add(instance);
    auto& dispatches = seen.emplace_back();
    for (int i = 0; i < 3; ++i) {
      begin();
      record();
      ASSERT_GE(mock.dispatches.size(), 2u);
      for (std::size_t number = 0; number < 2; ++number) {
        auto& sizes = dispatches.emplace_back();
        for (const auto& [binding, descriptor] : mock.dispatches[number].descriptors) {
          if (binding > abi::BINDING_VISIBLE_RESULTS) continue;
          sizes.push_back(binding);
          sizes.push_back(descriptor.range);
        }
        EXPECT_GE(sizes.size(), 8u);
      }
    }
    system.reset();
  }
  EXPECT_EQ(seen[0], seen[1]);
}

}  // namespace
}  // namespace dermis::test
