// Thousands of random steps of a scene beside a model of it: meshes, palettes, figures and
// instances come and go, move, hide, find no room and are moved about while frames are under way,
// buffers grow, frames are abandoned, the GPU writes some poses, others are sampled from clips,
// some have joints that a rig drives, and
// every instance's output stays, bit for bit, what it would be alone. On the CPU, the same steps
// without those that are the GPU's. Calls with bad arguments, and Vulkan calls that fail, change
// nothing.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <optional>
#include <random>
#include <span>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "played_clips.h"
#include "refused_calls.h"
#include "rigged.h"
#include "scene_meshes.h"
#include "system_model.h"

namespace dermis::test {

inline constexpr std::uint32_t framesInFlight = 3;
inline constexpr std::uint32_t stepCount = 10'000;
inline constexpr std::uint32_t systemSteps = 500;  // then another system begins to grow
inline constexpr std::uint32_t poseCount = 12;
inline constexpr std::uint32_t meshKinds = 8;
// So small that they are full at times.
inline constexpr Capacity outputCapacity{1024, 100 << 10}, instanceCapacity{4, 32};
inline constexpr std::uint32_t boundsCapacity = 12;

/// Numbers of poses: written ones, those of each play and skin, and from here on those with a rig.
inline constexpr std::uint32_t riggedPoses = poseCount + playCount * playedSkins;

/// What an instance's set of morph weights is if clips write them.
inline constexpr std::uint32_t morphsOfClips = 3;
inline const std::array<std::vector<MorphWeight>, 3> morphSets{
    std::vector<MorphWeight>{}, {{0, 0.5f}}, {{1, 0.25f}, {2, 1.0f}}};
inline const std::array<Method, 3> methods{Method::linear, Method::dualQuaternion, Method::blended};

inline constexpr std::array<Box, 2> boxes{
    {{{-4, -4, -4}, {4, 4, 4}}, {{-8, -1, -8}, {8, 8, 0.5f}}}};

/// Layouts of several strides, with and without previous positions. Only the last needs a box.
inline std::array<VertexLayout, 4> someLayouts() {
  std::array<VertexLayout, 4> layouts{plainLayout(), motionLayout(), motionLayout(),
                                      motionLayout()};
  layouts[2].planar = true;
  layouts[2].tangents = VertexFormat::octahedral16x2;
  layouts[3].positions = VertexFormat::snorm16x4;
  return layouts;
}

struct ModelMesh {
  MeshHandle handle;
  std::uint32_t kind = 0;
};

/// The steps. What differs between the GPU and the CPU is left to the tests.
template <class Engine>
class ModelSteps {
 public:
  virtual ~ModelSteps() = default;

 protected:
  explicit ModelSteps(std::uint32_t seed) : random_(seed) {}

  /// An engine without anything, of which everything has to grow.
  virtual void makeEngine() = 0;
  virtual Result<void> tryToPrepare(const InstanceDescription& instance) = 0;
  virtual Result<void> trySubmit() = 0;
  virtual void abandon() = 0;
  /// Of all Vulkan calls that can fail from now on, that one does; none if it is negative.
  virtual void failAt(int /*call*/) {}
  /// More calls that are refused in the middle of a frame.
  virtual void addRefusedCalls(std::vector<RefusedCall>& /*calls*/) {}
  /// The same between the end of a frame and the begin of the next.
  virtual std::vector<RefusedCall> callsBetweenFrames() = 0;
  /// Differs if the output has become another buffer.
  virtual std::uint64_t outputNow() = 0;
  /// The pose of the only figure of a scene, if it plays this (played_clips.h).
  virtual std::vector<JointMatrix> sampleAlone(std::uint32_t play, std::uint32_t skin) = 0;
  /// All joints of the only pose of a scene with `smallRig`.
  virtual std::vector<JointMatrix> driveAlone(std::span<const JointMatrix> written) = 0;
  /// An instance skinned alone.
  virtual Streams skinAlone(const PackedMesh& mesh, std::span<const JointMatrix> pose,
                            const InstanceDescription& description,
                            std::span<const MorphWeight> morphs) = 0;

