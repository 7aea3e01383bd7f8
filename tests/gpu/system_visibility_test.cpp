// What is skipped costs nothing in the dispatch: instances that rest, are hidden by the engine, or
// culled on the GPU.

#include <gtest/gtest.h>

#include <algorithm>

#include "system_test.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t instanceCount = 60;
constexpr std::uint32_t vertexCount = 256;
constexpr std::byte poison{0x5a};

/// A crowd whose members can be culled on the GPU, and the words by which they are.
class SystemVisibilityTest : public SystemTest {
 protected:
  void open(samples::Device& device, vulkan::SkinningSystemDescription system, bool culledOnGpu,
            const VertexLayout& layout) {
    engine_.emplace(device, system);
    engine_->begin();
    instance_.mesh = engine_->addMesh(packed_);
    instance_.layout = layout;
    instance_.culledOnGpu = culledOnGpu;
    for (std::uint32_t i = 0; i < instanceCount; ++i) {
      instance_.palette = palettes_.emplace_back(engine_->addPalette(systemPose(i)));
      instances_.push_back(engine_->addInstance(instance_));
    }
    if (!culledOnGpu) return;
    words_ = must(samples::MappedBuffer::create(device, (*engine_)->instanceCapacity() * 4,
                                                VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
    show(0, instanceCount);
  }
  void open(bool culledOnGpu, const VertexLayout& layout) {
    open(device(), description(), culledOnGpu, layout);
  }
  void TearDown() override {
    engine_.reset();
    words_ = {};
    SystemTest::TearDown();
  }

  /// Only these are visible, once the frames under way are over.
  void show(std::uint32_t first, std::uint32_t count) {
    engine_->finish();
    std::ranges::fill(words_.bytes(), std::byte{0});
    for (std::uint32_t i = first; i < first + count; ++i) {
      const std::uint32_t index = must((*engine_)->visibilityIndex(instances_[i]));
      ASSERT_LT(index, (*engine_)->instanceCapacity());
      words_.bytes()[index * 4 + i % 4] = std::byte{1};  // any bit will do
    }
  }
  vulkan::FrameDescription frame() const { return {words_.handle(), 0}; }
  void submit() { engine_->submit(frame()); }
  void moveAll(std::uint32_t by) {
    for (std::uint32_t i = 0; i < instanceCount; ++i)
      engine_->writePose(palettes_[i], systemPose(i + by));
  }
  void moveAllInFrame(std::uint32_t by) {
    engine_->begin();
    moveAll(by);
    submit();
  }
  /// What the GPU did in the frame that was submitted last.
  vulkan::GpuStatistics completed() {
    const std::uint64_t number = engine_->frame();
    engine_->begin();
    const vulkan::GpuStatistics statistics = (*engine_)->statistics().lastCompletedFrame;
    EXPECT_EQ(statistics.frame, number);
    return statistics;
  }
  const std::vector<std::byte>& positionsIn(std::uint32_t pose) {
    std::vector<std::byte>& positions = expected_[pose];
    if (positions.empty()) positions = alone(packed_, systemPose(pose), instance_)[positionStream];
    return positions;
  }
  void expectMotion(std::span<const std::byte> bytes, std::uint32_t instance, std::uint32_t by,
                    std::uint32_t before) {
    const Streams streams = engine_->read(bytes, instances_[instance]);
    EXPECT_TRUE(streams[positionStream] == positionsIn(instance + by)) << instance;
    EXPECT_TRUE(streams[previousStream] == positionsIn(instance + before)) << instance;
  }
  void expectPoisoned(std::span<const std::byte> bytes, std::uint32_t instance) {
    for (const std::vector<std::byte>& stream : engine_->read(bytes, instances_[instance])) {
      EXPECT_TRUE(std::ranges::all_of(stream, [](std::byte byte) { return byte == poison; }))
          << instance;
    }
  }

  PackedMesh packed_ = systemMesh(1, vertexCount);
  std::optional<SystemEngine> engine_;
  samples::MappedBuffer words_;
  InstanceDescription instance_;
  std::vector<PaletteHandle> palettes_;
  std::vector<InstanceHandle> instances_;
  std::map<std::uint32_t, std::vector<std::byte>> expected_;
};

TEST_F(SystemVisibilityTest, OnlyWhatMovesIsDispatched) {
  open(false, plainLayout());
  engine_->submit();
  const vulkan::FrameStatistics all = engine_->lastFrame();
  EXPECT_EQ(all.skinnedVertices, instanceCount * vertexCount);
  EXPECT_EQ(all.writtenBytes, instanceCount * vertexCount * 24u);
  engine_->begin();
  for (std::uint32_t i = 0; i < 6; ++i) engine_->writePose(palettes_[i * 10], systemPose(i));
  engine_->submit();
  const vulkan::FrameStatistics few = engine_->lastFrame();
  EXPECT_EQ(few.skinnedInstances, 6u);
  EXPECT_EQ(few.skinnedVertices, 6u * vertexCount);
  EXPECT_EQ(few.writtenBytes, 6u * vertexCount * 24u);
  EXPECT_EQ(few.convertedPalettes, 6u);
  // Several instances share an invocation, so that the last group may hold fewer than it could.
  EXPECT_LE(few.workgroups * 5, all.workgroups);
}

TEST_F(SystemVisibilityTest, HiddenInstancesAreNotDispatched) {
  open(false, plainLayout());
  engine_->submit();
  const std::uint64_t allWorkgroups = engine_->lastFrame().workgroups;
  engine_->finish();
  engine_->fillOutput(poison);
  engine_->begin();
  moveAll(100);
  for (std::uint32_t i = 0; i < instanceCount; ++i)
    must((*engine_)->setVisible(instances_[i], i % 6 == 0));
  engine_->submit();
  const vulkan::FrameStatistics few = engine_->lastFrame();
  EXPECT_EQ(few.skinnedInstances, 10u);
  EXPECT_EQ(few.skinnedVertices, 10u * vertexCount);
  EXPECT_LE(few.workgroups * 4, allWorkgroups);
  EXPECT_EQ(few.convertedPalettes, 10u) << "nobody looks at the others";
  const std::vector<std::byte> bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) {
    if (i % 6 == 0) {
      EXPECT_TRUE(engine_->read(bytes, instances_[i])[positionStream] == positionsIn(i + 100));
    } else {
      expectPoisoned(bytes, i);
    }
  }
}

TEST_F(SystemVisibilityTest, TheEngineMayCullOnTheGpu) {
  open(true, motionLayout());
  submit();
  EXPECT_EQ(engine_->lastFrame().culledCandidates, instanceCount);
  EXPECT_EQ(engine_->lastFrame().skinnedInstances, 0u) << "the CPU does not know";
  std::vector<std::byte> bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) expectMotion(bytes, i, 0, 0);
  vulkan::GpuStatistics gpu = completed();
  EXPECT_EQ(gpu.visibleInstances, instanceCount);
  EXPECT_EQ(gpu.skinnedInstances, instanceCount);
  EXPECT_GT(gpu.workgroups, 0u);
  const std::uint32_t allWorkgroups = gpu.workgroups;

