// Tables that grow while frames are in flight: nothing that a frame was recorded with goes before
// that frame is complete, and nothing stays for ever.

#include <gtest/gtest.h>

#include <algorithm>

#include "intercepted_device.h"
#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t queuedFrames = 3;

/// Buffers that were created and not destroyed, and those that were copied from or to since the set
/// was cleared: of each frame its tables, and what they were uploaded from.
std::set<VkBuffer> alive, copied;
PFN_vkCreateBuffer realCreateBuffer = nullptr;
PFN_vkDestroyBuffer realDestroyBuffer = nullptr;
PFN_vkCmdCopyBuffer realCopyBuffer = nullptr;

VkResult VKAPI_CALL createBuffer(VkDevice device, const VkBufferCreateInfo* info,
                                 const VkAllocationCallbacks* allocator, VkBuffer* buffer) {
  const VkResult result = realCreateBuffer(device, info, allocator, buffer);
  if (result == VK_SUCCESS) alive.insert(*buffer);
  return result;
}
void VKAPI_CALL destroyBuffer(VkDevice device, VkBuffer buffer,
                              const VkAllocationCallbacks* allocator) {
  alive.erase(buffer);
  realDestroyBuffer(device, buffer, allocator);
}
void VKAPI_CALL copyBuffer(VkCommandBuffer commandBuffer, VkBuffer from, VkBuffer to,
                           std::uint32_t count, const VkBufferCopy* regions) {
  copied.insert({from, to});
  realCopyBuffer(commandBuffer, from, to, count, regions);
}

/// Buffer views and descriptor sets of old tables are looked after by the validation layer.
class SystemTablesTest : public SystemTest {
 protected:
  void intercept(InterceptedDevice& intercepted) {
    const vulkan::DeviceDescription description = device().description();
    const auto getDeviceProcAddr = reinterpret_cast<PFN_vkGetDeviceProcAddr>(
        description.getInstanceProcAddr(description.instance, "vkGetDeviceProcAddr"));
    const auto replace = [&]<typename Function>(const char* name, Function& real,
                                                Function replacement) {
      real = reinterpret_cast<Function>(getDeviceProcAddr(description.device, name));
      intercepted.replace(name, replacement);
    };
    alive.clear();
    replace("vkCreateBuffer", realCreateBuffer, createBuffer);
    replace("vkDestroyBuffer", realDestroyBuffer, destroyBuffer);
    replace("vkCmdCopyBuffer", realCopyBuffer, copyBuffer);
  }

  /// Ten frames, each with twice as many instances as the one before.
  void grow(SystemEngine& engine, InstanceDescription& instance,
            std::vector<InstanceHandle>& instances) {
    std::map<std::uint64_t, std::set<VkBuffer>> underWay;
    std::set<VkBuffer> tables;
    for (std::uint32_t pose = 1; pose <= 10; ++pose) {
      engine.begin(queuedFrames - 1);
      std::erase_if(underWay,
                    [&](const auto& entry) { return entry.first <= engine.completedFrame(); });
      engine.writePose(instance.pose, systemPose(pose));
      while (instances.size() < std::size_t{4} << pose)
        instances.push_back(must(engine->addInstance(instance)));
      copied.clear();
      engine.submit();
      ASSERT_EQ(copied.size(), 2u) << "tables, and what they were uploaded from";
      underWay[engine.frame()] = copied;
      tables.insert(copied.begin(), copied.end());
      for (const auto& [number, buffers] : underWay) {
        EXPECT_TRUE(std::ranges::includes(alive, buffers))
            << "in frame " << engine.frame() << " a buffer of frame " << number << " is gone";
      }
    }
    EXPECT_EQ(underWay.size(), queuedFrames);
    EXPECT_GE(tables.size(), queuedFrames + 4) << "tables were replaced";
  }
};

TEST_F(SystemTablesTest, OldTablesStayUntilTheirFramesAreComplete) {
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    InterceptedDevice intercepted(device().description());
    intercept(intercepted);
    {
      vulkan::Context watched = must(vulkan::Context::create(intercepted.description()));
      vulkan::SceneRecorderDescription system = description();
      system.scene.framesInFlight = queuedFrames;
      SystemEngine engine(device(), watched, system);
      const PackedMesh packed = systemMesh(1, 20);
      engine.begin();
      InstanceDescription instance;
      instance.method = Method::linear;
      instance.layout = plainLayout();
      instance.mesh = engine.addMesh(packed);
      instance.pose = engine.addPose(systemPose(0));
      std::vector<InstanceHandle> instances{engine.addInstance(instance)};
      engine.submit();
      const std::size_t before = alive.size();
      grow(engine, instance, instances);
      EXPECT_GE(engine.lastFrame().uploadedBytes, 128u << 10)
          << "they outgrew what they began with";
      const std::vector<std::byte> bytes = engine.readOutput();
      const Streams expected = alone(packed, systemPose(10), instance);
      for (const InstanceHandle handle : instances)
        ASSERT_TRUE(engine.read(bytes, handle)[positionStream] == expected[positionStream]);
      // With all frames complete there is no more than before, but one staging buffer a slot.
      for (std::uint32_t frame = 0; frame < queuedFrames; ++frame) engine.runFrame();
      EXPECT_LE(alive.size(), before + queuedFrames);
    }
    EXPECT_TRUE(alive.empty());
  }
}

}  // namespace
}  // namespace dermis::test
