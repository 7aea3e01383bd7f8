// The books of a scene without a device: what a plan lists, and what counts as done.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "plan_commands.h"
#include "planned_scene.h"
#include "scene_meshes.h"

namespace dermis::test {
namespace {

SceneCommandsDescription smallScene() {
  SceneCommandsDescription description;
  description.scene.meshCapacity = Capacity::fixed(1 << 16);
  description.scene.jointCapacity = Capacity::fixed(256);
  description.scene.outputCapacity = Capacity::fixed(1 << 16);
  description.scene.instanceCapacity = Capacity::fixed(16);
  description.scene.boundsCapacity = Capacity::fixed(16);
  description.limits.maxStorageBuffersPerStage = storageBuffersWanted;
  return description;
}

/// One instance of one mesh.
struct OneInstance {
  explicit OneInstance(bool isCulled = false, const SceneCommandsDescription& wanted = smallScene())
      : owner(wanted) {
    info.vertexCount = 100;
    info.requiredJoints = 4;
    info.maxInfluences = 4;
    info.byteSize = 4096;
    mesh = *owner.addMesh(info);
    pose = *scene.addPose(4);
    description.mesh = mesh;
    description.pose = pose;
    description.bounds = true;
    description.culledOnGpu = isCulled;
    instance = *scene.addInstance(description);
  }

  void plan(std::uint64_t frame, std::uint64_t completed) {
    must(scene.beginFrame(frame, completed));
    must(owner.plan());
    owner.expectCopiesApart();
  }
  void record(std::uint64_t frame, std::uint64_t completed) {
    plan(frame, completed);
    must(owner.commit());
  }

