// The work of samples/python/skin.py in C++: a glTF crowd on the CPU path, on all cores. Prints
// millions of vertices a second, of the best frame. tests/nightly/languages.sh runs both in turn.
//
//   dermis_languages_benchmark MODEL FIGURES FRAMES

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <thread>
#include <vector>

#include "dermis/cpu.h"
#include "dermis/gltf.h"

using namespace dermis;

namespace {

template <typename T>
T must(Result<T> result) {
  if (!result) std::exit((fmt::print("{}\n", result.error().message), 1));
  if constexpr (!std::is_void_v<T>) return std::move(result).value();
}

struct Figure {
  std::uint32_t skin;
  PoseHandle pose;
  double offset;  ///< of its clip, from 0 to 1
};

}  // namespace

int main(int count, char** words) {
  if (count != 4) return 2;
  const gltf::Model model =
      must(gltf::load(words[1], {.missingNormals = gltf::MissingNormals::smooth}));
  const int figureCount = std::atoi(words[2]), frameCount = std::atoi(words[3]);
  cpu::SceneRunner runner = must(cpu::SceneRunner::create());
  Scene& scene = runner.scene();
  std::vector<Figure> figures;
  std::uint64_t vertices = 0;
  for (const gltf::SkinnedPrimitive& skinned : model.skinnedPrimitives) {
    const gltf::Primitive& primitive = model.meshes[skinned.mesh].primitives[skinned.primitive];
    const auto joints = static_cast<std::uint32_t>(model.skins[skinned.skin].joints.size());
    InstanceDescription description;
    description.layout.normals = VertexFormat::float32x3;
    const gltf::PrimitiveView view(primitive);
    description.mesh = must(scene.addMesh(must(pack(view.mesh(), joints))));
    for (int figure = 0; figure < figureCount; ++figure) {
      description.pose = must(scene.addPose(joints));
      static_cast<void>(must(scene.addInstance(description)));
      figures.push_back(
          {skinned.skin, description.pose, static_cast<double>(figure) / figureCount});
      vertices += primitive.vertexCount;
    }
  }
  const double duration = model.clips.empty() ? 0 : model.clips[0].duration;
  std::vector<std::vector<JointMatrix>> poses(figures.size());
  std::vector<std::thread> threads;
  double best = 1e9;
  for (std::uint64_t frame = 1; frame <= static_cast<std::uint64_t>(frameCount); ++frame) {
    for (std::size_t i = 0; i < figures.size(); ++i) {
      const double time = static_cast<double>(frame) / 30 + duration * figures[i].offset;
      poses[i] = gltf::pose(model, figures[i].skin, model.clips.empty() ? noIndex : 0,
                            duration > 0 ? std::fmod(time, duration) : 0);
    }
    const auto begin = std::chrono::steady_clock::now();
    must(scene.beginFrame(frame, frame - 1));
    for (std::size_t i = 0; i < figures.size(); ++i)
      std::ranges::copy(poses[i], must(scene.writePose(figures[i].pose)).begin());
    const std::span<const cpu::PlannedJob> jobs = must(runner.jobs());
    std::atomic<std::size_t> next = 0;
    threads.clear();
    for (unsigned i = 0; i < std::max(1u, std::thread::hardware_concurrency()); ++i) {
      threads.emplace_back([&] {
        for (std::size_t job = next++; job < jobs.size(); job = next++) cpu::run(jobs[job]);
      });
    }
    for (std::thread& thread : threads) thread.join();
    best = std::min(
        best, std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  fmt::print("{:.1f}\n", static_cast<double>(vertices) / best / 1e6);
  return 0;
}
