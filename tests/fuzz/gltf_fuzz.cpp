// libFuzzer: any bytes as a glTF file, without a folder, so that no file is opened. What loads is
// sampled, viewed, and packed or repaired as well, its clips are added to itself, and rigs applied.
#include <dermis/gltf.h>
#include <dermis/mesh.h>
#include <dermis/rig.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <string>

using namespace dermis;

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

/// A view makes sense, whatever the file says: only its values may be bad.
void checkPrimitive(const gltf::Model& model, const gltf::SkinnedPrimitive& skinned) {
  const gltf::Mesh& mesh = model.meshes[skinned.mesh];
  const gltf::PrimitiveView view(mesh.primitives[skinned.primitive]);
  const MeshView bindPose = view.mesh();
  require(bindPose.vertexCount != 0);
  require(bindPose.morphTargets.size() <= mesh.morphTargetCount);
  if (bindPose.influenceSets.empty()) return;
  const auto joints = static_cast<std::uint32_t>(model.skins[skinned.skin].joints.size());
  const MeshReport report = validate(bindPose, joints);
  require(report.repairable());
  require(pack(bindPose, joints).ok() == report.packable());
  if (report.packable()) return;
  const Result<RepairedMesh> repaired = repair(bindPose, joints);
  require(repaired.ok() && pack(repaired->view(), joints).ok());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const gltf::LoadOptions options{.rigidMeshes = true,
                                  .missingNormals = static_cast<gltf::MissingNormals>(size % 3)};
  auto result = gltf::loadFromMemory(std::as_bytes(std::span(data, size)), {}, options);
  if (!result) {
    // An error has a sentence, on one line.
    const std::string& message = result.error().message;
    require(!message.empty() && message.find('\n') == std::string::npos);
    return 0;
  }
  gltf::Model& model = *result;
  // Notes are sentences, too, and there are some fifty kinds of them.
  require(model.notes.size() < 64);
  for (const std::string& note : model.notes)
    require(!note.empty() && note.size() < 1000 && note.find('\n') == std::string::npos);
  // A hostile file may have very many primitives, clips and skins: a few of them will do.
  for (std::size_t i = 0; i < std::min<std::size_t>(model.skinnedPrimitives.size(), 4); ++i) {
    const gltf::SkinnedPrimitive& skinned = model.skinnedPrimitives[i];
    checkPrimitive(model, skinned);
    const std::uint32_t clip = model.clips.empty() ? noIndex : 0;
    require(gltf::morphWeights(model, skinned.node, clip, 0.5).size() ==
            model.meshes[skinned.mesh].morphTargetCount);
  }
  const std::size_t ownClips = model.clips.size();
  const auto added = gltf::addClips(model, model);
  require(model.clips.size() == ownClips * (added ? 2 : 1));
  for (std::size_t i = 0; i < std::min<std::size_t>(ownClips, 4); ++i) {
    // The first and the last ones; the last ones are added.
    const auto clip =
        static_cast<std::uint32_t>(i % 2 == 0 ? i / 2 : model.clips.size() - 1 - i / 2);
    for (std::uint32_t node = 0; node < model.nodes.size() && node < 4; ++node)
      gltf::morphWeights(model, node, clip, 0.5);
    const auto globals = gltf::nodeGlobals(model, clip, model.clips[clip].duration / 2);
    require(globals.size() == model.nodes.size());
    for (std::uint32_t skin = 0; skin < model.skins.size() && skin < 4; ++skin) {
      require(gltf::pose(model, skin, globals).size() == model.skins[skin].joints.size());
    }
  }
  for (std::uint32_t skin = 0; skin < model.skins.size() && skin < 4; ++skin) {
    if (model.skins[skin].rig.empty()) continue;
    const std::string text = model.skins[skin].rig;
    const auto rig = gltf::applyRig(model, skin, text);
    require(!rig || packRig(**rig).ok());
  }
  return 0;
}
