// A SceneRecorder as simple as can be: for each instance what its output must hold, whether a
// frame had to skin it, and which places frames under way may still read. `Engine` is one of
// SystemEngine (of vulkan::SceneRecorder) and CpuEngine (of cpu::SceneRunner).
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <compare>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "dermis/scene.h"

namespace dermis::test {

/// What positions are made of. Numbers count meshes, poses, sets of morph weights and boxes that
/// the test can look up.
struct ShownPose {
  std::uint32_t mesh = 0, pose = 0, morphs = 0, box = 0;
  Method method = Method::dualQuaternion;
  friend auto operator<=>(const ShownPose&, const ShownPose&) = default;
};

struct ModelPose {
  PoseHandle handle;
  std::uint32_t pose = 0;
  FigureHandle figure = {};  ///< null: somebody writes it
  std::uint32_t skin = 0;    ///< of the figure
  std::uint32_t clips = 0;   ///< number of its bank
  bool isRigged = false;     ///< `pose` is a number of a pose with driven joints
};

struct ModelInstance {
  InstanceHandle handle;
  InstanceDescription description;
  std::uint32_t mesh = 0, pose = 0, morphs = 0, box = 0;
  std::uint32_t vertexCount = 0;
  bool isVisible = true;
  bool isShownByGpu = true;  ///< the word of the frame, where it is culled on the GPU

  // Since the last `record`.
  bool isChanged = true;   ///< its positions are not what they should be
  bool isNew = true;       ///< it changed after `isOwed` was decided
  bool isUrgent = false;   ///< it changed in a way that no interval holds back
  bool teleports = false;  ///< or has a new box
  bool changesMesh = true;
  bool isDue = false;              ///< what the scene says before `record`
  bool isOwed = false;             ///< the GPU skins it when it next displays it
  std::uint32_t waitedFrames = 0;  ///< in which it was changed, but skipped for its interval

  // As of the last `record`.
  InstanceOutput output;
  bool hasPlace = false;        ///< its place was recorded
  std::uint64_t writtenIn = 0;  ///< the frame that first wrote what is there; 0: none
  bool wasDisplayed = false;
  bool isMoving = false;  ///< its previous positions are not its positions
  std::optional<ShownPose> shown, before;
  /// Of those that interpolate: when it was last skinned, or for the GPU was to be skinned.
  std::uint64_t updatedIn = 0;
  std::uint32_t updatedInterval = 1;                 ///< its update interval then
  std::optional<ShownPose> bounded, earlierBounded;  ///< as it was last skinned, and before that

  void change() { isChanged = isNew = true; }
  void updateIn(std::uint64_t frame) {
    updatedIn = frame;
    updatedInterval = description.updateInterval;
  }
  bool isDisplayed() const { return isVisible && (!description.culledOnGpu || isShownByGpu); }
};

template <class Engine>
class SystemModel {
 public:
  explicit SystemModel(Engine& engine) : engine_(engine) {}

  std::map<std::uint32_t, ModelPose> poses;
  std::vector<ModelInstance> instances;
  bool mayMove = false;  ///< `compact` was called since the last `record`
  std::uint64_t movedInstances = 0;
  std::uint64_t interpolations = 0;  ///< instances that were drawn between two updates

  bool isPoseUsed(std::uint32_t palette) const {
    return std::ranges::any_of(
        instances, [&](const ModelInstance& instance) { return instance.pose == palette; });
  }
  bool isMeshUsed(std::uint32_t mesh) const {
    return std::ranges::any_of(
        instances, [&](const ModelInstance& instance) { return instance.mesh == mesh; });
  }
  void writePose(std::uint32_t number, std::uint32_t pose) {
    poses.at(number).pose = pose;
    for (ModelInstance& instance : instances) {
      if (instance.pose == number) instance.change();
    }
  }
  /// The instance was removed in the frame that was begun last.
  void remove(std::size_t index) {
    if (instances[index].hasPlace) lock(instances[index].output);
    std::swap(instances[index], instances.back());
    instances.pop_back();
  }