  show(0, 10);
  moveAll(100);
  submit();
  bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) expectMotion(bytes, i, i < 10 ? 100 : 0, 0);
  gpu = completed();
  EXPECT_EQ(gpu.visibleInstances, 10u);
  EXPECT_EQ(gpu.skinnedInstances, 10u);
  EXPECT_LE(gpu.workgroups * 4, allWorkgroups);
  submit();
}

TEST_F(SystemVisibilityTest, WhatIsCulledKeepsItsBytes) {
  open(true, motionLayout());
  submit();
  engine_->finish();
  engine_->fillOutput(poison);
  show(20, 5);
  moveAllInFrame(100);
  const std::vector<std::byte> bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) {
    if (i < 20 || i >= 25) {
      expectPoisoned(bytes, i);
    } else {
      EXPECT_TRUE(engine_->read(bytes, instances_[i])[positionStream] == positionsIn(i + 100));
    }
  }
}

TEST_F(SystemVisibilityTest, WhatTheGpuShowsAgainDoesNotMove) {
  open(true, motionLayout());
  submit();
  moveAllInFrame(100);
  show(0, 10);
  moveAllInFrame(200);
  engine_->begin();
  submit();  // the ten settle, in poses that the others have not been skinned in yet
  show(0, 30);
  engine_->begin();
  submit();
  std::vector<std::byte> bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < 30; ++i) expectMotion(bytes, i, 200, 200);
  for (std::uint32_t i = 30; i < instanceCount; ++i) expectMotion(bytes, i, 100, 0);
  show(0, instanceCount);
  moveAllInFrame(300);
  bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < 30; ++i) expectMotion(bytes, i, 300, 200);
  for (std::uint32_t i = 30; i < instanceCount; ++i) expectMotion(bytes, i, 300, 300);
}

