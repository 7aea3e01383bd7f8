// Joints and clips of a sample model.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "maths.h"

namespace dermis::models {

inline constexpr int noParent = -1;

// A joint's rest pose in the model's space. A parent stands before its children.
struct Joint {
  std::string name;
  int parent = noParent;
  Vec3 position{0.0};
  Quat rotation{1.0, 0.0, 0.0, 0.0};
};

struct Skeleton {
  std::vector<Joint> joints;

  // Appends a joint and returns its index. `along` is where its own y axis points in rest.
  int add(std::string name, int parent, const Vec3& position, const Vec3& along);
  int indexOf(const std::string& name) const;
};

// What a joint does at one moment. The turn is relative to the parent but written along the axes of
// the model's space in rest, as an animator thinks of it ("bend about x"), whatever the joint's own
// axes are.
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

// A joint's transform relative to its parent, as glTF stores it.
struct LocalTransform {
  Quat rotation;
  Vec3 translation;
};
LocalTransform localTransform(const Skeleton& skeleton, std::size_t joint, const JointPose& pose);

// Samples `poseAt(phase)` for phase 0 to 1 in `intervals` steps; the last key repeats the first bit
// for bit.
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
