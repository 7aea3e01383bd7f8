// What is skipped is not skinned: instances that rest, are hidden by the engine, or culled on the
// GPU.

#include <cmath>
#include <cstring>

#include "played_clips.h"
#include "system_visibility.h"

namespace dermis::test {
namespace {

TEST_F(SystemVisibilityTest, OnlyWhatMovesIsDispatched) {
  open(false, plainLayout());
  engine_->submit();
  const LastFrame all = engine_->lastFrame();
  EXPECT_EQ(all.skinnedVertices, instanceCount * crowdVertices);
  EXPECT_EQ(all.writtenBytes, instanceCount * crowdVertices * 24u);
  engine_->begin();
  for (std::uint32_t i = 0; i < 6; ++i) engine_->writePose(palettes_[i * 10], systemPose(i));
  engine_->submit();
  const LastFrame few = engine_->lastFrame();
  EXPECT_EQ(few.skinnedInstances, 6u);
  EXPECT_EQ(few.skinnedVertices, 6u * crowdVertices);
  EXPECT_EQ(few.writtenBytes, 6u * crowdVertices * 24u);
  EXPECT_EQ(few.convertedPoses, 6u);
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
    must((*engine_)->change({.instance = instances_[i], .visible = i % 6 == 0}));
  engine_->submit();
  const LastFrame few = engine_->lastFrame();
  EXPECT_EQ(few.skinnedInstances, 10u);
  EXPECT_EQ(few.skinnedVertices, 10u * crowdVertices);
  EXPECT_LE(few.workgroups * 4, allWorkgroups);
  EXPECT_EQ(few.convertedPoses, 10u) << "nobody looks at the others";
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
  SceneStatistics::Culling gpu = completed();
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
  SceneStatistics::Culling gpu = completed();
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

// Instances that moved, then leave and return: those that are skinned again, or had settled before,
// have nothing to settle.
TEST_F(SystemVisibilityTest, WhatTheGpuShowsAgainSettlesOnlyIfItHasTo) {
  open(true, motionLayout());
  submit();
  moveAllInFrame(100);
  show(0, 20);
  engine_->begin();
  submit();  // the first twenty settle, the others are out of view
  SceneStatistics::Culling gpu = completed();
  EXPECT_EQ(gpu.settledInstances, 20u);
  submit();
  show(0, 0);
  engine_->begin();
  submit();
  gpu = completed();
  EXPECT_EQ(gpu.visibleInstances, 0u);
  EXPECT_EQ(gpu.settledInstances, 0u) << "nobody sees them";
  submit();
  show(0, 40);
  engine_->begin();
  submit();
  gpu = completed();
  EXPECT_EQ(gpu.skinnedInstances, 0u);
  EXPECT_EQ(gpu.settledInstances, 20u) << "those that left while they moved";
  std::vector<std::byte> bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < 40; ++i) expectMotion(bytes, i, 100, 100);
  for (std::uint32_t i = 40; i < instanceCount; ++i) expectMotion(bytes, i, 100, 0);
  show(0, instanceCount);
  moveAll(200);
  submit();
  gpu = completed();
  EXPECT_EQ(gpu.skinnedInstances, instanceCount);
  EXPECT_EQ(gpu.settledInstances, 0u);
  bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) expectMotion(bytes, i, 200, i < 40 ? 100 : 200);
  submit();
}

// Of what is visible, only what is due is skinned; of what is not visible, nothing.
TEST_F(SystemVisibilityTest, UpdateIntervalsHoldForWhatTheGpuSees) {
  constexpr std::uint32_t visible = 20, interval = 4;
  instance_.updateInterval = interval;
  open(true, plainLayout());
  submit();
  show(0, visible);
  engine_->begin();
  std::vector<std::uint32_t> shown(instanceCount, 0), updates(instanceCount, 0);
  for (std::uint32_t frame = 1; frame <= 2 * interval; ++frame) {
    moveAll(frame * 100);
    submit();
    const std::vector<std::byte> bytes = engine_->readOutput();
    std::uint32_t skinned = 0;
    for (std::uint32_t i = 0; i < instanceCount; ++i) {
      const std::vector<std::byte> positions = engine_->read(bytes, instances_[i])[positionStream];
      if (positions == positionsIn(i + frame * 100)) {
        shown[i] = frame * 100;
        ++updates[i];
        ++skinned;
      }
      ASSERT_TRUE(positions == positionsIn(i + shown[i])) << i << ", frame " << frame;
    }
    const SceneStatistics::Culling gpu = completed();
    EXPECT_EQ(gpu.skinnedInstances, skinned);
    EXPECT_LT(skinned, visible / 2) << "they take turns";
  }
  submit();
  for (std::uint32_t i = 0; i < instanceCount; ++i)
    EXPECT_EQ(updates[i], i < visible ? 2u : 0u) << i;
}

// Between its turns, an instance that appears shows the pose of its last turn, if it was visible
// then; otherwise its output is older, and it is skinned at once.
TEST_F(SystemVisibilityTest, WhatAppearsBetweenItsTurnsShowsThePoseOfTheLastOrOfThisFrame) {
  constexpr std::uint32_t interval = 4;
  instance_.updateInterval = interval;
  open(true, plainLayout());
  submit();
  engine_->begin();
  const auto poseOf = [&](std::span<const std::byte> bytes, std::uint32_t i) -> std::uint32_t {
    const std::vector<std::byte> positions = engine_->read(bytes, instances_[i])[positionStream];
    for (std::uint32_t frame = 0; frame < 2 * interval; ++frame) {
      if (positions == positionsIn(i + frame * 100)) return frame;
    }
    ADD_FAILURE() << "instance " << i << " shows no pose";
    return 0;
  };
  const auto frame = [&](std::uint32_t number, bool visible) {
    show(0, visible ? instanceCount : 0);
    if (number != 1) engine_->begin();
    moveAll(number * 100);
    submit();
  };
  for (std::uint32_t number = 1; number <= interval; ++number) frame(number, true);
  std::vector<std::uint32_t> turns;  // of the first four frames
  std::vector<std::byte> bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) turns.push_back(poseOf(bytes, i));
  for (std::uint32_t turn = 1; turn <= interval; ++turn)
    EXPECT_NE(std::ranges::count(turns, turn), 0) << "they take turns";
  frame(5, true);
  frame(6, false);
  frame(7, true);
  bytes = engine_->readOutput();
  for (std::uint32_t i = 0; i < instanceCount; ++i) {
    // Turn 2 came again in frame 6, when nothing was visible, and turn 3 in this frame.
    const std::uint32_t expected[] = {0, 5, 7, 7, 4};
    EXPECT_EQ(poseOf(bytes, i), expected[turns[i]]) << "instance " << i << ", turn " << turns[i];
  }
}

