// Rigs.
#include <algorithm>
#include <deque>
#include <memory>

#include "convert.h"

using namespace dermis;
using namespace dermis::c;

namespace {

/// Both have the same bytes.
std::span<const std::array<float, 4>> quaternionsOf(const float* numbers, std::size_t count) {
  static_assert(sizeof(std::array<float, 4>) == 4 * sizeof(float));
  array(numbers, count, "a corrective's rotations");
  return {reinterpret_cast<const std::array<float, 4>*>(numbers), count};
}

std::vector<RigJoint> rigJointsOf(const dermis_rig_joint* joints, std::uint32_t count) {
  std::vector<RigJoint> result;
  for (const dermis_rig_joint& joint : array(joints, count, "joints")) {
    RigJoint& made = result.emplace_back();
    if (joint.parent != 0) made.parent = joint.parent - 1;
    made.bind = jointsOf(&joint.bind, 1, "bind").front();
  }
  return result;
}

JointOffset offsetOf(const dermis_joint_offset& offset) {
  const auto isSet = [](float number) { return number != 0; };
  JointOffset result;
  std::ranges::copy(offset.translation, result.translation.begin());
  if (std::ranges::any_of(offset.rotation, isSet))
    std::ranges::copy(offset.rotation, result.rotation.begin());
  if (std::ranges::any_of(offset.scale, isSet))
    std::ranges::copy(offset.scale, result.scale.begin());
  return result;
}

ChainDriver chainOf(const dermis_chain& chain) {
  return {array(chain.joints, chain.joint_count, "a chain's joints"), chain.first_driven,
          chain.segments};
}

/// A view of what the caller has.
struct RigOfCaller {
  explicit RigOfCaller(const dermis_rig_source* callers) {
    const dermis_rig_source source = in(callers, "source");
    joints_ = rigJointsOf(source.joints, source.joint_count);
    for (const dermis_twist& twist : inArray(source.twists, source.twist_count, "twists")) {
      TwistDriver& made = twists_.emplace_back();
      made.joint = twist.joint;
      made.source = twist.source;
      std::ranges::copy(twist.axis, made.axis.begin());
      made.share = twist.share;
    }
    for (const dermis_corrective& corrective :
         inArray(source.correctives, source.corrective_count, "correctives"))
      correctives_.push_back(correctiveOf(corrective));
    for (const dermis_chain& chain : inArray(source.chains, source.chain_count, "chains"))
      chains_.push_back(chainOf(chain));
    for (const dermis_linear& linear : inArray(source.linears, source.linear_count, "linears")) {
      linears_.push_back({linear.joint,
                          array(linear.weights, linear.count, "a linear driver's weights"),
                          jointsOf(linear.matrices, linear.count, "a linear driver's matrices")});
    }
    view = {.joints = joints_,
            .writtenJoints = source.written_joints,
            .givenWeights = source.given_weights,
            .drivenWeights = source.driven_weights,
            .twists = twists_,
            .correctives = correctives_,
            .chains = chains_,
            .linears = linears_};
    if (source.given_weights != 0) view.weightsOf = source.weights_of;
  }
  RigOfCaller(const RigOfCaller&) = delete;
  RigOfCaller& operator=(const RigOfCaller&) = delete;

  RigView view;

 private:
  CorrectiveDriver correctiveOf(const dermis_corrective& corrective) {
    const std::size_t examples = corrective.example_count;
    CorrectiveDriver made;
    made.inputs = array(corrective.inputs, corrective.input_count, "a corrective's inputs");
    made.examples = quaternionsOf(corrective.rotations, examples * corrective.input_count);
    made.radius = corrective.radius;
    made.firstWeight = corrective.first_weight;
    made.weightCount = corrective.weight_count;
    made.weights =
        array(corrective.weights, examples * corrective.weight_count, "a corrective's weights");
    made.joints = array(corrective.joints, corrective.joint_count, "a corrective's joints");
    std::vector<JointOffset>& moved = offsets_.emplace_back();
    for (const dermis_joint_offset& offset :
         array(corrective.offsets, examples * corrective.joint_count, "a corrective's offsets"))
      moved.push_back(offsetOf(offset));
    made.offsets = moved;
    return made;
  }