  void run() {
    for (std::uint32_t kind = 0; kind < meshKinds; ++kind)
      kinds_.push_back(systemMesh(kind, 10 + 17 * kind, 8, 4, 3 + kind % 2));
    makeSystem();
    for (std::uint32_t number = 0; number < stepCount && !::testing::Test::HasFailure(); ++number) {
      SCOPED_TRACE("step " + std::to_string(number));
      step();
      if (number % systemSteps != systemSteps - 1) continue;
      runFrame();
      expectOutputs();
      makeSystem();
    }
    // Or else nothing was tested.
    EXPECT_GT(checkedInstances_, 1000u);
    EXPECT_GT(movedInstances_, 20u);
    EXPECT_GT(interpolations_, 1000u);
    EXPECT_GT(refusals_, 20u);
    EXPECT_GT(abandonedFrames_, 50u);
    EXPECT_GT(growths_, 80u);
    EXPECT_GT(failedCalls_, 500u);
    // How many depends on how large a device's blocks of memory are.
    if (hasGpu) {
      EXPECT_GT(failedFrames_, 0u);
    }
  }
  /// Every one of these texts was in the message of an error.
  void expectAllGiven(const std::set<std::string>& texts) const {
    for (const std::string& text : texts) {
      EXPECT_TRUE(std::ranges::any_of(
          messages_,
          [&](const std::string& message) { return message.find(text) != std::string::npos; }))
          << "no error said: " << text;
    }
  }
  void makeSystem() {
    model_.reset();
    meshes_.clear();
    gone_.clear();
    makeEngine();
    model_.emplace(*engine_);
    engine_->begin();
    narrow_ = must(system().addPose(1));
    for (ClipsHandle& clips : clips_) clips = must(system().addClips(playedClips()));
    rig_ = must(system().addRig(smallRig()));
    weightedRig_ = must(system().addRig(riggedPose(1, 2, weightedNode(3))));
  }

  Scene& system() { return engine_->scene(); }
  std::uint32_t below(std::size_t count) { return static_cast<std::uint32_t>(random_() % count); }
  bool chance(std::uint32_t percent) { return below(100) < percent; }
  ModelInstance& anyInstance() { return model_->instances[below(model_->instances.size())]; }
  auto anyOf(auto& map) {
    return std::next(map.begin(), static_cast<std::ptrdiff_t>(below(map.size())));
  }
  auto anyPalette() { return anyOf(model_->poses); }
  auto anyMesh() { return anyOf(meshes_); }