  PlannedScene owner;
  Scene& scene = owner.scene();
  MeshInfo info;
  MeshHandle mesh;
  PoseHandle pose;
  InstanceDescription description;
  InstanceHandle instance;
  Plan& planned = owner.planned;
};

std::string nameOf(Use uses) {
  std::string name;
  const auto add = [&](Use read, Use write, const std::string& kind) {
    if (!includes(uses, read | write)) return;
    if (!name.empty()) name += ", ";
    name += kind;
    if (!includes(uses, write)) name += " read";
    if (!includes(uses, read)) name += " write";
  };
  add(Use::computeRead, Use::computeWrite, "compute");
  add(Use::copyRead, Use::copyWrite, "copy");
  if (includes(uses, Use::indirectRead)) name += ", indirect";
  if (includes(uses, Use::hostRead)) name += "host";
  return name;
}

/// The kinds of a plan's commands, for copies and clears their buffers, and for barriers their
/// accesses.
std::vector<std::string> namesOf(const PlannedScene& scene) {
  // The counters are at the beginning of the history.
  const auto nameOfBuffer = [&](std::uint32_t number, std::uint64_t offset) {
    switch (scene.roleOf(number)) {
      case BufferRole::meshes:
        return "meshes";
      case BufferRole::poses:
        return "poses";
      case BufferRole::tables:
        return "tables";
      case BufferRole::history:
        return offset == 0 ? "counters" : "history";
      case BufferRole::results:
        return "results";
      case BufferRole::readBack:
        return "read-back";
      default:
        return "output";
    }
  };
  std::vector<std::string> names;
  for (const Command& command : scene.planned.commands()) {
    if (const auto* dispatch = std::get_if<DispatchCommand>(&command)) {
      const Kernel kernel = variantOf(dispatch->pipeline).kernel;
      names.push_back(std::string(dispatch->indirect.size != 0 ? "indirect " : "") +
                      (kernel == Kernel::palette      ? "palette"
                       : kernel == Kernel::skin       ? "skin"
                       : kernel == Kernel::clear      ? "clear"
                       : kernel == Kernel::morphLists ? "morph lists"
                                                      : "visibility"));
    } else if (const auto* upload = std::get_if<UploadCommand>(&command)) {
      names.push_back(std::string("upload to ") +
                      nameOfBuffer(upload->to.buffer, upload->to.offset));
      EXPECT_EQ(upload->bytes.size(), upload->to.size);
    } else if (const auto* copy = std::get_if<CopyCommand>(&command)) {
      names.push_back(std::string(nameOfBuffer(copy->from, copy->fromOffset)) + " to " +
                      nameOfBuffer(copy->to, copy->toOffset));
    } else if (const auto* clear = std::get_if<ClearCommand>(&command)) {
      names.push_back(std::string("clear ") + nameOfBuffer(clear->part.buffer, clear->part.offset));
    } else {
      const auto& barrier = std::get<BarrierCommand>(command);
      names.push_back(nameOf(barrier.before) + " before " + nameOf(barrier.after));
    }
  }
  return names;
}

TEST(Scene, AFrameUploadsConvertsSkinsAndReadsBack) {
  OneInstance one;
  one.plan(1, 0);
  EXPECT_EQ(
      namesOf(one.owner),
      (std::vector<std::string>{
          "compute, copy, indirect before compute, copy", "upload to tables",
          "copy write before compute", "palette", "clear", "compute write before compute", "skin",
          "compute write before copy read", "results to read-back", "copy write before host"}));
}

// What every plan of `PlannedScene` is checked for, where the tables do not fit.
TEST(Scene, TablesAreElsewhereIfTheLentMemoryIsTooSmall) {
  OneInstance one;
  one.plan(1, 0);
  const auto tables = [&] {
    const auto* upload = std::get_if<UploadCommand>(&one.planned.commands()[1]);
    return std::vector<std::byte>(upload->bytes.begin(), upload->bytes.end());
  };
  const std::vector<std::byte> fitting = tables();
  for (const std::size_t bytes :
       {std::size_t{0}, std::size_t{1}, fitting.size() - 1, fitting.size()}) {
    one.owner.lentBytes = bytes;
    must(one.owner.plan());
    EXPECT_EQ(tables(), fitting);
  }
  one.owner.lentBytes = 1;
  for (int i = 0; i < 100; ++i) must(one.owner.plan());  // memory of their own does not grow
}

/// Every variant that the plans of one instance use, with and without active morph targets.
std::set<PipelineId> pipelinesOf(PlannedScene& owner, InstanceHandle instance,
                                 std::uint32_t targets) {
  Scene& scene = owner.scene();
  std::set<PipelineId> used;
  std::uint64_t frame = 0;
  for (const float weight : {0.f, 1.f}) {
    const MorphWeight morph{0, weight};
    InstanceChange change{.instance = instance, .teleports = true};
    if (targets != 0) change.morphs = std::span(&morph, 1);
    EXPECT_TRUE(scene.change(change).ok());
    ++frame;
    EXPECT_TRUE(scene.beginFrame(frame, frame - 1).ok());
    EXPECT_TRUE(owner.plan().ok());
    for (const PipelineId id : owner.planned.pipelines()) used.insert(id);
    EXPECT_TRUE(owner.commit().ok());
  }
  return used;
}

// What is prepared for one instance is what its frames use, and no more.
TEST(Scene, TellsThePipelinesOfOneInstance) {
  SceneCommandsDescription description = smallScene();
  description.limits.texelBuffers = true;
  for (const Method method : allMethods) {
    for (const auto& [fewest, most] : {std::pair{0u, 0u},
                                       {1u, 1u},
                                       {1u, 2u},
                                       {2u, 3u},
                                       {3u, 3u},
                                       {1u, 4u},
                                       {4u, 4u},
                                       {2u, 9u}}) {
      for (std::uint32_t targets = 0; targets < 2; ++targets) {
        for (int choices = 0; choices < 8; ++choices) {
          PlannedScene owner(description);
          Scene& scene = owner.scene();
          MeshInfo info;
          info.vertexCount = 100;
          info.requiredJoints = 4;
          info.minInfluences = fewest;
          info.maxInfluences = most;
          info.morphTargetCount = targets;
          info.hasCentersOfRotation = true;
          info.byteSize = 4096;
          InstanceDescription figure;
          figure.mesh = *owner.addMesh(info);
          figure.pose = *scene.addPose(
              4,
              {.promise = choices % 2 != 0 ? JointPromise::scaling : JointPromise::scaleIgnored});
          figure.method = method;
          figure.bounds = choices / 2 % 2 != 0;
          figure.culledOnGpu = choices / 4 != 0;
          const PipelineNeeds needs = *scene.pipelineNeeds(figure);
          const std::vector<PipelineId> all = *pipelines(needs, description.limits, {});
          const std::set<PipelineId> foreseen(all.begin(), all.end());
          const InstanceHandle instance = *scene.addInstance(figure);
          EXPECT_EQ(pipelinesOf(owner, instance, targets), foreseen)
              << methodName(method) << ", " << fewest << " to " << most << " influences, "
              << targets << " targets, choices " << choices;
        }
      }
    }
  }
  // Without a mesh and a pose: for all.
  const PlannedScene empty(description);
  const PipelineNeeds all = must(empty.scene().pipelineNeeds({}));
  EXPECT_FALSE(all.mesh || all.promise);
  EXPECT_FALSE(empty.scene().pipelineNeeds({.mesh = {0, 1}}).ok());
}

TEST(Scene, RunsThatAreNotWholeWordsAreRefused) {
  OneInstance one(false);
  for (const auto& [layout, text] :
       {std::pair{VertexLayout{.positions = VertexFormat::float16x3}, "use float16x4"},
        {VertexLayout{.stride = 14}, "multiples of 4"}}) {
    InstanceDescription wrong = one.description;
    wrong.layout = layout;
    const Result<InstanceHandle> added = one.scene.addInstance(wrong);
    const Result<PipelineNeeds> needs = one.scene.pipelineNeeds(wrong);
    ASSERT_FALSE(added.ok() || needs.ok());
    for (const Error& error : {added.error(), needs.error()})
      EXPECT_NE(error.message.find(text), std::string::npos) << error.message;
  }
}

TEST(Scene, TheGpuChoosesBeforeItSkins) {
  OneInstance one(true);
  const std::vector<std::string> first{"compute, copy, indirect before compute, copy",
                                       "upload to tables",
                                       "clear counters",
                                       "clear history",  //
                                       "copy write before compute",
                                       "visibility",
                                       "compute write before compute",
                                       "visibility",  //
                                       "compute write before compute, indirect",
                                       "palette",
                                       "clear",  //
                                       "compute write before compute",
                                       "indirect skin",  //
                                       "compute write before copy read",
                                       "counters to read-back",
                                       "history to read-back",
                                       "results to read-back",
                                       "copy write before host"};
  one.plan(1, 0);
  EXPECT_EQ(namesOf(one.owner), first);
  // History is cleared until a frame that does so is recorded, and never again.
  ASSERT_TRUE(one.owner.plan().ok());
  EXPECT_EQ(namesOf(one.owner), first);
  ASSERT_TRUE(one.owner.commit().ok());
  one.plan(2, 1);
  EXPECT_EQ(std::ranges::count(namesOf(one.owner), "clear history"), 0);
  EXPECT_EQ(std::ranges::count(namesOf(one.owner), "clear counters"), 1);
}

// What other frames have written to the history before stays.
TEST(Scene, TheNewPartOfAHistoryThatHasGrownIsCleared) {
  SceneCommandsDescription description = smallScene();
  description.scene.instanceCapacity = {16, 64};
  OneInstance one(true, description);
  one.record(1, 0);
  const std::uint64_t before = one.owner.sizeOf(BufferRole::history);
  InstanceDescription next = one.description;
  next.bounds = false;
  for (int i = 0; i < 16; ++i) ASSERT_TRUE(one.scene.addInstance(next).ok());
  one.record(2, 1);
  const std::uint64_t size = one.owner.sizeOf(BufferRole::history);
  EXPECT_GT(size, before);
  std::uint32_t clears = 0;
  for (const Command& command : one.planned.commands()) {
    const auto* clear = std::get_if<ClearCommand>(&command);
    if (clear == nullptr || one.owner.roleOf(clear->part.buffer) != BufferRole::history) continue;
    if (clear->part.offset == 0) continue;  // the counters
    ++clears;
    EXPECT_EQ(clear->part.offset, before);
    EXPECT_EQ(clear->part.offset + clear->part.size, size);
  }
  EXPECT_EQ(clears, 1u);
  one.record(3, 2);
  EXPECT_EQ(std::ranges::count(namesOf(one.owner), "clear history"), 0);
}

TEST(Scene, WhatIsNotCommittedIsPlannedAgain) {
  OneInstance one;
  one.plan(1, 0);
  const std::vector<std::string> all = namesOf(one.owner);
  one.plan(2, 0);
  EXPECT_EQ(namesOf(one.owner), all);
  const InstanceOutput early = *one.scene.output(one.instance);
  EXPECT_FALSE(early.isWritten);
  EXPECT_EQ(early.places.size, 100u * 12u) << "the place is known";
  ASSERT_TRUE(one.owner.commit().ok());
  EXPECT_TRUE(one.scene.output(one.instance)->isWritten);
  EXPECT_EQ(one.scene.output(one.instance)->offset, early.offset);
  EXPECT_EQ(one.scene.statistics().lastFrame.skinnedInstances, 1u);
  one.plan(3, 2);
  EXPECT_TRUE(one.planned.commands().empty());
}

TEST(Scene, AnAbandonedFrameIsPlannedAgain) {
  OneInstance one;
  one.plan(1, 0);
  const std::vector<std::string> all = namesOf(one.owner);
  ASSERT_TRUE(one.owner.commit().ok());
  EXPECT_EQ(one.scene.skinnedInstances().size(), 1u);
  ASSERT_TRUE(one.scene.abandonFrame(1).ok());
  EXPECT_TRUE(one.scene.skinnedInstances().empty());
  EXPECT_EQ(one.scene.statistics().lastFrame.skinnedInstances, 0u);
  ASSERT_TRUE(one.owner.plan().ok()) << "in the same frame";
  EXPECT_EQ(namesOf(one.owner), all);
  ASSERT_TRUE(one.owner.commit().ok());
  ASSERT_TRUE(one.scene.abandonFrame(1).ok());
  one.plan(2, 0);
  EXPECT_EQ(namesOf(one.owner), all);
  ASSERT_TRUE(one.owner.commit().ok());
  one.plan(3, 2);
  EXPECT_TRUE(one.planned.commands().empty());
}

/// The flags of the instance records of a plan's skin kernel.
std::vector<std::uint32_t> flagsOf(const Plan& plan) {
  std::vector<std::uint32_t> words(plan.buffer(BufferRole::tables).size / 4), flags;
  must(writeTables(plan, std::as_writable_bytes(std::span(words))));
  for (const PlannedDispatch& dispatch : dispatchesOf(plan)) {
    if (dispatch.variant.kernel != Kernel::skin) continue;
    const abi::SkinPush push = dispatch.skinPush();
    const auto group = abi::load<abi::GroupRecord>(words, push.groups);
    for (std::uint32_t index = 0; index < group.instanceCount; ++index) {
      const auto record = abi::load<abi::InstanceRecord>(
          words, push.instances + (group.firstInstance + index) * abi::INSTANCE_WORDS);
      flags.push_back(record.joints & (abi::INSTANCE_RESTARTS | abi::INSTANCE_SETTLES));
    }
  }
  return flags;
}

/// What a frame did with the only instance of a scene.
Action actionOf(PlannedScene& owner) {
  must(owner.plan());
  const std::vector<std::uint32_t> flags = flagsOf(owner.planned);
  must(owner.commit());
  const bool isSkinned = !owner.scene().skinnedInstances().empty();
  const bool isSettled = !owner.scene().settledInstances().empty();
  EXPECT_EQ(flags.size(), isSkinned || isSettled ? 1u : 0u);
  EXPECT_FALSE(isSkinned && isSettled);
  if (isSettled) {
    EXPECT_EQ(flags, std::vector{std::uint32_t{abi::INSTANCE_SETTLES}});
  }
  if (!isSkinned) return isSettled ? Action::settle : Action::leave;
  return flags[0] == abi::INSTANCE_RESTARTS ? Action::restart : Action::skin;
}

// Every state and event of states.h, by what the next two frames do.
TEST(Scene, DoesWithAnInstanceWhatTheTablesSay) {
  const auto expected = [](View view, Need need, bool isOnBeat, bool isMoving) {
    const Action action = actionFor(view, need, isOnBeat);
    return action == Action::settle && !isMoving ? Action::leave : action;
  };
  for (int choice = 0; choice < 128; ++choice) {
    const auto view = static_cast<View>(choice % 4);
    const auto need = static_cast<Need>(choice / 4 % 4);
    bool isMoving = choice / 16 % 2 != 0;
    const bool isOnBeat = choice / 32 % 2 != 0, hasDetour = choice / 64 != 0;
    SCOPED_TRACE("view " + std::to_string(choice % 4) + ", need " + std::to_string(choice / 4 % 4) +
                 (isMoving ? ", moving" : "") + (isOnBeat ? "" : ", not on the beat") +
                 (hasDetour ? ", changed and changed back" : ""));
    OneInstance one;
    must(one.scene.removeInstance(one.instance));
    one.description.bounds = false;
    one.description.layout.motion = true;
    const InstanceHandle instance = must(one.scene.addInstance(one.description));
    std::uint64_t frame = 0;
    const auto begin = [&] {
      ++frame;
      must(one.scene.beginFrame(frame, frame - 1));
    };
    const auto show = [&](bool isShown) {
      must(one.scene.change({.instance = instance, .visible = isShown}));
    };
    const auto wait = [&](std::uint32_t interval) {
      must(one.scene.change({.instance = instance, .updateInterval = interval}));
    };
    begin();
    EXPECT_EQ(actionOf(one.owner), Action::restart);
    begin();
    if (isMoving) must(one.scene.writePose(one.pose));
    EXPECT_EQ(actionOf(one.owner), isMoving ? Action::skin : Action::leave);
    if (view != View::shown) show(false);
    if (view == View::hidden || view == View::returning) {
      begin();
      EXPECT_EQ(actionOf(one.owner), Action::leave);
    }
    if (view == View::returning) show(true);
    if (hasDetour) {
      show(!isDisplayed(view));
      show(isDisplayed(view));
    }
    begin();
    if (!isOnBeat) wait(100'000);
    if (need == Need::stale) must(one.scene.writePose(one.pose));
    if (need == Need::urgent)
      must(one.scene.change({.instance = instance, .method = Method::linear}));
    if (need == Need::restart) must(one.scene.change({.instance = instance, .teleports = true}));
    const Action done = actionOf(one.owner);
    EXPECT_EQ(done, expected(view, need, isOnBeat, isMoving));

    // What is left of it.
    const Need left = done >= Action::skin ? Need::none : need;
    if (done != Action::leave) isMoving = done == Action::skin;
    begin();
    wait(1);
    const View now = after(view, ViewEvent::execute);
    show(true);
    EXPECT_EQ(actionOf(one.owner), expected(after(now, ViewEvent::show), left, true, isMoving));
  }
}

// Whatever was done since: one that rests, one that is not due and one that is hidden.
TEST(Scene, AfterAnAbandonedFrameEverythingIsSkinnedAndItsMotionRestarts) {
  OneInstance one;
  InstanceDescription description = one.description;
  description.layout.motion = true;
  description.bounds = false;
  const InstanceHandle resting = must(one.scene.addInstance(description));
  description.pose = must(one.scene.addPose(4));
  description.updateInterval = 1000;
  const InstanceHandle waiting = must(one.scene.addInstance(description));
  const InstanceHandle hidden = must(one.scene.addInstance(description));
  must(one.scene.removeInstance(one.instance));
  one.record(1, 0);
  must(one.scene.change({.instance = hidden, .visible = false}));
  one.record(2, 1);
  must(one.scene.beginFrame(3, 2));
  must(one.scene.writePose(one.pose));
  must(one.scene.writePose(description.pose));
  must(one.owner.plan());
  EXPECT_EQ(flagsOf(one.planned), std::vector{0u}) << "one moves";
  must(one.owner.commit());
  must(one.scene.abandonFrame(3));
  must(one.owner.plan());
  EXPECT_EQ(flagsOf(one.planned), std::vector(2, abi::INSTANCE_RESTARTS));
  must(one.owner.commit());
  EXPECT_EQ(one.scene.skinnedInstances().size(), 2u);
  for (const InstanceHandle instance : {resting, waiting})
    EXPECT_EQ(std::ranges::count(one.scene.skinnedInstances(), instance), 1);
  must(one.scene.beginFrame(4, 3));
  must(one.scene.change({.instance = hidden, .visible = true}));
  must(one.owner.plan());
  EXPECT_EQ(flagsOf(one.planned), std::vector{std::uint32_t{abi::INSTANCE_RESTARTS}});
}

// A new pose that is written, too, is uploaded once: two uploads of it would have no order.
TEST(Scene, APoseIsUploadedOnce) {
  PlannedScene owner;
  owner.mapsPoses = false;
  must(owner.tryToCreate(smallScene()));
  Scene& scene = owner.scene();
  const auto uploads = [&](std::uint64_t frame, bool isAbandoned) {
    must(owner.plan());
    owner.expectCopiesApart();
    const auto count = std::ranges::count(namesOf(owner), "upload to poses");
    must(owner.commit());
    if (isAbandoned) must(scene.abandonFrame(frame));
    return count;
  };
  const PoseHandle early = must(scene.addPose(4));
  must(scene.writePose(early));
  must(scene.beginFrame(1, 0));
  const PoseHandle late = must(scene.addPose(4));
  for (const PoseHandle pose : {early, late, late}) must(scene.writePose(pose));
  EXPECT_EQ(uploads(1, true), 2);
  for (const PoseHandle pose : {early, late}) must(scene.writePose(pose));
  EXPECT_EQ(uploads(1, false), 2);
  must(scene.beginFrame(2, 1));
  must(scene.writePose(late));
  EXPECT_EQ(uploads(2, false), 1);
}

// Also where it grew again between, and where poses are not mapped.
TEST(Scene, AnAbandonedFrameUploadsAndCopiesAgain) {
  SceneCommandsDescription description = smallScene();
  description.scene.meshCapacity = {8192};
  PlannedScene owner;
  owner.mapsPoses = false;
  must(owner.tryToCreate(description));
  Scene& scene = owner.scene();
  const PoseHandle pose = must(scene.addPose(4));
  const auto addMesh = [&] { return must(scene.addMesh(systemMesh(0, 40))); };
  const auto copiesOf = [&] {
    const std::vector<std::string> names = namesOf(owner);
    std::map<std::string, std::ptrdiff_t> copies;
    for (const char* name : {"upload to meshes", "upload to poses", "meshes to meshes"})
      copies[name] = std::ranges::count(names, name);
    return std::vector{copies["upload to meshes"], copies["upload to poses"],
                       copies["meshes to meshes"]};
  };
  using Counts = std::vector<std::ptrdiff_t>;
  const MeshHandle first = addMesh();
  must(scene.beginFrame(1, 0));
  must(owner.plan());
  EXPECT_EQ(copiesOf(), (Counts{1, 1, 0}));
  must(owner.commit());
  must(scene.beginFrame(2, 1));
  must(scene.writePose(pose));
  for (int count = 0; count < 3; ++count) addMesh();
  must(owner.plan());
  EXPECT_EQ(copiesOf(), (Counts{3, 1, 1}));
  must(owner.commit());
  must(scene.removeMesh(first));
  for (int count = 0; count < 9; ++count) addMesh();  // it grows again
  must(scene.abandonFrame(2));
  must(owner.plan());
  EXPECT_EQ(copiesOf(), (Counts{12, 1, 1}));
  const auto& copy = std::get<CopyCommand>(*std::ranges::find_if(
      owner.planned.commands(),
      [](const Command& command) { return std::holds_alternative<CopyCommand>(command); }));
  EXPECT_EQ(copy.size, 8192u) << "from the buffer that has the contents";
  must(owner.commit());
  must(scene.beginFrame(3, 2));
  must(owner.plan());
  EXPECT_TRUE(owner.planned.commands().empty());
  must(owner.commit());
  must(scene.beginFrame(4, 3));
  EXPECT_EQ(std::ranges::count_if(
                owner.buffers,
                [](const auto& buffer) { return buffer.second.role == BufferRole::meshes; }),
            1)
      << "all but the last are released";
}

// The GPU's history was not cleared either.
TEST(Scene, AnAbandonedFrameClearsNothing) {
  OneInstance one(true);
  for (std::uint64_t frame = 1; frame < 4; ++frame) {
    one.plan(frame, 0);
    EXPECT_EQ(std::ranges::count(namesOf(one.owner), "clear history"), 1) << frame;
    ASSERT_TRUE(one.owner.commit().ok());
    if (frame < 3) {
      ASSERT_TRUE(one.scene.abandonFrame(frame).ok());
    }
  }
  one.plan(4, 0);
  EXPECT_EQ(std::ranges::count(namesOf(one.owner), "clear history"), 0);
}

/// A moving instance, shown and hidden by `change` or by `setVisibility`.
class SceneVisibility : public ::testing::TestWithParam<bool> {
 protected:
  SceneVisibility() {
    InstanceDescription description = one_.description;
    description.pose = pose_ = *scene_.addPose(4);
    description.bounds = false;
    description.layout.motion = true;
    instance_ = *scene_.addInstance(description);
  }
  void show(bool isVisible) {
    const InstanceVisibility visibility{instance_, isVisible, 1};
    ASSERT_TRUE((GetParam() ? scene_.setVisibility({&visibility, 1})
                            : scene_.change({.instance = instance_, .visible = isVisible}))
                    .ok());
  }
  void begin() {
    ++frame_;
    ASSERT_TRUE(scene_.beginFrame(frame_, frame_ - 1).ok());
  }
  void record() {
    ASSERT_TRUE(one_.owner.plan().ok());
    ASSERT_TRUE(one_.owner.commit().ok()) << frame_;
  }
  /// A frame in which its pose changes.
  void move() {
    begin();
    ASSERT_TRUE(scene_.writePose(pose_).ok());
    record();
  }
  bool isSkinned() const { return contains(scene_.skinnedInstances()); }
  bool isSettled() const { return contains(scene_.settledInstances()); }
  bool contains(std::span<const InstanceHandle> list) const {
    return std::ranges::count(list, instance_) == 1;
  }

  OneInstance one_;
  Scene& scene_ = one_.scene;
  PoseHandle pose_;
  InstanceHandle instance_;
  std::uint64_t frame_ = 0;
};

// Its vertices are those of the frame in which it moved.
TEST_P(SceneVisibility, WhatIsShownAgainUnchangedSettles) {
  move();
  move();
  for (const bool isVisible : {false, true}) {
    begin();
    show(isVisible);
    record();
    EXPECT_FALSE(isSkinned());
    EXPECT_EQ(isSettled(), isVisible);
  }
  begin();
  record();
  EXPECT_FALSE(isSettled()) << "once";
}

INSTANTIATE_TEST_SUITE_P(Calls, SceneVisibility, ::testing::Bool(), [](const auto& call) {
  return std::string(call.param ? "SetVisibility" : "Change");
});

TEST(Scene, NothingIsDueBetweenFrames) {
  OneInstance one;
  EXPECT_FALSE(*one.scene.isDue(one.instance));
  must(one.scene.beginFrame(1, 0));
  EXPECT_TRUE(*one.scene.isDue(one.instance));
  must(one.owner.plan());
  must(one.owner.commit());
  EXPECT_FALSE(*one.scene.isDue(one.instance));
}

TEST(Scene, WhatWasDueInAFrameThatWasSkippedIsDueInTheNext) {
  OneInstance one;
  must(one.scene.change({.instance = one.instance, .updateInterval = 10u}));
  one.record(8, 0);
  must(one.scene.beginFrame(9, 8));
  EXPECT_FALSE(must(one.scene.isDue(one.instance)));
  must(one.scene.beginFrame(12, 8));
  EXPECT_TRUE(must(one.scene.isDue(one.instance))) << "in frame 10";
}

TEST(Scene, AMeshWithOtherTargetsTakesNoMorphWeights) {
  OneInstance one;
  std::vector<MeshHandle> meshes;
  for (const std::uint32_t targets : {5u, 2u, 5u}) {
    MeshInfo info = one.info;
    info.morphTargetCount = targets;
    meshes.push_back(*one.owner.addMesh(info));
  }
  const auto isMorphed = [&](std::uint64_t frame) {
    one.record(frame, frame - 1);
    for (const PlannedDispatch& dispatch : dispatchesOf(one.planned)) {
      if (dispatch.variant.kernel == Kernel::skin) return dispatch.variant.morphs;
    }
    ADD_FAILURE() << "not skinned";
    return false;
  };
  for (const std::uint32_t target : {4u, 0u}) {
    const MorphWeight weight{target, 1};
    const std::uint64_t frame = target == 4 ? 1 : 4;
    must(one.scene.change(
        {.instance = one.instance, .mesh = meshes[0], .morphs = std::span(&weight, 1)}));
    EXPECT_TRUE(isMorphed(frame));
    must(one.scene.change({.instance = one.instance, .mesh = meshes[2]}));
    EXPECT_TRUE(isMorphed(frame + 1)) << "they have as many";
    must(one.scene.change({.instance = one.instance, .mesh = meshes[1]}));
    EXPECT_FALSE(isMorphed(frame + 2));
  }
}

TEST(Scene, TheGpuListsMorphTargetsBeforeItSkins) {
  OneInstance one;
  const auto expectRefused = [&](const char* text) {
    const std::uint64_t used = one.scene.statistics().outputs.used;
    const Result<InstanceHandle> added = one.scene.addInstance(one.description);
    ASSERT_FALSE(added.ok()) << text;
    EXPECT_NE(added.error().message.find(text), std::string::npos) << added.error().message;
    EXPECT_EQ(one.scene.statistics().outputs.used, used) << text;
  };
  one.description.bounds = false;
  one.description.morphWriter = MorphWriter::gpu;
  expectRefused("its mesh has no targets");
  MeshInfo info = one.info;
  info.morphTargetCount = 30;
  one.description.mesh = *one.owner.addMesh(info);
  const InstanceHandle instance = must(one.scene.addInstance(one.description));
  const BufferPart weights = must(one.owner.books().weightsPart(instance));
  EXPECT_EQ(weights.size, 120u);
  EXPECT_EQ(weights.offset % 16, 0u);
  EXPECT_FALSE(one.owner.books().weightsPart(one.instance).ok());
  one.plan(1, 0);
  const std::vector<std::string> names = namesOf(one.owner);
  const auto lists = std::ranges::find(names, "morph lists");
  ASSERT_NE(lists, names.end());
  EXPECT_EQ(lists[-1], "copy write before compute");
  EXPECT_EQ(lists[1], "compute write before compute");
  EXPECT_EQ(std::ranges::count(names.begin(), lists, "skin"), 0);
  must(one.owner.commit());
  // Only what was written is skinned again.
  must(one.scene.beginFrame(2, 1));
  must(one.scene.markMorphsWritten({&instance, 1}));
  must(one.owner.plan());
  must(one.owner.commit());
  ASSERT_EQ(one.scene.skinnedInstances().size(), 1u);
  EXPECT_EQ(one.scene.skinnedInstances()[0], instance);
  EXPECT_FALSE(one.scene.markMorphsWritten({&instance, 1}).ok()) << "the frame was executed";
  // Its place is free when the frame is complete.
  must(one.scene.removeInstance(instance));
  one.record(3, 2);
  one.record(4, 3);
  const InstanceHandle next = must(one.scene.addInstance(one.description));
  EXPECT_EQ(must(one.owner.books().weightsPart(next)).offset, weights.offset);
}

TEST(Scene, WhatIsRemovedIsFreeWhenItsFrameIsComplete) {
  OneInstance one;
  one.record(1, 0);
  must(one.scene.removeInstance(one.instance));
  must(one.scene.removePose(one.pose));
  EXPECT_GT(one.scene.statistics().palettes.used, 0u);
  EXPECT_GT(one.scene.statistics().outputs.used, 0u);
  one.record(2, 1);
  must(one.scene.beginFrame(3, 2));
  EXPECT_EQ(one.scene.statistics().palettes.used, 0u);
  EXPECT_EQ(one.scene.statistics().outputs.used, 0u);
  EXPECT_TRUE(one.scene.addPose(256).ok()) << "all joints";
}

// Its mesh was changed after a frame that is then abandoned: two places are free, not one.
TEST(Scene, ThePlaceOfAnAbandonedFrameIsFree) {
  OneInstance one;
  const MeshHandle other = *one.owner.addMesh(one.info);
  one.record(1, 0);
  must(one.scene.change({.instance = one.instance, .mesh = other}));
  must(one.scene.abandonFrame(1));
  must(one.owner.plan());
  must(one.owner.commit());
  must(one.scene.beginFrame(2, 1));
  EXPECT_EQ(one.scene.statistics().outputs.used, 100u * 12u);
}

TEST(Scene, PosesHaveUpToTheMaximumOfJoints) {
  SceneCommandsDescription description = smallScene();
  description.scene.jointCapacity = Capacity::fixed(maxPoseJoints);
  OneInstance one;
  PlannedScene owner(description);
  Scene& scene = owner.scene();
  EXPECT_TRUE(scene.addPose(maxPoseJoints).ok());
  for (const std::uint32_t count : {0u, maxPoseJoints + 1}) {
    const Result<PoseHandle> refused = scene.addPose(count);
    ASSERT_FALSE(refused.ok());
    EXPECT_EQ(refused.error().message, "a pose has 1 to " + std::to_string(maxPoseJoints) +
                                           " joints, not " + std::to_string(count));
  }
}

TEST(Scene, PalettesGrowToAStorageBufferRange) {
  SceneCommandsDescription description = smallScene();
  description.limits.maxStorageBufferRange = 1024;  // 64 units
  description.scene.meshCapacity = Capacity::fixed(512);
  description.scene.jointCapacity = {4};
  PlannedScene owner(description);
  EXPECT_EQ(owner.sizeOf(BufferRole::palettes),
            (4 + description.scene.gpuJointCapacity.initial) * 5 * 16)
      << "what the first joints need";
  MeshInfo info;
  info.byteSize = 512;
  info.vertexCount = info.requiredJoints = info.maxInfluences = 1;
  InstanceDescription instance;
  instance.mesh = must(owner.addMesh(info));
  for (int count = 0; count < 12; ++count) {
    instance.pose = must(owner.scene().addPose(1));
    must(owner.scene().addInstance(instance));
  }
  EXPECT_EQ(owner.sizeOf(BufferRole::palettes), 1024u);
  instance.pose = must(owner.scene().addPose(1));
  EXPECT_EQ(
      owner.scene().addInstance(instance).error().message,
      "pose 12 needs 5 units of 16 bytes of palettes for dual_quaternion, but of 64 units only "
      "4 are free; the largest free range has 4");
}

TEST(Scene, OnlyTheFrameCommittedLastIsAbandoned) {
  OneInstance one;
  const auto expectRefused = [&](std::uint64_t frame) {
    const Result<void> abandoned = one.scene.abandonFrame(frame);
    ASSERT_FALSE(abandoned.ok());
    EXPECT_EQ(abandoned.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(abandoned.error().message.find("frame " + std::to_string(frame)), std::string::npos);
  };
  expectRefused(0);
  one.plan(1, 0);
  expectRefused(1);
  ASSERT_TRUE(one.owner.commit().ok());
  expectRefused(2);
  ASSERT_TRUE(one.scene.beginFrame(2, 0).ok());
  expectRefused(1);
  expectRefused(2);
  ASSERT_TRUE(one.owner.plan().ok());
  ASSERT_TRUE(one.owner.commit().ok());
  EXPECT_TRUE(one.scene.abandonFrame(2).ok());
  expectRefused(2);
}

// Otherwise an engine that cannot present for a while could not begin another frame; and what a
// frame in flight reads must not be overwritten.
TEST(Scene, AbandonedFramesAreNotInFlight) {
  OneInstance one;
  const auto place = [&](std::uint64_t frame) {
    EXPECT_TRUE(one.scene.beginFrame(frame, 0).ok()) << frame;
    const JointMatrix* const matrices = one.scene.writePose(one.pose)->data();
    EXPECT_TRUE(one.owner.plan().ok());
    EXPECT_TRUE(one.owner.commit().ok());
    return matrices;
  };
  const JointMatrix* const first = place(1);
  const JointMatrix* const second = place(2);
  EXPECT_NE(first, second);
  ASSERT_TRUE(one.scene.abandonFrame(2).ok());
  for (std::uint64_t frame = 3; frame < 8; ++frame) {
    EXPECT_EQ(place(frame), second) << "frame 1 still reads its pose";
    ASSERT_TRUE(one.scene.abandonFrame(frame).ok());
  }
  EXPECT_EQ(place(8), second);
  EXPECT_EQ(one.scene.beginFrame(9, 0).error().message,
            "frame 9 begins while the GPU has completed frame 0: more frames are in flight than "
            "framesInFlight, which is 2; if one of them was recorded and not submitted, call "
            "abandonFrame");
  EXPECT_TRUE(one.scene.beginFrame(9, 1).ok());
}

// A change between plan and commit would count as done.
TEST(Scene, AChangedSceneIsNotCommitted) {
  const std::vector<std::function<void(OneInstance&)>> changes{
      [](OneInstance& one) { EXPECT_TRUE(one.scene.removeInstance(one.instance).ok()); },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.writePose(one.pose).ok()); },
      [](OneInstance& one) {
        EXPECT_TRUE(one.scene.change({.instance = one.instance, .visible = false}).ok());
      },
      [](OneInstance& one) {
        EXPECT_TRUE(one.scene.change({.instance = one.instance, .teleports = true}).ok());
      },
      [](OneInstance& one) { EXPECT_TRUE(one.scene.beginFrame(2, 0).ok()); },
      [](OneInstance& one) { EXPECT_EQ(one.scene.compact(1000), 0u); }};
  for (const auto& change : changes) {
    OneInstance one;
    EXPECT_FALSE(one.owner.commit().ok()) << "nothing is planned";
    one.plan(1, 0);
    change(one);
    const Result<void> committed = one.owner.commit();
    ASSERT_FALSE(committed.ok());
    EXPECT_EQ(committed.error().code, ErrorCode::invalidArgument);
    EXPECT_EQ(committed.error().message,
              "there is no plan to commit, or the scene has changed since");
    ASSERT_TRUE(one.owner.plan().ok());
    EXPECT_TRUE(one.owner.commit().ok());
    EXPECT_FALSE(one.owner.commit().ok()) << "once";
  }
}

TEST(Scene, ReadsBackOnlyWhatWasRecorded) {
  OneInstance one;
  one.record(1, 0);
  ASSERT_TRUE(one.scene.beginFrame(2, 1).ok());
  std::vector<std::byte> bytes(4096);
  for (const std::uint64_t frame : {0u, 2u}) {
    EXPECT_EQ(one.owner.readBack(frame, bytes).error().message,
              "frame " + std::to_string(frame) +
                  " cannot be read back: it is not one of the last 2 frames that were committed");
  }
  EXPECT_EQ(
      one.owner.readBack(1, std::span(bytes).first(40)).error().message,
      "the read-back buffer of a frame has 40 bytes, fewer than the 48 that the frame copied");
  EXPECT_FALSE(one.scene.bounds(one.instance)->has_value());
  EXPECT_TRUE(one.owner.readBack(1, bytes).ok());
  EXPECT_TRUE(one.scene.bounds(one.instance)->has_value());
}

// Bounds of a frame that has not been displayed, or whose results are not read yet, are not there.
TEST(Scene, BoundsAreThoseOfAFrameThatWasReadBack) {
  OneInstance one;
  std::vector<std::byte> bytes(4096);
  const InstanceHandle second = *one.scene.addInstance(one.description);
  one.record(1, 0);
  must(one.scene.beginFrame(2, 1));
  must(one.owner.readBack(1, bytes));
  EXPECT_TRUE(one.scene.bounds(one.instance)->has_value());
  // Two others with their results.
  for (const InstanceHandle instance : {one.instance, second})
    must(one.scene.removeInstance(instance));
  const InstanceHandle hidden = *one.scene.addInstance(one.description);
  const InstanceHandle shown = *one.scene.addInstance(one.description);
  must(one.owner.plan());
  must(one.owner.commit());
  must(one.scene.abandonFrame(2));
  must(one.scene.change({.instance = hidden, .visible = false}));
  must(one.owner.plan());
  must(one.owner.commit());
  one.record(3, 2);  // has no results
  must(one.scene.beginFrame(4, 3));
  must(one.owner.readBack(3, bytes));
  EXPECT_FALSE(one.scene.bounds(shown)->has_value()) << "only frame 2 has them";
  EXPECT_FALSE(one.scene.bounds(hidden)->has_value()) << "it was never displayed";
}

// There is no binding for them.
TEST(Scene, DevicesWithFourBuffersHaveNoResults) {
  SceneCommandsDescription description = smallScene();
  EXPECT_GT(PlannedScene(description).sizeOf(BufferRole::results), 0u);
  description.limits.maxStorageBuffersPerStage = 4;
  EXPECT_EQ(PlannedScene(description).sizeOf(BufferRole::results), 0u);
  EXPECT_EQ(PlannedScene(description).sizeOf(BufferRole::results), 0u);
}

/// Instances with a box each, in frames that an engine reads back or forgets to.
struct SeveralInstances : OneInstance {
  explicit SeveralInstances(std::size_t count) {
    must(scene.removeInstance(instance));
    for (std::size_t index = 0; index < count; ++index) all.push_back(add());
  }
  InstanceHandle add() {
    InstanceDescription added = description;
    added.pose = *scene.addPose(4);
    return must(scene.addInstance(added));
  }
  void skin(InstanceHandle which) {
    must(scene.change({.instance = which, .teleports = true}));
    must(owner.plan());
    must(owner.commit());
  }
  Result<void> readBack(std::uint64_t frame) {
    return owner.readBack(frame, std::vector<std::byte>(4096));
  }
  bool hasBox(InstanceHandle which) const { return must(scene.bounds(which)).has_value(); }

