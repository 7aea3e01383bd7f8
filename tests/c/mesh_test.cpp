// The C interface against that of C++: meshes, errors, and the numbers of enums.

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <vector>

#include "c_helpers.h"
#include "dermis/cpu.h"
#include "dermis/dermis.h"
#include "dermis/verify.h"

namespace dermis::test {
namespace {

// The numbers of C are those of C++, but for methods, where 0 is the default.
static_assert(DERMIS_HEADER_VERSION ==
              DERMIS_VERSION_MAJOR * 10000 + DERMIS_VERSION_MINOR * 100 + DERMIS_VERSION_PATCH);
static_assert(DERMIS_INVALID_ARGUMENT == static_cast<int>(ErrorCode::invalidArgument) + 1);
static_assert(DERMIS_IO_ERROR == static_cast<int>(ErrorCode::ioError) + 1);
static_assert(DERMIS_METHOD_LINEAR == static_cast<int>(Method::linear) + 1);
static_assert(DERMIS_METHOD_BULGE_CONTROLLED == static_cast<int>(Method::bulgeControlled) + 1);
static_assert(DERMIS_UINT32 == static_cast<int>(ComponentType::uint32));
static_assert(DERMIS_UNORM8 == static_cast<int>(ComponentType::unorm8));
static_assert(DERMIS_FORMAT_OCTAHEDRAL8X2 == static_cast<int>(VertexFormat::octahedral8x2));
static_assert(DERMIS_FORMAT_SNORM16X4 == static_cast<int>(VertexFormat::snorm16x4));
static_assert(DERMIS_PROMISE_RIGID == static_cast<int>(JointPromise::rigid));
static_assert(DERMIS_MORPH_WRITER_GPU == static_cast<int>(MorphWriter::gpu));
static_assert(DERMIS_MORPH_WRITER_CLIPS == static_cast<int>(MorphWriter::clips));
static_assert(DERMIS_PROBLEM_TANGENT_SIGN == static_cast<int>(MeshProblem::tangentSign));
static_assert(DERMIS_PROBLEM_JOINT_OUT_OF_RANGE == static_cast<int>(MeshProblem::jointOutOfRange));
static_assert(DERMIS_PREVIOUS_POSITIONS == static_cast<int>(Stream::previousPositions));
static_assert(DERMIS_BUFFER_ROLE_COUNT == bufferRoleCount);
static_assert(DERMIS_BUFFER_GPU_POSES == static_cast<int>(BufferRole::gpuPoses));
static_assert(DERMIS_USE_INDIRECT_READ == static_cast<int>(Use::indirectRead));
static_assert(DERMIS_USE_COPY_READ == static_cast<int>(Use::copyRead));
static_assert(DERMIS_VISIBILITY_BUFFER == visibilityBuffer);

TEST(CMeshTest, AViewOfCIsTheSameMesh) {
  CMesh source(1);
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(&source.view, source.jointCount, &packed, &error));
  const PackedMesh expected = must(pack(source.mesh.view(), source.jointCount));
  dermis_packed_info info = sized<dermis_packed_info>();
  expectOk(dermis_packed_contents(packed, &info, &error));
  ASSERT_EQ(info.byte_count, expected.bytes().size());
  EXPECT_TRUE(isSame(info.bytes, expected.bytes().data(), info.byte_count));
  const MeshInfo known = expected.info();
  EXPECT_EQ(info.vertex_count, known.vertexCount);
  EXPECT_EQ(info.required_joints, known.requiredJoints);
  EXPECT_EQ(info.max_influences, known.maxInfluences);
  EXPECT_EQ(info.min_influences, known.minInfluences);
  EXPECT_EQ(info.morph_target_count, known.morphTargetCount);
  EXPECT_EQ(info.has_normals, 1u);
  EXPECT_EQ(info.has_tangents, 1u);
  EXPECT_EQ(info.has_centers_of_rotation, 1u);