// Each instance goes to its new pose on its beat, and settles an interval later. Those that leave
// and return meanwhile settle when they return.
TEST_F(SystemVisibilityTest, WhatIsDrawnBetweenUpdatesIsHeldUntilItHasReachedItsPose) {
  constexpr std::uint32_t interval = 4, away = 10;
  instance_.updateInterval = interval;
  instance_.interpolates = true;
  open(true, motionLayout());
  submit();
  engine_->begin();
  moveAll(100);
  std::vector<std::uint32_t> updatedIn(instanceCount, 0), settled(instanceCount, 0);
  for (std::uint32_t frame = 2; frame <= 2 * interval + 2; ++frame) {
    SCOPED_TRACE(frame);
    const bool isLeaving = frame == interval + 2, isReturning = frame == interval + 3;
    show(isLeaving ? away : 0, instanceCount - (isLeaving ? away : 0));
    submit();
    const std::vector<std::byte> bytes = engine_->readOutput();
    std::uint32_t settling = 0;
    for (std::uint32_t i = 0; i < instanceCount; ++i) {
      const bool hasMoved =
          engine_->read(bytes, instances_[i])[positionStream] == positionsIn(i + 100);
      if (hasMoved && updatedIn[i] == 0) updatedIn[i] = frame;
      const bool isSeen = !isLeaving || i >= away;
      const bool isDone = updatedIn[i] != 0 && frame >= updatedIn[i] + interval;
      if (hasMoved && isSeen && settled[i] == 0 && (isDone || (isReturning && i < away))) {
        settled[i] = frame;
        ++settling;
      }
      expectMotion(bytes, i, hasMoved ? 100 : 0, settled[i] != 0 ? 100 : 0);
    }
    EXPECT_EQ(completed().settledInstances, settling);
  }
  EXPECT_EQ(std::ranges::count(settled, 0u), 0);
  for (std::uint32_t turn = 2; turn < 2 + interval; ++turn)
    EXPECT_NE(std::ranges::count(updatedIn, turn), 0) << "they take turns";
  submit();
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
  must((*engine_)->change({.instance = instances_[1], .visible = false}));
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
  must((*engine_)->change({.instance = instances_[3], .teleports = true}));
  submit();
  const std::vector<std::byte> bytes = engine_->readOutput();
  expectMotion(bytes, 3, 100, 100);
  expectMotion(bytes, 4, 100, 0);
}

