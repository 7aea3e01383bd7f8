// The reference and `diagnose`. They are a separate library, since engines do not ship them.
#include "dermis/dermis_compare.h"

#include <algorithm>

#include "convert.h"
#include "dermis/verify.h"

using namespace dermis;
using namespace dermis::c;

namespace {

/// A mesh in a pose, skinned by the reference.
reference::SkinnedMesh skin(const dermis_posed_mesh* callers) {
  const dermis_posed_mesh posed = in(callers, "posed");
  const View view(posed.mesh);
  return must(reference::skin(view.mesh, jointsOf(posed.joints, posed.joint_count, "joints"),
                              methodOf(posed.method), morphsOf(posed.morphs, posed.morph_count)));
}

template <typename Vector>
void checkCount(const double* to, std::size_t count, const std::vector<Vector>& from,
                const char* name) {
  if (to == nullptr) return;
  const std::size_t size = from.size() * std::tuple_size_v<Vector>;
  if (from.empty()) fail(std::string("the mesh has no ") + name);
  if (count != size) {
    fail(std::string(name) + " have " + std::to_string(size) + " numbers, not " +
         std::to_string(count));
  }
}
template <typename Vector>
void copyTo(double* to, const std::vector<Vector>& from) {
  if (to == nullptr) return;
  for (const Vector& vector : from) to = std::copy(vector.begin(), vector.end(), to);
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
    checkCount(positions, position_count, skinned.positions, "positions");
    checkCount(normals, normal_count, skinned.normals, "normals");
    checkCount(tangents, tangent_count, skinned.tangents, "tangents");
    copyTo(positions, skinned.positions);
    copyTo(normals, skinned.normals);
    copyTo(tangents, skinned.tangents);
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
