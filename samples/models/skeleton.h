// Joints and clips of a sample model.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "maths.h"

namespace dermis::models {

inline constexpr int noParent = -1;

// The rest pose of a joint in model space. A parent precedes its children.
struct Joint {
  std::string name;
  int parent = noParent;
  Vec3 position{0.0};
  Quat rotation{1.0, 0.0, 0.0, 0.0};
};

struct Skeleton {
  std::vector<Joint> joints;

  // Appends a joint and returns its index. `along` is the direction of its y axis in the rest pose.
  int add(std::string name, int parent, const Vec3& position, const Vec3& along);
  int indexOf(const std::string& name) const;
};

// The pose of a joint. The rotation is relative to the parent, but expressed in the axes of model
// space in the rest pose ("bend about x"), not in the axes of the joint.
struct JointPose {
  Quat turn{1.0, 0.0, 0.0, 0.0};
  Vec3 offset{0.0};  // only for joints without a parent
};

using Pose = std::vector<JointPose>;

struct Clip {
  std::string name;
  std::vector<double> times;
  std::vector<Pose> poses;  // one for each time
};

// The transform of a joint relative to its parent, as in glTF.
struct LocalTransform {
  Quat rotation;
  Vec3 translation;
};
LocalTransform localTransform(const Skeleton& skeleton, std::size_t joint, const JointPose& pose);

// Samples `poseAt(phase)` from phase 0 to 1 in `intervals` steps. The last key has the same bits as
// the first.
template <typename PoseAt>
Clip sampleCycle(std::string name, double duration, int intervals, const PoseAt& poseAt) {
  Clip clip{std::move(name), {}, {}};
  for (int key = 0; key <= intervals; ++key) {
    const double phase = static_cast<double>(key) / static_cast<double>(intervals);
    clip.times.push_back(phase * duration);
    clip.poses.push_back(key == intervals ? clip.poses.front() : poseAt(phase));
  }
  return clip;
}

}  // namespace dermis::models