TEST_F(SystemVisibilityTest, CullingOnTheGpuNeedsTheWords) {
  open(true, motionLayout());
  const Result<void> recorded = engine_->trySubmit();
  ASSERT_FALSE(recorded.ok());
  EXPECT_EQ(recorded.error().code, ErrorCode::invalidArgument);
  engine_->begin();
  submit();
  EXPECT_EQ(completed().skinnedInstances, instanceCount);
  submit();
}

// An instance that comes in the place of one that went must be skinned, and have no motion,
// whatever the GPU remembers of the old one: which was visible and moved in the frame before, and
// had as many poses. `away`: so many frames in which the new one is posed, but not seen.
TEST_F(SystemVisibilityTest, ANewInstanceIsNotTakenForTheOneBefore) {
  open(true, motionLayout());
  submit();
  for (std::uint32_t away = 0; away < 3; ++away) {
    SCOPED_TRACE(away);
    show(0, instanceCount);
    moveAllInFrame(100 * away + 50);  // the old ones move
    engine_->begin();
    for (std::uint32_t i = 0; i < 10; ++i) {
      must((*engine_)->removeInstance(instances_[i]));
      instance_.pose = palettes_[i + 20];
      instances_[i] = engine_->addInstance(instance_);
    }
    std::uint32_t by = 100 * away + 60;
    for (std::uint32_t frame = 0; frame < away; ++frame) {
      show(10, 10);
      moveAll(++by);
      submit();
      engine_->begin();
    }
    show(0, instanceCount);
    moveAll(++by);
    submit();
    std::vector<std::byte> bytes = engine_->readOutput();
    for (std::uint32_t i = 0; i < 10; ++i) {
      const Streams streams = engine_->read(bytes, instances_[i]);
      EXPECT_TRUE(streams[positionStream] == positionsIn(i + 20 + by)) << i;
      EXPECT_TRUE(streams[previousStream] == positionsIn(i + 20 + by)) << i;
    }
    // Nor does it settle what the old one left to settle.
    engine_->begin();
    submit();
    EXPECT_EQ(completed().settledInstances, away == 0 ? 50u : 10u);
    submit();
  }
}

// What the GPU culls costs no sampling either; a play is made up for when somebody sees it.
TEST_F(SystemVisibilityTest, WhatIsCulledOnTheGpuIsNotSampled) {
  SystemEngine& engine = engine_.emplace(device(), context(), description());
  const FigureHandle figure =
      must(engine->addFigure(must(engine->addClips(PackedClips(playedClips())))));
  InstanceDescription body;
  body.mesh = engine.addMesh(systemMesh(1, 40, 8, 4));
  body.pose = must(engine->pose(figure));
  body.culledOnGpu = true;
  const InstanceHandle instance = engine.addInstance(body);
  words_ = must(samples::MappedBuffer::create(device(), engine->visibilityCount() * 4,
                                              VK_BUFFER_USAGE_STORAGE_BUFFER_BIT));
  const auto frame = [&](bool isVisible) {
    engine.begin();
    const std::uint32_t word = isVisible ? 1 : 0;
    std::memcpy(words_.bytes().data() + must(engine->visibilityIndex(instance)) * sizeof(word),
                &word, sizeof(word));
    submit();
  };
  const auto play = [&](std::uint32_t number) {
    const FigurePlay plays{figure, playedLayers(number)};
    must(engine->play({&plays, 1}));
  };
  const auto isPoseOf = [&](std::uint32_t number) {
    const std::vector<JointMatrix> pose = engine.readPose(body.pose);
    const std::vector<JointMatrix> wanted = playedPose(number, 0);
    double largest = 0;
    for (std::size_t joint = 0; joint < wanted.size(); ++joint) {
      for (std::size_t i = 0; i < 12; ++i) {
        const float difference = pose[joint].m[i / 4][i % 4] - wanted[joint].m[i / 4][i % 4];
        largest = std::max(largest, std::abs(double{difference}));
      }
    }
    return largest < 1e-5;
  };
  play(1);
  frame(true);
  EXPECT_TRUE(isPoseOf(1));
  const std::vector<std::byte> shown = engine.read(instance)[positionStream];
  play(3);
  frame(false);
  frame(false);
  EXPECT_TRUE(isPoseOf(1)) << "nobody saw the other";
  EXPECT_TRUE(engine.read(instance)[positionStream] == shown);
  frame(true);
  EXPECT_TRUE(isPoseOf(3)) << "it was made up for";
  EXPECT_FALSE(engine.read(instance)[positionStream] == shown);
}

}  // namespace
}  // namespace dermis::test