  std::vector<RigJoint> joints_;
  std::vector<TwistDriver> twists_;
  std::vector<CorrectiveDriver> correctives_;
  std::vector<ChainDriver> chains_;
  std::vector<LinearDriver> linears_;
  std::deque<std::vector<JointOffset>> offsets_;  ///< of each corrective
};

}  // namespace

extern "C" {

dermis_code dermis_pack_rig(const dermis_rig_source* source, dermis_packed_rig** rig,
                            dermis_error* error) {
  return guarded(error, [&] {
    const RigOfCaller callers(source);
    dermis_packed_rig*& result = required(rig, "rig");
    result = new dermis_packed_rig(must(packRig(callers.view)));
  });
}

dermis_code dermis_packed_rig_load(const void* bytes, size_t byte_count, dermis_packed_rig** rig,
                                   dermis_error* error) {
  return guarded(error, [&] {
    const auto blob = array(static_cast<const std::byte*>(bytes), byte_count, "bytes");
    dermis_packed_rig*& result = required(rig, "rig");
    result = new dermis_packed_rig(must(PackedRig::fromBytes(blob)));
  });
}

dermis_code dermis_packed_rig_contents(const dermis_packed_rig* rig, dermis_packed_rig_info* info,
                                       dermis_error* error) {
  return guarded(error, [&] {
    const PackedRig& known = required(rig, "rig").rig;
    checkOut(info, "info");
    dermis_packed_rig_info result{};
    result.written_joints = known.writtenJoints();
    result.driven_joints = known.drivenJoints();
    result.given_weights = known.givenWeights();
    result.driven_weights = known.drivenWeights();
    result.weights_of = known.weightsOf();
    result.bytes = known.bytes().data();
    result.byte_count = known.bytes().size();
    result.is_rigid = known.isRigid() ? 1 : 0;
    result.residual = known.residual();
    give(info, result);
  });
}

dermis_code dermis_evaluate_rig(const dermis_packed_rig* rig, const dermis_joint* written,
                                uint32_t written_count, const float* given_weights,
                                uint32_t given_count, dermis_joint* driven, uint32_t driven_count,
                                float* weights, uint32_t weight_count, dermis_error* error) {
  return guarded(error, [&] {
    const std::span<dermis_joint> joints = array(driven, driven_count, "driven");
    must(evaluateRig(required(rig, "rig").rig, jointsOf(written, written_count, "written"),
                     array(given_weights, given_count, "given_weights"),
                     {reinterpret_cast<JointMatrix*>(joints.data()), joints.size()},
                     array(weights, weight_count, "weights")));
  });
}

dermis_code dermis_bend_chain(const dermis_mesh_view* mesh, const dermis_rig_joint* joints,
                              uint32_t joint_count, const dermis_chain* chain,
                              dermis_mesh_view* view, dermis_repaired** repaired,
                              dermis_error* error) {
  return guarded(error, [&] {
    const View straight(mesh);
    checkOut(view, "view");
    dermis_repaired*& result = required(repaired, "repaired");
    auto made = std::make_unique<dermis_repaired>(must(
        bendChain(straight.mesh, rigJointsOf(joints, joint_count), chainOf(in(chain, "chain")))));
    give(view, made->view.mesh);
    result = made.release();
  });
}

dermis_code dermis_add_rig(dermis_scene* scene, const dermis_packed_rig* packed, dermis_rig* rig,
                           dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    const PackedRig& added = required(packed, "packed").rig;
    dermis_rig& result = required(rig, "rig");
    result = handleTo<dermis_rig>(must(target.addRig(added)));
  });
}

dermis_code dermis_remove_rig(dermis_scene* scene, dermis_rig rig, dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).removeRig(handleOf(rig))); });
}

}  // extern "C"
