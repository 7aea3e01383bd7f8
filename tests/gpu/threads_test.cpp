// One context, many threads: each records into a command buffer of its own, binds and prepares,
// while another builds pipelines. What the thread sanitizer finds in here is a defect of Dermis, or
// of the driver.

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <barrier>
#include <cstring>
#include <functional>
#include <map>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "intercepted_device.h"
#include "kit/buffer.h"
#include "plan/variant.h"
#include "random_rig.h"
#include "system_engine.h"
#include "test_device.h"

namespace dermis::test {
namespace {

constexpr std::size_t threadCount = 4;

/// A pool and a command buffer, which belong to one thread.
struct ThreadCommands {
  VkCommandPool pool = VK_NULL_HANDLE;
  VkCommandBuffer buffer = VK_NULL_HANDLE;

  void begin(const samples::Device& device) {
    VkCommandPoolCreateInfo poolInfo{};
    poolInfo.sType = VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO;
    poolInfo.queueFamilyIndex = device.queueFamily();
    device.functions().CreateCommandPool(device.handle(), &poolInfo, nullptr, &pool);
    VkCommandBufferAllocateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO;
    info.commandPool = pool;
    info.commandBufferCount = 1;
    device.functions().AllocateCommandBuffers(device.handle(), &info, &buffer);
    VkCommandBufferBeginInfo beginInfo{};
    beginInfo.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    device.functions().BeginCommandBuffer(buffer, &beginInfo);
  }
};

/// What one thread skins: its own pose and output, the mesh shared.
struct Work {
  Plan plan;
  samples::MappedBuffer matrices, tables, palettes, output;
  std::optional<vulkan::Bindings> bindings;
  ThreadCommands commands;
};

void runOnThreads(const std::function<void(std::size_t thread)>& run) {
  std::vector<std::thread> threads;
  for (std::size_t thread = 0; thread < threadCount; ++thread) threads.emplace_back(run, thread);
  for (std::thread& thread : threads) thread.join();
}

/// Pipelines that were created and destroyed, and where threads wait for each other in the middle
/// of creating one.
std::atomic<int> pipelinesCreated = 0, pipelinesDestroyed = 0;
std::barrier<>* creatingTogether = nullptr;
PFN_vkCreateComputePipelines realCreateComputePipelines = nullptr;
PFN_vkDestroyPipeline realDestroyPipeline = nullptr;

VkResult VKAPI_CALL createComputePipelines(VkDevice device, VkPipelineCache cache,
                                           std::uint32_t count,
                                           const VkComputePipelineCreateInfo* infos,
                                           const VkAllocationCallbacks* allocator,
                                           VkPipeline* pipelines) {
  ++pipelinesCreated;
  creatingTogether->arrive_and_wait();
  return realCreateComputePipelines(device, cache, count, infos, allocator, pipelines);
}
void VKAPI_CALL destroyPipeline(VkDevice device, VkPipeline pipeline,
                                const VkAllocationCallbacks* allocator) {
  if (pipeline != VK_NULL_HANDLE) ++pipelinesDestroyed;
  realDestroyPipeline(device, pipeline, allocator);
}

class ThreadsTest : public DeviceTest {
 protected:
  void interceptPipelines(InterceptedDevice& intercepted) {
    const vulkan::DeviceDescription real = device().description();
    const auto getDeviceProcAddr = reinterpret_cast<PFN_vkGetDeviceProcAddr>(
        real.getInstanceProcAddr(real.instance, "vkGetDeviceProcAddr"));
    realCreateComputePipelines = reinterpret_cast<PFN_vkCreateComputePipelines>(
        getDeviceProcAddr(real.device, "vkCreateComputePipelines"));
    realDestroyPipeline = reinterpret_cast<PFN_vkDestroyPipeline>(
        getDeviceProcAddr(real.device, "vkDestroyPipeline"));
    pipelinesCreated = pipelinesDestroyed = 0;
    intercepted.replace("vkCreateComputePipelines", createComputePipelines);
    intercepted.replace("vkDestroyPipeline", destroyPipeline);
  }

  /// Each repeat uses the palettes and the output of the one before.
  void recordEdge(VkCommandBuffer commandBuffer) {
    context().recordBarrier(commandBuffer, Use::dermis, Use::dermis);
  }

