#include "verify/pose_skeleton.h"

#include <cstddef>
#include <numeric>
#include <string>
#include <utility>

#include "strict_floating_point.h"

namespace dermis::diagnosis {
namespace {

Error refused(std::string message) {
  return {ErrorCode::invalidArgument, std::move(message)};
}

}  // namespace

std::vector<std::uint32_t> orderOf(const std::vector<std::uint32_t>& parents) {
  std::vector<std::vector<std::uint32_t>> children(parents.size());
  std::vector<std::uint32_t> order;
  for (std::uint32_t node = 0; node < parents.size(); ++node) {
    if (parents[node] == noJoint) {
      order.push_back(node);
    } else {
      children[parents[node]].push_back(node);
    }
  }
  for (std::size_t i = 0; i < order.size(); ++i)
    order.insert(order.end(), children[order[i]].begin(), children[order[i]].end());
  if (order.size() != parents.size()) order.clear();
  return order;
}

Result<PoseSkeleton> skeletonOf(const PoseInput& input) {
  const std::size_t count = input.jointMatrices.size();
  const auto isFor = [count](const char* name, std::size_t size) -> Result<void> {
    if (size == 0 || size == count) return {};
    return refused(std::string(name) + " has " + std::to_string(size) + " elements for " +
                   std::to_string(count) + " joints");
  };
  for (const auto& [name, size] :
       {std::pair("PoseInput::inverseBindMatrices", input.inverseBindMatrices.size()),
        std::pair("PoseInput::jointNames", input.jointNames.size()),
        std::pair("PoseInput::jointNodes", input.jointNodes.size())}) {
    if (const Result<void> fits = isFor(name, size); !fits) return fits.error();
  }
  const std::size_t nodes = input.parents.size();
  if (!input.localTransforms.empty() && input.localTransforms.size() != nodes) {
    return refused("PoseInput::localTransforms has " +
                   std::to_string(input.localTransforms.size()) + " elements and parents " +
                   std::to_string(nodes) + "; both have one for each node");
  }
  PoseSkeleton skeleton;
  skeleton.nodeOfJoint.assign(input.jointNodes.begin(), input.jointNodes.end());
  if (skeleton.nodeOfJoint.empty()) {
    skeleton.nodeOfJoint.resize(count);
    std::iota(skeleton.nodeOfJoint.begin(), skeleton.nodeOfJoint.end(), 0u);
  }
  for (const JointMatrix& matrix : input.inverseBindMatrices)
    skeleton.bind.inverseBind.push_back(toAffine(matrix));
  skeleton.names.assign(input.jointNames.begin(), input.jointNames.end());
  if (nodes == 0) return skeleton;

  for (std::uint32_t joint = 0; joint < count; ++joint) {
    if (skeleton.nodeOfJoint[joint] >= nodes) {
      return refused("joint " + std::to_string(joint) + " is node " +
                     std::to_string(skeleton.nodeOfJoint[joint]) +
                     ", but PoseInput::parents has only " + std::to_string(nodes) + " nodes");
    }
  }
  for (const std::uint32_t parent : input.parents)
    skeleton.nodeParents.push_back(parent < nodes ? parent : noJoint);
  skeleton.nodeOrder = orderOf(skeleton.nodeParents);
  if (skeleton.nodeOrder.empty()) return refused("PoseInput::parents form a cycle");
  std::vector<std::uint32_t> jointOfNode(nodes, noJoint);
  for (std::uint32_t joint = 0; joint < count; ++joint)
    jointOfNode[skeleton.nodeOfJoint[joint]] = joint;
  for (const std::uint32_t node : skeleton.nodeOfJoint) {
    std::uint32_t above = skeleton.nodeParents[node];
    while (above != noJoint && jointOfNode[above] == noJoint) above = skeleton.nodeParents[above];
    skeleton.bind.parents.push_back(above == noJoint ? noJoint : jointOfNode[above]);
  }
  for (const JointMatrix& local : input.localTransforms) skeleton.locals.push_back(toAffine(local));
  return skeleton;
}

Pose globalsOf(const PoseSkeleton& skeleton, const Pose& locals) {
  Pose globals = locals;
  for (const std::uint32_t node : skeleton.nodeOrder) {
    const std::uint32_t parent = skeleton.nodeParents[node];
    if (parent != noJoint) globals[node] = globals[parent] * locals[node];
  }
  return globals;
}

Pose rebuild(const PoseSkeleton& skeleton, const Pose& globals) {
  Pose pose;
  for (std::size_t joint = 0; joint < skeleton.nodeOfJoint.size(); ++joint)
    pose.push_back(globals[skeleton.nodeOfJoint[joint]] * skeleton.bind.inverseBind[joint]);
  return pose;
}

}  // namespace dermis::diagnosis