  std::vector<InstanceHandle> all;
};

// The result of the last instance was never read, and is beyond all that were.
TEST(Scene, AFrameThatIsNotReadBackHasNoBoxes) {
  SeveralInstances several(12);
  several.record(1, 0);
  must(several.scene.beginFrame(2, 1));
  several.skin(several.all.front());
  must(several.scene.beginFrame(3, 2));
  must(several.readBack(2));
  EXPECT_TRUE(several.hasBox(several.all.front()));
  for (std::size_t index = 1; index < several.all.size(); ++index)
    EXPECT_FALSE(several.hasBox(several.all[index])) << index;
  several.skin(several.all.back());
  must(several.scene.beginFrame(4, 3));
  must(several.readBack(3));
  EXPECT_TRUE(several.hasBox(several.all.back()));
}

// An instance that is new may get the number of a removed one, whose box was read.
TEST(Scene, ABoxIsNeverThatOfARemovedInstance) {
  SeveralInstances several(2);
  several.record(1, 0);
  must(several.scene.beginFrame(2, 1));
  must(several.readBack(1));
  must(several.scene.removeInstance(several.all[0]));
  const InstanceHandle added = several.add();
  several.skin(added);  // is not read back
  must(several.scene.beginFrame(3, 2));
  several.skin(several.all[1]);
  must(several.scene.beginFrame(4, 3));
  must(several.readBack(3));
  EXPECT_TRUE(several.hasBox(several.all[1]));
  EXPECT_FALSE(several.hasBox(added));
}

TEST(Scene, FramesAreReadBackInOrderOnceTheyAreComplete) {
  SeveralInstances several(1);
  several.record(1, 0);
  must(several.scene.beginFrame(2, 0));
  several.skin(several.all[0]);
  const auto expectRefused = [&](std::uint64_t frame, const std::string& text) {
    const Result<void> read = several.readBack(frame);
    ASSERT_FALSE(read.ok()) << frame;
    EXPECT_EQ(read.error().code, ErrorCode::invalidArgument);
    EXPECT_NE(read.error().message.find(text), std::string::npos) << read.error().message;
  };
  expectRefused(2, "which frames up to 0 are");
  must(several.scene.beginFrame(3, 2));
  must(several.readBack(2));
  expectRefused(1, "newer than the last that was, 2");
  expectRefused(2, "newer than the last that was, 2");
  EXPECT_EQ(several.scene.statistics().lastCompletedFrame.frame, 2u);
}

// The engine's visibility buffer would be too small for the next frame.
TEST(Scene, AnInstanceThatIsRefusedLeavesNothingBehind) {
  SceneCommandsDescription description = smallScene();
  description.scene.instanceCapacity = {1};
  description.scene.boundsCapacity = {1, 1};
  description.scene.outputCapacity = {1200, 1200};
  description.scene.jointCapacity = {5};
  PlannedScene owner;
  owner.refuses = [](const SceneBuffer& buffer) -> Result<void> {
    const bool isFirst = buffer.requirement.size == 25 * 16;
    if (buffer.role != BufferRole::palettes || isFirst) return {};
    return Error{ErrorCode::vulkanError, "no palettes"};
  };
  must(owner.tryToCreate(description));
  Scene& scene = owner.scene();
  InstanceDescription instance;
  MeshInfo info;
  info.vertexCount = 50;
  info.maxInfluences = info.requiredJoints = 1;
  info.byteSize = 4096;
  instance.mesh = must(owner.addMesh(info));
  instance.pose = must(scene.addPose(1));
  must(scene.addInstance(instance));
  const auto expectRefused = [&](InstanceDescription wanted, std::uint32_t joints,
                                 std::uint32_t vertices, const std::string& text) {
    wanted.pose = must(scene.addPose(joints));
    info.vertexCount = vertices;
    wanted.mesh = must(owner.addMesh(info));
    const SceneStatistics before = scene.statistics();
    const std::uint32_t slots = scene.visibilityCount();
    const Result<InstanceHandle> added = scene.addInstance(wanted);
    ASSERT_FALSE(added.ok()) << text;
    EXPECT_NE(added.error().message.find(text), std::string::npos) << added.error().message;
    EXPECT_EQ(scene.visibilityCount(), slots) << text;
    EXPECT_EQ(scene.statistics().outputs.used, before.outputs.used) << text;
    EXPECT_EQ(scene.statistics().palettes.used, before.palettes.used) << text;
  };
  expectRefused(instance, 1, 51, "the instance takes 612 bytes");
  instance.bounds = true;
  expectRefused(instance, 50, 50, "no palettes");
  // The result is free again.
  must(scene.addInstance(instance));
  instance.layout.positions = VertexFormat::float16x4;
  expectRefused(instance, 1, 1, "the maximum of boundsCapacity");
}

// Instances of several strides, of which many go. `compact` moves at most what it may, and ends
// only once no instance fits a gap before it.
TEST(Scene, CompactionFillsEveryGapThatFits) {
  SceneCommandsDescription roomy = smallScene();
  roomy.scene.instanceCapacity = Capacity::fixed(400);
  PlannedScene owner(roomy);
  Scene& scene = owner.scene();
  std::mt19937 random(3);
  struct Shown {
    InstanceHandle handle;
    std::uint32_t stride;
  };
  std::vector<Shown> all;
  const PoseHandle pose = must(scene.addPose(4));
  std::vector<MeshHandle> meshes;
  for (std::uint32_t vertices = 1; vertices < 8; ++vertices) {
    MeshInfo info;
    info.byteSize = 512;
    info.vertexCount = vertices;
    meshes.push_back(must(owner.addMesh(info)));
  }
  for (int count = 0; count < 400; ++count) {
    InstanceDescription description;
    description.mesh = meshes[random() % meshes.size()];
    description.pose = pose;
    description.layout.stride = std::array{12u, 20u, 28u, 44u}[random() % 4];
    all.push_back({must(scene.addInstance(description)), description.layout.stride});
  }
  must(scene.beginFrame(1, 0));
  owner.record();
  std::ranges::shuffle(all, random);
  for (; all.size() > 150; all.pop_back()) must(scene.removeInstance(all.back().handle));
  std::uint64_t frame = 1, moved = 1;
  for (; moved != 0; ++frame) {
    must(scene.beginFrame(frame + 1, frame));
    EXPECT_EQ(scene.compact(0), 0u);
    EXPECT_EQ(scene.compact(11), 0u) << "less than any instance has";
    moved = scene.compact(1000);
    EXPECT_LE(moved, 1000u);
    must(owner.plan());
    EXPECT_EQ(moved != 0, !owner.planned.commands().empty());
    must(owner.commit());
    EXPECT_EQ(scene.statistics().lastFrame.movedBytes, moved);
  }
  EXPECT_GT(frame, 5u);
  std::map<std::uint64_t, Shown> byOffset;
  for (const Shown& shown : all) byOffset[must(scene.output(shown.handle)).offset] = shown;
  ASSERT_EQ(byOffset.size(), all.size());
  std::vector<std::pair<std::uint64_t, std::uint64_t>> gaps;  // begin, end
  std::uint64_t end = 0;
  for (const auto& [offset, shown] : byOffset) {
    const std::uint64_t size = must(scene.output(shown.handle)).places.size;
    ASSERT_GE(offset, end);
    gaps.emplace_back(end, offset);
    end = offset + size;
    for (const auto& [begin, gapEnd] : gaps) {
      const std::uint64_t first = (begin + shown.stride - 1) / shown.stride * shown.stride;
      EXPECT_GT(first + size, gapEnd) << "the instance at " << offset << " fits at " << first;
    }
  }
}

// An instance whose move is not recorded yet stays where it goes. Moved twice, it would keep the
// place between.
TEST(Scene, CompactionMovesEachInstanceOnceInAFrame) {
  PlannedScene owner(smallScene());
  Scene& scene = owner.scene();
  const PoseHandle pose = must(scene.addPose(4));
  std::vector<InstanceHandle> instances;
  for (const std::uint32_t vertices : {5u, 1u, 2u, 1u, 2u}) {
    MeshInfo info;
    info.byteSize = 512;
    info.vertexCount = vertices;
    InstanceDescription description;
    description.mesh = must(owner.addMesh(info));
    description.pose = pose;
    instances.push_back(must(scene.addInstance(description)));
  }
  must(scene.beginFrame(1, 0));
  owner.record();
  must(scene.removeInstance(instances[0]));
  must(scene.removeInstance(instances[2]));
  must(scene.beginFrame(2, 1));
  EXPECT_EQ(scene.compact(1000), 12u + 12u + 24u);
  EXPECT_EQ(scene.compact(1000), 0u);
  must(owner.plan());
  must(owner.commit());
  must(scene.beginFrame(3, 2));
  EXPECT_EQ(scene.statistics().outputs.used, 12u + 12u + 24u);
}

TEST(Scene, DrawsAreTheInstancesInTheirOrder) {
  PlannedScene owner(smallScene());
  Scene& scene = owner.scene();
  std::vector<IndexRange> indices;
  std::vector<InstanceHandle> instances;
  for (const std::uint32_t vertices : {5u, 2u}) {
    MeshInfo info;
    info.byteSize = 512;
    info.vertexCount = vertices;
    InstanceDescription description;
    description.mesh = must(owner.addMesh(info));
    description.pose = must(scene.addPose(4));
    instances.push_back(must(scene.addInstance(description)));
    indices.resize(description.mesh.index + std::size_t{1});
    indices[description.mesh.index] = {10 * vertices, vertices};
  }
  must(scene.change({.instance = instances[1], .visible = false}));
  const auto drawsOf = [&](const std::vector<InstanceHandle>& list) {
    std::vector<IndexedDraw> draws(list.size());
    must(scene.indexedDraws(list, indices, draws));
    return draws;
  };
  EXPECT_EQ(drawsOf({instances[0]})[0].instanceCount, 0u) << "nothing is there yet";
  must(scene.beginFrame(1, 0));
  owner.record();
  const std::vector<IndexedDraw> draws = drawsOf({instances[1], instances[0], instances[0]});
  ASSERT_EQ(draws.size(), 3u);
  EXPECT_EQ(draws[0].instanceCount, 0u) << "it was never visible";
  EXPECT_EQ(draws[0].indexCount, 2u);
  EXPECT_EQ(draws[0].firstIndex, 20u);
  for (const std::uint32_t number : {1u, 2u}) {
    EXPECT_EQ(draws[number].indexCount, 5u);
    EXPECT_EQ(draws[number].instanceCount, 1u);
    EXPECT_EQ(draws[number].firstIndex, 50u);
    EXPECT_EQ(static_cast<std::uint64_t>(draws[number].vertexOffset) * 12,
              must(scene.output(instances[0])).offset);
    EXPECT_EQ(draws[number].firstInstance, number);
  }
  EXPECT_NE(draws[0].vertexOffset, draws[1].vertexOffset);
}

TEST(Scene, DrawsBeginBelowTwoToTheThirtyFirst) {
  for (const bool isLast : {true, false}) {
    SceneCommandsDescription description = smallScene();
    description.outputOffset = 12 * ((std::uint64_t{1} << 31) - (isLast ? 256 : 0));
    PlannedScene owner(description);
    MeshInfo info;
    info.byteSize = 4096;
    info.vertexCount = 100;
    InstanceDescription figure;
    figure.mesh = must(owner.addMesh(info));
    figure.pose = must(owner.scene().addPose(4));
    const InstanceHandle instance = must(owner.scene().addInstance(figure));
    const std::vector<IndexRange> indices(figure.mesh.index + std::size_t{1});
    IndexedDraw draw;
    const Result<void> drawn = owner.scene().indexedDraws({&instance, 1}, indices, {&draw, 1});
    ASSERT_EQ(drawn.ok(), isLast);
    if (isLast) {
      EXPECT_EQ(draw.vertexOffset, 0x7fffff00);
    } else {
      EXPECT_EQ(drawn.error().code, ErrorCode::limitExceeded);
    }
  }
}

/// The version of the only candidate of a plan.
std::uint32_t versionOf(const Plan& plan) {
  std::vector<std::uint32_t> words(plan.buffer(BufferRole::tables).size / 4);
  must(writeTables(plan, std::as_writable_bytes(std::span(words))));
  for (const PlannedDispatch& dispatch : dispatchesOf(plan)) {
    if (dispatch.variant.kernel != Kernel::visibility) continue;
    const auto push = abi::load<abi::VisibilityPush>(dispatch.constants, 0);
    return abi::load<abi::CandidateRecord>(words, push.candidates).version;
  }
  return 0;
}

// If it did, the GPU would skin the instance in the next frame, although it is not due.
TEST(Scene, APlanThatIsNotExecutedLeavesNoVersionBehind) {
  OneInstance one(true);
  must(one.scene.change({.instance = one.instance, .updateInterval = 4}));
  one.record(1, 0);
  const std::uint32_t executed = versionOf(one.planned);
  must(one.scene.beginFrame(4, 1));
  must(one.scene.writePose(one.pose));
  EXPECT_TRUE(must(one.scene.isDue(one.instance)));
  must(one.owner.plan());
  EXPECT_NE(versionOf(one.planned), executed);
  must(one.scene.change({.instance = one.instance, .updateInterval = 1000}));
  EXPECT_FALSE(must(one.scene.isDue(one.instance)));
  must(one.owner.plan());
  EXPECT_EQ(versionOf(one.planned), executed);
  must(one.scene.change({.instance = one.instance, .updateInterval = 1}));
  must(one.owner.plan());
  EXPECT_NE(versionOf(one.planned), executed) << "it is still to be skinned";
}

TEST(Scene, BudgetsThatMakeNoSenseAreRefusedByName) {
  const auto expectRefused = [](const SceneCommandsDescription& description, ErrorCode code,
                                const std::string& text) {
    const Result<void> made = PlannedScene().tryToCreate(description);
    ASSERT_FALSE(made.ok()) << text;
    EXPECT_EQ(made.error().code, code) << made.error().message;
    EXPECT_NE(made.error().message.find(text), std::string::npos) << made.error().message;
  };
  SceneCommandsDescription bad = smallScene();
  bad.scene.framesInFlight = 0;
  expectRefused(bad, ErrorCode::invalidArgument, "framesInFlight is 0");
  bad = smallScene();
  bad.scene.outputCapacity = Capacity::fixed(0);
  expectRefused(bad, ErrorCode::invalidArgument, "outputCapacity has a maximum of 0");
  bad = smallScene();
  bad.limits.maxStorageBufferRange = 65536;
  bad.scene.jointCapacity = Capacity::fixed(1000);
  expectRefused(bad, ErrorCode::limitExceeded, "jointCapacity");
  bad = smallScene();
  bad.limits.maxStorageBufferRange = 65536;
  bad.scene.instanceCapacity =
      Capacity::fixed((65536 - sizeof(abi::CounterRecord)) / sizeof(abi::HistoryRecord));
  EXPECT_TRUE(PlannedScene().tryToCreate(bad).ok());
  bad.scene.instanceCapacity = Capacity::fixed(bad.scene.instanceCapacity.initial + 1);
  expectRefused(bad, ErrorCode::limitExceeded, "instanceCapacity");
  bad = smallScene();
  bad.scene.framesInFlight = 0xffffffffu;
  bad.scene.jointCapacity =
      Capacity::fixed(bad.scene.framesInFlight);  // 48 times their product is more than 2^64
  expectRefused(bad, ErrorCode::limitExceeded, "framesInFlight");
  bad = smallScene();
  bad.tuning.workgroupSize = 3;
  expectRefused(bad, ErrorCode::invalidArgument, "Tuning::workgroupSize");
  bad = smallScene();
  bad.limits.maxWorkgroupCountX = 0;
  expectRefused(bad, ErrorCode::invalidArgument, "maxWorkgroupCountX and Y must be at least 1");
  bad = smallScene();
  bad.limits.maxStorageBufferRange = 1000;
  expectRefused(bad, ErrorCode::invalidArgument, "maxStorageBufferRange must be at least 1024");
  bad = smallScene();
  bad.limits.minStorageBufferOffsetAlignment = 48;
  expectRefused(bad, ErrorCode::invalidArgument, "must be a power of two");
  bad = smallScene();
  bad.outputOffset = 2;
  expectRefused(bad, ErrorCode::invalidArgument, "the scene's outputOffset");
}

}  // namespace
}  // namespace dermis::test
