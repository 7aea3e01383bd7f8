#include "dermis/verify.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "core/text.h"
#include "dermis/mesh.h"
#include "strict_floating_point.h"
#include "verify/bank_error.h"
#include "verify/bind_vertex.h"
#include "verify/conditioning.h"
#include "verify/methods.h"

namespace dermis::reference {
namespace {

using glm::dvec3;

void conditionOf(std::span<const Joint> joints, std::span<const Influence> influences,
                 const dvec3& position, Conditioning& conditioning) {
  double translation = 0, largest = 0;
  const double length = glm::length(position);
  for (const Influence& influence : influences) {
    const Joint& joint = joints[influence.joint];
    translation = std::max(translation, glm::length(joint.translation));
    largest = std::max(largest, joint.largest);
    conditioning.degenerate |= joint.degenerate;
    conditioning.undefined |= !joint.finite;
    if (joint.rigidForKernels) {
      conditioning.rigidShortcut = std::max(conditioning.rigidShortcut, joint.distanceFromRotation);
    }
  }
  conditioning.stretch = largest;
  conditioning.scale = translation + largest * length;
  conditioning.distance = length;
}

MethodInputs methodInputs(const MeshView& mesh, std::size_t vertex) {
  const auto share = [vertex](const AttributeView& view, float whole) {
    return view ? readComponent(view, vertex, 0) : static_cast<double>(whole);
  };
  MethodInputs inputs;
  if (mesh.centersOfRotation) inputs.center = readVector(mesh.centersOfRotation, vertex);
  inputs.dualQuaternionWeight = share(mesh.dualQuaternionWeights, mesh.dualQuaternionWeight);
  inputs.bulgeStrength = share(mesh.bulgeStrengths, mesh.bulgeStrength);
  return inputs;
}

BindVertex skinOrKeep(const VertexToSkin& vertex, Method method, Conditioning& conditioning) {
  const BindVertex& bind = vertex.bind;
  if (vertex.influences.empty()) {
    conditioning.distance = conditioning.scale = glm::length(bind.position);
    return {bind.position, unitOrZero(bind.normal), unitOrZero(bind.tangent), bind.handedness};
  }
  conditionOf(vertex.joints, vertex.influences, bind.position, conditioning);
  return skinVertex(vertex, method, conditioning);
}

Double3 toArray(const dvec3& v) {
  return {v.x, v.y, v.z};
}

/// `errors` is empty unless the joints are those of a bank.
VertexBounds boundsOf(const VertexToSkin& vertex, std::span<const JointError> errors, Method method,
                      Conditioning& conditioning) {
  if (errors.empty() || vertex.influences.empty()) return boundsOf(method, conditioning);
  const BankError error = bankError(vertex, errors, method, conditioning);
  VertexBounds bounds = boundsOf(method, conditioning);
  bounds.position += error.position;
  // Numbers may leave the range of float32, or an inverse bind matrix is singular.
  if (!std::isfinite(bounds.position)) bounds.onlyFinite = bounds.outOfRange = true;
  const auto add = [](double& bound, double more) {
    bound = bound < 0 || !std::isfinite(more) ? -1 : bound + more;
  };
  add(bounds.normal, error.normal);
  add(bounds.tangent, error.tangent);
  return bounds;
}

Result<AnalyzedMesh> analyze(const MeshView& mesh, std::span<const Joint> joints,
                             std::span<const JointError> errors, Method method,
                             std::span<const MorphWeight> morphs) {
  const MeshReport report = validate(
      mesh, static_cast<std::uint32_t>(std::min<std::size_t>(joints.size(), maxPoseJoints)));
  if (const Result<void> accepted = report.accepted(); !accepted) return accepted.error();
  if (method > allMethods.back()) {
    return Error{ErrorCode::invalidArgument, "the number " +
                                                 std::to_string(static_cast<unsigned>(method)) +
                                                 " is not a value of Method"};
  }
  if (needsCentersOfRotation(method) && !mesh.centersOfRotation) {
    return Error{ErrorCode::invalidArgument, "mesh " + inQuotes(mesh.name) + ": " +
                                                 std::string(methodName(method)) +
                                                 " needs centers of rotation, but it has none"};
  }
  const Result<std::vector<ActiveMorph>> active = activeMorphs(mesh, morphs);
  if (!active) return active.error();

  AnalyzedMesh skinned;
  skinned.positions.resize(mesh.vertexCount);
  skinned.conditioning.resize(mesh.vertexCount);
  skinned.bounds.resize(mesh.vertexCount);
  if (mesh.normals) skinned.normals.resize(mesh.vertexCount);
  if (mesh.tangents) skinned.tangents.resize(mesh.vertexCount);

  std::vector<Influence> influences;
  for (std::size_t index = 0; index < mesh.vertexCount; ++index) {
    readInfluences(mesh, index, influences);
    Conditioning& conditioning = skinned.conditioning[index];
    const VertexToSkin vertex{joints, influences, bindVertex(mesh, index, *active, conditioning),
                              methodInputs(mesh, index)};
    const BindVertex result = skinOrKeep(vertex, method, conditioning);
    skinned.bounds[index] = boundsOf(vertex, errors, method, conditioning);
    skinned.positions[index] = toArray(result.position);
    if (mesh.normals) skinned.normals[index] = toArray(result.normal);
    if (mesh.tangents) {
      const dvec3& t = result.tangent;
      skinned.tangents[index] = {t.x, t.y, t.z, result.handedness};
    }
  }
  return skinned;
}

}  // namespace

Result<AnalyzedMesh> analyze(const MeshView& mesh, std::span<const JointMatrix> pose, Method method,
                             std::span<const MorphWeight> morphs) {
  std::vector<Joint> joints;
  joints.reserve(pose.size());
  for (const JointMatrix& matrix : pose) joints.push_back(takeApart(matrix));
  return analyze(mesh, joints, {}, method, morphs);
}

Result<SkinnedMesh> skin(const MeshView& mesh, std::span<const JointMatrix> pose, Method method,
                         std::span<const MorphWeight> morphs) {
  Result<AnalyzedMesh> analyzed = analyze(mesh, pose, method, morphs);
  if (!analyzed) return analyzed.error();
  return SkinnedMesh(std::move(*analyzed));
}

Result<SkinnedMesh> skin(const MeshView& mesh, const SampledPose& pose, Method method,
                         std::span<const MorphWeight> morphs) {
  if (pose.bounds.size() != pose.joints.size() || pose.inverseBind.size() != pose.joints.size()) {
    return Error{ErrorCode::invalidArgument,
                 "the pose has no bounds: samplePose needs the bank for them"};
  }
  if (method <= allMethods.back() && isForComparison(method)) {
    std::string bounded;
    for (const Method other : allMethods) {
      if (isForComparison(other)) continue;
      bounded += (bounded.empty() ? "" : ", ") + std::string(methodName(other));
    }
    return Error{ErrorCode::invalidArgument,
                 std::string(methodName(method)) +
                     " has no bounds for sampled poses; these have: " + bounded};
  }
  std::vector<Joint> joints;
  std::vector<JointError> errors;
  for (std::size_t joint = 0; joint < pose.joints.size(); ++joint) {
    joints.push_back(takeApart(pose.joints[joint]));
    errors.emplace_back(joints.back(), pose.inverseBind[joint], pose.bounds[joint]);
  }
  Result<AnalyzedMesh> analyzed = analyze(mesh, joints, errors, method, morphs);
  if (!analyzed) return analyzed.error();
  return SkinnedMesh(std::move(*analyzed));
}

}  // namespace dermis::reference