  // The steps.
  void addMesh() {
    if (meshes_.size() >= 12) return;
    if (chance(30))
      tryToAdd([&] { return system().addMesh(kinds_[below(meshKinds)]); },
               [&](MeshHandle mesh) { must(system().removeMesh(mesh)); });
    const std::uint32_t kind = below(meshKinds);
    kindOf_[nextNumber_] = kind;
    meshes_[nextNumber_++] = {engine_->addMesh(kinds_[kind]), kind};
  }
  void removeMesh() {
    if (meshes_.size() < 3) return;
    const auto mesh = anyMesh();
    const Result<void> removed = system().removeMesh(mesh->second.handle);
    EXPECT_NE(removed.ok(), model_->isMeshUsed(mesh->first));
    if (removed) meshes_.erase(mesh);
  }
  void addPose() {
    if (model_->poses.size() >= 30) return;
    if (chance(25)) return addFigure();
    const std::uint32_t pose = below(poseCount);
    const bool writtenByGpu = hasGpu && chance(40), isRigged = chance(30);
    const PoseOptions options{.writtenByGpu = writtenByGpu, .rig = isRigged ? rig_ : RigHandle()};
    const auto add = [&] { return system().addPose(isRigged ? smallWritten : 8, options); };
    if (chance(30)) {
      tryToAdd(add, [&](PoseHandle added) { must(system().removePose(added)); });
      tryToAdd([&] { return system().addRig(smallRig()); },
               [&](RigHandle added) { must(system().removeRig(added)); });
    }
    const Result<PoseHandle> added = add();
    if (!added) {  // places of palettes that went are not free yet
      messages_.insert(added.error().message);
      return;
    }
    ModelPose& made = model_->poses[nextNumber_++];
    made.handle = *added;
    made.isRigged = isRigged;
    made.pose = numberOf(made, pose);
    writePose(made, pose);
  }
  static std::uint32_t numberOf(const ModelPose& its, std::uint32_t pose) {
    return its.isRigged ? riggedPoses + pose : pose;
  }
  void writePose(const ModelPose& its, std::uint32_t pose) {
    const Pose matrices = systemPose(pose);
    engine_->writePose(its.handle,
                       std::span(matrices).first(its.isRigged ? smallWritten : matrices.size()));
  }
  void addFigure() {
    if (chance(30)) {
      tryToAdd([&] { return system().addClips(playedClips()); },
               [&](ClipsHandle added) { must(system().removeClips(added)); });
      tryToAdd([&] { return system().addFigure(clips_[0]); },
               [&](FigureHandle added) { must(system().removeFigure(added)); });
    }
    const std::uint32_t clips = below(clips_.size());
    const Result<FigureHandle> figure = system().addFigure(clips_[clips]);
    if (!figure) {
      messages_.insert(figure.error().message);
      return;
    }
    for (std::uint32_t skin = 0; skin < playedSkins; ++skin) {
      model_->poses[nextNumber_++] = {must(system().pose(*figure, skin)), poseOfPlay(0, skin),
                                      *figure, skin, clips};
    }
  }
  void removeFigure(FigureHandle figure) {
    const auto isOfIt = [&](const auto& pose) { return pose.second.figure == figure; };
    const bool isUsed = std::ranges::any_of(model_->poses, [&](const auto& pose) {
      return isOfIt(pose) && model_->isPoseUsed(pose.first);
    });
    const Result<void> removed = system().removeFigure(figure);
    EXPECT_NE(removed.ok(), isUsed);
    if (removed) std::erase_if(model_->poses, isOfIt);
  }
  /// Some figures play something, in one call, some twice.
  void play(std::uint32_t percent) {
    std::vector<FigurePlay> plays;
    for (auto& [number, pose] : model_->poses) {
      if (!pose.figure || pose.skin != 0 || !chance(percent)) continue;
      const std::uint32_t played = below(playCount);
      if (chance(20)) plays.push_back({pose.figure, playedLayers(below(playCount))});
      plays.push_back({pose.figure, playedLayers(played)});
      for (const auto& [other, its] : model_->poses) {
        if (its.figure == pose.figure) model_->writePose(other, poseOfPlay(played, its.skin));
      }
    }
    must(system().play(plays));
  }
  static std::uint32_t poseOfPlay(std::uint32_t play, std::uint32_t skin) {
    return poseCount + play * playedSkins + skin;
  }
  void removePose() {
    if (model_->poses.size() < 3) return;
    const auto palette = anyPalette();
    if (palette->second.figure) return removeFigure(palette->second.figure);
    const Result<void> removed = system().removePose(palette->second.handle);
    EXPECT_NE(removed.ok(), model_->isPoseUsed(palette->first));
    if (removed) model_->poses.erase(palette);
  }
  void addInstance() {
    if (meshes_.empty() || model_->poses.empty()) return;
    const auto mesh = anyMesh();
    const auto palette = anyPalette();
    ModelInstance instance;
    instance.mesh = mesh->first;
    instance.pose = palette->first;
    instance.vertexCount = kinds_[mesh->second.kind].vertexCount();
    InstanceDescription& description = instance.description;
    description.mesh = mesh->second.handle;
    description.pose = palette->second.handle;
    description.method = methods[below(methods.size())];
    // Boxes and bounds are the same on the GPU, which would need many more pipelines for them.
    description.layout = someLayouts()[below(hasGpu ? 3 : 4)];
    description.box = boxes[instance.box];
    description.bounds = !hasGpu && description.layout.positions == VertexFormat::float32x3;
    description.culledOnGpu = hasGpu && chance(25);
    if (chance(30)) description.updateInterval = 2 + below(3);
    if (hasGpu && chance(30)) description.morphWriter = MorphWriter::gpu;
    if (chance(20)) {
      instance.morphs = morphsOfClips;
      description.morphWriter = MorphWriter::clips;
      description.weightsOf = weightedNode(targetsOf(mesh->first));
      if (hasGpu) description.layout = someLayouts()[below(2)];  // in float32
    }
    description.interpolates = description.layout.motion && chance(60);
    if (description.interpolates) description.updateInterval = 1 + below(6);
    prepare(description);
    if (chance(30))
      tryToAdd([&] { return system().addInstance(description); },
               [&](InstanceHandle added) { must(system().removeInstance(added)); });
    const Result<InstanceHandle> added = system().addInstance(description);
    if (!added) {
      expectRoomIsMissing(added.error(), std::uint64_t{instance.vertexCount} * 44);
      return;
    }
    instance.handle = *added;
    model_->instances.push_back(instance);
    if (description.morphWriter == MorphWriter::gpu) writeWeights(instance);
  }
  std::uint32_t targetsOf(std::uint32_t mesh) const {
    return kinds_[kindOf_.at(mesh)].info().morphTargetCount;
  }
  /// All weights, of which the instance's set names those that are not 0.
  void writeWeights(const ModelInstance& instance) {
    if constexpr (hasGpu) {
      std::vector<float> weights(targetsOf(instance.mesh));
      for (const MorphWeight& morph : morphSets[instance.morphs])
        weights[morph.target] = morph.weight;
      engine_->writeWeights(instance.handle, weights);
    }
  }
  void removeInstance() {
    if (model_->instances.empty()) return;
    const std::uint32_t index = below(model_->instances.size());
    gone_.push_back(model_->instances[index].handle);
    must(system().removeInstance(gone_.back()));
    model_->remove(index);
  }
  void changeInstance() {
    if (model_->instances.empty()) return;
    ModelInstance& instance = anyInstance();
    switch (below(hasGpu ? 6 : 7)) {
      case 0:
      case 1:
        instance.isVisible = !instance.isVisible || chance(30);
        return must(system().change({.instance = instance.handle, .visible = instance.isVisible}));
      case 2:
        if (instance.morphs == morphsOfClips) return;
        instance.morphs = (instance.morphs + 1 + below(2)) % 3;
        instance.change();
        if (instance.description.morphWriter == MorphWriter::gpu) return writeWeights(instance);
        return must(
            system().change({.instance = instance.handle, .morphs = morphSets[instance.morphs]}));
      case 3:
        instance.description.updateInterval = chance(50) ? 1 : 2 + below(4);
        instance.waitedFrames = 0;
        return must(system().change(
            {.instance = instance.handle, .updateInterval = instance.description.updateInterval}));
      case 4:
        instance.change();
        instance.teleports = true;
        return must(system().change({.instance = instance.handle, .teleports = true}));
      case 5:
        return setMesh(instance);
      default:
        if (instance.description.layout.positions == VertexFormat::float32x3) return;
        instance.box = below(boxes.size());
        instance.description.box = boxes[instance.box];
        instance.change();
        instance.teleports = true;
        return must(
            system().change({.instance = instance.handle, .box = instance.description.box}));
    }
  }
  void setMesh(ModelInstance& instance) {
    // Twice between two frames would leave open whether its output has been another's.
    if (instance.changesMesh) return;
    const auto mesh = anyMesh();
    if (mesh->first == instance.mesh) return;
    const std::uint32_t vertexCount = kinds_[mesh->second.kind].vertexCount();
    const bool hasOtherTargets = targetsOf(instance.mesh) != targetsOf(mesh->first);
    if (hasOtherTargets && instance.description.morphWriter != MorphWriter::cpu) {
      // Without a figure it would be permitted, and then not to go back to one.
      if (instance.morphs == morphsOfClips && !model_->poses.at(instance.pose).figure) return;
      const Result<void> set =
          system().change({.instance = instance.handle, .mesh = mesh->second.handle});
      ASSERT_FALSE(set);
      messages_.insert(set.error().message);
      return;
    }
    if (const Result<void> set =
            system().change({.instance = instance.handle, .mesh = mesh->second.handle});
        !set) {
      expectRoomIsMissing(set.error(), std::uint64_t{vertexCount} * 44);
      return;
    }
    if (hasOtherTargets) instance.morphs = 0;
    instance.mesh = mesh->first;
    instance.description.mesh = mesh->second.handle;
    prepare(instance.description);
    instance.vertexCount = vertexCount;
    instance.change();
    instance.changesMesh = true;
  }
  /// In one call: methods, poses, visibility, morph weights and jumps, of some instances twice.
  void changeSeveral() {
    if (model_->instances.empty()) return;
    std::vector<InstanceChange> changes;
    for (std::uint32_t count = 1 + below(12); count != 0; --count) {
      ModelInstance& instance = anyInstance();
      InstanceChange& change = changes.emplace_back();
      change.instance = instance.handle;
      if (chance(40)) change.visible = instance.isVisible = chance(60);
      if (chance(20)) {
        instance.change();
        change.teleports = instance.teleports = true;
      }
      if (chance(30)) {
        const auto pose = anyPalette();
        change.pose = pose->second.handle;
        instance.pose = pose->first;
        instance.description.pose = pose->second.handle;
      }
      if (chance(30)) change.method = instance.description.method = methods[below(methods.size())];
      if (change.pose || change.method) {
        prepare(instance.description);
        instance.change();
        instance.isUrgent = true;
        instance.waitedFrames = 0;
      }
      if (instance.morphs != morphsOfClips && chance(30)) {
        instance.morphs = below(3);
        if (instance.description.morphWriter == MorphWriter::gpu) {
          writeWeights(instance);
        } else {
          change.morphs = morphSets[instance.morphs];
        }
        instance.change();
      }
      if (chance(20)) {
        change.updateInterval = instance.description.updateInterval = 1 + below(4);
        instance.waitedFrames = 0;
      }
    }
    must(system().change(changes));
  }
  /// Of all instances, as culling decides.
  void setVisibility() {
    std::vector<InstanceVisibility> wanted;
    for (ModelInstance& instance : model_->instances) {
      if (chance(20)) instance.isVisible = !instance.isVisible;
      if (chance(10)) {
        instance.description.updateInterval = 1 + below(4);
        instance.waitedFrames = 0;
      }
      wanted.push_back({instance.handle, instance.isVisible, instance.description.updateInterval});
    }
    must(system().setVisibility(wanted));
  }
  void runFrame() {
    const std::uint32_t moving = below(4) * 30;  // percent of the poses; at times all rest
    play(moving);
    for (auto& [number, palette] : model_->poses) {
      if (palette.figure || !chance(moving)) continue;
      const std::uint32_t pose = below(poseCount);
      writePose(palette, pose);
      model_->writePose(number, numberOf(palette, pose));
    }
    if (chance(15)) compact();
    if (chance(15)) {
      abandon();
      model_->afterAbandon();
      ++abandonedFrames_;
      if (chance(50)) return beginFrame();
    }
    for (ModelInstance& instance : model_->instances)
      instance.isDue = must(system().isDue(instance.handle));
    const SeenScene before = seen();
    if (chance(15)) failAt(static_cast<int>(below(4)));
    const Result<void> submitted = trySubmit();
    failAt(-1);
    if (!submitted) {
      expectFailed(submitted, before);
      ++failedFrames_;
      return beginFrame();
    }
    ++submittedFrames_;
    model_->afterRecord();
    movedInstances_ += std::exchange(model_->movedInstances, 0);
    interpolations_ += std::exchange(model_->interpolations, 0);
    const std::uint64_t output = outputNow();
    growths_ += std::exchange(output_, output) != output;
    if (submittedFrames_ % 8 == 0) expectOutputs();
    beginFrame();
  }
  void beginFrame() {
    if constexpr (hasGpu) {
      engine_->begin(below(framesInFlight));
    } else {
      engine_->begin();
    }
    model_->beginFrame();
    for (const ModelInstance& instance : model_->instances) {
      if (instance.description.bounds) expectBounds(instance);
    }
  }
  // -- What fails.

