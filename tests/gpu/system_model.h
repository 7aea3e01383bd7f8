// A SkinningSystem as simple as can be: for each instance what its output must hold, whether a
// frame had to skin it, and which places frames under way may still read. `Engine` is one of
// SystemEngine (of vulkan::SkinningSystem) and CpuEngine (of cpu::SkinningSystem).
#pragma once

#include <compare>
#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "cpu_engine.h"
#include "system_test.h"

namespace dermis::test {

/// What positions are made of. Numbers count meshes, poses and sets of morph weights that the test
/// can look up.
struct ShownPose {
  std::uint32_t mesh = 0, pose = 0, morphs = 0;
  Method method = Method::dualQuaternion;
  friend auto operator<=>(const ShownPose&, const ShownPose&) = default;
};

struct ModelPose {
  PoseHandle handle;
  std::uint32_t pose = 0;
};

struct ModelInstance {
  InstanceHandle handle;
  InstanceDescription description;
  std::uint32_t mesh = 0, pose = 0, morphs = 0;
  std::uint32_t vertexCount = 0;
  bool isVisible = true;
  bool isShownByGpu = true;  ///< the word of the frame, where it is culled on the GPU

  // Since the last `record`.
  bool isChanged = true;  ///< its positions are not what they should be
  bool isUrgent = false;  ///< it changed in a way that no interval holds back
  bool teleports = false;
  bool changesMesh = true;
  std::uint32_t waitedFrames = 0;  ///< in which it was changed, but skipped for its interval

  // As of the last `record`.
  InstanceOutput output;
  bool wasDisplayed = false;
  bool isMoving = false;  ///< its previous positions are not its positions
  std::optional<ShownPose> shown, before;

  bool hasPlace() const { return output.size != 0; }
  bool isDisplayed() const { return isVisible && (!description.culledOnGpu || isShownByGpu); }
};

template <class Engine>
class SystemModel {
 public:
  explicit SystemModel(Engine& engine) : engine_(engine) {}

  std::map<std::uint32_t, ModelPose> poses;
  std::vector<ModelInstance> instances;

  bool isPoseUsed(std::uint32_t pose) const;
  bool isMeshUsed(std::uint32_t mesh) const;
  void writePose(std::uint32_t number, std::uint32_t pose);
  /// The instance was removed in the frame that was begun last.
  void remove(std::size_t index);

  /// After `beginFrame`: places are free again, and what the GPU did in the newest complete frame
  /// is known, which is checked.
  void beginFrame();
  /// After `record`: checks what was skinned, settled and moved, and where everything stands.
  void afterRecord();

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
    std::set<std::uint32_t> skinned, settled, moved;
    GpuCounts gpu;
    /// By palette and interval, whether its instances took this frame.
    std::map<std::pair<std::uint32_t, std::uint32_t>, bool> beats;
  };
  ShownPose wantedPose(const ModelInstance& instance) const {
    return {instance.mesh, poses.at(instance.pose).pose, instance.morphs,
            instance.description.method};
  }
  void lock(const InstanceOutput& output);
  void checkPlace(ModelInstance& instance, const InstanceOutput& output, bool isListed);
  void checkPlacesAreApart() const;
  void update(ModelInstance& instance, Lists& lists);
  void updateHidden(ModelInstance& instance, bool isPlaced, const Lists& lists);
  void updateDisplayed(ModelInstance& instance, bool isPlaced, Lists& lists);
  bool isSkinnedNow(const ModelInstance& instance, bool isPlaced, Lists& lists);
  void checkStatistics(const Lists& lists) const;

  Engine& engine_;
  std::vector<Place> locked_;
  std::map<std::uint64_t, GpuCounts> gpuCounts_;  ///< by frame
};

}  // namespace dermis::test
