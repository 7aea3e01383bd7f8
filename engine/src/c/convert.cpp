#include "convert.h"

#include <algorithm>
#include <variant>

namespace dermis::c {
namespace {

AttributeView attributeOf(const dermis_attribute& attribute, std::uint32_t count) {
  AttributeView view;
  view.data = attribute.data;
  view.count = attribute.data == nullptr ? 0 : count;
  view.type = static_cast<ComponentType>(
      enumerator(attribute.type, DERMIS_UINT32, "the component type of an attribute"));
  view.components = attribute.components;
  view.stride = attribute.stride;
  if (view.stride == 0) {
    const std::uint64_t size = std::uint64_t{attribute.components} * componentSize(view.type);
    view.stride = static_cast<std::uint32_t>(std::min<std::uint64_t>(size, 0xffffffff));
  }
  return view;
}

dermis_attribute attributeTo(const AttributeView& view) {
  return {view.data, view.stride, static_cast<dermis_component>(view.type), view.components};
}

std::array<float, 3> scaleOf(const float (&scale)[3]) {
  if (scale[0] == 0 && scale[1] == 0 && scale[2] == 0) return {1, 1, 1};
  return {scale[0], scale[1], scale[2]};
}

Capacity capacityOf(const dermis_capacity& capacity, const Capacity& defaults) {
  Capacity result = defaults;
  if (capacity.maximum != 0) {
    result.maximum = capacity.maximum;
    result.initial = std::min(result.initial, result.maximum);
  }
  if (capacity.initial != 0) result.initial = capacity.initial;
  return result;
}

VertexFormat formatOf(const dermis_format& format, const char* name) {
  return static_cast<VertexFormat>(enumerator(format, DERMIS_FORMAT_OCTAHEDRAL8X2, name));
}

}  // namespace

Method methodOf(const dermis_method& method) {
  const std::uint8_t number = enumerator(method, DERMIS_METHOD_BULGE_CONTROLLED, "the method");
  return number == 0 ? Method::dualQuaternion : static_cast<Method>(number - 1);
}

VertexLayout layoutOf(const dermis_layout& layout) {
  VertexLayout result;
  const VertexFormat positions = formatOf(layout.positions, "the format of the positions");
  if (positions != VertexFormat::none) result.positions = positions;
  result.normals = formatOf(layout.normals, "the format of the normals");
  result.tangents = formatOf(layout.tangents, "the format of the tangents");
  result.motion = layout.has_motion != 0;
  result.planar = layout.is_planar != 0;
  result.stride = layout.stride;
  return result;
}

JointPromise promiseOf(const dermis_promise& promise) {
  return static_cast<JointPromise>(enumerator(promise, DERMIS_PROMISE_RIGID, "the promise"));
}

Box boxOf(const dermis_box& box) {
  Box result;
  std::copy_n(box.min, 3, result.min);
  std::copy_n(box.max, 3, result.max);
  return result;
}
dermis_box boxOf(const Box& box) {
  dermis_box result;
  std::copy_n(box.min, 3, result.min);
  std::copy_n(box.max, 3, result.max);
  return result;
}

VertexPlaces placesOf(const dermis_places& places) {
  VertexPlaces result;
  for (std::size_t i = 0; i < streamCount; ++i) {
    const dermis_place& place = places.streams[i];
    result.attributes.at(i) = {place.offset, place.stride,
                               formatOf(place.format, "the format of an attribute")};
  }
  result.size = places.byte_count;
  result.alignment = places.alignment;
  return result;
}
dermis_places placesOf(const VertexPlaces& places) {
  dermis_places result{};
  for (std::size_t i = 0; i < streamCount; ++i) {
    const OutputAttribute& attribute = places.attributes.at(i);
    result.streams[i] = {attribute.offset, attribute.stride,
                         static_cast<dermis_format>(attribute.format)};
  }
  result.byte_count = places.size;
  result.alignment = places.alignment;
  return result;
}

std::span<const MorphWeight> morphsOf(const dermis_morph_weight* morphs, std::uint32_t count) {
  static_assert(sizeof(dermis_morph_weight) == sizeof(MorphWeight));
  array(morphs, count, "morphs");
  return {reinterpret_cast<const MorphWeight*>(morphs), count};
}
std::span<const JointMatrix> jointsOf(const dermis_joint* joints, std::uint32_t count,
                                      const char* name) {
  static_assert(sizeof(dermis_joint) == sizeof(JointMatrix));
  array(joints, count, name);
  return {reinterpret_cast<const JointMatrix*>(joints), count};
}

void checkKind(std::uint32_t kind, Kind wanted, const char* name) {
  if (kind == static_cast<std::uint32_t>(wanted)) return;
  constexpr const char* kinds[] = {"nothing", "a mesh",   "a pose", "an instance",
                                   "clips",   "a figure", "a rig"};
  fail(std::string(name) + ": this is the handle of " +
       (kind < std::size(kinds) ? kinds[kind] : "nothing that Dermis made"));
}

View::View(const dermis_mesh_view* callers) {
  const dermis_mesh_view view = in(callers, "mesh");
  const std::uint32_t count = view.vertex_count;
  mesh.name = text(view.name);
  mesh.vertexCount = count;
  mesh.positions = attributeOf(view.positions, count);
  mesh.positionScale = scaleOf(view.position_scale);
  std::copy_n(view.position_offset, 3, mesh.positionOffset.begin());
  mesh.normals = attributeOf(view.normals, count);
  mesh.tangents = attributeOf(view.tangents, count);
  for (const dermis_influence_set& set :
       array(view.influence_sets, view.influence_set_count, "influence_sets")) {
    influenceSets_.push_back({attributeOf(set.joints, count), attributeOf(set.weights, count)});
  }
  for (const dermis_morph_target& target :
       array(view.morph_targets, view.morph_target_count, "morph_targets")) {
    const bool isSparse = target.vertices != nullptr;
    const std::uint32_t elements = isSparse ? target.vertex_count : count;
    MorphTargetView converted;
    if (isSparse) {
      // A target without vertices displaces nothing. An empty list would be one of all vertices.
      if (elements == 0) {
        morphTargets_.emplace_back();
        continue;
      }
      converted.vertices = {target.vertices, elements};
    }
    converted.positions = attributeOf(target.positions, elements);
    converted.normals = attributeOf(target.normals, elements);
    converted.tangents = attributeOf(target.tangents, elements);
    converted.positionScale = scaleOf(target.position_scale);
    morphTargets_.push_back(converted);
  }
  mesh.influenceSets = influenceSets_;
  mesh.morphTargets = morphTargets_;
  mesh.dualQuaternionWeights = attributeOf(view.dual_quaternion_weights, count);
  mesh.bulgeStrengths = attributeOf(view.bulge_strengths, count);
  mesh.centersOfRotation = attributeOf(view.centers_of_rotation, count);
}

ViewForCaller::ViewForCaller(const MeshView& view) : name_(view.name) {
  mesh.size = sizeof(mesh);
  mesh.vertex_count = view.vertexCount;
  mesh.name = name_.c_str();
  mesh.positions = attributeTo(view.positions);
  std::copy_n(view.positionScale.begin(), 3, mesh.position_scale);
  std::copy_n(view.positionOffset.begin(), 3, mesh.position_offset);
  mesh.normals = attributeTo(view.normals);
  mesh.tangents = attributeTo(view.tangents);
  for (const InfluenceSet& set : view.influenceSets)
    influenceSets_.push_back({attributeTo(set.joints), attributeTo(set.weights)});
  for (const MorphTargetView& target : view.morphTargets) {
    dermis_morph_target converted{};
    converted.vertices = target.vertices.empty() ? nullptr : target.vertices.data();
    converted.vertex_count = static_cast<std::uint32_t>(target.vertices.size());
    converted.positions = attributeTo(target.positions);
    converted.normals = attributeTo(target.normals);
    converted.tangents = attributeTo(target.tangents);
    std::copy_n(target.positionScale.begin(), 3, converted.position_scale);
    morphTargets_.push_back(converted);
  }
  mesh.influence_sets = influenceSets_.data();
  mesh.influence_set_count = static_cast<std::uint32_t>(influenceSets_.size());
  mesh.morph_targets = morphTargets_.data();
  mesh.morph_target_count = static_cast<std::uint32_t>(morphTargets_.size());
  mesh.dual_quaternion_weights = attributeTo(view.dualQuaternionWeights);
  mesh.bulge_strengths = attributeTo(view.bulgeStrengths);
  mesh.centers_of_rotation = attributeTo(view.centersOfRotation);
}

MeshInfo infoOf(const dermis_packed_info& info) {
  MeshInfo result;
  result.byteSize = info.byte_count;
  result.vertexCount = info.vertex_count;
  result.requiredJoints = info.required_joints;
  result.maxInfluences = info.max_influences;
  result.minInfluences = info.min_influences;
  result.morphTargetCount = info.morph_target_count;
  result.hasNormals = info.has_normals != 0;
  result.hasTangents = info.has_tangents != 0;
  result.hasCentersOfRotation = info.has_centers_of_rotation != 0;
  return result;
}

SceneDescription sceneOf(const dermis_scene_desc* callers) {
  const dermis_scene_desc desc = inOrDefault(callers, "scene");
  SceneDescription result;
  if (desc.frames_in_flight != 0) result.framesInFlight = desc.frames_in_flight;
  result.meshCapacity = capacityOf(desc.mesh_bytes, result.meshCapacity);
  result.jointCapacity = capacityOf(desc.joints, result.jointCapacity);
  result.gpuJointCapacity = capacityOf(desc.gpu_joints, result.gpuJointCapacity);
  result.outputCapacity = capacityOf(desc.output_bytes, result.outputCapacity);
  result.instanceCapacity = capacityOf(desc.instances, result.instanceCapacity);
  result.boundsCapacity = capacityOf(desc.bounds, result.boundsCapacity);
  return result;
}

InstanceDescription instanceOf(const dermis_instance_desc& desc) {
  InstanceDescription result;
  result.mesh = handleOf(desc.mesh);
  result.pose = handleOf(desc.pose);
  result.method = methodOf(desc.method);
  result.layout = layoutOf(desc.layout);
  result.box = boxOf(desc.box);
  result.bounds = desc.wants_bounds != 0;
  if (desc.update_interval != 0) result.updateInterval = desc.update_interval;
  result.culledOnGpu = desc.culled_on_gpu != 0;
  result.interpolates = desc.interpolates != 0;
  result.morphWriter = static_cast<MorphWriter>(
      enumerator(desc.morph_writer, DERMIS_MORPH_WRITER_CLIPS, "the morph writer"));
  result.weightsOf = desc.weights_of;
  result.drivenTargets = desc.driven_targets;
  result.firstDrivenWeight = desc.first_driven_weight;
  return result;
}

PipelineNeeds needsOf(const dermis_scene* scene, const dermis_instance_desc* callers) {
  const InstanceDescription desc = instanceOf(in(callers, "desc"));
  if (scene != nullptr) return must(sceneOf(scene).pipelineNeeds(desc));
  PipelineNeeds needs;
  needs.method = desc.method;
  needs.layout = desc.layout;
  needs.bounds = desc.bounds;
  needs.culledOnGpu = desc.culledOnGpu;
  needs.rigs = desc.drivenTargets != 0;
  needs.morphsOnGpu = desc.morphWriter != MorphWriter::cpu || needs.rigs;
  return needs;
}

DeviceLimits limitsOf(const dermis_limits* callers) {
  const dermis_limits limits = inOrDefault(callers, "limits");
  DeviceLimits result;
  const auto set = [](auto& limit, auto value) {
    if (value != 0) limit = value;
  };
  set(result.maxStorageBufferRange, limits.max_storage_buffer_range);
  set(result.minStorageBufferOffsetAlignment, limits.min_storage_buffer_offset_alignment);
  set(result.maxWorkgroupCountX, limits.max_workgroup_count_x);
  set(result.maxWorkgroupCountY, limits.max_workgroup_count_y);
  set(result.maxStorageBuffersPerStage, limits.max_storage_buffers_per_stage);
  result.separateRanges = limits.one_output_range == 0;
  result.texelBuffers = limits.texel_buffers != 0;
  result.stagedStores = limits.staged_stores != 0;
  result.comparisonMethods = limits.no_comparison_methods == 0;
  return result;
}

Tuning tuningOf(const dermis_tuning* callers) {
  const dermis_tuning tuning = inOrDefault(callers, "tuning");
  Tuning result;
  if (tuning.workgroup_size != 0) result.workgroupSize = tuning.workgroup_size;
  if (tuning.instances_per_invocation != 0)
    result.instancesPerInvocation = tuning.instances_per_invocation;
  result.minWorkgroups = tuning.min_workgroups;
  if (tuning.vertices_per_invocation != 0)
    result.verticesPerInvocation = tuning.vertices_per_invocation;
  return result;
}

dermis_requirement requirementOf(const BufferRequirement& requirement) {
  return {requirement.size, requirement.alignment, requirement.usage};
}
dermis_part partOf(const BufferPart& part) {
  return {part.offset, part.size, part.buffer};
}

void CommandList::fill(std::span<const Command> from) {
  commands.clear();
  bindings_.clear();
  std::size_t bindingCount = 0;
  for (const Command& command : from) {
    if (const auto* dispatch = std::get_if<DispatchCommand>(&command))
      bindingCount += dispatch->bindings.size();
  }
  bindings_.reserve(bindingCount);  // commands point to them
  commands.reserve(from.size());
  for (const Command& command : from) {
    dermis_command converted{};
    if (const auto* dispatch = std::get_if<DispatchCommand>(&command)) {
      converted.kind = DERMIS_DISPATCH;
      dermis_dispatch& to = converted.as.dispatch;
      to.pipeline = static_cast<std::uint64_t>(dispatch->pipeline);
      to.group_count_x = dispatch->groupCountX;
      to.group_count_y = dispatch->groupCountY;
      to.indirect = partOf(dispatch->indirect);
      static_assert(std::extent_v<decltype(to.constants)> ==
                    std::tuple_size_v<decltype(dispatch->constants)>);
      std::copy(dispatch->constants.begin(), dispatch->constants.end(), to.constants);
      to.constant_count = dispatch->constantCount;
      to.bindings = bindings_.data() + bindings_.size();
      to.binding_count = static_cast<std::uint32_t>(dispatch->bindings.size());
      for (const Binding& binding : dispatch->bindings)
        bindings_.push_back({partOf(binding.part), binding.slot, binding.isTexelBuffer ? 1u : 0u});
    } else if (const auto* upload = std::get_if<UploadCommand>(&command)) {
      converted.kind = DERMIS_UPLOAD;
      converted.as.upload = {partOf(upload->to), upload->bytes.data()};
    } else if (const auto* copy = std::get_if<CopyCommand>(&command)) {
      converted.kind = DERMIS_COPY;
      converted.as.copy = {copy->from, copy->to, copy->fromOffset, copy->toOffset, copy->size};
    } else if (const auto* clear = std::get_if<ClearCommand>(&command)) {
      converted.kind = DERMIS_CLEAR;
      converted.as.clear = partOf(clear->part);
    } else if (const auto* barrier = std::get_if<BarrierCommand>(&command)) {
      converted.kind = DERMIS_BARRIER;
      converted.as.barrier = {static_cast<std::uint32_t>(barrier->before),
                              static_cast<std::uint32_t>(barrier->after)};
    }
    commands.push_back(converted);
  }
}

}  // namespace dermis::c
