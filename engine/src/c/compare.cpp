// The reference and `diagnose`. They are a separate library, since engines do not ship them.
#include "dermis/dermis.h"

#include <algorithm>
#include <initializer_list>
#include <optional>

#include "convert.h"
#include "dermis/verify.h"
#include "sources.h"

using namespace dermis;
using namespace dermis::c;

namespace {

/// Numbers for the caller, who may not want them.
struct Numbers {
  template <typename Element>
  Numbers(const std::vector<Element>& elements, double* to, std::size_t count, const char* of)
      : numbers(reinterpret_cast<const double*>(elements.data()),
                elements.size() * sizeof(Element) / sizeof(double)),
        target(to),
        name(of) {
    if (to == nullptr || count == numbers.size()) return;
    fail(std::string(name) + " have " + std::to_string(numbers.size()) + " numbers, not " +
         std::to_string(count));
  }

  std::span<const double> numbers;
  double* target;
  const char* name;
};
/// Writes all of them or, if a count is wrong, none.
void giveAll(std::initializer_list<Numbers> all) {
  for (const Numbers& of : all)
    if (of.target != nullptr) std::ranges::copy(of.numbers, of.target);
}

/// Layers of clips of the caller.
struct Sampled {
  Sampled(const dermis_sampled_clips* callers, bool wantsBounds)
      : given(in(callers, "sampled")), source(in(given.source, "source")) {
    appendLayers(array(given.layers, given.layer_count, "layers"), layers);
    const auto bytes =
        array(static_cast<const std::byte*>(given.bank), given.bank_byte_count, "bank");
    if (given.bank != nullptr) bank.emplace(must(PackedClips::fromBytes(bytes)));
    if (wantsBounds && !bank) fail("there is no bank, from which bounds follow");
  }
  const PackedClips* bankOrNull() const { return bank ? &*bank : nullptr; }
  const RootMotionOptions* rootMotionOrNull() const {
    return source.rootMotion ? &*source.rootMotion : nullptr;
  }

  dermis_sampled_clips given;
  ClipsOfCaller source;
  std::vector<ClipLayer> layers;
  std::optional<PackedClips> bank;
};

reference::SampledPose poseOf(const Sampled& from, std::uint32_t skin) {
  return must(reference::samplePose(from.source.skeleton, from.source.clips, from.source.masks,
                                    from.layers, skin, from.bankOrNull(), from.rootMotionOrNull()));
}

/// A mesh in a pose, skinned by the reference.
reference::SkinnedMesh skin(const dermis_posed_mesh* callers) {
  const dermis_posed_mesh posed = in(callers, "posed");
  const View view(posed.mesh);
  const Method method = methodOf(posed.method);
  const auto morphs = morphsOf(posed.morphs, posed.morph_count);
  const auto joints = jointsOf(posed.joints, posed.joint_count, "joints");
  if (posed.clips == nullptr) return must(reference::skin(view.mesh, joints, method, morphs));
  if (!joints.empty()) fail("there are joints and clips");
  return must(
      reference::skin(view.mesh, poseOf(Sampled(posed.clips, true), posed.skin), method, morphs));
}

SkinnedAttribute attributeOf(const dermis_skinned_attribute& attribute, std::uint32_t count) {
  const auto format = static_cast<VertexFormat>(
      enumerator(attribute.format, DERMIS_FORMAT_OCTAHEDRAL8X2, "the format of an attribute"));
  const std::uint32_t stride = attribute.stride == 0 ? formatSize(format) : attribute.stride;
  return {attribute.data, attribute.data == nullptr ? 0 : count, stride, format};
}

}  // namespace

