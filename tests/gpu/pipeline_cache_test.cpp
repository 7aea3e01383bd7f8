// A VkPipelineCache that the engine lends, stores and loads: every pipeline is built with it, those
// of a SceneRecorder too.

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "dermis/vulkan/scene_recorder.h"
#include "intercepted_device.h"
#include "kit/batch_runner.h"
#include "random_rig.h"
#include "system_engine.h"
#include "test_device.h"

namespace dermis::test {
namespace {

std::vector<VkPipelineCache> cachesUsed;
PFN_vkCreateComputePipelines realCreateComputePipelines = nullptr;

VkResult VKAPI_CALL createComputePipelines(VkDevice device, VkPipelineCache cache,
                                           std::uint32_t count,
                                           const VkComputePipelineCreateInfo* infos,
                                           const VkAllocationCallbacks* allocator,
                                           VkPipeline* pipelines) {
  cachesUsed.push_back(cache);
  return realCreateComputePipelines(device, cache, count, infos, allocator, pipelines);
}

/// The engine's side: a cache made of stored bytes, and stored again.
class EngineCache {
 public:
  EngineCache(const samples::Device& device, const std::vector<char>& stored) : device_(device) {
    VkPipelineCacheCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_PIPELINE_CACHE_CREATE_INFO;
    info.initialDataSize = stored.size();
    info.pInitialData = stored.data();
    EXPECT_EQ(function<PFN_vkCreatePipelineCache>("vkCreatePipelineCache")(device.handle(), &info,
                                                                           nullptr, &cache_),
              VK_SUCCESS);
  }
  ~EngineCache() {
    function<PFN_vkDestroyPipelineCache>("vkDestroyPipelineCache")(device_.handle(), cache_,
                                                                   nullptr);
  }
  EngineCache(const EngineCache&) = delete;
  EngineCache& operator=(const EngineCache&) = delete;

  VkPipelineCache handle() const { return cache_; }
  std::vector<char> store() const {
    const auto getData = function<PFN_vkGetPipelineCacheData>("vkGetPipelineCacheData");
    std::size_t size = 0;
    EXPECT_EQ(getData(device_.handle(), cache_, &size, nullptr), VK_SUCCESS);
    std::vector<char> bytes(size);
    EXPECT_EQ(getData(device_.handle(), cache_, &size, bytes.data()), VK_SUCCESS);
    return bytes;
  }

 private:
  template <typename Function>
  Function function(const char* name) const {
    return reinterpret_cast<Function>(
        device_.functions().GetDeviceProcAddr(device_.handle(), name));
  }

  const samples::Device& device_;
  VkPipelineCache cache_ = VK_NULL_HANDLE;
};

class PipelineCacheTest : public DeviceTest {
 protected:
  /// A batch on a context of its own and, where wanted, a system with a visibility kernel.
  std::vector<std::byte> skinWith(VkPipelineCache cache, bool alsoASystem) {
    InterceptedDevice intercepted(device().description());
    realCreateComputePipelines = reinterpret_cast<PFN_vkCreateComputePipelines>(
        device().functions().GetDeviceProcAddr(device().handle(), "vkCreateComputePipelines"));
    intercepted.replace("vkCreateComputePipelines", createComputePipelines);
    vulkan::DeviceDescription description = intercepted.description();
    description.pipelineCache = cache;
    vulkan::Context context = must(vulkan::Context::create(description));
    cachesUsed.clear();
    if (alsoASystem) prepareSystem(context);
    OwnedMesh mesh = randomMesh(1, 100, 4, 4);
    const PackedMesh packed = must(pack(mesh.view(), 4));
    const std::vector<JointMatrix> pose = randomPose(2, 4, Rigidity::rigid);
    const samples::SkinRequest request{&packed, pose, JointPromise::scaling,
                                       Method::dualQuaternion};
    return must(samples::runBatch(device(), context, {&request, 1})).instances[0].streams[0];
  }

  static void prepareSystem(vulkan::Context& context) {
    vulkan::SceneRecorderDescription system;
    system.scene.meshCapacity = system.scene.outputCapacity = Capacity::fixed(1 << 20);
    system.scene.jointCapacity = system.scene.instanceCapacity = system.scene.boundsCapacity =
        Capacity::fixed(16);
    InstanceDescription instance;
    instance.method = Method::linear;
    instance.culledOnGpu = true;
    must(must(vulkan::SceneRecorder::create(context, system)).prepare(instance));
  }
};

TEST_F(PipelineCacheTest, EveryPipelineIsBuiltWithItAndItMayBeStored) {
  std::vector<char> stored;
  std::vector<std::byte> positions;
  {
    const EngineCache cache(device(), {});
    positions = skinWith(cache.handle(), true);
    // The palette's, the visibility kernel's, and some that skin.
    EXPECT_GE(cachesUsed.size(), 3u);
    EXPECT_EQ(std::ranges::count(cachesUsed, cache.handle()), std::ssize(cachesUsed));
    stored = cache.store();
  }
  EXPECT_GE(stored.size(), sizeof(VkPipelineCacheHeaderVersionOne));
  const EngineCache loaded(device(), stored);
  EXPECT_EQ(skinWith(loaded.handle(), false), positions);
  EXPECT_EQ(std::ranges::count(cachesUsed, loaded.handle()), std::ssize(cachesUsed));
  EXPECT_EQ(skinWith(VK_NULL_HANDLE, false), positions) << "it changes no bit";
}

}  // namespace
}  // namespace dermis::test