TEST_F(SystemVisibilityTest, WhatRestsInViewOfTheGpuSettlesAndIsNotSkinnedAgain) {
  open(true, motionLayout());
  submit();
  moveAllInFrame(100);
  engine_->begin();
  submit();
  vulkan::GpuStatistics gpu = completed();
  EXPECT_EQ(gpu.skinnedInstances, 0u);
  EXPECT_EQ(gpu.settledInstances, instanceCount);
  std::vector<std::byte> bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) expectMotion(bytes, i, 100, 100);
  submit();
  gpu = completed();
  EXPECT_EQ(gpu.skinnedInstances, 0u);
  EXPECT_EQ(gpu.settledInstances, 0u);
  EXPECT_EQ(gpu.workgroups, 0u);
  engine_->fillOutput(poison);
  submit();
  engine_->begin();
  submit();
  bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) expectPoisoned(bytes, i);
}

TEST_F(SystemVisibilityTest, SomeAreCulledOnTheGpuAndSomeAreNot) {
  open(true, motionLayout());
  InstanceDescription other = instance_;
  other.culledOnGpu = false;
  const InstanceHandle free = engine_->addInstance(other);
  show(0, 1);
  submit();
  EXPECT_EQ(engine_->lastFrame().skinnedInstances, 1u);
  EXPECT_EQ(indicesOf((*engine_)->skinnedInstances()), std::set<std::uint32_t>{free.index});
  EXPECT_TRUE(engine_->read(free)[positionStream] == positionsIn(instanceCount - 1));
  EXPECT_EQ(completed().visibleInstances, 1u);
  // The engine hides one that the GPU would show.
  show(0, 2);
  must((*engine_)->setVisible(instances_[1], false));
  moveAll(100);
  submit();
  EXPECT_EQ(completed().skinnedInstances, 1u);
  submit();
}

TEST_F(SystemVisibilityTest, ATeleportReachesWhatIsCulledOnTheGpu) {
  open(true, motionLayout());
  submit();
  engine_->begin();
  moveAll(100);
  must((*engine_)->teleport(instances_[3]));
  submit();
  const std::vector<std::byte> bytes = engine_->readOutput();
  expectMotion(bytes, 3, 100, 100);
  expectMotion(bytes, 4, 100, 0);
}

TEST_F(SystemVisibilityTest, CullingOnTheGpuNeedsTheWords) {
  open(true, motionLayout());
  const Result<void> recorded = engine_->trySubmit({});
  ASSERT_FALSE(recorded.ok());
  EXPECT_EQ(recorded.error().code, ErrorCode::invalidArgument);
  engine_->begin();
  submit();
  EXPECT_EQ(completed().skinnedInstances, instanceCount);
  submit();
}

// An instance that comes in the place of one that went must be skinned, whatever the GPU remembers
// of the old one.
TEST_F(SystemVisibilityTest, ANewInstanceIsNotTakenForTheOneBefore) {
  open(true, motionLayout());
  submit();
  for (std::uint32_t round = 1; round < 4; ++round) {
    engine_->begin();
    for (std::uint32_t i = 0; i < 10; ++i) {
      must((*engine_)->removeInstance(instances_[i]));
      instance_.palette = palettes_[i + 20];
      instances_[i] = engine_->addInstance(instance_);
    }
    show(0, instanceCount);
    submit();
    const std::vector<std::byte> bytes = engine_->readOutput();
    for (std::uint32_t i = 0; i < 10; ++i) {
      const Streams streams = engine_->read(bytes, instances_[i]);
      EXPECT_TRUE(streams[positionStream] == positionsIn(i + 20)) << i;
      EXPECT_TRUE(streams[previousStream] == positionsIn(i + 20)) << i;
    }
  }
}

