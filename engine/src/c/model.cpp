// glTF.
#include <algorithm>
#include <deque>
#include <optional>

#include "convert.h"
#include "dermis/gltf.h"
#include "sources.h"

using namespace dermis;
using namespace dermis::c;

struct dermis_model : Object {
  explicit dermis_model(gltf::Model loaded) : model(std::move(loaded)) { list(); }

  /// Makes what callers get, whenever the model has changed.
  void list() {
    skeleton = gltf::skeleton(model);
    animations.emplace(skeleton, gltf::clips(model));
    views.clear();
    clips.clear();
    notes.clear();
    for (const gltf::SkinnedPrimitive& skinned : model.skinnedPrimitives) {
      const gltf::PrimitiveView view(primitive(skinned));
      views.emplace_back(view.mesh());
    }
    for (const gltf::Clip& clip : model.clips) clips.push_back({clip.name.c_str(), clip.duration});
    for (const std::string& note : model.notes) notes.push_back(note.c_str());
  }

  const gltf::Primitive& primitive(const gltf::SkinnedPrimitive& skinned) const {
    return model.meshes[skinned.mesh].primitives[skinned.primitive];
  }

  gltf::Model model;
  Skeleton skeleton;
  std::optional<ClipsForCaller> animations;
  std::deque<ViewForCaller> views;  ///< of the skinned primitives
  std::vector<dermis_clip> clips;
  std::vector<const char*> notes;
};

namespace {

const gltf::SkinnedPrimitive& primitiveOf(const dermis_model& model, std::uint32_t index) {
  if (index >= model.model.skinnedPrimitives.size())
    fail("the model has no skinned primitive " + std::to_string(index));
  return model.model.skinnedPrimitives[index];
}

std::filesystem::path pathOf(const char* utf8) {
  const std::string_view string = text(utf8);
  return std::u8string(string.begin(), string.end());
}

}  // namespace

extern "C" {

dermis_code dermis_model_load(const dermis_model_source* callers, dermis_model** model,
                              dermis_error* error) {
  return guarded(error, [&] {
    const dermis_model_source source = in(callers, "source");
    dermis_model*& result = required(model, "model");
    gltf::LoadOptions options;
    options.rigidMeshes = source.rigid_meshes != 0;
    options.missingNormals = static_cast<gltf::MissingNormals>(
        enumerator(source.missing_normals, DERMIS_NORMALS_FLAT, "missing_normals"));
    options.strict = source.is_strict != 0;
    if ((source.path == nullptr) == (source.bytes == nullptr))
      fail("a model needs either a path or bytes");
    gltf::Model loaded = must(
        source.path != nullptr
            ? gltf::load(pathOf(source.path), options)
            : gltf::loadFromMemory({static_cast<const std::byte*>(source.bytes), source.byte_count},
                                   pathOf(source.folder), options));
    if (source.clips_path != nullptr) {
      for (std::string& note :
           must(gltf::addClips(loaded, must(gltf::load(pathOf(source.clips_path), options)))))
        loaded.notes.push_back(std::move(note));
    }
    result = new dermis_model(std::move(loaded));
  });
}

dermis_code dermis_model_apply_rig(dermis_model* model, uint32_t skin, const char* json,
                                   dermis_packed_rig** rig, dermis_error* error) {
  return guarded(error, [&] {
    dermis_model& target = required(model, "model");
    dermis_packed_rig*& result = required(rig, "rig");
    if (skin >= target.model.skins.size()) fail("the model has no skin " + std::to_string(skin));
    const std::string drivers = json != nullptr ? json : target.model.skins[skin].rig;
    if (drivers.empty()) fail("the file has no rig for skin " + std::to_string(skin));
    const auto applied = must(gltf::applyRig(target.model, skin, drivers));
    target.list();
    result = new dermis_packed_rig(must(packRig(*applied)));
  });
}

dermis_code dermis_model_contents(const dermis_model* model, dermis_model_info* info,
                                  dermis_error* error) {
  return guarded(error, [&] {
    const dermis_model& source = required(model, "model");
    checkOut(info, "info");
    dermis_model_info result{};
    result.primitive_count = static_cast<std::uint32_t>(source.views.size());
    result.clips = source.clips.data();
    result.clip_count = static_cast<std::uint32_t>(source.clips.size());
    result.notes = source.notes.data();
    result.note_count = static_cast<std::uint32_t>(source.notes.size());
    give(info, result);
  });
}

dermis_code dermis_model_primitive(const dermis_model* model, uint32_t index,
                                   dermis_primitive* primitive, dermis_error* error) {
  return guarded(error, [&] {
    const dermis_model& source = required(model, "model");
    checkOut(primitive, "primitive");
    const gltf::SkinnedPrimitive& skinned = primitiveOf(source, index);
    const gltf::Primitive& contents = source.primitive(skinned);
    const auto dataOf = [](const auto& values) { return values.empty() ? nullptr : values.data(); };
    dermis_primitive result{};
    result.skin = skinned.skin;
    result.joint_count = static_cast<std::uint32_t>(source.model.skins[skinned.skin].joints.size());
    result.mesh = &source.views[index].mesh;
    result.triangles = dataOf(contents.triangles);
    result.index_count = contents.triangles.size();
    if (!contents.texcoords.empty()) result.texcoords = dataOf(contents.texcoords.front());
    result.colors = dataOf(contents.colors);
    const gltf::Material material = contents.material < source.model.materials.size()
                                        ? source.model.materials[contents.material]
                                        : gltf::Material{};
    std::copy_n(material.baseColor.begin(), 4, result.base_color);
    give(primitive, result);
  });
}

dermis_code dermis_model_clips(const dermis_model* model, dermis_clips_source* clips,
                               dermis_error* error) {
  return guarded(error, [&] {
    const dermis_model& source = required(model, "model");
    checkOut(clips, "source");
    give(clips, source.animations->source);
  });
}

dermis_code dermis_model_pose(const dermis_model* model, uint32_t primitive, uint32_t clip,
                              double time, dermis_joint* joints, uint32_t joint_count,
                              float* morph_weights, uint32_t morph_weight_count,
                              dermis_error* error) {
  return guarded(error, [&] {
    const dermis_model& source = required(model, "model");
    const gltf::SkinnedPrimitive& skinned = primitiveOf(source, primitive);
    if (clip == DERMIS_REST_POSE) {
      clip = noIndex;
    } else if (clip >= source.clips.size()) {
      fail("the model has no clip " + std::to_string(clip));
    }
    const std::span<dermis_joint> results = array(joints, joint_count, "joints");
    const std::vector<JointMatrix> pose = gltf::pose(source.model, skinned.skin, clip, time);
    if (results.size() != pose.size()) {
      fail("joint_count is " + std::to_string(joint_count) + ", but the primitive has " +
           std::to_string(pose.size()) + " joints");
    }
    const std::uint32_t targets = source.views[primitive].mesh.morph_target_count;
    if (morph_weights != nullptr ? morph_weight_count != targets : morph_weight_count != 0) {
      fail("morph_weight_count is " + std::to_string(morph_weight_count) +
           ", but the primitive has " + std::to_string(targets) + " morph targets");
    }
    if (!pose.empty()) std::memcpy(results.data(), pose.data(), results.size_bytes());
    if (morph_weights != nullptr) {
      std::vector<float> weights = gltf::morphWeights(source.model, skinned.node, clip, time);
      weights.resize(targets);
      std::copy(weights.begin(), weights.end(), morph_weights);
    }
  });
}

}  // extern "C"