  Owned<dermis_packed> loaded;
  expectOk(dermis_packed_load(info.bytes, info.byte_count, &loaded, &error));
  expectError(dermis_packed_load(info.bytes, info.byte_count - 16, &loaded, &error), "",
              DERMIS_INVALID_DATA);
}

TEST(CMeshTest, ScalesOfZeroAreOne) {
  CMesh source(2);
  const auto bytes = [&] {
    Owned<dermis_packed> packed;
    dermis_packed_info info = sized<dermis_packed_info>();
    expectOk(dermis_pack(&source.view, source.jointCount, &packed, &error));
    expectOk(dermis_packed_contents(packed, &info, &error));
    const auto* first = static_cast<const std::byte*>(info.bytes);
    return std::vector<std::byte>(first, first + info.byte_count);
  };
  const auto zeros = bytes();
  for (float& scale : source.view.position_scale) scale = 1;
  for (dermis_morph_target& target : source.targets) {
    for (float& scale : target.position_scale) scale = 1;
  }
  EXPECT_EQ(bytes(), zeros);
  source.view.position_scale[1] = 0;  // a flat mesh
  EXPECT_NE(bytes(), zeros);
}

TEST(CMeshTest, ATargetWithoutVerticesDisplacesNothing) {
  CMesh source(3);
  source.targets[1].vertex_count = 0;
  Owned<dermis_packed> packed;
  expectOk(dermis_pack(&source.view, source.jointCount, &packed, &error));
  source.targets[1].vertices = nullptr;  // now all vertices, for which there are not enough
  source.targets[1].positions = {};
  source.targets[1].normals = {};
  source.targets[1].tangents = {};
  Owned<dermis_packed> absent;
  expectOk(dermis_pack(&source.view, source.jointCount, &absent, &error));
  dermis_packed_info a = sized<dermis_packed_info>(), b = a;
  expectOk(dermis_packed_contents(packed, &a, &error));
  expectOk(dermis_packed_contents(absent, &b, &error));
  ASSERT_EQ(a.byte_count, b.byte_count);
  EXPECT_TRUE(isSame(a.bytes, b.bytes, a.byte_count));
}

TEST(CMeshTest, FindingsAndRepair) {
  CMesh source(4);
  source.mesh.weights[2] = -1;
  source.mesh.positions[7] = std::numeric_limits<float>::quiet_NaN();
  const MeshReport expected = validate(source.mesh.view(), source.jointCount);
  std::vector<std::string> messages;
  const dermis_finding_callback collect = [](void* user, const dermis_finding* finding) {
    static_cast<std::vector<std::string>*>(user)->push_back(
        std::string(finding->message) + std::to_string(finding->problem) +
        std::to_string(finding->count) + std::to_string(finding->first_vertex) +
        std::to_string(finding->is_refused));
    return DERMIS_OK;
  };
  expectError(dermis_validate(&source.view, source.jointCount, collect, &messages, &error),
              "a mesh of C", DERMIS_INVALID_MESH);
  ASSERT_EQ(messages.size(), expected.findings.size());
  for (std::size_t i = 0; i < messages.size(); ++i) {
    const MeshReport::Finding& finding = expected.findings[i];
    std::string message = finding.message;
    message.replace(message.find("random"), 6, "a mesh of C");
    EXPECT_EQ(messages[i], message + std::to_string(static_cast<int>(finding.problem)) +
                               std::to_string(finding.count) + std::to_string(finding.firstVertex) +
                               std::to_string(refusedByPack(finding.problem) ? 1 : 0));
  }
  const dermis_finding_callback stop = [](void*, const dermis_finding*) {
    return DERMIS_LIMIT_EXCEEDED;
  };
  expectError(dermis_validate(&source.view, source.jointCount, stop, nullptr, &error), "callback",
              DERMIS_LIMIT_EXCEEDED);
  // A number that is none of Dermis.
  const dermis_finding_callback fails = [](void*, const dermis_finding*) {
    return static_cast<dermis_code>(0xfffffffeu);
  };
  expectError(dermis_validate(&source.view, source.jointCount, fails, nullptr, &error), "callback",
              static_cast<dermis_code>(0xfffffffeu));

  Owned<dermis_packed> packed;
  expectError(dermis_pack(&source.view, source.jointCount, &packed, &error), "a mesh of C",
              DERMIS_INVALID_MESH);
  EXPECT_EQ(packed.object, nullptr);
  Owned<dermis_repaired> repaired;
  dermis_mesh_view view = sized<dermis_mesh_view>();
  expectOk(dermis_repair(&source.view, source.jointCount, &view, &repaired, &error));
  expectOk(dermis_pack(&view, source.jointCount, &packed, &error));
  const RepairedMesh right = must(repair(source.mesh.view(), source.jointCount));
  const PackedMesh expectedMesh = must(pack(right.view(), source.jointCount));
  dermis_packed_info info = sized<dermis_packed_info>();
  expectOk(dermis_packed_contents(packed, &info, &error));
  ASSERT_EQ(info.byte_count, expectedMesh.bytes().size());
  EXPECT_TRUE(isSame(info.bytes, expectedMesh.bytes().data(), info.byte_count));
}

TEST(CMeshTest, CentersOfRotation) {
  CMesh source(5, 200);
  std::vector<std::uint32_t> triangles;
  for (std::uint32_t i = 0; i + 2 < 200; ++i) triangles.insert(triangles.end(), {i, i + 1, i + 2});
  const auto solver =
      must(CenterOfRotationSolver::make(source.mesh.view(), source.jointCount, triangles));
  std::vector<float> expected(600), alone(600), shared(600, 7);
  must(solver.solve(0, expected));
  expectOk(dermis_centers_of_rotation(&source.view, source.jointCount, triangles.data(),
                                      triangles.size(), solver.termCount(), nullptr, nullptr,
                                      alone.data(), alone.size(), &error));
  EXPECT_EQ(alone, expected);
  const dermis_parallel_callback backwards = [](void*, uint32_t count, void (*job)(void*, uint32_t),
                                                void* context) {
    for (uint32_t i = count + 3; i-- > 0;) job(context, i);  // more than there are: ignored
    return DERMIS_OK;
  };
  expectOk(dermis_centers_of_rotation(&source.view, source.jointCount, triangles.data(),
                                      triangles.size(), 0, backwards, nullptr, shared.data(),
                                      shared.size(), &error));
  EXPECT_EQ(shared, expected);
  expectError(dermis_centers_of_rotation(&source.view, source.jointCount, triangles.data(),
                                         triangles.size(), solver.termCount() - 1, nullptr, nullptr,
                                         alone.data(), alone.size(), &error),
              "terms", DERMIS_LIMIT_EXCEEDED);
  expectError(
      dermis_centers_of_rotation(&source.view, source.jointCount, triangles.data(),
                                 triangles.size(), 0, nullptr, nullptr, alone.data(), 599, &error),
      "float_count is 599");
}

TEST(CMeshTest, BoxesAreThoseOfCpp) {
  CMesh source(4);
  const std::vector<JointMatrix> pose = samples::randomPose(3, 8, samples::Rigidity::shear);
  const auto* joints = reinterpret_cast<const dermis_joint*>(pose.data());
  const float ranges[] = {0, 0.5f, -1, 1, 0.25f, 0.25f};
  const std::array<float, 2> same[] = {{0, 0.5f}, {-1, 1}, {0.25f, 0.25f}};
  for (const bool hasRanges : {false, true}) {
    Owned<dermis_joint_bounds> bounds;
    expectOk(dermis_joint_bounds_create(&source.view, 8, hasRanges ? ranges : nullptr,
                                        hasRanges ? 3 : 0, &bounds, &error));
    const JointBounds expected = must(hasRanges ? jointBounds(source.mesh.view(), 8, same)
                                                : jointBounds(source.mesh.view(), 8));
    for (const dermis_promise promise : {DERMIS_PROMISE_SCALING, DERMIS_PROMISE_SCALE_IGNORED}) {
      dermis_box box{};
      expectOk(dermis_skinned_box(bounds, joints, 8, DERMIS_METHOD_BLENDED, promise, &box, &error));
      const Box found =
          skinnedBounds(expected, pose, Method::blended, static_cast<JointPromise>(promise));
      EXPECT_TRUE(isSame(&box, &found, sizeof(box)));
      EXPECT_LT(box.min[0], box.max[0]);
    }
    dermis_box box{};
    expectError(dermis_skinned_box(bounds, nullptr, 8, DERMIS_METHOD_BLENDED,
                                   DERMIS_PROMISE_SCALING, &box, &error),
                "joints is null");
  }
  Owned<dermis_joint_bounds> none;
  expectError(dermis_joint_bounds_create(&source.view, 8, ranges, 2, &none, &error), "");
  expectError(dermis_joint_bounds_create(&source.view, 8, nullptr, 3, &none, &error),
              "morph_ranges is null");
}

TEST(CMeshTest, PlacesAreThoseOfCpp) {
  for (const bool planar : {false, true}) {
    const dermis_layout layout = {DERMIS_FORMAT_SNORM16X4,
                                  DERMIS_FORMAT_OCTAHEDRAL16X2,
                                  DERMIS_FORMAT_OCTAHEDRAL8X2,
                                  1,
                                  planar ? 1u : 0u,
                                  0};
    const VertexLayout same{VertexFormat::snorm16x4, VertexFormat::octahedral16x2,
                            VertexFormat::octahedral8x2, true, planar};
    const std::uint64_t alignment = must(placeVertices(same, 10)).alignment;
    const VertexPlaces expected = must(placeVertices(same, 10, 2 * alignment));
    dermis_places places{};
    expectOk(dermis_place_vertices(&layout, 10, 2 * alignment, &places, &error));
    EXPECT_EQ(places.byte_count, expected.size);
    EXPECT_EQ(places.alignment, expected.alignment);
    for (std::size_t i = 0; i < streamCount; ++i) {
      EXPECT_EQ(places.streams[i].offset, expected.attributes[i].offset);
      EXPECT_EQ(places.streams[i].stride, expected.attributes[i].stride);
      EXPECT_EQ(static_cast<int>(places.streams[i].format),
                static_cast<int>(expected.attributes[i].format));
    }
    expectError(dermis_place_vertices(&layout, 10, 2 * alignment + 1, &places, &error),
                "multiple of");
  }
}

// What is wrong is named, and nothing is read or written beside it.
TEST(CMeshTest, PointersSizesAndEnumsAreChecked) {
  CMesh source(6);
  Owned<dermis_packed> packed;
  expectError(dermis_pack(nullptr, 8, &packed, &error), "mesh is null");
  expectError(dermis_pack(&source.view, 8, nullptr, &error), "packed is null");
  EXPECT_EQ(dermis_pack(nullptr, 8, &packed, nullptr), DERMIS_INVALID_ARGUMENT);
  dermis_mesh_view view = source.view;
  view.size = 12;
  expectError(dermis_pack(&view, 8, &packed, &error), "mesh: its size is 12, not ");
  view = source.view;
  view.influence_sets = nullptr;
  expectError(dermis_pack(&view, 8, &packed, &error), "influence_sets is null");
  view = source.view;
  view.normals.type = static_cast<dermis_component>(9);
  expectError(dermis_pack(&view, 8, &packed, &error), "component type of an attribute is 9");
  view.normals.type = static_cast<dermis_component>(256);  // 0 as a byte
  expectError(dermis_pack(&view, 8, &packed, &error), "component type of an attribute is 256");
  dermis_layout layout{};
  const std::uint32_t large = 0x80000001;  // no enumerator, and not a value of the type
  std::memcpy(&layout.tangents, &large, sizeof(large));
  dermis_places unplaced{};
  expectError(dermis_place_vertices(&layout, 1, 0, &unplaced, &error), "tangents is 2147483649");
  layout = {};
  layout.normals = static_cast<dermis_format>(257);
  dermis_places places{};
  expectError(dermis_place_vertices(&layout, 1, 0, &places, &error),
              "format of the normals is 257");
  EXPECT_EQ(packed.object, nullptr);
  dermis_destroy(nullptr);

  // A caller with a newer header.
  struct Newer {
    dermis_mesh_view view;
    std::uint64_t added;
  } newer{source.view, 0};
  newer.view.size = sizeof(newer);
  expectOk(dermis_pack(&newer.view, 8, &packed, &error));
  newer.added = 1;
  Owned<dermis_packed> other;
  expectError(dermis_pack(&newer.view, 8, &other, &error), "does not know");
  struct NewerInfo {
    dermis_packed_info info = sized<dermis_packed_info>();
    std::uint64_t added = 5;
  } info;
  info.info.size = sizeof(info);
  expectOk(dermis_packed_contents(packed, &info.info, &error));
  EXPECT_EQ(info.info.vertex_count, 50u);
  EXPECT_EQ(info.info.size, sizeof(info));
  EXPECT_EQ(info.added, 5u);
}

// Messages name functions and members of C. Names of the caller stay.
TEST(CMeshTest, MessagesSpeakOfC) {
  CMesh source(10);
  source.mesh.weights[0] = -1;
  source.view.name = "beginFrame";
  Owned<dermis_packed> packed;
  expectError(dermis_pack(&source.view, 8, &packed, &error), "mesh 'beginFrame'",
              DERMIS_INVALID_MESH);
  dermis_pack(&source.view, 8, &packed, &error);
  EXPECT_NE(std::string(error.message).find("dermis_repair"), std::string::npos) << error.message;
  EXPECT_EQ(std::string(error.message).find("repair()"), std::string::npos) << error.message;
}

TEST(CMeshTest, ALongMessageIsCutBetweenCharacters) {
  for (std::size_t shift = 0; shift < 3; ++shift) {
    std::string path(shift, 'x');
    for (int euro = 0; euro < 300; ++euro) path += "\u20ac";  // three bytes each
    dermis_model_source source = sized<dermis_model_source>();
    source.path = path.c_str();
    Owned<dermis_model> model;
    std::memset(&error, 'x', sizeof(error));
    EXPECT_EQ(dermis_model_load(&source, &model, &error), DERMIS_IO_ERROR);
    const std::string message = error.message;
    EXPECT_LT(message.size(), sizeof(error.message));
    EXPECT_GT(message.size(), sizeof(error.message) - 4);
    for (std::size_t i = 0; i < message.size();) {
      i += static_cast<unsigned char>(message[i]) < 0x80 ? 1u : 3u;
      EXPECT_LE(i, message.size()) << "the last character is cut";
    }
  }
}

TEST(CMeshTest, TheReferenceIsThatOfCpp) {
  CMesh source(8);
  const std::vector<JointMatrix> pose = samples::randomPose(3, 8, samples::Rigidity::shear);
  const dermis_morph_weight morphs[] = {{0, 0.5f}, {2, -1}};
  dermis_posed_mesh posed = sized<dermis_posed_mesh>();
  posed.mesh = &source.view;
  posed.joints = reinterpret_cast<const dermis_joint*>(pose.data());
  posed.joint_count = 8;
  posed.morphs = morphs;
  posed.morph_count = 2;
  posed.method = DERMIS_METHOD_BLENDED;
  std::vector<double> positions(150), normals(150), tangents(200);
  expectOk(dermis_reference_skin(&posed, positions.data(), 150, normals.data(), 150,
                                 tangents.data(), 200, &error));
  const MorphWeight same[] = {{0, 0.5f}, {2, -1}};
  const auto expected = must(reference::skin(source.mesh.view(), pose, Method::blended, same));
  EXPECT_TRUE(isSame(positions.data(), expected.positions.data(), 150 * sizeof(double)));
  EXPECT_TRUE(isSame(normals.data(), expected.normals.data(), 150 * sizeof(double)));
  EXPECT_TRUE(isSame(tangents.data(), expected.tangents.data(), 200 * sizeof(double)));
  expectError(dermis_reference_skin(&posed, positions.data(), 149, nullptr, 0, nullptr, 0, &error),
              "positions have 150 numbers, not 149");

  std::vector<float> skinned(150);
  for (std::size_t i = 0; i < 150; ++i) skinned[i] = static_cast<float>(positions[i]);
  dermis_skinned_view view = sized<dermis_skinned_view>();
  view.vertex_count = 50;
  view.positions = {skinned.data(), 12, DERMIS_FORMAT_FLOAT32X3};
  dermis_comparison comparison = sized<dermis_comparison>();
  expectOk(dermis_compare(&posed, &view, &comparison, &error));
  EXPECT_EQ(comparison.passed, 1u);
  EXPECT_EQ(comparison.compared + comparison.only_finite + comparison.out_of_range, 50u);
  skinned[30] += 1;
  expectOk(dermis_compare(&posed, &view, &comparison, &error));
  EXPECT_EQ(comparison.passed, 0u);
  EXPECT_EQ(comparison.failures, 1u);
  EXPECT_EQ(comparison.first_failure, 10u);
  EXPECT_EQ(comparison.worst_position_vertex, 10u);
  EXPECT_NEAR(comparison.largest_position_error, 1, 1e-5);
  // Relative to a box: 4 components of 16 bits.
  std::vector<std::int16_t> stored(200, 32767);
  view.box = {{-32, -32, -32}, {32, 32, 32}};
  for (std::size_t i = 0; i < 150; ++i) {
    stored[i / 3 * 4 + i % 3] = static_cast<std::int16_t>(std::lround(positions[i] / 32 * 32767));
  }
  view.positions = {stored.data(), 8, DERMIS_FORMAT_SNORM16X4};
  expectOk(dermis_compare(&posed, &view, &comparison, &error));
  EXPECT_EQ(comparison.passed, 1u);
  view.positions.stride = 0;  // packed
  expectOk(dermis_compare(&posed, &view, &comparison, &error));
  EXPECT_EQ(comparison.passed, 1u);
  stored[0] = static_cast<std::int16_t>(stored[0] / 2 + 1000);
  expectOk(dermis_compare(&posed, &view, &comparison, &error));
  EXPECT_EQ(comparison.passed, 0u) << "the box is not that of the view";
  view.vertex_count = 49;
  expectError(dermis_compare(&posed, &view, &comparison, &error), "");
}

TEST(CMeshTest, TheDiagnosisIsThatOfCpp) {
  static_assert(DERMIS_MISTAKE_WEIGHT_SET == static_cast<int>(PoseMistake::weightSet));
  static_assert(DERMIS_MISTAKE_ROOT_MISSING == static_cast<int>(PoseMistake::rootMissing));
  // A chain of joints along y, one apart, that bends; the inverse bind matrices are left out.
  CMesh source(9, 90, 9);
  std::vector<JointMatrix> inverse(9), local(9), globals(9);
  std::vector<std::uint32_t> parents(9), nodes(9), triangles;
  std::vector<std::string> names;
  for (std::uint32_t joint = 0; joint < 9; ++joint) {
    inverse[joint].m[1][3] = -static_cast<float>(joint);
    local[joint] = {
        {{0.98f, -0.199f, 0, 0}, {0.199f, 0.98f, 0, joint == 0 ? 0.0f : 1.0f}, {0, 0, 1, 0}}};
    parents[joint] = joint == 0 ? 0xffffffff : joint - 1;
    nodes[joint] = joint;
    names.push_back("joint " + std::to_string(joint));
    globals[joint] = local[joint];
    if (joint == 0) continue;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 4; ++column) {
        const auto& parent = globals[joint - 1].m;
        globals[joint].m[row][column] = parent[row][0] * local[joint].m[0][column] +
                                        parent[row][1] * local[joint].m[1][column] +
                                        parent[row][2] * local[joint].m[2][column] +
                                        (column == 3 ? parent[row][3] : 0);
      }
    }
  }
  for (std::uint32_t vertex = 0; vertex < 90; ++vertex) {
    source.mesh.positions[3 * vertex] = 0.2f * static_cast<float>(vertex % 3);
    source.mesh.positions[3 * vertex + 1] = static_cast<float>(vertex) / 10;
    for (std::uint32_t i = 0; i < 4; ++i) {
      source.mesh.joints[4 * vertex + i] = vertex / 10;
      source.mesh.weights[4 * vertex + i] = 0.25f;
    }
    if (vertex > 1) triangles.insert(triangles.end(), {vertex - 2, vertex - 1, vertex});
  }
  std::vector<const char*> cNames;
  std::vector<std::string_view> views;
  for (const std::string& name : names) {
    cNames.push_back(name.c_str());
    views.push_back(name);
  }
  const auto matrices = [](const std::vector<JointMatrix>& of) {
    return reinterpret_cast<const dermis_joint*>(of.data());
  };
  dermis_pose_input input = sized<dermis_pose_input>();
  input.joint_count = input.node_count = 9;
  input.joints = matrices(globals);
  dermis_diagnosis diagnosis = sized<dermis_diagnosis>();
  expectOk(dermis_diagnose(&source.view, &input, &diagnosis, &error));
  Diagnosis expected = must(diagnose(source.mesh.view(), {.jointMatrices = globals}));
  EXPECT_EQ(diagnosis.mistake, static_cast<int>(expected.mistake));
  input.triangles = triangles.data();
  input.index_count = triangles.size();
  input.inverse_bind_matrices = matrices(inverse);
  input.joint_names = cNames.data();
  input.joint_nodes = nodes.data();
  input.parents = parents.data();
  input.local_transforms = matrices(local);
  expectOk(dermis_diagnose(&source.view, &input, &diagnosis, &error));
  expected = must(diagnose(source.mesh.view(), {.jointMatrices = globals,
                                                .triangles = triangles,
                                                .inverseBindMatrices = inverse,
                                                .jointNames = views,
                                                .jointNodes = nodes,
                                                .parents = parents,
                                                .localTransforms = local}));
  EXPECT_EQ(diagnosis.mistake, DERMIS_MISTAKE_INVERSE_BIND_MISSING) << diagnosis.message;
  EXPECT_EQ(diagnosis.message, expected.message);
  EXPECT_EQ(diagnosis.stretch, expected.stretch);
  EXPECT_EQ(diagnosis.mended_stretch, expected.mendedStretch);
  input.joints = nullptr;
  expectError(dermis_diagnose(&source.view, &input, &diagnosis, &error), "joints is null");
}

}  // namespace
}  // namespace dermis::test
