// A scene allocates no memory once it has run some frames, on the GPU and on the CPU. The test
// counts every `operator new` of this thread while Dermis works. It is a separate program because
// it replaces that operator.

#include <gtest/gtest.h>

#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <new>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "dermis/cpu.h"
#include "dermis/dermis.h"
#include "kit/device.h"
#include "played_clips.h"
#include "rigged.h"
#include "system_test.h"

namespace {

thread_local bool isCounting = false;
thread_local std::uint32_t allocations = 0;
thread_local std::uint32_t allowed = ~0u;  ///< so many more; then there is no memory

void spend() {
  if (isCounting) ++allocations;
  if (allowed == 0) throw std::bad_alloc();
  if (allowed != ~0u) --allowed;
}

void* allocate(std::size_t size) {
  spend();
  if (void* const memory = std::malloc(size != 0 ? size : 1)) return memory;
  std::abort();
}

}  // namespace

/// LLVM, inside lavapipe, deletes by the operators below what it got from the sanitizer's, whose
/// library looks for this function in the program.
extern "C" __attribute__((visibility("default"))) const char* __asan_default_options();
extern "C" const char* __asan_default_options() {
  return "alloc_dealloc_mismatch=0";
}

void* operator new(std::size_t size) {
  return allocate(size);
}
void* operator new(std::size_t size, std::align_val_t alignment) {
  const auto multiple = static_cast<std::size_t>(alignment);
  spend();
  return std::aligned_alloc(multiple, (size + multiple - 1) / multiple * multiple);
}
void operator delete(void* memory, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t, std::align_val_t) noexcept {
  std::free(memory);
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t) noexcept {
  std::free(memory);
}

namespace dermis::test {
namespace {

/// Counts while it lives.
class Counting {
 public:
  Counting() { isCounting = true; }
  ~Counting() { isCounting = false; }
};

class AllocationTest : public SystemTest {
 protected:
  void SetUp() override {
    SystemTest::SetUp();
    if (device_ == nullptr) return;
    samples::DeviceOptions options = testDeviceOptions();
    options.validation = false;  // the layer allocates in the same thread
    open_.emplace(must(samples::openDevice(options)));
  }
  void TearDown() override {
    open_.reset();
    SystemTest::TearDown();
  }