extern "C" {

dermis_code dermis_reference_skin(const dermis_posed_mesh* posed, double* positions,
                                  size_t position_count, double* normals, size_t normal_count,
                                  double* tangents, size_t tangent_count, dermis_error* error) {
  return guarded(error, [&] {
    const reference::SkinnedMesh skinned = skin(posed);
    if (normals != nullptr && skinned.normals.empty()) fail("the mesh has no normals");
    if (tangents != nullptr && skinned.tangents.empty()) fail("the mesh has no tangents");
    giveAll({{skinned.positions, positions, position_count, "positions"},
             {skinned.normals, normals, normal_count, "normals"},
             {skinned.tangents, tangents, tangent_count, "tangents"}});
  });
}

dermis_code dermis_compare(const dermis_posed_mesh* posed, const dermis_skinned_view* callers,
                           dermis_comparison* comparison, dermis_error* error) {
  return guarded(error, [&] {
    const reference::SkinnedMesh expected = skin(posed);
    const dermis_skinned_view actual = in(callers, "skinned");
    checkOut(comparison, "comparison");
    SkinnedView view;
    view.positions = attributeOf(actual.positions, actual.vertex_count);
    view.normals = attributeOf(actual.normals, actual.vertex_count);
    view.tangents = attributeOf(actual.tangents, actual.vertex_count);
    view.box = boxOf(actual.box);
    if (actual.positions.data == nullptr) fail("the skinned vertices have no positions");
    const Comparison found = must(compareWithReference(expected, view, exemptionsOf(expected)));
    dermis_comparison result{};
    result.passed = found.passed() ? 1 : 0;
    result.worst_position = found.worstPosition;
    result.worst_normal = found.worstNormal;
    result.worst_tangent = found.worstTangent;
    result.largest_position_error = found.largestPositionError;
    result.compared = found.compared;
    result.failures = found.failures;
    result.only_finite = found.exempt.onlyFinite;
    result.skipped = found.exempt.skipped;
    result.out_of_range = found.exempt.outOfRange;
    result.worst_position_vertex = found.worstPositionVertex;
    result.first_failure = found.firstFailure;
    give(comparison, result);
  });
}

dermis_code dermis_reference_pose(const dermis_sampled_clips* sampled, uint32_t skin,
                                  double* joints, size_t joint_count, double* bounds,
                                  size_t bound_count, dermis_error* error) {
  return guarded(error, [&] {
    const Sampled from(sampled, bounds != nullptr);
    const reference::SampledPose pose = poseOf(from, skin);
    giveAll({{pose.joints, joints, joint_count, "joints"},
             {pose.bounds, bounds, bound_count, "bounds"}});
  });
}

dermis_code dermis_reference_weights(const dermis_sampled_clips* sampled, uint32_t node,
                                     double* weights, size_t weight_count, double* bounds,
                                     size_t bound_count, dermis_error* error) {
  return guarded(error, [&] {
    const Sampled from(sampled, bounds != nullptr);
    const reference::SampledWeights result =
        must(reference::sampleWeights(from.source.skeleton, from.source.clips, from.source.masks,
                                      from.layers, node, from.bankOrNull()));
    giveAll({{result.weights, weights, weight_count, "weights"},
             {result.bounds, bounds, bound_count, "bounds"}});
  });
}

dermis_code dermis_reference_motion(const dermis_sampled_clips* sampled, uint32_t clip, double from,
                                    double to, uint32_t hold, double motion[4], double bounds[2],
                                    dermis_error* error) {
  return guarded(error, [&] {
    const Sampled callers(sampled, bounds != nullptr);
    const ClipsOfCaller& source = callers.source;
    if (!source.rootMotion) fail("the source has no root_motion_node");
    const reference::SampledMotion found =
        must(reference::rootMotion(source.skeleton, source.clips, *source.rootMotion, clip, from,
                                   to, hold != 0, callers.bankOrNull()));
    if (motion != nullptr) {
      std::ranges::copy(found.motion.displacement, motion);
      motion[3] = found.motion.turn;
    }
    if (bounds == nullptr) return;
    bounds[0] = found.displacementBound;
    bounds[1] = found.turnBound;
  });
}

dermis_code dermis_reference_rig(const dermis_rig_source* source, const dermis_joint* written,
                                 uint32_t written_count, const float* given_weights,
                                 uint32_t given_count, double* joints, double* joint_bounds,
                                 size_t joint_count, double* weights, double* weight_bounds,
                                 size_t weight_count, dermis_error* error) {
  return guarded(error, [&] {
    const RigOfCaller callers(source);
    const reference::EvaluatedRig result =
        must(reference::evaluateRig(callers.view, jointsOf(written, written_count, "written"),
                                    array(given_weights, given_count, "given_weights")));
    giveAll({{result.joints, joints, joint_count, "joints"},
             {result.jointBounds, joint_bounds, joint_count, "joint_bounds"},
             {result.weights, weights, weight_count, "weights"},
             {result.weightBounds, weight_bounds, weight_count, "weight_bounds"}});
  });
}

dermis_code dermis_diagnose(const dermis_mesh_view* mesh, const dermis_pose_input* callers,
                            dermis_diagnosis* diagnosis, dermis_error* error) {
  return guarded(error, [&] {
    const View view(mesh);
    const dermis_pose_input input = in(callers, "input");
    checkOut(diagnosis, "diagnosis");
    const std::uint32_t joints = input.joint_count, nodes = input.node_count;
    const auto optional = [](const auto* first, std::size_t count) {
      return std::span(first, first == nullptr ? 0 : count);
    };
    const auto matrices = [](const dermis_joint* first, std::uint32_t count) {
      return jointsOf(first, first == nullptr ? 0 : count, "matrices");
    };
    std::vector<std::string_view> names;
    for (const char* name : optional(input.joint_names, joints)) names.push_back(text(name));
    const Diagnosis found = must(
        diagnose(view.mesh, {.jointMatrices = jointsOf(input.joints, joints, "joints"),
                             .triangles = array(input.triangles, input.index_count, "triangles"),
                             .inverseBindMatrices = matrices(input.inverse_bind_matrices, joints),
                             .jointNames = names,
                             .jointNodes = optional(input.joint_nodes, joints),
                             .parents = optional(input.parents, nodes),
                             .localTransforms = matrices(input.local_transforms, nodes)}));
    dermis_diagnosis result{};
    result.mistake = static_cast<dermis_mistake>(found.mistake);
    result.stretch = found.stretch;
    result.mended_stretch = found.mendedStretch;
    cutTo(result.message, found.message);
    give(diagnosis, result);
  });
}

}  // extern "C"
