// Calls of the C interface that need no scene: import, batches, the reference and models.
#pragma once

#include <bit>
#include <cmath>
#include <fstream>
#include <iterator>

#include "c_calls.h"
#include "dermis/dermis.h"

namespace dermis::fuzz {

struct Packed {
  Owned<dermis_packed> packed;
  dermis_packed_info info;
};
inline std::string readFile(const char* path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

class Imports : protected Arguments {
 protected:
  Imports(const std::uint8_t* bytes, std::size_t size) : Arguments(bytes, size) {}

  // ---- Import.

  void keep(Owned<dermis_packed> packed) {
    const auto info = filled<dermis_packed_info>();
    const auto code = call({&info}, dermis_packed_contents, packed.get(), info.get());
    expect((code == DERMIS_OK) == info.isValid);
    if (!info.isValid) return;
    expect(info->required_joints <= 65536 && info->bytes != nullptr);
    if (packed_.size() >= 6) packed_.erase(packed_.begin());
    packed_.push_back({std::move(packed), *info.get()});
  }
  dermis_code packView(const dermis_mesh_view* view, std::uint32_t joints) {
    const Made<dermis_packed> made;
    const auto code = call({&made}, dermis_pack, view, joints, made.get());
    if (code == DERMIS_OK) keep(made.take());
    return code;
  }
  static dermis_code found(void* user, const dermis_finding* finding) {
    expect(finding->size == sizeof(*finding) && finding->message[0] != '\0');
    return static_cast<Imports*>(user)->sometimesStop(77);
  }
  dermis_code sometimesStop(int code) {
    if (!seldom()) return DERMIS_OK;
    codes_.insert(code);
    return static_cast<dermis_code>(code);
  }
  void pack() {
    auto mesh = makeMesh();
    const auto view = given(mesh->view);
    const auto code = packView(view.get(), mesh->joints);
    if (!view.isValid) expect(code == DERMIS_INVALID_ARGUMENT);
    if (view.isValid && mesh->isGood) expect(code == DERMIS_OK);
    const auto report = call({}, dermis_validate, view.get(), mesh->joints, orNull(&found), this);
    if (report != 77 && mesh->joints > 0) expect((report == DERMIS_OK) == (code == DERMIS_OK));
    if (!view.isValid) return;
    if (meshes_.size() >= 4) meshes_.erase(meshes_.begin());
    meshes_.push_back(std::move(mesh));
  }
  const MeshData& anyMesh() {
    while (meshes_.empty()) pack();
    return *anyOf(meshes_);
  }
  const Packed& anyPacked() {
    while (packed_.empty()) pack();
    return anyOf(packed_);
  }
  void repair() {
    const MeshData& mesh = anyMesh();
    const auto view = filled<dermis_mesh_view>();
    const Made<dermis_repaired> made;
    const auto code =
        call({&view, &made}, dermis_repair, &mesh.view, mesh.joints, view.get(), made.get());
    if (mesh.isGood) expect((code == DERMIS_OK) == view.isValid);
    if (code != DERMIS_OK) return;
    const Owned<dermis_repaired> repaired = made.take();
    view->size = sizeof(dermis_mesh_view);
    expect(mesh.joints == 0 || packView(view.get(), mesh.joints) == DERMIS_OK);
  }
  void load() {
    const dermis_packed_info& info = anyPacked().info;
    const auto bytes = damaged(static_cast<const char*>(info.bytes), info.byte_count);
    const Made<dermis_packed> made;
    const auto code =
        call({&made}, dermis_packed_load, orNull(bytes.data()), bytes.size(), made.get());
    if (bytes.size() == info.byte_count && !isNull_ &&
        std::memcmp(bytes.data(), info.bytes, bytes.size()) == 0)
      expect(code == DERMIS_OK);
    if (code == DERMIS_OK) keep(made.take());
  }
  static dermis_code runAll(void* user, std::uint32_t count,
                            void (*job)(void* context, std::uint32_t index), void* context) {
    Imports& self = *static_cast<Imports*>(user);
    if (self.seldom()) job(context, count + self.number(0, 0xffff));  // one too many
    for (std::uint32_t i = count; i > 0; --i) {
      if (const dermis_code code = self.sometimesStop(78); code != DERMIS_OK) return code;
      job(context, i - 1);
    }
    return DERMIS_OK;
  }
  void centers() {
    const MeshData& mesh = anyMesh();
    std::vector<std::uint32_t> triangles(number(0, 20) * 3 + (seldom() ? 1 : 0));
    for (std::uint32_t& vertex : triangles)
      vertex = random() % (std::max(mesh.view.vertex_count, 1u) + (seldom() ? 1 : 0));
    triangles.shrink_to_fit();
    const std::size_t count = seldom() ? number(0, 300) : std::size_t{3} * mesh.view.vertex_count;
    const Outputs<float> centers(count);
    call({&centers}, dermis_centers_of_rotation, &mesh.view, mesh.joints, triangles.data(),
         triangles.size(), std::uint64_t{seldom() ? 1u : 0u}, oneOf(2) ? nullptr : &runAll, this,
         orNull(centers.get()), count);
  }
  dermis_layout makeLayout() {
    constexpr std::array positions{DERMIS_FORMAT_NONE, DERMIS_FORMAT_FLOAT32X3,
                                   DERMIS_FORMAT_FLOAT32X4, DERMIS_FORMAT_FLOAT16X4,
                                   DERMIS_FORMAT_SNORM16X4};
    constexpr std::array others{DERMIS_FORMAT_NONE, DERMIS_FORMAT_FLOAT32X4,
                                DERMIS_FORMAT_OCTAHEDRAL16X2};
    const auto format = [&](const auto& usual) {
      return seldom() ? enumerator<dermis_format>(10) : anyOf(usual);
    };
    return {format(positions), format(others), format(others),
            oneOf(4),          oneOf(4),       seldom() ? number(0, 100) : 0};
  }
  /// Whether every batch and scene takes it, if the mesh has what it writes.
  static bool isPlain(const dermis_layout& layout) {
    const auto isUsual = [](dermis_format format) {
      return format == DERMIS_FORMAT_NONE || format == DERMIS_FORMAT_FLOAT32X4 ||
             format == DERMIS_FORMAT_OCTAHEDRAL16X2;
    };
    return layout.positions <= DERMIS_FORMAT_FLOAT32X4 && layout.stride == 0 &&
           isUsual(layout.normals) && isUsual(layout.tangents);
  }
  void place() {
    const dermis_layout layout = makeLayout();
    const Outputs<dermis_places> places;
    const std::uint64_t offset = seldom() ? any<std::uint64_t>() : 0;
    const std::uint32_t vertices = seldom() ? any<std::uint32_t>() : number(0, 9);
    const auto code = call({&places}, dermis_place_vertices, orNull(&layout), vertices, offset,
                           orNull(places.get()));
    if (isNull_) expect(code == DERMIS_INVALID_ARGUMENT);
    if (!isNull_ && isPlain(layout) && offset == 0) expect(code == DERMIS_OK);
  }

  // ---- Batches.

  dermis_limits makeLimits() {
    dermis_limits limits{};
    limits.max_storage_buffers_per_stage = oneOf(4) ? number(0, 8) : 8;
    if (oneOf(4)) limits.min_storage_buffer_offset_alignment = 16u << number(0, 4);
    if (oneOf(4)) limits.max_storage_buffer_range = number(1, 0x4000) * 4;
    limits.one_output_range = number(0, 1);
    limits.texel_buffers = number(0, 1);
    limits.staged_stores = number(0, 1);
    limits.no_comparison_methods = number(0, 1);
    if (!seldom()) return limits;
    limits.min_storage_buffer_offset_alignment = any<std::uint32_t>();
    limits.max_storage_buffer_range = any<std::uint64_t>();
    limits.max_workgroup_count_x = number(0, 100);
    limits.max_workgroup_count_y = number(0, 2);
    return limits;
  }
  dermis_tuning makeTuning() {
    dermis_tuning tuning{};
    if (oneOf(2)) return tuning;
    tuning.workgroup_size = seldom() ? number(0, 300) : 8u << number(0, 4);
    tuning.instances_per_invocation = number(0, 33);
    tuning.min_workgroups = number(0, 1000);
    tuning.vertices_per_invocation = seldom() ? number(0, 40) : 1u << number(0, 4);
    return tuning;
  }
  /// `sizeOfBuffer` gives the size of the buffer with a number.
  template <typename Function>
  void checkDispatch(const dermis_dispatch& dispatch, const Function& sizeOfBuffer) {
    const Filled<dermis_pipeline_info> info;
    expect(call({&info}, dermis_describe_pipeline, dispatch.pipeline, info.get()) == DERMIS_OK);
    expect(dispatch.constant_count <= std::size(dispatch.constants));
    expect((dispatch.group_count_x * dispatch.group_count_y > 0) !=
           (dispatch.indirect.byte_count != 0));
    for (std::uint32_t i = 0; i < dispatch.binding_count; ++i) {
      const dermis_binding& binding = dispatch.bindings[i];
      expect(binding.slot < info->storage_buffers + info->texel_buffers);
      const std::uint64_t size = sizeOfBuffer(binding.part.buffer);
      expect(binding.part.offset <= size && binding.part.byte_count <= size - binding.part.offset);
    }
    if (dispatch.indirect.byte_count != 0)
      expect(dispatch.indirect.offset + 12 <= sizeOfBuffer(dispatch.indirect.buffer));
  }

  void makePlan() {
    dermis_batch batch{};
    std::vector<dermis_batch_pose> poses(number(0, 3));
    for (dermis_batch_pose& pose : poses) {
      pose = {batch.pose_bytes, number(1, 60), enumerator<dermis_promise>(2)};
      batch.pose_bytes += std::uint64_t{48} * pose.joint_count;
      if (seldom()) pose.joint_count = any<std::uint32_t>();
      if (seldom()) pose.matrix_offset = any<std::uint64_t>();
    }
    const std::vector<dermis_morph_weight> morphs{{number(0, 3), 1}, {number(0, 3), 0.5f}};
    std::vector<dermis_job> jobs(number(0, 5));
    std::vector<Given<dermis_packed_info>> infos;
    std::uint64_t end = 0;
    bool isValid = true;
    for (dermis_job& job : jobs) {
      dermis_packed_info info = anyPacked().info;
      if (seldom()) info.vertex_count = any<std::uint32_t>();
      if (seldom()) info.byte_count = any<std::uint64_t>();
      if (seldom()) info.max_influences = any<std::uint32_t>();
      infos.push_back(given(info));
      if (!infos.back().isValid) isValid = false;
      job.mesh = infos.back().get();
      job.pose = number(0, 3);
      job.mesh_offset = batch.mesh_bytes;
      batch.mesh_bytes += (info.byte_count + 15) / 16 * 16;
      const dermis_layout layout = makeLayout();
      call({}, dermis_place_vertices, &layout, info.vertex_count, std::uint64_t{0}, &job.places);
      const std::uint64_t alignment = std::max(job.places.alignment, std::uint64_t{1});
      end = (end + alignment - 1) / alignment * alignment;
      call({}, dermis_place_vertices, &layout, info.vertex_count, end, &job.places);
      if (seldom())
        anyOf(job.places.streams) = {number(0, 99), number(0, 99), enumerator<dermis_format>(10)};
      end += job.places.byte_count;
      job.method = enumerator<dermis_method>(9);
      job.box = {{-4, -4, -4}, {4, 4, 4}};
      job.wants_bounds = oneOf(4);
      job.restarts_motion = layout.has_motion != 0 && oneOf(2);
      job.settles = seldom();
      job.morphs = morphs.data();
      job.morph_count = seldom() ? 2 : 0;
    }
    std::fill_n(batch.output_bytes, 4, (end + 3) / 4 * 4);
    if (seldom()) anyOf(batch.output_bytes) = any<std::uint64_t>();
    const auto list = given(jobs);
    batch.poses = poses.data();
    batch.pose_count = sizeOf(poses);
    batch.jobs = list.get();
    batch.job_count = sizeOf(jobs);
    batch.has_separate_outputs = seldom();
    const auto all = given(batch);
    const auto limits = given(makeLimits());
    const auto tuning = given(makeTuning());
    if (!all.isValid || !list.isValid || !limits.isValid || !tuning.isValid) isValid = false;
    dermis_plan* plan = plan_.get();
    const auto code = call({}, dermis_make_plan, all.get(), limits.get(), tuning.get(), &plan);
    if (!isValid) expect(code == DERMIS_INVALID_ARGUMENT);
    if (plan_ == nullptr) {
      expect((code == DERMIS_OK) == (plan != nullptr));
      plan_.reset(plan);
    }
    expect(plan == plan_.get());
    if (plan != nullptr) checkPlan(plan, code == DERMIS_OK);
    if (oneOf(8)) plan_.reset();
  }
  void checkPlan(const dermis_plan* plan, bool isMade) {
    const auto info = filled<dermis_plan_info>();
    const auto code = call({&info}, dermis_plan_contents, plan, info.get());
    expect((code == DERMIS_OK) == info.isValid);
    if (!info.isValid) return;
    if (!isMade)
      return expect(info->command_count + info->pipeline_count + info->dispatch_count == 0);
    for (std::uint32_t i = 0; i < info->command_count; ++i) {
      if (info->commands[i].kind != DERMIS_DISPATCH) continue;
      checkDispatch(info->commands[i].as.dispatch, [&](std::uint32_t role) {
        expect(role < std::size(info->buffers));
        return info->buffers[role].byte_count;
      });
    }
    const std::uint64_t needed = info->buffers[DERMIS_BUFFER_TABLES].byte_count;
    const std::size_t size = needed - (needed > 0 && seldom() ? 1 : 0);
    const Outputs<std::byte> tables(size);
    const auto written = call({&tables}, dermis_write_tables, plan, tables.get(), size);
    expect((written == DERMIS_OK) == (size == needed));
  }
  // ---- The reference, and models.

  bool fill(dermis_joint* joints, std::uint32_t count) {
    const std::uint32_t kind = number(0, 255);
    for (std::uint32_t i = 0; i < count; ++i) {
      const float angle = static_cast<float>(random() % 628) / 100, c = std::cos(angle),
                  s = std::sin(angle), t = static_cast<float>(random() % 100) / 50;
      joints[i] = {{{c, -s, 0, t}, {s, c, 0, -t}, {0, 0, kind > 200 ? -0.5f : 1.0f, t}}};
    }
    constexpr std::array odd{3e38f, INFINITY, NAN};
    if (kind > 247 && count > 0) joints[0].m[kind % 3][1] = anyOf(odd);
    return kind <= 247;
  }

  void compare() {
    const MeshData& mesh = anyMesh();
    const std::uint32_t vertices = mesh.view.vertex_count;
    std::vector<dermis_joint> joints(mesh.joints);
    fill(joints.data(), mesh.joints);
    const dermis_morph_weight morph{number(0, 3), 0.5f};
    const auto posed = given(dermis_posed_mesh{0, mesh.joints, &mesh.view, joints.data(), &morph,
                                               seldom() ? 1u : 0u, enumerator<dermis_method>(9)});
    const auto numbers = [&](std::size_t each) {
      return each * vertices - (seldom() && vertices > 0 ? 1 : 0);
    };
    const std::size_t sizes[] = {numbers(3), numbers(3), numbers(4)};
    const Outputs<double> positions(sizes[0]), normals(sizes[1]), tangents(sizes[2]);
    call({&positions, &normals, &tangents}, dermis_reference_skin, posed.get(), positions.get(),
         sizes[0], oneOf(2) ? nullptr : normals.get(), sizes[1],
         oneOf(2) ? nullptr : tangents.get(), sizes[2]);

    const dermis_layout layout = makeLayout();
    dermis_places places{};
    if (call({}, dermis_place_vertices, &layout, vertices, std::uint64_t{0}, &places) != DERMIS_OK)
      return;
    const Bytes skinned(new std::byte[places.byte_count]);
    for (std::uint64_t i = 0; i < places.byte_count; ++i)
      skinned[i] = static_cast<std::byte>(random());
    dermis_skinned_view view{};
    view.vertex_count = seldom() ? number(0, vertices) : vertices;
    view.box = {{-1, -1, -1}, {1, 1, seldom() ? -1.0f : 1.0f}};
    dermis_skinned_attribute* attributes[] = {&view.positions, &view.normals, &view.tangents};
    for (std::size_t i = 0; i < 3; ++i) {
      const dermis_place& one = places.streams[i];
      if (one.format == DERMIS_FORMAT_NONE) continue;
      *attributes[i] = {orNull(skinned.get() + one.offset),
                        seldom() ? number(0, one.stride) : one.stride, one.format};
    }
    const auto compared = given(view);
    const auto result = filled<dermis_comparison>();
    const auto code = call({&result}, dermis_compare, posed.get(), compared.get(), result.get());
    if (code == DERMIS_OK) expect(posed.isValid && compared.isValid && result.isValid);
  }

  void model() {
    static const std::array files{readFile(DERMIS_SOURCE_DIR "/tests/fuzz/seeds/skin.gltf"),
                                  readFile(DERMIS_SOURCE_DIR "/tests/fuzz/seeds/morph.gltf"),
                                  readFile(DERMIS_SOURCE_DIR "/samples/models/bar.glb")};
    const std::string& file = oneOf(16) ? files[2] : files[number(0, 1)];
    const auto bytes = damaged(file.data(), file.size());
    dermis_model_source desc{};
    desc.bytes = orNull(bytes.data());
    desc.byte_count = bytes.size();
    desc.is_strict = number(0, 1);
    desc.rigid_meshes = number(0, 1);
    desc.missing_normals = enumerator<dermis_missing_normals>(2);
    const auto source = given(desc);
    const Made<dermis_model> made;
    const auto code = call({&made}, dermis_model_load, source.get(), made.get());
    if (isNull_ || !source.isValid) expect(code == DERMIS_INVALID_ARGUMENT);
    if (code == DERMIS_OK) return readModel(*made.take());
    expect(isNull_ || !source.isValid || desc.missing_normals > 2 || bytes.size() != file.size() ||
           std::memcmp(bytes.data(), file.data(), file.size()) != 0);
  }
  void readModel(const dermis_model& model) {
    const auto info = filled<dermis_model_info>();
    const auto code = call({&info}, dermis_model_contents, &model, info.get());
    expect((code == DERMIS_OK) == info.isValid);
    if (!info.isValid) return;
    for (std::uint32_t i = 0; i < info->note_count; ++i) expect(info->notes[i][0] != '\0');
    for (std::uint32_t i = 0; i <= std::min(info->primitive_count, 8u); ++i) {
      const Filled<dermis_primitive> primitive;
      const auto known = call({&primitive}, dermis_model_primitive, &model, i, primitive.get());
      expect((known == DERMIS_OK) == (i < info->primitive_count));
      if (known == DERMIS_OK) poseModel(model, i, *primitive.get(), info->clip_count);
    }
  }
  void poseModel(const dermis_model& model, std::uint32_t index, const dermis_primitive& primitive,
                 std::uint32_t clips) {
    for (std::size_t i = 0; i < primitive.index_count; ++i)
      expect(primitive.triangles[i] < primitive.mesh->vertex_count);
    packView(primitive.mesh, primitive.joint_count);
    const std::uint32_t clip = oneOf(2) ? std::uint32_t{DERMIS_REST_POSE} : number(0, clips),
                        jointCount = primitive.joint_count + (seldom() ? 1 : 0),
                        weightCount = primitive.mesh->morph_target_count + (seldom() ? 1 : 0);
    const double time = seldom() ? std::bit_cast<double>(any<std::uint64_t>()) : number(0, 20);
    const Outputs<dermis_joint> joints(jointCount);
    const Outputs<float> weights(weightCount);
    isNull_ = false;
    const auto code = call({&joints, &weights}, dermis_model_pose, &model, index, clip, time,
                           orNull(joints.get()), jointCount, weights.get(), weightCount);
    expect((code == DERMIS_OK) ==
           (!isNull_ && clip != clips && jointCount == primitive.joint_count &&
            weightCount == primitive.mesh->morph_target_count));
  }

  std::vector<std::unique_ptr<MeshData>> meshes_;
  std::vector<Packed> packed_;
  Owned<dermis_plan> plan_;
};

}  // namespace dermis::fuzz
