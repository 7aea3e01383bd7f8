#include "skeleton.h"

#include <stdexcept>
#include <utility>

namespace dermis::models {

int Skeleton::add(std::string name, int parent, const Vec3& position, const Vec3& along) {
  joints.push_back({std::move(name), parent, position, turnBetween({0.0, 1.0, 0.0}, unit(along))});
  return static_cast<int>(joints.size()) - 1;
}

int Skeleton::indexOf(const std::string& name) const {
  for (std::size_t joint = 0; joint < joints.size(); ++joint) {
    if (joints[joint].name == name) return static_cast<int>(joint);
  }
  throw std::out_of_range("no joint '" + name + "'");
}

LocalTransform localTransform(const Skeleton& skeleton, std::size_t joint, const JointPose& pose) {
  const Joint& self = skeleton.joints[joint];
  if (self.parent == noParent) return {pose.turn * self.rotation, self.position + pose.offset};
  const Joint& parent = skeleton.joints[static_cast<std::size_t>(self.parent)];
  const Quat toParent = glm::conjugate(parent.rotation);
  return {toParent * pose.turn * self.rotation, toParent * (self.position - parent.position)};
}

}  // namespace dermis::models
