#include "skinned_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <tuple>
#include <utility>
#include <vector>

#include "kit/file_name.h"
#include "kit/memory_left.h"
#include "kit/program.h"
#include "kit/text.h"
#include "prepared_mesh.h"

namespace dermis::cli {
namespace {

/// Memory of a part except its vertices: the part, its names, and the output of `info` about it.
constexpr std::uint64_t bytesPerPart = 1024;
/// Memory per vertex of a pose: float32 positions, normals and tangents.
constexpr std::uint64_t bytesPerPosedVertex = 40;
/// Memory per vertex of a primitive that is drawn: texture coordinates and a color.
constexpr std::uint64_t bytesPerDrawnVertex = 16;
/// Memory per weight of a morph target: sampled, and in the list of active ones.
constexpr std::uint64_t bytesPerTarget = 2 * sizeof(MorphWeight);
/// A part's name is copied several times when it is written to a file.
constexpr std::uint64_t copiesOfName = 8;

std::string partLabel(const gltf::Model& model, const gltf::SkinnedPrimitive& source,
                      const gltf::Primitive& primitive) {
  const std::string& node = model.nodes[source.node].name;
  const std::string name = node.empty() ? "" : fmt::format(" {}", samples::inQuotes(node));
  return fmt::format("node {}{}, mesh '{}'", source.node, name, primitive.name);
}

/// For messages: a path in UTF-8, without its folder.
std::string nameOf(const std::filesystem::path& path) {
  const std::u8string name = path.filename().u8string();
  return {name.begin(), name.end()};
}

void addFindings(Scene& scene, const MeshReport& report) {
  for (const MeshReport::Finding& finding : report.findings) {
    std::string text = finding.message;
    if (finding.count > 1) text += fmt::format(" (and {} more such vertices)", finding.count - 1);
    if (refusedByPack(finding.problem)) {
      scene.warnings.push_back(text + "; repaired");
    } else {
      scene.remarks.push_back(std::move(text));
    }
  }
}

/// Counts the parts before any is made, because a few nodes and a few primitives can make many.
bool spendOnParts(gltf::Model& model) {
  std::set<const gltf::Primitive*> drawn;
  for (const gltf::SkinnedPrimitive& source : model.skinnedPrimitives) {
    const gltf::Mesh& mesh = model.meshes[source.mesh];
    const gltf::Primitive& primitive = mesh.primitives[source.primitive];
    const std::size_t name = std::max(model.nodes[source.node].name.size(), mesh.name.size());
    if (!samples::spend(model.memoryLeft, 1, bytesPerPart) ||
        !samples::spend(model.memoryLeft, name, copiesOfName) ||
        !samples::spend(model.memoryLeft, mesh.morphTargetCount, bytesPerTarget) ||
        !samples::spend(model.memoryLeft, primitive.vertexCount, bytesPerPosedVertex)) {
      return false;
    }
    if (drawn.insert(&primitive).second &&
        (!samples::spend(model.memoryLeft, primitive.triangles.size(), sizeof(std::uint32_t)) ||
         !samples::spend(model.memoryLeft, primitive.vertexCount, bytesPerDrawnVertex))) {
      return false;
    }
  }
  return true;
}

/// Prepares the meshes of the scene, once for all skins for which the result is the same.
class Preparer {
 public:
  Preparer(Scene& scene, const MeshPreparation& preparation)
      : scene_(scene),
        preparation_(preparation),
        centers_(preparation.mostCenterTerms, scene.model->memoryLeft) {}

  Result<std::shared_ptr<const PreparedMesh>> prepare(const gltf::SkinnedPrimitive& source) {
    gltf::Model& model = *scene_.model;
    const gltf::Primitive& primitive = model.meshes[source.mesh].primitives[source.primitive];
    const auto [named, isNew] = namedJoints_.emplace(source.mesh, 0);
    if (isNew) named->second = joints_.of(model.meshes[source.mesh]);
    const std::uint32_t joints = std::min(jointCount(scene_, source.skin), named->second);
    std::shared_ptr<const PreparedMesh>& mesh = prepared_[{&primitive, joints}];
    if (mesh != nullptr) return mesh;
    // Centers of rotation depend on all primitives of the mesh.
    std::shared_ptr<const PreparedMesh>& shared =
        shared_[{vertexKey(primitive), joints, preparation_.centersOfRotation ? source.mesh : 0}];
    if (shared != nullptr) return mesh = shared;
    const CentersOfPrimitive findCenters = [&]() -> Result<std::vector<float>> {
      if (!preparation_.centersOfRotation) return std::vector<float>();
      Result<std::vector<float>> found = centers_.of(model, source, joints);
      if (found || found.error().code != ErrorCode::limitExceeded) return found;
      if (refused_.insert(found.error().message).second)
        scene_.warnings.push_back(found.error().message);
      return std::vector<float>();
    };
    Result<std::shared_ptr<const PreparedMesh>> made =
        PreparedMesh::prepare(primitive, joints, preparation_, model.memoryLeft, findCenters);
    if (!made) return made;
    mesh = shared = std::move(*made);
    addFindings(scene_, mesh->report());
    return mesh;
  }