  /// What a caller sees of a scene.
  struct SeenScene {
    std::vector<std::uint64_t> numbers;
    friend bool operator==(const SeenScene&, const SeenScene&) = default;
  };
  SeenScene seen(bool countsSlots = true) {
    const auto now = system().statistics();
    SeenScene scene{{now.outputs.used, now.palettes.used, now.meshes.used,
                     now.lastFrame.skinnedInstances, now.lastFrame.instances,
                     system().skinnedInstances().size(), system().settledInstances().size()}};
    if constexpr (hasGpu) scene.numbers.push_back(countsSlots ? system().visibilityCount() : 0);
    for (const ModelInstance& instance : model_->instances) {
      const InstanceOutput output = must(system().output(instance.handle));
      scene.numbers.insert(scene.numbers.end(),
                           {output.offset, output.places.size, output.mesh.index, output.isWritten,
                            std::uint64_t{must(system().isDue(instance.handle))}});
    }
    return scene;
  }
  void compact() {
    system().compact(below(40'000));
    model_->mayMove = true;
  }
  /// The call failed and the scene is as it was `before`.
  void expectFailed(const Result<void>& done, const SeenScene& before, bool countsSlots = true) {
    ASSERT_FALSE(done.ok());
    EXPECT_TRUE(seen(countsSlots) == before) << done.error().message;
    messages_.insert(done.error().message);
    ++failedCalls_;
  }
  /// Adds something while a Vulkan call fails, and removes it where none did.
  void tryToAdd(auto add, auto remove) {
    const SeenScene before = seen();
    failAt(static_cast<int>(below(3)));
    const auto added = add();
    failAt(-1);
    if (added) return remove(*added);
    expectFailed(added.error(), before);
  }
  void prepare(const InstanceDescription& instance) {
    if (chance(50)) {
      const SeenScene before = seen();
      failAt(static_cast<int>(below(2)));
      const Result<void> prepared = tryToPrepare(instance);
      failAt(-1);
      if (!prepared) expectFailed(prepared, before);
    }
    must(tryToPrepare(instance));
  }
  void refuseOne(const std::vector<RefusedCall>& calls) {
    const std::uint32_t number = below(calls.size());
    SCOPED_TRACE("refused call " + std::to_string(number));
    const RefusedCall& call = calls[number];
    const SeenScene before = seen(!call.addsForAWhile);
    expectFailed(call.call(), before, !call.addsForAWhile);
  }
  void tryWhatIsRefused() {
    if (model_->instances.empty()) return;
    const ModelInstance& instance = anyInstance();
    InstanceDescription description = instance.description;
    description.updateInterval = 1;
    description.interpolates = false;  // some layouts of the calls have no motion
    std::vector<RefusedCall> calls = refusedCalls(
        system(), {description, instance.handle,
                   gone_.empty() ? InstanceHandle() : gone_[below(gone_.size())], narrow_});
    addRefusedCalls(calls);
    addRefusedClips(calls);
    addRefusedRigs(calls, description);
    refuseOne(calls);
  }

  void addRefusedClips(std::vector<RefusedCall>& calls) {
    const auto add = [&](auto call) { calls.push_back({[call] { return withoutValue(call()); }}); };
    Scene& scene = system();
    add([&scene] { return scene.addFigure({}); });
    add([&scene] { return scene.removeClips({7777, 1}); });
    add([&scene] { return scene.removeFigure({}); });
    add([&scene] { return scene.pose(FigureHandle{}); });
    const auto found = std::ranges::find_if(
        model_->poses, [](const auto& pose) { return bool{pose.second.figure}; });
    if (found == model_->poses.end()) return;
    const ModelPose pose = found->second;
    add([&scene, clips = clips_[pose.clips]] { return scene.removeClips(clips); });
    add([&scene, pose] { return scene.pose(pose.figure, playedSkins); });
    add([&scene, pose] { return scene.removePose(pose.handle); });
    add([&scene, pose] { return scene.writePose(pose.handle); });
    add([&scene, pose] { return scene.markWritten({&pose.handle, 1}); });
    const auto play = [&](FigureHandle figure, std::vector<ClipLayer> layers) {
      add([&scene, pose, figure, layers] {
        const std::array<FigurePlay, 2> plays{{{pose.figure, playedLayers(3)}, {figure, layers}}};
        const Result<void> played = scene.play(plays);
        EXPECT_EQ(played.error().message.substr(0, 9), "entry 1: ") << played.error().message;
        return played;
      });
    };
    play({}, {});
    play(pose.figure, {{.clip = 3}});
    play(pose.figure, {{}, {.mask = 2}});
    play(pose.figure, {{.time = NAN}});
    play(pose.figure, std::vector<ClipLayer>(maxClipLayers + 1));
  }

  void addRefusedRigs(std::vector<RefusedCall>& calls, const InstanceDescription& description) {
    const auto add = [&](auto call) { calls.push_back({[call] { return withoutValue(call()); }}); };
    Scene& scene = system();
    add([&scene] { return scene.removeRig({7777, 1}); });
    add([&scene, rig = rig_] { return scene.addPose(8, {.rig = rig}); });
    add([&scene] { return scene.addPose(8, {.rig = {7777, 1}}); });
    const auto addFigure = [&](std::vector<RigHandle> rigs) {
      add([&scene, rigs, clips = clips_[0]] { return scene.addFigure(clips, rigs); });
    };
    addFigure({rig_});
    addFigure({rig_, {}});
    addFigure({{}, weightedRig_});
    const auto addInstance = [&](PoseHandle pose, std::uint32_t targets, std::uint32_t weight) {
      InstanceDescription wrong = description;
      wrong.pose = pose;
      wrong.morphWriter = MorphWriter::cpu;
      wrong.drivenTargets = targets;
      wrong.firstDrivenWeight = weight;
      add([&scene, wrong] { return scene.addInstance(wrong); });
    };
    addInstance(description.pose, 9, 0);
    if constexpr (hasGpu) {
      static const PackedRig large = longRig(40'000);
      add([&scene] { return scene.addRig(PackedRig(large)); });
    }
    const auto found =
        std::ranges::find_if(model_->poses, [](const auto& pose) { return pose.second.isRigged; });
    if (found == model_->poses.end()) return;
    add([&scene, rig = rig_] { return scene.removeRig(rig); });
    addInstance(found->second.handle, 1, 0);
  }

  /// Between `record` and `abandonFrame`, when poses cannot be written.
  void changeMeanwhile() {
    if (chance(30)) refuseOne(callsBetweenFrames());
    for (std::uint32_t count = below(6); count != 0; --count) {
      switch (below(7)) {
        case 0:
          addMesh();
          break;
        case 6:
          play(30);
          break;
        case 1:
          removeMesh();
          break;
        case 2:
          removePose();
          break;
        case 3:
          addInstance();
          break;
        case 4:
          removeInstance();
          break;
        default:
          changeSeveral();
      }
    }
    if (chance(15)) compact();
  }
  void step() {
    const std::uint32_t kind = below(100);
    const bool isCrowded = model_->instances.size() > 60;
    if (kind < 4) return addMesh();
    if (kind < 7) return removeMesh();
    if (kind < 13) return addPose();
    if (kind < 17) return removePose();
    if (kind < 38) return isCrowded ? removeInstance() : addInstance();
    if (kind < 50) return removeInstance();
    if (kind < 65) return changeInstance();
    if (kind < 70) return changeSeveral();
    if (kind < 75) return setVisibility();
    if (kind < 81) return tryWhatIsRefused();
    if (kind < 84) return play(50);
    runFrame();
  }

  /// Refused where there is no room, and only there.
  void expectRoomIsMissing(const Error& error, std::uint64_t size) {
    EXPECT_EQ(error.code, ErrorCode::limitExceeded) << error.message;
    ++refusals_;
    messages_.insert(error.message);
    if (model_->instances.size() == instanceCapacity.maximum) return;
    if (error.message.find("boundsCapacity") != std::string::npos) {
      const auto bounded = std::ranges::count_if(model_->instances, [](const auto& instance) {
        return instance.description.bounds ||
               instance.description.layout.positions == VertexFormat::snorm16x4;
      });
      EXPECT_EQ(bounded, boundsCapacity) << error.message;
      return;
    }
    EXPECT_LT(system().statistics().outputs.largestFree, size + 256) << error.message;
  }
  const Streams& expected(const ModelInstance& instance, const ShownPose& shown) {
    // Meshes are told apart by what is in them, of which there are few.
    const std::uint32_t kind = kindOf_.at(shown.mesh);
    const ShownPose content{kind, shown.pose, shown.morphs, shown.box, shown.method};
    InstanceDescription description = instance.description;
    description.method = shown.method;
    description.box = boxes[shown.box];
    Streams& streams =
        expected_[{content, description.layout.positions, description.layout.tangents}];
    if (!streams[positionStream].empty()) return streams;
    std::vector<MorphWeight> morphs;
    if (shown.morphs != morphsOfClips) {
      morphs = morphSets[shown.morphs];
    } else if (shown.pose >= poseCount && shown.pose < riggedPoses) {
      morphs = playedMorphs((shown.pose - poseCount) / playedSkins, targetsOf(shown.mesh));
    }
    return streams = skinAlone(kinds_[kind], matricesOf(shown.pose), description, morphs);
  }
  /// Weights that kernels sample from clips are only near those that the CPU samples.
  static bool isExpected(const ShownPose& shown, const std::vector<std::byte>& found,
                         const std::vector<std::byte>& wanted) {
    if (!hasGpu || shown.morphs != morphsOfClips) return found == wanted;
    if (found.size() != wanted.size()) return false;
    for (std::size_t i = 0; i < found.size(); i += sizeof(float)) {
      float a = 0, b = 0;
      std::memcpy(&a, &found[i], sizeof(a));
      std::memcpy(&b, &wanted[i], sizeof(b));
      if (!(std::abs(a - b) < 1e-5f)) return false;
    }
    return true;
  }
  const std::vector<JointMatrix>& matricesOf(std::uint32_t pose) {
    std::vector<JointMatrix>& matrices = matrices_[pose];
    if (!matrices.empty()) return matrices;
    if (pose < poseCount) return matrices = systemPose(pose);
    if (pose >= riggedPoses) {
      const Pose written = systemPose(pose - riggedPoses);
      return matrices = driveAlone(std::span(written).first(smallWritten));
    }
    return matrices =
               sampleAlone((pose - poseCount) / playedSkins, (pose - poseCount) % playedSkins);
  }
  void expectBounds(const ModelInstance& instance) {
    const std::optional<Box> box = must(system().bounds(instance.handle));
    ASSERT_EQ(box.has_value(), instance.bounded.has_value()) << instance.handle.index;
    if (!box) return;
    Box wanted{{HUGE_VALF, HUGE_VALF, HUGE_VALF}, {-HUGE_VALF, -HUGE_VALF, -HUGE_VALF}};
    for (const std::optional<ShownPose>& shown : {instance.bounded, instance.earlierBounded}) {
      if (!shown) continue;
      const std::vector<std::byte>& positions = expected(instance, *shown)[positionStream];
      for (std::size_t i = 0; i < positions.size() / sizeof(float); ++i) {
        float value;
        std::memcpy(&value, positions.data() + i * sizeof(float), sizeof(value));
        wanted.min[i % 3] = std::min(wanted.min[i % 3], value);
        wanted.max[i % 3] = std::max(wanted.max[i % 3], value);
      }
    }
    EXPECT_EQ(std::memcmp(&*box, &wanted, sizeof(wanted)), 0) << instance.handle.index;
  }
  void expectOutputs() {
    const std::vector<std::byte> bytes = engine_->readOutput();
    for (const ModelInstance& instance : model_->instances) {
      if (!instance.shown) continue;
      SCOPED_TRACE("frame " + std::to_string(engine_->frame()) + ", instance " +
                   std::to_string(instance.handle.index));
      const Streams streams = engine_->read(bytes, instance.handle);
      const Streams& wanted = expected(instance, *instance.shown);
      for (std::size_t stream = 0; stream < previousStream; ++stream)
        EXPECT_TRUE(isExpected(*instance.shown, streams[stream], wanted[stream]))
            << "stream " << stream;
      ++checkedInstances_;
      if (!instance.description.layout.motion || !instance.before) continue;
      EXPECT_TRUE(isExpected(*instance.before, streams[previousStream],
                             expected(instance, *instance.before)[positionStream]))
          << "previous positions";
    }
  }

  static constexpr bool hasGpu = Engine::hasGpu;
  std::mt19937 random_;
  std::vector<PackedMesh> kinds_;
  std::optional<Engine> engine_;
  std::optional<SystemModel<Engine>> model_;
  std::map<std::uint32_t, ModelMesh> meshes_;
  std::uint32_t nextNumber_ = 0;
  std::map<std::uint32_t, std::uint32_t> kindOf_;  ///< of every mesh that ever was
  std::vector<InstanceHandle> gone_;
  PoseHandle narrow_;
  RigHandle rig_, weightedRig_;
  std::array<ClipsHandle, 2> clips_;                            ///< the same twice
  std::map<std::uint32_t, std::vector<JointMatrix>> matrices_;  ///< of poses
  std::map<std::tuple<ShownPose, VertexFormat, VertexFormat>, Streams> expected_;
  std::set<std::string> messages_;  ///< of all errors
  std::uint32_t submittedFrames_ = 0, abandonedFrames_ = 0, failedFrames_ = 0, failedCalls_ = 0;
  std::uint64_t growths_ = 0, output_ = 0;
  std::uint64_t refusals_ = 0, movedInstances_ = 0, checkedInstances_ = 0, interpolations_ = 0;
};

}  // namespace dermis::test
