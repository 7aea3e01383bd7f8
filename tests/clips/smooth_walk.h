// How smoothly Fox walks, drawn at 60 frames a second as a vertex shader would: skinned in every
// frame or seldom, and drawn between two updates or not. `Engine` is one of SystemEngine and
// CpuEngine.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <functional>
#include <numeric>
#include <optional>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "clip_rig.h"
#include "dermis/gltf.h"
#include "dermis/scene.h"
#include "scene_meshes.h"
#include "test_data.h"

namespace dermis::test {

class SmoothWalk {
 public:
  explicit SmoothWalk(const std::filesystem::path& data)
      : rig_(must(gltf::load(data / "models/Fox/glTF-Binary/Fox.glb"))),
        mesh_(packed(rig_.model)),
        clip_(gltf::findClip(rig_.model, "Walk").value()) {
    if (!rig_.pack()) throw std::runtime_error("Fox has no bank");
  }

  /// Checks the bars of updates in every frame, every second and every fourth.
  template <class Engine>
  void check(const std::function<void(std::optional<Engine>&)>& makeEngine,
             const std::function<void(Engine&, const InstanceDescription&)>& prepare) const {
    const auto largestOf = [&](std::uint32_t interval, bool interpolates) {
      std::optional<Engine> engine;
      makeEngine(engine);
      return run(*engine, prepare, interval, interpolates);
    };
    const auto max = [](const Differences& all) { return *std::ranges::max_element(all); };
    const auto mean = [](const Differences& all) {
      return std::accumulate(all.begin(), all.end(), 0.0) / figures;
    };
    const Differences everyFrame = largestOf(1, false);
    const double full = max(everyFrame);
    EXPECT_GT(full, 1);
    EXPECT_EQ(largestOf(1, true), everyFrame) << "there is nothing to draw between";
    const Differences half = largestOf(2, true), fourth = largestOf(4, true);
    const Differences stepped = largestOf(4, false);
    std::printf(
        "second differences: %.2f in every frame, %.2f and %.2f in every second and fourth; "
        "without interpolation %.2f in every fourth; in the mean %.2f and %.2f\n",
        full, max(half), max(fourth), max(stepped), mean(fourth), mean(stepped));
    EXPECT_LE(max(half), 1.1 * full);
    EXPECT_LE(max(fourth), 2 * full);
    EXPECT_LE(max(fourth), max(stepped) / 3);
    // Where the kinks of the walk lie between two updates depends on the beat.
    EXPECT_LE(mean(fourth), 0.3 * mean(stepped));
    for (std::uint32_t beat = 0; beat < figures; ++beat)
      EXPECT_LE(fourth[beat], stepped[beat] / 3) << beat;
  }

 private:
  using Positions = std::vector<float>;
  /// Of one instance.
  struct Drawn {
    Positions current, previous;
    std::vector<Positions> frames;  ///< the last three
    Positions motion;               ///< sum since the last update
  };
  static constexpr std::uint32_t figures = 4;  ///< on all beats of the largest interval
  using Differences = std::array<double, figures>;
  static constexpr std::uint32_t frameCount = 100;

  static PackedMesh packed(const gltf::Model& model) {
    const gltf::PrimitiveView view(model.meshes[0].primitives[0]);
    return must(pack(view.mesh(), static_cast<std::uint32_t>(model.skins[0].joints.size())));
  }
  static Positions floatsOf(const std::vector<std::byte>& bytes) {
    Positions floats(bytes.size() / sizeof(float));
    std::memcpy(floats.data(), bytes.data(), bytes.size());
    return floats;
  }