 private:
  Scene& scene_;
  const MeshPreparation& preparation_;
  MeshCenters centers_;
  std::set<std::string> refused_;  ///< meshes that need too much work, each reported once
  NamedJoints joints_;
  std::map<std::uint32_t, std::uint32_t> namedJoints_;  ///< by mesh
  std::map<std::pair<const gltf::Primitive*, std::uint32_t>, std::shared_ptr<const PreparedMesh>>
      prepared_;
  /// By vertices, number of joints, and mesh.
  std::map<std::tuple<VertexKey, std::uint32_t, std::uint32_t>, std::shared_ptr<const PreparedMesh>>
      shared_;
};

Result<void> addClips(Scene& scene, const MeshPreparation& preparation) {
  for (const std::string& name : preparation.clips) {
    const std::filesystem::path path = samples::pathOf(name);
    Result<gltf::Model> loaded = gltf::load(path, {.strict = preparation.strict});
    if (!loaded) return loaded.error();
    const std::string file = samples::inQuotes(nameOf(path));
    const auto add = [&](const std::vector<std::string>& notes) {
      for (const std::string& note : notes)
        scene.notes.push_back(fmt::format("{}: {}", file, note));
    };
    add(loaded->notes);
    scene.clipFiles.push_back({path, static_cast<std::uint32_t>(scene.model->clips.size())});
    const Result<std::vector<std::string>> notes = gltf::addClips(*scene.model, std::move(*loaded));
    if (!notes)
      return Error{notes.error().code, fmt::format("{}: {}", file, notes.error().message)};
    add(*notes);
  }
  return {};
}

Result<std::string> readText(const std::string& name) {
  std::ifstream file(samples::pathOf(name), std::ios::binary);
  std::string text(std::istreambuf_iterator<char>(file), {});
  if (!file.is_open() || file.bad())
    return Error{ErrorCode::ioError, fmt::format("cannot read {}", samples::inQuotes(name))};
  return text;
}

/// Applies the rigs of all skins that have a mesh. A file of `--rig` is applied to each skin that
/// has its joints, and fails if no skin has them.
Result<void> addRigs(Scene& scene, const std::string& file, const MeshPreparation& preparation) {
  if (preparation.rig == "none") return {};
  std::optional<std::string> own;
  if (!preparation.rig.empty()) {
    Result<std::string> text = readText(preparation.rig);
    if (!text) return text.error();
    own = std::move(*text);
  }
  gltf::Model& model = *scene.model;
  std::set<std::uint32_t> skins;
  for (const gltf::SkinnedPrimitive& source : model.skinnedPrimitives) skins.insert(source.skin);
  std::vector<Error> errors;
  for (const std::uint32_t skin : skins) {
    const std::string text = own ? *own : model.skins[skin].rig;
    if (text.empty() && !own) continue;
    const std::vector<std::uint32_t> joints = model.skins[skin].joints;
    const std::size_t notes = model.notes.size();
    Result<std::shared_ptr<const RigView>> view = gltf::applyRig(model, skin, text);
    const std::string name = own ? nameOf(samples::pathOf(preparation.rig)) : file;
    if (view) {
      SceneRig rig{*view, samples::must(packRig(**view)), {}};
      const std::vector<std::uint32_t>& left = model.skins[skin].joints;
      const std::set<std::uint32_t> written(left.begin(), left.end());
      std::ranges::copy_if(joints, std::back_inserter(rig.drivenNodes),
                           [&](std::uint32_t node) { return !written.contains(node); });
      scene.rigs.emplace(skin, std::move(rig));
      for (std::size_t note = notes; note < model.notes.size(); ++note)
        scene.notes.push_back(fmt::format("{}: {}", samples::inQuotes(name), model.notes[note]));
      continue;
    }
    const Error error{view.error().code, fmt::format("{}: skin {}: {}", samples::inQuotes(name),
                                                     skin, view.error().message)};
    if (!own) return error;
    errors.push_back(error);
  }
  if (own && scene.rigs.empty() && !errors.empty()) return errors.front();
  for (const Error& error : errors) scene.notes.push_back(error.message + "; it has no rig");
  return {};
}

/// Makes the parts. `file` is the file's name, for messages.
Result<void> addParts(Scene& scene, const std::string& file, const MeshPreparation& preparation) {
  gltf::Model& model = *scene.model;
  const auto inFile = [&file](const Error& error) {
    return Error{error.code, fmt::format("{}: {}", samples::inQuotes(file), error.message)};
  };
  if (!spendOnParts(model)) {
    return inFile({ErrorCode::limitExceeded,
                   fmt::format("its nodes and primitives make {} parts, which need more memory "
                               "than the limit for a file of this size",
                               model.skinnedPrimitives.size())});
  }
  Preparer preparer(scene, preparation);
  for (const gltf::SkinnedPrimitive& source : model.skinnedPrimitives) {
    ScenePart part;
    part.source = source;
    part.primitive = &model.meshes[source.mesh].primitives[source.primitive];
    part.name = partLabel(model, source, *part.primitive);
    if (part.primitive->influences.empty()) {
      scene.notes.push_back(fmt::format("{} has no JOINTS_0: its {} vertices stay in bind pose",
                                        part.name, part.primitive->vertexCount));
    } else {
      Result<std::shared_ptr<const PreparedMesh>> mesh = preparer.prepare(source);
      if (!mesh) return inFile(mesh.error());
      part.mesh = std::move(*mesh);
    }
    scene.parts.push_back(std::move(part));
  }
  return {};
}

/// Makes a scene of a model.
Result<Scene> makeScene(gltf::Model loaded, const std::filesystem::path& path,
                        const MeshPreparation& preparation) {
  Scene scene;
  scene.model = std::make_unique<gltf::Model>(std::move(loaded));
  scene.notes = scene.model->notes;
  scene.clipFiles.push_back({path});
  Result<void> done = addClips(scene, preparation);
  if (done) done = addRigs(scene, nameOf(path), preparation);
  if (done) done = addParts(scene, nameOf(path), preparation);
  if (!done) return done.error();
  return scene;
}

/// The first clip with this name in each file that is called `file`, or in all if it is empty.
std::vector<std::uint32_t> clipsNamed(const Scene& scene, std::string_view name,
                                      const std::filesystem::path& file) {
  std::vector<std::uint32_t> found;
  for (std::uint32_t clip = 0; clip < scene.model->clips.size(); ++clip) {
    if (scene.model->clips[clip].name != name) continue;
    const std::size_t source = fileOfClip(scene, clip);
    const std::filesystem::path& path = scene.clipFiles[source].path;
    if (!file.empty() && path != file && path.filename() != file) continue;
    if (found.empty() || fileOfClip(scene, found.back()) != source) found.push_back(clip);
  }
  return found;
}

/// The clips that a name or FILE:NAME may mean. Names may have colons, too.
std::vector<std::uint32_t> clipsCalled(const Scene& scene, std::string_view wanted) {
  std::vector<std::uint32_t> found = clipsNamed(scene, wanted, {});
  for (std::size_t colon = wanted.find(':'); found.empty() && colon != std::string_view::npos;
       colon = wanted.find(':', colon + 1)) {
    found = clipsNamed(scene, wanted.substr(colon + 1), samples::pathOf(wanted.substr(0, colon)));
  }
  return found;
}

}  // namespace

Result<Scene> loadScene(const std::filesystem::path& path, const MeshPreparation& preparation) {
  Result<gltf::Model> loaded = gltf::load(path, {.images = preparation.images,
                                                 .rigidMeshes = preparation.rigidMeshes,
                                                 .strict = preparation.strict});
  if (!loaded) return loaded.error();
  return makeScene(std::move(*loaded), path, preparation);
}

Result<Scene> loadScene(std::span<const std::byte> file, const std::string& name,
                        const MeshPreparation& preparation) {
  Result<gltf::Model> loaded =
      gltf::loadFromMemory(file, {}, {.images = preparation.images, .strict = preparation.strict});
  if (!loaded) return loaded.error();
  return makeScene(std::move(*loaded), name, preparation);
}

std::uint32_t jointCount(const Scene& scene, std::uint32_t skin) {
  const auto rig = scene.rigs.find(skin);
  const std::size_t driven = rig == scene.rigs.end() ? 0 : rig->second.packed.drivenJoints();
  return static_cast<std::uint32_t>(scene.model->skins[skin].joints.size() + driven);
}

bool allows(const Scene& scene, Method method) {
  return std::ranges::all_of(scene.parts, [method](const ScenePart& part) {
    return part.mesh == nullptr || part.mesh->allows(method);
  });
}

std::size_t fileOfClip(const Scene& scene, std::uint32_t clip) {
  const auto next = std::ranges::upper_bound(scene.clipFiles, clip, {}, &ClipFile::firstClip);
  return static_cast<std::size_t>(next - scene.clipFiles.begin()) - 1;
}

Result<std::uint32_t> chooseClip(const Scene& scene, const std::optional<std::string>& wanted) {
  const gltf::Model& model = *scene.model;
  if (!wanted) return model.clips.empty() ? noIndex : 0u;
  if (*wanted == "none") return noIndex;
  const std::optional<std::uint32_t> numbered = gltf::findClip(model, *wanted);
  const bool isNumber = numbered && std::to_string(*numbered) == *wanted;
  if (numbered && (isNumber || model.clips[*numbered].name != *wanted)) return *numbered;
  const std::vector<std::uint32_t> found = clipsCalled(scene, *wanted);
  if (found.size() == 1) return found[0];
  if (found.empty()) {
    return Error{ErrorCode::invalidArgument,
                 fmt::format("--animation: there is no clip {}; there {} {} clip{}",
                             samples::inQuotes(*wanted), model.clips.size() == 1 ? "is" : "are",
                             model.clips.size(), model.clips.size() == 1 ? "" : "s")};
  }
  std::string all;
  for (const std::uint32_t clip : found) {
    all += fmt::format("{}{} of {}", all.empty() ? "" : ", ", clip,
                       samples::inQuotes(nameOf(scene.clipFiles[fileOfClip(scene, clip)].path)));
  }
  return Error{
      ErrorCode::invalidArgument,
      fmt::format("--animation: several clips are called {}: {}; give a number or FILE:NAME",
                  samples::inQuotes(*wanted), all)};
}

namespace {

samples::RigInput rigInput(const Scene& scene, std::uint32_t skin, std::uint32_t clip, double time,
                           std::span<const Transform> globals) {
  const SceneRig& rig = scene.rigs.at(skin);
  samples::RigInput input{gltf::pose(*scene.model, skin, globals), {}};
  if (rig.packed.givenWeights() != 0)
    input.givenWeights = gltf::morphWeights(*scene.model, rig.view->weightsOf, clip, time);
  return input;
}

/// The pose of a skin with a rig, and the weights that the rig drives.
struct DrivenPose {
  std::vector<JointMatrix> palette;
  std::vector<float> weights;
};

DrivenPose drive(const PackedRig& rig, const samples::RigInput& input) {
  DrivenPose pose{input.written, {}};
  pose.palette.resize(input.written.size() + rig.drivenJoints());
  std::vector<float> weights(input.givenWeights.size() + rig.drivenWeights());
  samples::must(evaluateRig(rig, input.written, input.givenWeights,
                            std::span(pose.palette).subspan(input.written.size()), weights));
  pose.weights.assign(weights.end() - static_cast<std::ptrdiff_t>(rig.drivenWeights()),
                      weights.end());
  return pose;
}

}  // namespace

samples::RigInput rigInput(const Scene& scene, std::uint32_t skin, std::uint32_t clip,
                           double time) {
  return rigInput(scene, skin, clip, time, gltf::nodeGlobals(*scene.model, clip, time));
}

ScenePose scenePose(const Scene& scene, std::uint32_t clip, double time) {
  const std::vector<Transform> globals = gltf::nodeGlobals(*scene.model, clip, time);
  ScenePose pose;
  pose.poses.resize(scene.model->skins.size());
  std::map<std::uint32_t, std::vector<float>> driven;  // by skin: weights
  for (const ScenePart& part : scene.parts) {
    const std::uint32_t skin = part.source.skin;
    std::vector<JointMatrix>& palette = pose.poses[skin];
    if (palette.empty()) {
      const auto rig = scene.rigs.find(skin);
      if (rig == scene.rigs.end()) {
        palette = gltf::pose(*scene.model, skin, globals);
      } else {
        DrivenPose posed = drive(rig->second.packed, rigInput(scene, skin, clip, time, globals));
        palette = std::move(posed.palette);
        driven[skin] = std::move(posed.weights);
      }
    }
    std::vector<MorphWeight>& morphs = pose.morphs.emplace_back();
    // A primitive may have fewer targets than the mesh has weights.
    const std::size_t targets = part.primitive->morphTargets.size();
    if (targets == 0) continue;
    std::vector<float> weights = gltf::morphWeights(*scene.model, part.source.node, clip, time);
    // Those that a rig drives are the last ones.
    if (targets > weights.size())
      weights.insert(weights.end(), driven[skin].begin(), driven[skin].end());
    for (std::uint32_t target = 0; target < weights.size() && target < targets; ++target) {
      if (weights[target] != 0) morphs.push_back({target, weights[target]});
    }
  }
  return pose;
}

}  // namespace dermis::cli
