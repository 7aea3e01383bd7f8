// What stands in for instances that wait for room: an instance of the same mesh and layout in a
// pose that is never written, shared by all of them.

#include <algorithm>
#include <cstring>

#include "system/scene.h"

namespace dermis {
namespace {

bool isSame(const Box& a, const Box& b) {
  return std::memcmp(&a, &b, sizeof(Box)) == 0;
}

}  // namespace

Result<InstanceHandle> Scene::acquireBindPose(const SceneInstance& instance) {
  for (BindPose& bindPose : bindPoses_) {
    if (bindPose.mesh == instance.mesh && bindPose.layout == instance.layout &&
        isSame(bindPose.box, instance.box)) {
      ++bindPose.users;
      return bindPose.instance;
    }
  }
  Result<PaletteHandle> palette = addPalette(
      std::max(meshes_.at(instance.mesh.index).info.requiredJoints, std::uint32_t{1}), false);
  if (!palette) return palette.error();
  InstanceDescription description;
  description.mesh = instance.mesh;
  description.palette = *palette;
  // Exact for identities: no sum of weights stands in the result, unlike that of linear.
  description.method = Method::dualQuaternion;
  description.layout = instance.layout;
  description.box = instance.box;
  Result<InstanceHandle> added = insert(description, true);
  if (!added) {
    static_cast<void>(removePalette(*palette).ok());
    return added.error();
  }
  ++internalInstances_;
  bindPoses_.push_back({instance.mesh, instance.layout, instance.box, *added, *palette, 1});
  return *added;
}

void Scene::releaseBindPose(InstanceHandle handle) {
  const auto found =
      std::find_if(bindPoses_.begin(), bindPoses_.end(),
                   [&](const BindPose& bindPose) { return bindPose.instance == handle; });
  if (found == bindPoses_.end() || --found->users != 0) return;
  const PaletteHandle palette = found->palette;
  bindPoses_.erase(found);
  instances_.at(handle.index).isInternal = false;
  static_cast<void>(removeInstance(handle).ok());
  static_cast<void>(removePalette(palette).ok());
  --internalInstances_;
}

}  // namespace dermis