  /// The largest second difference of a vertex of each figure, in units of the model a frame
  /// squared.
  template <class Engine>
  Differences run(Engine& engine, const auto& prepare, std::uint32_t interval,
                  bool interpolates) const {
    Scene& scene = engine.scene();
    engine.begin();
    InstanceDescription description;
    description.mesh = engine.addMesh(mesh_);
    description.layout.motion = true;
    description.updateInterval = interval;
    description.interpolates = interpolates;
    const ClipsHandle clips = must(scene.addClips(PackedClips(*rig_.bank)));
    std::array<FigureHandle, figures> playing;
    std::array<InstanceHandle, figures> instances;
    for (std::uint32_t figure = 0; figure < figures; ++figure) {
      playing[figure] = must(scene.addFigure(clips));
      description.pose = must(scene.pose(playing[figure]));
      prepare(engine, description);
      instances[figure] = must(scene.addInstance(description));
    }
    std::array<Drawn, figures> drawn;
    Differences largest{};
    for (std::uint32_t frame = 0; frame < frameCount; ++frame) {
      if (frame != 0) engine.begin();
      const ClipLayer layer{.clip = clip_, .time = static_cast<float>(frame) / 60};
      for (const FigureHandle figure : playing) {
        const FigurePlay play{figure, {&layer, 1}};
        must(scene.play({&play, 1}));
      }
      engine.submit();
      const std::vector<std::byte> bytes = engine.readOutput();
      for (std::uint32_t figure = 0; figure < figures; ++figure) {
        // At first the figure waits for its beat.
        const bool isOnBeat = frame > 2 * interval;
        draw(engine.read(bytes, instances[figure]), must(scene.output(instances[figure])),
             isOnBeat && interpolates, drawn[figure]);
        if (isOnBeat) largest[figure] = std::max(largest[figure], secondDifference(drawn[figure]));
      }
    }
    return largest;
  }
  /// What a vertex shader does, and that its motion vectors are how it moves.
  static void draw(const Streams& streams, const InstanceOutput& output, bool hasMotion,
                   Drawn& drawn) {
    const Positions current = floatsOf(streams[positionStream]);
    const Positions previous = floatsOf(streams[previousStream]);
    const std::size_t count = current.size();
    Positions positions(count), motion(count);
    for (std::size_t i = 0; i < count; ++i) {
      const float t = output.interpolation;
      positions[i] = previous[i] * (1 - t) + current[i] * t;
      motion[i] = (current[i] - previous[i]) * output.motionScale;
    }
    if (drawn.current != current) drawn.motion.assign(count, 0);
    for (std::size_t i = 0; i < count; ++i) drawn.motion[i] += motion[i];
    if (hasMotion) {
      double off = 0, offInSum = 0;
      for (std::size_t i = 0; i < count; ++i) {
        const float moved = positions[i] - drawn.frames.back()[i];
        off = std::max(off, std::abs(double{motion[i]} - double{moved}));
        if (output.interpolation != 1) continue;
        const double all = double{current[i]} - double{previous[i]};
        offInSum = std::max(offInSum, std::abs(double{drawn.motion[i]} - all));
      }
      EXPECT_LT(off, 1e-4) << "of vertices up to 100 units away";
      EXPECT_LT(offInSum, 1e-5) << "between two updates";
    }
    drawn.current = current;
    drawn.frames.push_back(std::move(positions));
    if (drawn.frames.size() > 3) drawn.frames.erase(drawn.frames.begin());
  }
  static double secondDifference(const Drawn& drawn) {
    if (drawn.frames.size() < 3) return 0;
    double largest = 0;
    for (std::size_t i = 0; i < drawn.frames[0].size(); i += 3) {
      double square = 0;
      for (std::size_t axis = i; axis < i + 3; ++axis) {
        const double difference = double{drawn.frames[2][axis]} -
                                  2 * double{drawn.frames[1][axis]} + double{drawn.frames[0][axis]};
        square += difference * difference;
      }
      largest = std::max(largest, std::sqrt(square));
    }
    return largest;
  }

  PackedRig rig_;
  PackedMesh mesh_;
  std::uint32_t clip_;
};

}  // namespace dermis::test