  /// After `beginFrame`: places are free again, and what the GPU did in the newest complete frame
  /// is known, which is checked.
  void beginFrame() {
    std::erase_if(locked_,
                  [&](const Place& place) { return place.frame <= engine_.completedFrame(); });
    checkWritten();
    const SceneStatistics::Culling gpu = engine_->statistics().lastCompletedFrame;
    const auto counted = gpuCounts_.find(gpu.frame);
    if (counted == gpuCounts_.end()) return;
    EXPECT_EQ(gpu.visibleInstances, counted->second.visible) << "frame " << gpu.frame;
    EXPECT_EQ(gpu.skinnedInstances, counted->second.skinned) << "frame " << gpu.frame;
    EXPECT_EQ(gpu.settledInstances, counted->second.settled) << "frame " << gpu.frame;
    gpuCounts_.erase(gpuCounts_.begin(), std::next(counted));
  }
  /// After `abandonFrame`: everything is to be skinned again, and what the outputs hold is unknown.
  void afterAbandon() {
    for (ModelInstance& instance : instances) {
      const InstanceOutput output = must(engine_->output(instance.handle));
      if (instance.hasPlace && output.offset != instance.output.offset) lock(instance.output);
      instance.output = output;
      if (instance.hasPlace && output.mesh == instance.description.mesh)
        instance.changesMesh = false;
      instance.writtenIn = 0;
      instance.change();
      instance.isUrgent = instance.teleports = true;
      instance.isMoving = instance.isOwed = false;
      instance.waitedFrames = 0;
      instance.shown = instance.before = std::nullopt;
      instance.bounded = instance.earlierBounded = std::nullopt;
    }
  }
  /// After `record`: checks what was skinned, settled and moved, and where everything stands.
  void afterRecord() {
    Lists lists{
        indicesOf(engine_->skinnedInstances()), indicesOf(engine_->settledInstances()), {}, {}};
    for (ModelInstance& instance : instances) {
      SCOPED_TRACE("frame " + std::to_string(engine_.frame()) + ", instance " +
                   std::to_string(instance.handle.index));
      update(instance, lists);
    }
    mayMove = false;
    checkWritten();
    checkPlacesAreApart();
    checkStatistics(lists);
    gpuCounts_[engine_.frame()] = lists.gpu;
  }

