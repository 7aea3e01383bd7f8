// Checking, repairing and packing meshes; centers of rotation; places of vertices.
#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "convert.h"

using namespace dermis;
using namespace dermis::c;

extern "C" {

dermis_code dermis_validate(const dermis_mesh_view* mesh, uint32_t joint_count,
                            dermis_finding_callback found, void* user, dermis_error* error) {
  return guarded(error, [&] {
    const View view(mesh);
    const MeshReport report = validate(view.mesh, joint_count);
    for (const MeshReport::Finding& finding : report.findings) {
      if (found == nullptr) break;
      const dermis_finding converted{sizeof(dermis_finding),
                                     static_cast<dermis_problem>(finding.problem),
                                     refusedByPack(finding.problem) ? 1u : 0u,
                                     finding.firstVertex,
                                     finding.count,
                                     finding.message.c_str()};
      const dermis_code code = found(user, &converted);
      if (code != DERMIS_OK) fail("the callback stopped the function", code);
    }
    must(report.accepted());
  });
}

dermis_code dermis_repair(const dermis_mesh_view* mesh, uint32_t joint_count,
                          dermis_mesh_view* view, dermis_repaired** repaired, dermis_error* error) {
  return guarded(error, [&] {
    const View broken(mesh);
    checkOut(view, "view");
    dermis_repaired*& result = required(repaired, "repaired");
    auto made = std::make_unique<dermis_repaired>(must(repair(broken.mesh, joint_count)));
    give(view, made->view.mesh);
    result = made.release();
  });
}

dermis_code dermis_pack(const dermis_mesh_view* mesh, uint32_t joint_count, dermis_packed** packed,
                        dermis_error* error) {
  return guarded(error, [&] {
    const View view(mesh);
    dermis_packed*& result = required(packed, "packed");
    result = new dermis_packed(must(pack(view.mesh, joint_count)));
  });
}

dermis_code dermis_joint_bounds_create(const dermis_mesh_view* mesh, uint32_t joint_count,
                                       const float* morph_ranges, uint32_t range_count,
                                       dermis_joint_bounds** bounds, dermis_error* error) {
  return guarded(error, [&] {
    const View view(mesh);
    std::vector<std::array<float, 2>> ranges;
    const auto numbers = array(morph_ranges, std::size_t{2} * range_count, "morph_ranges");
    for (std::size_t i = 0; i < numbers.size(); i += 2)
      ranges.push_back({numbers[i], numbers[i + 1]});
    dermis_joint_bounds*& result = required(bounds, "bounds");
    result = new dermis_joint_bounds(must(jointBounds(view.mesh, joint_count, ranges)));
  });
}

dermis_code dermis_skinned_box(const dermis_joint_bounds* bounds, const dermis_joint* joints,
                               uint32_t joint_count, dermis_method method, dermis_promise promise,
                               dermis_box* box, dermis_error* error) {
  return guarded(error, [&] {
    const JointBounds& mesh = required(bounds, "bounds").bounds;
    dermis_box& result = required(box, "box");
    result = boxOf(skinnedBounds(mesh, jointsOf(joints, joint_count, "joints"), methodOf(method),
                                 promiseOf(promise)));
  });
}

dermis_code dermis_packed_load(const void* bytes, size_t byte_count, dermis_packed** packed,
                               dermis_error* error) {
  return guarded(error, [&] {
    const auto blob = array(static_cast<const std::byte*>(bytes), byte_count, "bytes");
    dermis_packed*& result = required(packed, "packed");
    result = new dermis_packed(must(PackedMesh::fromBytes(blob)));
  });
}

dermis_code dermis_packed_contents(const dermis_packed* packed, dermis_packed_info* info,
                                   dermis_error* error) {
  return guarded(error, [&] {
    const PackedMesh& mesh = required(packed, "packed").mesh;
    checkOut(info, "info");
    const MeshInfo known = mesh.info();
    dermis_packed_info result{};
    result.vertex_count = known.vertexCount;
    result.bytes = mesh.bytes().data();
    result.byte_count = known.byteSize;
    result.required_joints = known.requiredJoints;
    result.max_influences = known.maxInfluences;
    result.min_influences = known.minInfluences;
    result.morph_target_count = known.morphTargetCount;
    result.has_normals = known.hasNormals ? 1 : 0;
    result.has_tangents = known.hasTangents ? 1 : 0;
    result.has_centers_of_rotation = known.hasCentersOfRotation ? 1 : 0;
    give(info, result);
  });
}

dermis_code dermis_centers_of_rotation(const dermis_mesh_view* mesh, uint32_t joint_count,
                                       const uint32_t* triangles, size_t index_count,
                                       uint64_t max_terms, dermis_parallel_callback parallel,
                                       void* user, float* centers, size_t float_count,
                                       dermis_error* error) {
  return guarded(error, [&] {
    const View view(mesh);
    const auto solver = must(CenterOfRotationSolver::make(
        view.mesh, joint_count, array(triangles, index_count, "triangles")));
    const std::span<float> all = array(centers, float_count, "centers");
    if (all.size() != std::size_t{3} * solver.vertexCount()) {
      fail("float_count is " + std::to_string(float_count) + ", not 3 for each of " +
           std::to_string(solver.vertexCount()) + " vertices");
    }
    if (max_terms != 0 && solver.termCount() > max_terms) {
      fail("the centers of rotation have " + std::to_string(solver.termCount()) +
               " terms, more than " + std::to_string(max_terms),
           DERMIS_LIMIT_EXCEEDED);
    }

    struct Work {
      const CenterOfRotationSolver& solver;
      std::span<float> centers;
    };
    // The outputs stay as they are if the callback fails half way.
    std::vector<float> found(all.size());
    Work work{solver, found};
    constexpr std::size_t vertices = 64;  // of a job
    const auto job = [](void* context, uint32_t index) {
      const Work& mine = *static_cast<const Work*>(context);
      const std::size_t first = index * 3 * vertices;
      if (first >= mine.centers.size()) return;  // a callback that counts wrong
      // It cannot fail: the vertices are in the mesh.
      static_cast<void>(mine.solver.solve(
          static_cast<std::uint32_t>(first / 3),
          mine.centers.subspan(first, std::min(3 * vertices, mine.centers.size() - first))));
    };
    const auto count = static_cast<std::uint32_t>((all.size() + 3 * vertices - 1) / (3 * vertices));
    if (parallel == nullptr) {
      for (std::uint32_t i = 0; i < count; ++i) job(&work, i);
    } else {
      const dermis_code code = parallel(user, count, job, &work);
      if (code != DERMIS_OK) fail("the callback stopped the function", code);
    }
    std::copy(found.begin(), found.end(), all.begin());
  });
}

dermis_code dermis_place_vertices(const dermis_layout* layout, uint32_t vertex_count,
                                  uint64_t offset, dermis_places* places, dermis_error* error) {
  return guarded(error, [&] {
    const VertexLayout arrangement = layoutOf(required(layout, "layout"));
    dermis_places& result = required(places, "places");
    result = placesOf(must(placeVertices(arrangement, vertex_count, offset)));
  });
}

}  // extern "C"
