// An engine in C++17, which embeds Dermis by its C interface alone: a strip that twists, skinned on
// the CPU and checked.
#define DERMIS_VULKAN
#include <cmath>
#include <cstdio>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <vector>

#include "dermis/dermis.h"

static_assert(__cplusplus == 201703L);

namespace {

dermis_error error;

void must(dermis_code code) {
  if (code != DERMIS_OK) throw std::runtime_error(error.message);
}

struct Destroy {
  void operator()(void* object) const { dermis_destroy(object); }
};
template <typename T>
using Owned = std::unique_ptr<T, Destroy>;

int skin() {
  constexpr std::uint32_t count = 100;
  std::vector<float> positions, weights;
  std::vector<std::uint16_t> joints;
  for (std::uint32_t i = 0; i < count; ++i) {
    const float along = static_cast<float>(i / 2) / (count / 2 - 1);
    positions.insert(positions.end(), {i % 2 == 0 ? -0.1f : 0.1f, along, 0});
    weights.insert(weights.end(), {1 - along, along});
    joints.insert(joints.end(), {0, 1});
  }
  const dermis_influence_set influences = {{joints.data(), 0, DERMIS_UINT16, 2},
                                           {weights.data(), 0, DERMIS_FLOAT32, 2}};
  dermis_mesh_view view{};
  view.size = sizeof view;
  view.vertex_count = count;
  view.positions = {positions.data(), 0, DERMIS_FLOAT32, 3};
  view.influence_sets = &influences;
  view.influence_set_count = 1;
  dermis_packed* packed = nullptr;
  must(dermis_pack(&view, 2, &packed, &error));
  const Owned<dermis_packed> mesh(packed);

  dermis_runner* made = nullptr;
  must(dermis_runner_create(nullptr, &made, &error));
  const Owned<dermis_runner> runner(made);
  dermis_scene* scene = dermis_runner_scene(runner.get());
  dermis_instance_desc figure{};
  figure.size = sizeof figure;
  must(dermis_add_mesh(scene, mesh.get(), &figure.mesh, &error));
  dermis_pose_desc pose{};
  pose.size = sizeof pose;
  pose.joint_count = 2;
  must(dermis_add_poses(scene, &pose, 1, &figure.pose, &error));
  dermis_instance instance{};
  must(dermis_add_instance(scene, &figure, &instance, &error));

  must(dermis_begin_frame(scene, 1, 0, &error));
  const float c = std::cos(2.0f), s = std::sin(2.0f);
  const dermis_joint twist[2] = {{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}},
                                 {{{c, 0, s, 0}, {0, 1, 0, 0}, {-s, 0, c, 0}}}};
  dermis_joint* memory = nullptr;
  must(dermis_write_poses(scene, &figure.pose, 1, &memory, nullptr, &error));
  std::memcpy(memory, twist, sizeof twist);
  dermis_runner_frame frame{};
  frame.size = sizeof frame;
  must(dermis_runner_jobs(runner.get(), 0, &frame, &error));
  for (std::uint32_t job = 0; job < frame.job_count; ++job)
    must(dermis_run_job(runner.get(), job, &error));
  dermis_instance_info place{};
  place.size = sizeof place;
  must(dermis_instance_contents(scene, instance, &place, &error));

  dermis_posed_mesh posed{};
  posed.size = sizeof posed;
  posed.mesh = &view;
  posed.joints = twist;
  posed.joint_count = 2;
  dermis_skinned_view skinned{};
  skinned.size = sizeof skinned;
  skinned.vertex_count = count;
  skinned.positions = {static_cast<const char*>(frame.output) + place.offset,
                       place.places.streams[DERMIS_POSITIONS].stride, DERMIS_FORMAT_FLOAT32X3};
  dermis_comparison comparison{};
  comparison.size = sizeof comparison;
  must(dermis_compare(&posed, &skinned, &comparison, &error));
  std::printf("%u vertices, %s\n", count, comparison.passed ? "every one is right" : "WRONG");
  // What needs a device is there, too.
  dermis_context* context = nullptr;
  const bool refused =
      dermis_context_create(nullptr, nullptr, nullptr, &context, &error) != DERMIS_OK;
  return comparison.passed && refused ? 0 : 1;
}

}  // namespace

int main() {
  try {
    return skin();
  } catch (const std::exception& failure) {
    std::printf("%s\n", failure.what());
    return 1;
  }
}