 private:
  struct Place {
    std::uint64_t begin = 0, end = 0;
    std::uint64_t frame = 0;  ///< free when it is complete
  };
  /// Instances culled on the GPU.
  struct GpuCounts {
    std::uint32_t visible = 0, skinned = 0, settled = 0;
  };
  struct Lists {
    std::set<std::uint32_t> skinned, settled;
    GpuCounts gpu;
    /// By palette and interval, whether its instances took this frame.
    std::map<std::pair<std::uint32_t, std::uint32_t>, bool> beats;
  };
  ShownPose wantedPose(const ModelInstance& instance) const {
    return {instance.mesh, poses.at(instance.pose).pose, instance.morphs, instance.box,
            instance.description.method};
  }
  void lock(const InstanceOutput& output) {
    locked_.push_back({output.offset, output.offset + output.places.size, engine_.frame()});
  }
  void checkPlace(const ModelInstance& instance, const InstanceOutput& output, bool hasPlace) {
    const bool stays = instance.hasPlace && output.offset == instance.output.offset &&
                       output.places.size == instance.output.places.size;
    const bool hasSameMesh = output.mesh == instance.output.mesh;
    EXPECT_TRUE(stays || mayMove || !instance.hasPlace || !hasSameMesh) << "it moved";
    movedInstances += !stays && instance.hasPlace;
    // Where another stood that a frame under way may still read.
    for (const Place& place : locked_) {
      EXPECT_TRUE(!hasPlace || stays || output.offset >= place.end ||
                  output.offset + output.places.size <= place.begin)
          << "a place of a frame under way is used again";
    }
  }
  /// The CPU learns what the GPU chose when the frame is complete.
  void checkWritten() const {
    for (const ModelInstance& instance : instances) {
      const bool isKnown =
          !instance.description.culledOnGpu || instance.writtenIn <= engine_.completedFrame();
      EXPECT_EQ(must(engine_->output(instance.handle)).isWritten,
                instance.writtenIn != 0 && isKnown)
          << "instance " << instance.handle.index << " in frame " << engine_.frame();
    }
  }
  void checkPlacesAreApart() const {
    std::map<std::uint64_t, std::uint64_t> places;
    for (const ModelInstance& instance : instances) {
      if (!instance.hasPlace) continue;
      EXPECT_TRUE(places.emplace(instance.output.offset, instance.output.places.size).second);
    }
    std::uint64_t end = 0;
    for (const auto& [offset, size] : places) {
      EXPECT_GE(offset, end) << "two instances overlap";
      end = offset + size;
    }
  }
  void update(ModelInstance& instance, Lists& lists) {
    const InstanceOutput output = must(engine_->output(instance.handle));
    const bool hasPlace = instance.hasPlace || instance.description.culledOnGpu || output.isWritten;
    checkPlace(instance, output, hasPlace);
    // Out of view it has the place and the vertices of its old mesh until somebody looks.
    const bool isWanted = hasPlace && output.mesh == instance.description.mesh;
    const bool isPlaced = isWanted && instance.changesMesh;
    if (instance.hasPlace && output.offset != instance.output.offset) lock(instance.output);
    instance.output = output;
    instance.hasPlace = hasPlace;
    if (isPlaced) instance.writtenIn = 0;
    if (isWanted) instance.changesMesh = false;
    EXPECT_TRUE(isWanted || !instance.isVisible);
    if (instance.description.culledOnGpu && instance.isVisible && instance.isNew &&
        (instance.isDue || instance.teleports || instance.isUrgent)) {
      instance.isOwed = true;
      instance.updateIn(engine_.frame());
      instance.isNew = instance.isUrgent = false;
    }
    if (instance.isDisplayed()) {
      updateDisplayed(instance, isPlaced, lists);
    } else {
      updateHidden(instance, isPlaced, lists);
    }
    instance.teleports = false;
    checkInterpolation(instance);
  }
  /// What the vertex shader does with it: from the positions before to those of the last update in
  /// so many frames as its interval was.
  void checkInterpolation(const ModelInstance& instance) {
    const InstanceOutput& output = instance.output;
    const bool mayRest = instance.description.culledOnGpu && instance.description.interpolates;
    if (instance.isDisplayed() && instance.isMoving && instance.description.interpolates) {
      const auto interval = static_cast<float>(instance.updatedInterval);
      const auto frames = static_cast<float>(engine_.frame() - instance.updatedIn + 1);
      EXPECT_EQ(output.interpolation, frames / interval);
      EXPECT_EQ(output.motionScale, 1 / interval);
      ++interpolations;
    } else if (instance.isDisplayed() && !mayRest) {
      EXPECT_EQ(output.interpolation, 1.0f);
      EXPECT_EQ(output.motionScale, 1.0f);
    }
    EXPECT_GT(output.interpolation, 0.0f);
    EXPECT_LE(output.interpolation, 1.0f);
  }
  void updateHidden(ModelInstance& instance, bool isPlaced, const Lists& lists) {
    EXPECT_FALSE(lists.skinned.contains(instance.handle.index)) << "nobody sees it";
    EXPECT_FALSE(lists.settled.contains(instance.handle.index)) << "nobody sees it";
    if (isPlaced) instance.shown = instance.before = std::nullopt;
    instance.wasDisplayed = false;
  }
  void updateDisplayed(ModelInstance& instance, bool isPlaced, Lists& lists) {
    const bool comesBack = !instance.wasDisplayed;
    const bool hasPrevious = instance.description.layout.motion;
    const bool isCulled = instance.description.culledOnGpu;
    const bool isSettled = lists.settled.contains(instance.handle.index);
    lists.gpu.visible += isCulled;
    if (isSkinnedNow(instance, isPlaced, lists)) {
      lists.gpu.skinned += isCulled;
      if (instance.writtenIn == 0) instance.writtenIn = engine_.frame();
      EXPECT_FALSE(isSettled) << "it was skinned";
      const bool restarts = isPlaced || instance.teleports || comesBack;
      const ShownPose now = wantedPose(instance);
      instance.before = restarts ? now : instance.shown;
      instance.shown = instance.bounded = now;
      if (!isCulled) instance.updateIn(engine_.frame());
      instance.isMoving = hasPrevious && !restarts;
      instance.isChanged = instance.isUrgent = instance.isOwed = false;
      instance.waitedFrames = 0;
    } else {
      const bool isHeld = instance.description.interpolates && !comesBack &&
                          engine_.frame() - instance.updatedIn < instance.updatedInterval;
      const bool settles = instance.isMoving && !isHeld;
      lists.gpu.settled += isCulled && settles;
      EXPECT_TRUE(isCulled || isSettled == settles)
          << "it settles in the next frame that displays it, or when it has reached its pose, and "
             "in no other";
      if (settles) {
        instance.before = instance.shown;
        instance.isMoving = false;
      }
      if (instance.isChanged) ++instance.waitedFrames;
      EXPECT_LT(instance.waitedFrames, instance.description.updateInterval) << "it waits too long";
    }
    instance.earlierBounded =
        instance.description.interpolates ? instance.before : instance.bounded;
    instance.wasDisplayed = true;
  }
  bool isSkinnedNow(const ModelInstance& instance, bool isPlaced, Lists& lists) {
    if (instance.description.culledOnGpu) return isPlaced || instance.isOwed;
    const bool comesBack = !instance.wasDisplayed;
    const bool isOwed = instance.isChanged && instance.description.updateInterval == 1;
    const bool isForced = isPlaced || instance.teleports || instance.isUrgent || isOwed;
    const bool isSkinned = lists.skinned.contains(instance.handle.index);
    if (isForced) {
      EXPECT_TRUE(isSkinned) << "it changed";
    } else if (!instance.isChanged && !comesBack) {
      EXPECT_FALSE(isSkinned) << "it did not change";
    } else if (!comesBack) {
      const std::pair beat{instance.pose, instance.description.updateInterval};
      EXPECT_EQ(lists.beats.emplace(beat, isSkinned).first->second, isSkinned)
          << "instances of one palette take the same frames";
    }
    return isSkinned;
  }
  void checkStatistics(const Lists& lists) const {
    const SceneStatistics::Frame frame = engine_->statistics().lastFrame;
    EXPECT_EQ(frame.frame, engine_.frame());
    EXPECT_EQ(frame.instances, instances.size());
    EXPECT_EQ(frame.skinnedInstances, lists.skinned.size());
    EXPECT_EQ(frame.settledInstances, lists.settled.size());
    std::uint64_t vertices = 0;
    for (const ModelInstance& instance : instances) {
      if (lists.skinned.contains(instance.handle.index)) vertices += instance.vertexCount;
    }
    EXPECT_EQ(frame.skinnedVertices, vertices);
    const bool didNothing =
        lists.skinned.empty() && lists.settled.empty() && frame.culledCandidates == 0;
    EXPECT_TRUE(!didNothing || engine_.isIdle()) << "nothing changed";
  }

  Engine& engine_;
  std::vector<Place> locked_;
  std::map<std::uint64_t, GpuCounts> gpuCounts_;  ///< by frame
};

}  // namespace dermis::test