  std::optional<samples::OpenDevice> open_;
};

/// All that a frame may have: poses by both writers, intervals, culling by both, morph weights,
/// bounds, motion, teleports, and now and then a frame that is not submitted.
TEST_F(AllocationTest, WarmFramesAllocateNothing) {
  constexpr std::uint32_t count = 200;
  samples::Device& device = *open_->device;
  vulkan::SceneRecorderDescription description;
  description.measuresGpuTime = true;
  std::optional<vulkan::SceneRecorder> system =
      must(vulkan::SceneRecorder::create(open_->context, description));
  const PackedMesh mesh = systemMesh(1, 50);
  InstanceDescription instance;
  instance.mesh = must(system->scene().addMesh(mesh));
  instance.layout = motionLayout();
  std::vector<PoseHandle> cpuPoses, gpuPoses;
  std::vector<InstanceHandle> instances;
  for (std::uint32_t i = 0; i < count; ++i) {
    const bool writtenByGpu = i % 3 == 0;
    instance.pose = must(system->scene().addPose(8, {.writtenByGpu = writtenByGpu}));
    (writtenByGpu ? gpuPoses : cpuPoses).push_back(instance.pose);
    instance.method = i % 2 == 0 ? Method::dualQuaternion : Method::linear;
    instance.bounds = i % 5 == 0;
    instance.culledOnGpu = i % 7 == 0;
    instance.updateInterval = 1 + i % 3;
    must(system->prepare(instance));
    instances.push_back(must(system->scene().addInstance(instance)));
  }
  const samples::MappedBuffer words = must(samples::MappedBuffer::create(
      device, system->scene().visibilityCount() * 4, VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
  std::ranges::fill(words.bytes(), std::byte{1});
  const Pose pose = systemPose(1);
  const std::array<MorphWeight, 2> morphs{{{0, 0.5f}, {1, 0.25f}}};
  for (const InstanceHandle each : instances)
    must(system->scene().change({.instance = each, .morphs = morphs}));
  std::vector<InstanceVisibility> views(count);
  std::vector<InstanceChange> changes(20);

  std::uint32_t counted = 0;
  const auto expect = [](bool isRight) {
    if (!isRight) std::abort();
  };
  for (std::uint32_t frame = 1; frame <= 60; ++frame) {
    const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
    VkCommandBufferBeginInfo begin{};
    begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
    device.functions().BeginCommandBuffer(commandBuffer, &begin);
    const bool isLost = frame % 9 == 8;
    {
      const Counting counting;
      expect(system->scene().beginFrame(frame, frame - 1 - (frame % 9 == 0 ? 1 : 0)).ok());
      for (std::uint32_t i = 0; i < cpuPoses.size(); ++i) {
        if ((i + frame) % 4 == 0) continue;
        const Result<std::span<JointMatrix>> place = system->scene().writePose(cpuPoses[i]);
        expect(place.ok());
        std::ranges::copy(pose, place->begin());
      }
      expect(frame % 2 == 0 ? system->scene().markAllWritten().ok()
                            : system->scene().markWritten(gpuPoses).ok());
      for (std::uint32_t i = 0; i < count; ++i) views[i] = {instances[i], (i + frame) % 6 != 0, 2};
      expect(system->scene().setVisibility(views).ok());
      for (std::uint32_t i = 0; i < changes.size(); ++i) {
        changes[i].instance = instances[(i * 7 + frame) % count];
        changes[i].teleports = i % 3 == 0;
        changes[i].morphs = std::span(morphs).first((i + frame) % 3);
        changes[i].updateInterval = 1 + i % 2;
      }
      expect(system->scene().change(changes).ok());
      expect(system->record(commandBuffer, words.range()).ok());
      if (isLost) expect(system->scene().abandonFrame(frame).ok());
      expect(system->scene().output(instances[3]).ok());
      expect(system->scene().bounds(instances[5]).ok());
      expect(system->scene().statistics().lastFrame.instances == (isLost ? 0 : count));
    }
    device.functions().EndCommandBuffer(commandBuffer);
    if (!isLost) must(device.submitAndWait(commandBuffer));
    device.freeCommandBuffer(commandBuffer);
    if (frame == 40) counted = allocations;  // it is warm
  }
  EXPECT_GT(counted, 0u) << "the first frames have to allocate, or nothing is counted";
  EXPECT_EQ(allocations, counted);
}

TEST(CpuAllocationTest, WarmFramesAllocateNothing) {
  constexpr std::uint32_t count = 200;
  cpu::SceneRunner system = must(cpu::SceneRunner::create());
  InstanceDescription instance;
  instance.mesh = must(system.scene().addMesh(systemMesh(1, 50)));
  instance.layout = motionLayout();
  std::vector<PoseHandle> poses(count);
  must(system.scene().addPoses(poses, 8));
  std::vector<InstanceHandle> instances;
  const std::array<MorphWeight, 2> morphs{{{0, 0.5f}, {1, 0.25f}}};
  for (std::uint32_t i = 0; i < count; ++i) {
    instance.pose = poses[i];
    instance.method = i % 2 == 0 ? Method::dualQuaternion : Method::linear;
    instance.bounds = i % 5 == 0;
    instance.updateInterval = 1 + i % 3;
    instances.push_back(must(system.scene().addInstance(instance)));
    if (i % 2 == 0) must(system.scene().change({.instance = instances.back(), .morphs = morphs}));
  }
  const Pose pose = systemPose(1);
  std::vector<InstanceVisibility> views(count);
  std::uint32_t counted = 0;
  const auto expect = [](bool isRight) {
    if (!isRight) std::abort();
  };
  for (std::uint32_t frame = 1; frame <= 60; ++frame) {
    {
      const Counting counting;
      expect(system.scene().beginFrame(frame, frame - 1).ok());
      for (std::uint32_t i = 0; i < count; ++i) {
        if ((i + frame) % 4 == 0) continue;
        const Result<std::span<JointMatrix>> place = system.scene().writePose(poses[i]);
        expect(place.ok());
        std::ranges::copy(pose, place->begin());
      }
      for (std::uint32_t i = 0; i < count; ++i) views[i] = {instances[i], (i + frame) % 6 != 0, 2};
      expect(system.scene().setVisibility(views).ok());
      const auto jobs = system.jobs(1000);
      expect(jobs.ok());
      if (frame % 9 == 8) {
        expect(system.scene().abandonFrame(frame).ok());
      } else {
        for (const cpu::PlannedJob& job : *jobs) cpu::run(job);
      }
    }
    if (frame == 40) {
      EXPECT_GT(allocations, 0u) << "the first frames have to allocate, or nothing is counted";
      allocations = 0;
    }
    if (frame > 40) counted += static_cast<std::uint32_t>(system.scene().skinnedInstances().size());
  }
  EXPECT_GT(counted, 1000u);
  EXPECT_EQ(allocations, 0u);
}

TEST(CpuAllocationTest, WarmJobsAllocateNothing) {
  const cpu::Mesh mesh = must(cpu::Mesh::create(systemMesh(1, 500)));
  const Pose rigid = systemPose(1), sheared = systemPose(4);
  std::array<cpu::Instance, 8> instances;
  std::vector<std::byte> output;
  for (const Method method : {Method::linear, Method::dualQuaternion, Method::blended}) {
    for (const VertexLayout& layout : {plainLayout(), motionLayout()}) {
      cpu::Job job;
      job.mesh = &mesh;
      job.method = method;
      job.places = must(placeVertices(layout, 500));
      output.resize(job.places.size * instances.size());
      for (std::size_t i = 0; i < instances.size(); ++i) {
        instances[i].pose = i % 2 == 0 ? rigid : sheared;
        instances[i].output.fill(output.data() + job.places.size * i);
      }
      job.instances = instances;
      must(cpu::skin(job));
      allocations = 0;
      bool isDone = false;
      {
        const Counting counting;
        isDone = cpu::skin(job).ok();
      }
      EXPECT_TRUE(isDone);
      EXPECT_EQ(allocations, 0u) << methodName(method);
    }
  }
}

/// Runs a job in a new thread, so that it has to allocate its working memory. Returns false if the
/// memory was not enough.
bool runInNewThread(const cpu::PlannedJob& job, std::uint32_t allocationsAllowed) {
  std::packaged_task<bool()> run([&] {
    allowed = allocationsAllowed;
    try {
      cpu::run(job);
      allowed = ~0u;
      return true;
    } catch (const std::bad_alloc&) {
      allowed = ~0u;
      return false;
    }
  });
  std::future<bool> done = run.get_future();
  std::thread thread(std::move(run));
  if (done.wait_for(std::chrono::minutes(1)) != std::future_status::ready) {
    std::fprintf(stderr, "the job waits for what nobody does any more\n");
    std::abort();
  }
  thread.join();
  return done.get();
}

/// A bank with a skin of eight joints, which needs more working memory than `playedClips`.
PackedClips longClips() {
  constexpr std::array<float, 2> times{0, 1};
  constexpr std::array<float, 8> turns{0, 0, 0, 1, 0, 0.6f, 0, 0.8f};
  constexpr std::uint32_t nodes = 300;
  Skeleton skeleton;
  ClipView clip{.name = "clip", .duration = 1, .wraps = false};
  for (std::uint32_t node = 0; node < nodes; ++node) {
    skeleton.nodes.push_back({.translation = {0, 0.1, 0}});
    if (node > 0) skeleton.nodes.back().parent = 0;
    clip.channels.push_back(
        {.node = node, .path = ChannelPath::rotation, .times = times, .values = turns});
  }
  const std::array<std::uint32_t, riggedJoints> joints{0, 1, 2, 3, 4, 5, 6, nodes - 1};
  const std::vector<JointMatrix> inverseBind(joints.size());
  skeleton.skins = {{"skin", joints, inverseBind}};
  return must(packClips(skeleton, {&clip, 1}));
}

// What the first of several jobs finds, the others wait for. If it has no memory for that, another
// one must be able to do it.
TEST(CAllocationTest, AFunctionWithoutMemorySaysSo) {
  bool isEnough = false;
  for (std::uint32_t given = 0; !isEnough; ++given) {
    dermis_runner* runner = nullptr;
    dermis_error error{};
    allowed = given;
    const dermis_code code = dermis_runner_create(nullptr, &runner, &error);
    allowed = ~0u;
    isEnough = code == DERMIS_OK;
    if (isEnough) {
      EXPECT_GT(given, 3u);
      dermis_destroy(runner);
      continue;
    }
    ASSERT_EQ(code, DERMIS_OUT_OF_MEMORY) << given;
    EXPECT_EQ(error.code, code);
    EXPECT_STREQ(error.message, "there is not enough memory");
    EXPECT_EQ(runner, nullptr);
  }
}

TEST(CpuAllocationTest, AJobWithoutMemoryCanBeRunAgain) {
  const std::vector<std::string_view> targets = cpu::targetNames();
  for (const std::string_view target : {targets.front(), targets.back()}) {
    must(cpu::setTarget(target));
    cpu::SceneRunner runner = must(cpu::SceneRunner::create());
    Scene& scene = runner.scene();
    const std::array banks{must(scene.addClips(PackedClips(playedClips()))),
                           must(scene.addClips(longClips()))};
    const RigHandle rig = must(scene.addRig(riggedPose(6, 0)));
    InstanceDescription instance;
    instance.mesh = must(scene.addMesh(systemMesh(1, 50)));
    instance.layout = plainLayout();
    std::vector<FigureHandle> figures;
    for (std::uint32_t i = 0; i < 4; ++i) {
      const std::array rigs{rig, rig};
      figures.push_back(
          must(scene.addFigure(banks[i % 2], std::span(rigs).first(i % 2 == 0 ? 2 : 1))));
      instance.pose = must(scene.pose(figures[i]));
      must(scene.addInstance(instance));
    }
    bool isEnough = false;
    std::uint32_t frame = 0;
    for (std::uint32_t given = 0; !isEnough; ++given) {
      must(scene.beginFrame(frame + 1, frame));
      ++frame;
      for (const FigureHandle figure : figures) {
        const ClipLayer layer{.time = 0.01 * frame};
        const FigurePlay play{figure, {&layer, 1}};
        must(scene.play({&play, 1}));
      }
      const auto jobs = must(runner.jobs(1));
      ASSERT_GT(jobs.size(), 1u);
      isEnough = runInNewThread(jobs[0], given);
      for (const cpu::PlannedJob& job : jobs) EXPECT_TRUE(runInNewThread(job, ~0u));
    }
    EXPECT_GT(frame, 5u) << target;
  }
  must(cpu::setTarget(""));
}

}  // namespace
}  // namespace dermis::test
