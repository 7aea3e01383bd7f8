// Calls that a scene refuses, each for another reason, and the sentences that it gives as reasons.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <set>
#include <string>
#include <vector>

#include "dermis/scene.h"

namespace dermis::test {

/// What the calls are made with.
struct SceneObjects {
  InstanceDescription description;  ///< one that is accepted
  InstanceHandle instance;          ///< of the same mesh and pose
  InstanceHandle removed;           ///< null if none was removed yet
  PoseHandle narrow;                ///< of too few joints
  std::uint32_t morphTargets = 3;
};

struct RefusedCall {
  std::function<Result<void>()> call;
  bool addsForAWhile = false;  ///< it adds an instance and removes it; there may be more slots
};

template <typename T>
Result<void> withoutValue(const Result<T>& result) {
  return result ? Result<void>() : result.error();
}

/// Of vulkan::SceneRecorder and cpu::SceneRunner.
template <typename System>
std::vector<RefusedCall> refusedCalls(System& system, const SceneObjects& objects) {
  std::vector<RefusedCall> calls;
  const auto add = [&](auto set) {
    InstanceDescription wrong = objects.description;
    set(wrong);
    calls.push_back({[&system, wrong] { return withoutValue(system.addInstance(wrong)); }});
  };
  add([](InstanceDescription& wrong) { wrong.mesh = {}; });
  add([](InstanceDescription& wrong) { wrong.pose = {}; });
  add([&](InstanceDescription& wrong) { wrong.pose = objects.narrow; });
  add([](InstanceDescription& wrong) { wrong.updateInterval = 0; });
  add([](InstanceDescription& wrong) { wrong.method = static_cast<Method>(9); });
  add([](InstanceDescription& wrong) { wrong.morphWriter = static_cast<MorphWriter>(9); });
  add([](InstanceDescription& wrong) { wrong.layout.positions = VertexFormat::none; });
  add([](InstanceDescription& wrong) { wrong.layout.tangents = VertexFormat::float16x3; });
  add([](InstanceDescription& wrong) { wrong.layout = {.stride = 1}; });
  add([](InstanceDescription& wrong) { wrong.layout = {.stride = 26}; });
  add([](InstanceDescription& wrong) { wrong.layout = {.stride = 1 << 20}; });
  add([](InstanceDescription& wrong) {
    wrong.layout.motion = false;
    wrong.interpolates = true;
  });
  add([](InstanceDescription& wrong) {
    wrong.layout.positions = VertexFormat::snorm16x4;
    wrong.box = {{0, 0, 0}, {0, 1, 1}};
  });

  const auto change = [&](auto set) {
    InstanceChange wrong{.instance = objects.instance};
    set(wrong);
    calls.push_back({[&system, wrong] { return system.change(wrong); }});
    calls.push_back({[&system, wrong] {
      const std::array<InstanceChange, 2> both{InstanceChange{.instance = wrong.instance}, wrong};
      return system.change(both);
    }});
  };
  static const std::array<MorphWeight, 1> none{{{7, 1}}}, notFinite{{{0, NAN}}};
  static const std::array<MorphWeight, 2> twice{{{0, 1}, {0, 1}}};
  change([](InstanceChange& wrong) { wrong.instance = {}; });
  change([&](InstanceChange& wrong) { wrong.instance = objects.removed; });
  change([](InstanceChange& wrong) { wrong.mesh = MeshHandle(); });
  change([](InstanceChange& wrong) { wrong.pose = PoseHandle(); });
  change([](InstanceChange& wrong) { wrong.method = static_cast<Method>(255); });
  change([](InstanceChange& wrong) { wrong.updateInterval = 0; });
  change([](InstanceChange& wrong) { wrong.morphs = none; });
  change([](InstanceChange& wrong) { wrong.morphs = notFinite; });
  change([](InstanceChange& wrong) { wrong.morphs = twice; });
  calls.push_back({[&system, instance = objects.instance] {
    const InstanceVisibility wrong{instance, true, 0};
    return system.setVisibility({&wrong, 1});
  }});

  // Objects that are in use, were removed, or never were.
  const InstanceHandle removed = objects.removed;
  const InstanceDescription used = objects.description;
  calls.push_back({[&system, used] { return system.removeMesh(used.mesh); }});
  calls.push_back({[&system, used] { return system.removePose(used.pose); }});
  calls.push_back({[&system] { return system.removeMesh({}); }});
  calls.push_back({[&system] { return system.removePose({5000, 1}); }});
  calls.push_back({[&system, removed] { return system.removeInstance(removed); }});
  calls.push_back({[&system, removed] { return withoutValue(system.output(removed)); }});
  calls.push_back({[&system, removed] { return withoutValue(system.isDue(removed)); }});
  calls.push_back({[&system, removed] { return withoutValue(system.bounds(removed)); }});
  calls.push_back({[&system] { return withoutValue(system.writePose({})); }});
  calls.push_back({[&system, removed] { return system.markMorphsWritten({&removed, 1}); }});
  const auto draw = [&](std::vector<InstanceHandle> instances, std::size_t ranges,
                        std::size_t draws) {
    calls.push_back({[&system, instances, ranges, draws] {
      std::vector<IndexedDraw> out(draws);
      return system.indexedDraws(instances, std::vector<IndexRange>(ranges), out);
    }});
  };
  draw({objects.instance}, 100, 2);
  draw({removed}, 100, 1);
  draw({objects.instance}, 0, 1);
  const auto drawOther = [&](const VertexLayout& layout) {
    calls.push_back({[&system, used, first = objects.instance, layout]() -> Result<void> {
                       InstanceDescription other = used;
                       other.layout = layout;
                       const Result<InstanceHandle> added = system.addInstance(other);
                       if (!added) return added.error();  // there is no room
                       const std::array<InstanceHandle, 2> both{first, *added};
                       std::array<IndexedDraw, 2> draws;
                       const Result<void> drawn =
                           system.indexedDraws(both, std::vector<IndexRange>(100), draws);
                       return system.removeInstance(*added) ? drawn : Result<void>();
                     },
                     true});
  };
  drawOther({.stride = 200});
  drawOther({.planar = true});

  const auto addPose = [&](std::uint32_t joints, bool writtenByGpu) {
    calls.push_back({[&system, joints, writtenByGpu] {
      return withoutValue(system.addPose(joints, {.writtenByGpu = writtenByGpu}));
    }});
  };
  addPose(0, false);
  addPose(maxPoseJoints + 1, false);
  addPose(maxPoseJoints, false);  // more than the maximum
  calls.push_back({[&system] {
    std::vector<PoseHandle> poses(100);
    return system.addPoses(poses, 1000);
  }});

  // Of instances with a box.
  InstanceDescription boxed = objects.description;
  boxed.layout = {.positions = VertexFormat::snorm16x4};
  boxed.box = {{-1, -1, -1}, {1, 1, 1}};
  const auto addBoxed = [&](std::uint32_t count, auto refused) {
    calls.push_back({[&system, boxed, count, refused]() -> Result<void> {
                       std::vector<InstanceHandle> all;
                       Result<void> error = {};
                       while (error.ok() && all.size() < count) {
                         const Result<InstanceHandle> added = system.addInstance(boxed);
                         if (added) all.push_back(*added);
                         if (!added) error = added.error();  // there is no room
                       }
                       if (error.ok()) error = refused(all.back());
                       for (const InstanceHandle instance : all)
                         if (!system.removeInstance(instance)) return {};
                       return error;
                     },
                     true});
  };
  const std::uint32_t more = 40;  // than there may be
  addBoxed(more, [](InstanceHandle) { return Result<void>(); });
  addBoxed(1, [&system](InstanceHandle instance) {
    return system.change({.instance = instance, .box = Box{{0, 0, 0}, {0, 1, 1}}});
  });
  return calls;
}

/// The texts of at least 12 characters that the errors of a source file are made of, or of a
/// folder's files, in `engine/src`.
std::set<std::string> errorTexts(const std::string& path);

}  // namespace dermis::test