  samples::MappedBuffer upload(const PackedMesh& mesh) {
    samples::MappedBuffer meshes = *samples::MappedBuffer::create(
        device(), mesh.bytes().size(),
        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_UNIFORM_TEXEL_BUFFER_BIT);
    std::memcpy(meshes.bytes().data(), mesh.bytes().data(), mesh.bytes().size());
    return meshes;
  }

  Result<vulkan::Bindings> bind(const Work& work, const samples::MappedBuffer& meshes) {
    return bind(work, meshes, context());
  }
  static Result<vulkan::Bindings> bind(const Work& work, const samples::MappedBuffer& meshes,
                                       const vulkan::Context& context) {
    return context.createBindings({meshes.range(),
                                   work.matrices.range(),
                                   work.tables.range(),
                                   work.palettes.range(),
                                   ByStream<vulkan::BufferRange>::all(work.output.range()),
                                   {}});
  }

  /// All but the bindings.
  void prepareWork(Work& work, const PackedMesh& mesh, std::uint32_t seed) {
    const std::vector<JointMatrix> pose = randomPose(seed, 10, Rigidity::rigid);
    const PoseDescription palette{10, 0, JointPromise::rigid};
    Job job;
    job.mesh = mesh.info();
    job.places[Stream::positions] = {0, 24, VertexFormat::float32x3};
    job.places[Stream::normals] = {12, 24, VertexFormat::float32x3};
    Batch batch;
    batch.poses = {&palette, 1};
    batch.jobs = {&job, 1};
    batch.meshesSize = mesh.bytes().size();
    batch.posesSize = pose.size() * sizeof(JointMatrix);
    batch.outputSizes.fill(std::uint64_t{mesh.vertexCount()} * 24);
    ASSERT_TRUE(makePlan(batch, context().limits(), {}, work.plan).ok());
    const auto make = [&](BufferRole role) {
      const BufferRequirement requirement = work.plan.buffer(role);
      return *samples::MappedBuffer::create(device(), requirement.size, requirement.usage, true);
    };
    work.matrices = make(BufferRole::poses);
    work.tables = make(BufferRole::tables);
    work.palettes = make(BufferRole::palettes);
    work.output = make(BufferRole::positions);
    std::memcpy(work.matrices.bytes().data(), pose.data(), work.matrices.bytes().size());
    ASSERT_TRUE(writeTables(work.plan, work.tables.bytes()).ok());
    work.commands.begin(device());
  }

