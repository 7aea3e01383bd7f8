// Rigs.
#include <memory>

#include "convert.h"
#include "sources.h"

using namespace dermis;
using namespace dermis::c;

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
