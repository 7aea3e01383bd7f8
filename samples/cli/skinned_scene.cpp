#include "skinned_scene.h"

#include <fmt/format.h>

namespace dermis::cli {
namespace {

std::string quoted(const std::string& name) {
  return name.empty() ? std::string() : fmt::format(" '{}'", name);
}

/// What `validate` puts behind "mesh": the mesh's name, and which of its primitives it is where
/// there are several.
std::string meshName(const gltf::Model& model, const gltf::SkinnedPrimitive& source) {
  const gltf::Mesh& mesh = model.meshes[source.mesh];
  const std::string name = mesh.name.empty() ? fmt::format("number {}", source.mesh) : mesh.name;
  return mesh.primitives.size() == 1 ? name
                                     : fmt::format("{}' primitive '{}", name, source.primitive);
}

std::string counted(const Finding& finding) {
  return finding.count == 1
             ? finding.message
             : fmt::format("{} (and {} more such vertices)", finding.message, finding.count - 1);
}

}  // namespace

Result<Scene> loadScene(const std::filesystem::path& path, bool strict) {
  Result<gltf::Model> loaded = gltf::load(path);
  if (!loaded) return loaded.error();

  Scene scene;
  scene.model = std::move(*loaded);
  const gltf::Model& model = scene.model;
  scene.notes = model.notes;
  std::size_t morphed = 0;
  for (const gltf::SkinnedPrimitive& source : model.skinnedPrimitives) {
    scene.parts.push_back(std::make_unique<ScenePart>());
    ScenePart& part = *scene.parts.back();
    part.source = source;
    part.primitive = &model.meshes[source.mesh].primitives[source.primitive];
    part.name = fmt::format("node {}{}, {}", source.node, quoted(model.nodes[source.node].name),
                            part.primitive->name);
    part.hasInfluences = part.primitive->influencesPerVertex != 0;
    if (!part.primitive->morphTargets.empty()) ++morphed;
    if (!part.hasInfluences) {
      scene.notes.push_back(fmt::format("{} has no JOINTS_0: its {} vertices stay in bind pose",
                                        part.name, part.primitive->vertexCount));
      continue;
    }

    part.original_ = part.primitive->view(part.set_);
    part.meshName_ = meshName(model, source);
    part.original_.name = part.meshName_;
    const auto jointCount = static_cast<std::uint32_t>(model.skins[source.skin].joints.size());
    part.report = validate(part.original_, jointCount);
    for (const Finding& finding : part.report.findings) {
      if (refusedByPack(finding.problem) && strict) {
        return Error{ErrorCode::invalidMesh,
                     fmt::format("{}: {}", path.string(), counted(finding))};
      }
      (refusedByPack(finding.problem) ? scene.warnings : scene.notes)
          .push_back(counted(finding) + (refusedByPack(finding.problem) ? "; repaired" : ""));
    }
    if (!part.report.packable()) {
      Result<RepairedMesh> repaired = repair(part.original_, jointCount);
      if (!repaired) return repaired.error();
      part.repaired.emplace(std::move(*repaired));
    }
    Result<PackedMesh> packed = pack(part.view(), jointCount);
    if (!packed) return packed.error();
    part.packed.emplace(std::move(*packed));
  }
  if (morphed != 0)
    scene.notes.push_back(
        fmt::format("{} primitives have morph targets, which are not skinned yet", morphed));
  return scene;
}

Result<std::uint32_t> chooseClip(const gltf::Model& model,
                                 const std::optional<std::string>& wanted) {
  if (!wanted) return model.clips.empty() ? gltf::none : 0u;
  if (*wanted == "none") return gltf::none;
  if (const std::optional<std::uint32_t> clip = gltf::findClip(model, *wanted)) return *clip;
  return Error{ErrorCode::invalidArgument,
               fmt::format("there is no animation '{}' among the {} of the file", *wanted,
                           model.clips.size())};
}

std::vector<std::vector<JointMatrix>> scenePalettes(const Scene& scene, std::uint32_t clip,
                                                    double time) {
  const std::vector<gltf::GlobalTransform> globals = gltf::nodeGlobals(scene.model, clip, time);
  std::vector<std::vector<JointMatrix>> palettes(scene.model.skins.size());
  for (const std::unique_ptr<ScenePart>& part : scene.parts) {
    std::vector<JointMatrix>& palette = palettes[part->source.skin];
    if (palette.empty()) palette = gltf::palette(scene.model, part->source.skin, globals);
  }
  return palettes;
}

}  // namespace dermis::cli
