#include "skinned_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>
#include <utility>
#include <vector>

#include "mesh_centers.h"

namespace dermis::cli {
namespace {

/// A pose of all parts takes 24 bytes a vertex and more; a small file can name a mesh very often.
constexpr std::uint64_t mostVertices = 100'000'000;

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

void addFindings(Scene& scene, const MeshReport& report) {
  for (const Finding& finding : report.findings) {
    std::string text = finding.message;
    if (finding.count > 1) text += fmt::format(" (and {} more such vertices)", finding.count - 1);
    if (refusedByPack(finding.problem)) {
      scene.warnings.push_back(text + "; repaired");
    } else {
      scene.remarks.push_back(std::move(text));
    }
  }
}

/// `file` is the file's name, for messages.
Result<Scene> prepareScene(gltf::Model loaded, const std::string& file,
                           const MeshPreparation& preparation) {
  Scene scene;
  scene.model = std::make_unique<gltf::Model>(std::move(loaded));
  const gltf::Model& model = *scene.model;
  scene.notes = model.notes;
  std::uint64_t vertices = 0;
  for (const gltf::SkinnedPrimitive& source : model.skinnedPrimitives)
    vertices += model.meshes[source.mesh].primitives[source.primitive].vertexCount;
  if (vertices > mostVertices) {
    return Error{ErrorCode::limitExceeded,
                 fmt::format("'{}': its scene has {} skinned vertices, more than the {} that this "
                             "command takes",
                             file, vertices, mostVertices)};
  }
  std::map<std::tuple<std::uint32_t, std::uint32_t, std::uint32_t>,
           std::shared_ptr<const PreparedMesh>>
      prepared;
  MeshCenters centers;
  const auto inFile = [&file](const Error& error) {
    return Error{error.code, fmt::format("'{}': {}", file, error.message)};
  };
  for (const gltf::SkinnedPrimitive& source : model.skinnedPrimitives) {
    ScenePart part;
    part.source = source;
    part.primitive = &model.meshes[source.mesh].primitives[source.primitive];
    part.name = fmt::format("node {}{}, {}", source.node, quoted(model.nodes[source.node].name),
                            part.primitive->name);
    if (part.primitive->influences.empty()) {
      scene.notes.push_back(fmt::format("{} has no JOINTS_0: its {} vertices stay in bind pose",
                                        part.name, part.primitive->vertexCount));
    } else {
      const auto jointCount = static_cast<std::uint32_t>(model.skins[source.skin].joints.size());
      std::shared_ptr<const PreparedMesh>& mesh =
          prepared[{source.mesh, source.primitive, jointCount}];
      if (mesh == nullptr) {
        const CentersOfPrimitive findCenters = [&]() -> Result<std::vector<float>> {
          if (!preparation.centersOfRotation) return std::vector<float>();
          Result<std::vector<float>> found = centers.of(model, source, jointCount);
          if (found || found.error().code != ErrorCode::limitExceeded) return found;
          scene.warnings.push_back(found.error().message);
          return std::vector<float>();
        };
        Result<std::shared_ptr<const PreparedMesh>> made = PreparedMesh::prepare(
            *part.primitive, meshName(model, source), jointCount, preparation, findCenters);
        if (!made) return inFile(made.error());
        mesh = std::move(*made);
        addFindings(scene, mesh->report());
      }
      part.mesh = mesh;
    }
    scene.parts.push_back(std::move(part));
  }
  return scene;
}

}  // namespace

Result<Scene> loadScene(const std::filesystem::path& path, const MeshPreparation& preparation) {
  Result<gltf::Model> loaded = gltf::load(path, {.images = preparation.images});
  if (!loaded) return loaded.error();
  return prepareScene(std::move(*loaded), path.filename().string(), preparation);
}

Result<Scene> loadScene(std::span<const std::byte> file, const std::string& name,
                        const MeshPreparation& preparation) {
  Result<gltf::Model> loaded = gltf::loadFromMemory(file, {}, {.images = preparation.images});
  if (!loaded) return loaded.error();
  return prepareScene(std::move(*loaded), name, preparation);
}

bool allows(const Scene& scene, Method method) {
  return std::ranges::all_of(scene.parts, [method](const ScenePart& part) {
    return part.mesh == nullptr || part.mesh->allows(method);
  });
}

Result<std::uint32_t> chooseClip(const gltf::Model& model,
                                 const std::optional<std::string>& wanted) {
  if (!wanted) return model.clips.empty() ? gltf::none : 0u;
  if (*wanted == "none") return gltf::none;
  if (const std::optional<std::uint32_t> clip = gltf::findClip(model, *wanted)) return *clip;
  return Error{ErrorCode::invalidArgument,
               fmt::format("--animation: there is no animation '{}' among the {} of the file",
                           *wanted, model.clips.size())};
}

ScenePose scenePose(const Scene& scene, std::uint32_t clip, double time) {
  const std::vector<gltf::GlobalTransform> globals = gltf::nodeGlobals(*scene.model, clip, time);
  ScenePose pose;
  pose.palettes.resize(scene.model->skins.size());
  for (const ScenePart& part : scene.parts) {
    std::vector<JointMatrix>& palette = pose.palettes[part.source.skin];
    if (palette.empty()) palette = gltf::palette(*scene.model, part.source.skin, globals);
    std::vector<MorphWeight>& morphs = pose.morphs.emplace_back();
    const std::vector<float> weights =
        gltf::morphWeights(*scene.model, part.source.node, clip, time);
    // A primitive may have fewer targets than its mesh names.
    const std::size_t targets = part.primitive->morphTargets.size();
    for (std::uint32_t target = 0; target < weights.size() && target < targets; ++target) {
      if (weights[target] != 0) morphs.push_back({target, weights[target]});
    }
  }
  return pose;
}

}  // namespace dermis::cli