// Where the device counts invocations they show that nobody looks at what is skipped.
class SystemInvocationsTest : public SystemVisibilityTest {
 protected:
  void SetUp() override {
    SystemVisibilityTest::SetUp();
    if (device_ == nullptr) return;
    samples::DeviceOptions options = testDeviceOptions();
    options.pipelineStatistics = true;
    counting_.emplace(must(samples::openDevice(options)));
    if (!counting_->device->info().pipelineStatistics) GTEST_SKIP() << "the device counts nothing";
    VkQueryPoolCreateInfo info{};
    info.sType = VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO;
    info.queryType = VK_QUERY_TYPE_PIPELINE_STATISTICS;
    info.queryCount = 1;
    info.pipelineStatistics = VK_QUERY_PIPELINE_STATISTIC_COMPUTE_SHADER_INVOCATIONS_BIT;
    ASSERT_EQ(functions().CreateQueryPool(counting_->device->handle(), &info, nullptr, &pool_),
              VK_SUCCESS);
  }
  void TearDown() override {
    engine_.reset();
    words_ = {};
    if (pool_ != VK_NULL_HANDLE)
      functions().DestroyQueryPool(counting_->device->handle(), pool_, nullptr);
    if (counting_) {
      for (const std::string& message : counting_->device->takeValidationMessages())
        ADD_FAILURE() << message;
    }
    counting_.reset();
    SystemVisibilityTest::TearDown();
  }
  void openCounting(bool culledOnGpu) {
    vulkan::SkinningSystemDescription counted = description();
    counted.context = &counting_->context;
    open(*counting_->device, counted, culledOnGpu, plainLayout());
    engine_->beforeRecord = [this](VkCommandBuffer commandBuffer) {
      functions().CmdResetQueryPool(commandBuffer, pool_, 0, 1);
      functions().CmdBeginQuery(commandBuffer, pool_, 0, 0);
    };
    engine_->afterRecord = [this](VkCommandBuffer commandBuffer) {
      functions().CmdEndQuery(commandBuffer, pool_, 0);
    };
  }
  /// Of the frame that was submitted last.
  std::uint64_t invocations() {
    engine_->finish();
    std::uint64_t count = 0;
    EXPECT_EQ(functions().GetQueryPoolResults(counting_->device->handle(), pool_, 0, 1,
                                              sizeof(count), &count, sizeof(count),
                                              VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT),
              VK_SUCCESS);
    return count;
  }
  const samples::VulkanFunctions& functions() const { return counting_->device->functions(); }

  std::optional<samples::OpenDevice> counting_;
  VkQueryPool pool_ = VK_NULL_HANDLE;
};

TEST_F(SystemInvocationsTest, WhatRestsRunsNoInvocation) {
  openCounting(false);
  engine_->submit();
  const std::uint64_t all = invocations();
  EXPECT_EQ(all, engine_->lastFrame().workgroups * Tuning{}.workgroupSize);
  engine_->runFrame();
  EXPECT_EQ(invocations(), 0u);
  engine_->begin();
  for (std::uint32_t i = 0; i < 6; ++i) engine_->writePose(palettes_[i], systemPose(i));
  engine_->submit();
  EXPECT_LE(invocations() * 5, all);
  EXPECT_EQ(invocations(), engine_->lastFrame().workgroups * Tuning{}.workgroupSize);
}

TEST_F(SystemInvocationsTest, WhatIsHiddenRunsNoInvocation) {
  openCounting(false);
  engine_->submit();
  const std::uint64_t all = invocations();
  engine_->begin();
  moveAll(100);
  for (std::uint32_t i = 6; i < instanceCount; ++i)
    must((*engine_)->setVisible(instances_[i], false));
  engine_->submit();
  EXPECT_LE(invocations() * 5, all);
}

TEST_F(SystemInvocationsTest, WhatTheGpuCullsRunsFewInvocations) {
  openCounting(true);
  submit();
  const std::uint64_t all = invocations();
  const std::uint32_t workgroups = completed().workgroups;
  show(0, 0);
  moveAll(100);
  submit();
  const std::uint64_t none = invocations();
  EXPECT_EQ(completed().workgroups, 0u);
  // What is left are the palettes and the visibility kernel, which are a few invocations each.
  EXPECT_EQ(all - none, std::uint64_t{workgroups} * Tuning{}.workgroupSize);
  submit();
}

}  // namespace
}  // namespace dermis::test
