// A crowd of which the engine, on the CPU or on the GPU, sees some.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>

#include "system_test.h"

namespace dermis::test {

inline constexpr std::uint32_t instanceCount = 60;
inline constexpr std::uint32_t crowdVertices = 256;
inline constexpr std::byte poison{0x5a};

/// A crowd whose members can be culled on the GPU, and the words by which they are.
class SystemVisibilityTest : public SystemTest {
 protected:
  void open(samples::Device& device, const vulkan::Context& context,
            vulkan::SceneRecorderDescription system, bool culledOnGpu, const VertexLayout& layout) {
    // Workgroups are counted: the more instances one skins, the coarser they are.
    system.tuning = Tuning{64, 4};
    engine_.emplace(device, context, system);
    engine_->begin();
    instance_.mesh = engine_->addMesh(packed_);
    instance_.layout = layout;
    instance_.culledOnGpu = culledOnGpu;
    for (std::uint32_t i = 0; i < instanceCount; ++i) {
      instance_.pose = palettes_.emplace_back(engine_->addPose(systemPose(i)));
      instances_.push_back(engine_->addInstance(instance_));
    }
    if (!culledOnGpu) return;
    words_ = must(samples::MappedBuffer::create(device, (*engine_)->visibilityCount() * 4,
                                                VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
    show(0, instanceCount);
  }
  void open(bool culledOnGpu, const VertexLayout& layout) {
    open(device(), context(), description(), culledOnGpu, layout);
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
      ASSERT_LT(index, (*engine_)->visibilityCount());
      words_.bytes()[index * 4 + i % 4] = std::byte{1};  // any bit will do
    }
  }
  void submit() { engine_->submit(words_.range()); }
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
  SceneStatistics::Culling completed() {
    const std::uint64_t number = engine_->frame();
    engine_->begin();
    const SceneStatistics::Culling statistics = (*engine_)->statistics().lastCompletedFrame;
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

  PackedMesh packed_ = systemMesh(1, crowdVertices);
  std::optional<SystemEngine> engine_;
  samples::MappedBuffer words_;
  InstanceDescription instance_;
  std::vector<PoseHandle> palettes_;
  std::vector<InstanceHandle> instances_;
  std::map<std::uint32_t, std::vector<std::byte>> expected_;
};

}  // namespace dermis::test