  void execute(std::span<Work> works) {
    for (Work& work : works) {
      device().functions().EndCommandBuffer(work.commands.buffer);
      ASSERT_TRUE(device().submitAndWait(work.commands.buffer).ok());
      device().functions().DestroyCommandPool(device().handle(), work.commands.pool, nullptr);
    }
  }
};

bool isSameOutput(const Work& a, const Work& b) {
  return std::memcmp(a.output.bytes().data(), b.output.bytes().data(), a.output.bytes().size()) ==
         0;
}

TEST_F(ThreadsTest, ManyRecordWhileOnePrepares) {
  OwnedMesh mesh = randomMesh(1, 500, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  const samples::MappedBuffer meshes = upload(packed);
  std::array<Work, threadCount> works;
  for (std::size_t i = 0; i < threadCount; ++i) {
    prepareWork(works[i], packed, i == 0 ? 1 : 2);
    works[i].bindings.emplace(must(bind(works[i], meshes)));
  }
  ASSERT_TRUE(context().prepare(works[0].plan.pipelines()).ok());

  std::atomic<int> failures = 0;
  std::thread preparing([&] {
    for (std::uint8_t instances = 1; instances <= 8; ++instances) {
      Variant variant = variantOf(works[0].plan.pipelines().back());
      variant.instancesPerInvocation = instances;
      variant.workgroupSize = 16;
      const PipelineId id = variant.id();
      if (!context().prepare({&id, 1})) ++failures;
    }
  });
  runOnThreads([&](std::size_t thread) {
    Work& work = works[thread];
    for (int repeat = 0; repeat < 20; ++repeat) {
      recordEdge(work.commands.buffer);
      if (!context().record(work.commands.buffer, work.plan, *work.bindings)) ++failures;
    }
  });
  preparing.join();
  EXPECT_EQ(failures, 0);
  execute(works);
  EXPECT_TRUE(isSameOutput(works[1], works[2]));
  EXPECT_TRUE(isSameOutput(works[1], works[3]));
  EXPECT_FALSE(isSameOutput(works[0], works[1]));
}

// Kernels are swapped, for the same ones, in every frame that others record and prepare.
TEST_F(ThreadsTest, ManyRecordWhileOneReplacesKernels) {
  using Words = std::vector<std::uint32_t>;
  std::map<std::string, Words, std::less<>> modules;
  vulkan::DeviceDescription description = device().description();
  description.kernelSource = {&modules, [](void* user, std::string_view name) -> Result<Words> {
                                return static_cast<decltype(modules)*>(user)->find(name)->second;
                              }};
  const vulkan::Context reloaded = must(vulkan::Context::create(description));
  OwnedMesh mesh = randomMesh(1, 500, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  const samples::MappedBuffer meshes = upload(packed);
  std::array<Work, threadCount> works;
  for (std::size_t i = 0; i < threadCount; ++i) {
    prepareWork(works[i], packed, i == 0 ? 1 : 2);
    works[i].bindings.emplace(must(bind(works[i], meshes, reloaded)));
  }
  for (const PipelineId id : works[0].plan.pipelines()) {
    const vulkan::PipelineDescription pipeline = must(vulkan::pipelineDescription(id));
    modules.try_emplace(pipeline.module, pipeline.spirv.begin(), pipeline.spirv.end());
  }
  must(reloaded.prepare(works[0].plan.pipelines()));

  std::atomic<int> failures = 0;
  constexpr std::uint64_t frames = 2;
  std::atomic<std::uint64_t> replacedPipelines = 0;
  std::thread replacing([&] {
    std::vector<vulkan::KernelModule> all;
    for (const auto& [name, words] : modules) all.push_back({name, words});
    // No frame is complete before what the others record has been executed.
    for (std::uint64_t frame = 1; frame <= frames; ++frame) {
      const Result<std::uint32_t> replaced = reloaded.replaceKernels(all, frame, 0);
      if (!replaced) ++failures;
      replacedPipelines += replaced ? *replaced : 0;
    }
  });
  std::thread preparing([&] {
    for (std::uint8_t instances = 1; instances <= 4; ++instances) {
      Variant variant = variantOf(works[0].plan.pipelines().back());
      variant.instancesPerInvocation = instances;
      variant.workgroupSize = 16;
      const PipelineId id = variant.id();
      if (!reloaded.prepare({&id, 1})) ++failures;
    }
  });
  runOnThreads([&](std::size_t thread) {
    Work& work = works[thread];
    for (int repeat = 0; repeat < 20; ++repeat) {
      recordEdge(work.commands.buffer);
      if (!reloaded.record(work.commands.buffer, work.plan, *work.bindings)) ++failures;
    }
  });
  replacing.join();
  preparing.join();
  EXPECT_EQ(failures, 0);
  EXPECT_GE(replacedPipelines, frames * works[0].plan.pipelines().size());
  execute(works);
  EXPECT_TRUE(isSameOutput(works[1], works[2]));
  EXPECT_TRUE(isSameOutput(works[1], works[3]));
  EXPECT_FALSE(isSameOutput(works[0], works[1]));
  EXPECT_EQ(must(reloaded.replaceKernels({}, frames + 1, frames)), 0u);
}

// Bindings come and go on every thread, with descriptors that are pushed and with descriptor sets.
TEST_F(ThreadsTest, ManyBindAndRecord) {
  for (const bool pushDescriptors : {true, false}) {
    useDevice(pushDescriptors);
    OwnedMesh mesh = randomMesh(1, 500, 10, 4);
    const PackedMesh packed = *pack(mesh.view(), 10);
    const samples::MappedBuffer meshes = upload(packed);
    std::array<Work, threadCount> works;
    for (std::size_t i = 0; i < threadCount; ++i) prepareWork(works[i], packed, i == 0 ? 1 : 2);
    ASSERT_TRUE(context().prepare(works[0].plan.pipelines()).ok());
    std::atomic<int> failures = 0;
    runOnThreads([&](std::size_t thread) {
      Work& work = works[thread];
      for (int repeat = 0; repeat < 20; ++repeat) {
        Result<vulkan::Bindings> bindings = bind(work, meshes);
        if (bindings) {
          work.bindings.emplace(std::move(*bindings));
        } else {
          ++failures;
        }
      }
      recordEdge(work.commands.buffer);
      if (!context().record(work.commands.buffer, work.plan, *work.bindings)) ++failures;
    });
    EXPECT_EQ(failures, 0);
    execute(works);
    EXPECT_TRUE(isSameOutput(works[1], works[2]));
    EXPECT_TRUE(isSameOutput(works[1], works[3]));
    EXPECT_FALSE(isSameOutput(works[0], works[1]));
  }
}

// All threads are in the middle of building one pipeline at the same time. One of the pipelines
// stays, the others are destroyed.
TEST_F(ThreadsTest, ManyPrepareTheSamePipelines) {
  InterceptedDevice intercepted(device().description());
  interceptPipelines(intercepted);
  const bool oneOutput = context().limits().maxStorageBuffersPerStage < storageBuffersWanted;
  std::vector<PipelineId> ids;
  for (std::uint8_t instances = 1; instances <= 3; ++instances)
    ids.push_back(Variant{.instancesPerInvocation = instances, .oneOutput = oneOutput}.id());
  const int count = static_cast<int>(ids.size()), threads = static_cast<int>(threadCount);
  std::barrier together(static_cast<std::ptrdiff_t>(threadCount));
  creatingTogether = &together;
  {
    Result<vulkan::Context> shared = vulkan::Context::create(intercepted.description());
    ASSERT_TRUE(shared.ok()) << shared.error().message;
    std::atomic<int> failures = 0;
    runOnThreads([&](std::size_t) {
      if (!shared->prepare(ids)) ++failures;
    });
    EXPECT_EQ(failures, 0);
    EXPECT_EQ(pipelinesCreated, threads * count);
    EXPECT_EQ(pipelinesDestroyed, (threads - 1) * count);
    EXPECT_TRUE(shared->prepare(ids).ok());
    EXPECT_EQ(pipelinesCreated, threads * count) << "they were built before";
  }
  EXPECT_EQ(pipelinesDestroyed, pipelinesCreated);
}

// A system is one thread's, but for `prepare` and the memory of poses.
TEST_F(ThreadsTest, ManyPrepareAndWritePosesOfASystem) {
  vulkan::SceneRecorderDescription description;
  description.scene.meshCapacity = description.scene.outputCapacity = Capacity::fixed(1 << 20);
  description.scene.jointCapacity = description.scene.instanceCapacity =
      description.scene.boundsCapacity = Capacity::fixed(256);
  description.tuning = Tuning{16, 2};
  SystemEngine engine(device(), context(), description);
  OwnedMesh mesh = randomMesh(1, 500, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  InstanceDescription instance;
  instance.mesh = engine.addMesh(packed);
  std::array<PoseHandle, threadCount> palettes;
  std::vector<InstanceHandle> instances;
  for (PoseHandle& palette : palettes) {
    instance.pose = palette = must(engine->addPose(10));
    instances.push_back(engine.addInstance(instance));
  }
  std::atomic<int> failures = 0;
  std::thread preparing([&] {
    InstanceDescription later;
    later.culledOnGpu = true;
    runOnThreads([&](std::size_t) {
      if (!engine.recorder().prepare(later)) ++failures;
    });
  });
  for (std::uint32_t frame = 0; frame < 10; ++frame) {
    engine.begin();
    std::array<std::span<JointMatrix>, threadCount> poses;
    for (std::size_t i = 0; i < threadCount; ++i) poses[i] = must(engine->writePose(palettes[i]));
    runOnThreads([&](std::size_t thread) {
      const auto seed = static_cast<std::uint32_t>(thread == 3 ? 2 : thread) + 10 * frame;
      std::ranges::copy(randomPose(seed, 10, Rigidity::rigid), poses[thread].begin());
    });
    engine.submit();
    const std::vector<std::byte> bytes = engine.readOutput();
    EXPECT_EQ(engine.read(bytes, instances[2]), engine.read(bytes, instances[3]));
    EXPECT_NE(engine.read(bytes, instances[0]), engine.read(bytes, instances[1]));
    EXPECT_NE(engine.read(bytes, instances[1]), engine.read(bytes, instances[2]));
  }
  preparing.join();
  EXPECT_EQ(failures, 0);
  // What they prepared is there: `addInstance` here is the system's own, and prepares nothing.
  const samples::MappedBuffer visibility = must(samples::MappedBuffer::create(
      device(), engine->visibilityCount() * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
  std::ranges::fill(visibility.bytes(), std::byte{1});
  engine.begin();
  instance.culledOnGpu = true;
  instance.pose = palettes[3];
  const InstanceHandle culled = must(engine->addInstance(instance));
  engine.submit(visibility.range());
  const std::vector<std::byte> bytes = engine.readOutput();
  EXPECT_EQ(engine.read(bytes, culled), engine.read(bytes, instances[3]));
}

// Systems of one context, each a thread's own: created, grown and recorded at the same time.
TEST_F(ThreadsTest, ManyRecordSystemsOfOneContext) {
  constexpr std::uint32_t frames = 10, vertexCount = 300;
  OwnedMesh mesh = randomMesh(1, vertexCount, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  struct Engine {
    samples::MappedBuffer output;
    std::optional<vulkan::SceneRecorder> system;
    std::vector<InstanceHandle> instances;
    ThreadCommands commands;
  };
  std::array<Engine, threadCount> engines;
  constexpr std::uint64_t outputSize = frames * vertexCount * 12;
  for (Engine& engine : engines) {
    engine.output = must(samples::MappedBuffer::create(device(), outputSize,
                                                       VK_BUFFER_USAGE_STORAGE_BUFFER_BIT |
                                                           VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                                                           VK_BUFFER_USAGE_TRANSFER_DST_BIT,
                                                       true));
  }
  std::atomic<int> failures = 0;
  runOnThreads([&](std::size_t thread) {
    Engine& engine = engines[thread];
    engine.commands.begin(device());
    vulkan::SceneRecorderDescription description;
    description.scene.framesInFlight = frames;
    description.scene.meshCapacity = {16};
    description.scene.jointCapacity = {1};
    description.output = engine.output.range();
    engine.system.emplace(must(vulkan::SceneRecorder::create(context(), description)));
    vulkan::SceneRecorder& system = *engine.system;
    InstanceDescription instance;
    for (std::uint32_t frame = 1; frame <= frames; ++frame) {
      must(system.scene().beginFrame(frame, 0));
      instance.mesh = must(system.scene().addMesh(packed));
      instance.pose = must(system.scene().addPose(10));
      must(system.prepare(instance));
      engine.instances.push_back(must(system.scene().addInstance(instance)));
      const std::uint32_t seed = frame + (thread == 0 ? 100 : 0);
      std::ranges::copy(randomPose(seed, 10, Rigidity::rigid),
                        must(system.scene().writePose(instance.pose)).begin());
      if (!system.record(engine.commands.buffer)) ++failures;
    }
  });
  EXPECT_EQ(failures, 0);
  for (Engine& engine : engines) {
    device().functions().EndCommandBuffer(engine.commands.buffer);
    ASSERT_TRUE(device().submitAndWait(engine.commands.buffer).ok());
  }
  const auto outputOf = [&](std::size_t thread) {
    const Engine& engine = engines[thread];
    std::vector<std::byte> bytes;
    for (const InstanceHandle instance : engine.instances) {
      const std::vector<std::byte> one = readAttribute(
          engine.output.bytes(),
          must(engine.system->scene().output(instance)).places[Stream::positions], vertexCount);
      bytes.insert(bytes.end(), one.begin(), one.end());
    }
    return bytes;
  };
  EXPECT_EQ(outputOf(1), outputOf(2));
  EXPECT_EQ(outputOf(1), outputOf(3));
  EXPECT_NE(outputOf(0), outputOf(1));
  for (Engine& engine : engines)
    device().functions().DestroyCommandPool(device().handle(), engine.commands.pool, nullptr);
}

}  // namespace
}  // namespace dermis::test
