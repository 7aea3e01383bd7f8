#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "commands.h"
#include "kit/text.h"
#include "skinned_scene.h"

namespace dermis::cli {
namespace {

using Json = nlohmann::ordered_json;

struct InfoOptions {
  std::string model;
  std::vector<std::string> clips;
  std::string rig;
  bool json = false;
  bool strict = false;
};

/// Cut, as in messages: skins may share joints.
Json nodeNames(const gltf::Model& model, const std::vector<std::uint32_t>& nodes) {
  Json names = Json::array();
  for (const std::uint32_t node : nodes)
    names.push_back(samples::shortName(model.nodes[node].name));
  return names;
}

/// The names of a part's morph targets.
Json targetNames(const Scene& scene, const ScenePart& part) {
  const gltf::Node& node = scene.model->nodes[part.source.node];
  const std::vector<std::string>& all = scene.model->meshes[node.mesh].morphTargetNames;
  Json names = Json::array();
  for (std::size_t i = 0; i < std::min(all.size(), part.primitive->morphTargets.size()); ++i)
    names.push_back(samples::shortName(all[i]));
  return names;
}

/// In quotes, separated by commas.
std::string listed(const Json& names) {
  constexpr std::size_t most = 200;
  std::string list;
  for (std::size_t i = 0; i < std::min(names.size(), most); ++i) {
    if (i > 0) list += ", ";
    list += "'" + names[i].get<std::string>() + "'";
  }
  return names.size() > most ? fmt::format("{} and {} more", list, names.size() - most) : list;
}

Json describePart(const Scene& scene, const ScenePart& part, bool isFirst) {
  const gltf::Primitive& primitive = *part.primitive;
  Json json;
  json["name"] = part.name;
  json["node"] = part.source.node;
  json["skin"] = part.source.skin;
  json["vertices"] = primitive.vertexCount;
  json["triangles"] = primitive.triangles.size() / 3;
  json["normals"] = !primitive.normals.empty();
  json["tangents"] = !primitive.tangents.empty();
  json["morphTargets"] = primitive.morphTargets.size();
  // Parts may share a mesh.
  if (isFirst) json["morphTargetNames"] = targetNames(scene, part);
  json["influencesStored"] = primitive.influencesPerVertex();
  json["influencesUsed"] = part.mesh ? part.mesh->packed().info().maxInfluences : 0;
  json["jointsUsed"] = part.mesh ? part.mesh->packed().info().requiredJoints : 0;
  json["joints"] = jointCount(scene, part.source.skin);
  json["packedBytes"] = part.mesh ? part.mesh->packed().bytes().size() : 0;
  json["problems"] = Json::array();
  static const MeshReport none;
  for (const MeshReport::Finding& finding : (part.mesh ? part.mesh->report() : none).findings) {
    json["problems"].push_back({{"kind", meshProblemName(finding.problem)},
                                {"vertices", finding.count},
                                {"firstVertex", finding.firstVertex},
                                {"repaired", refusedByPack(finding.problem)},
                                {"message", finding.message}});
  }
  return json;
}

Json describe(const Scene& scene, const InfoOptions& options) {
  Json json;
  json["meshes"] = Json::array();
  std::set<const gltf::Primitive*> described;
  for (const ScenePart& part : scene.parts) {
    const bool isFirst = described.insert(part.primitive).second;
    json["meshes"].push_back(describePart(scene, part, isFirst));
  }
  json["skins"] = Json::array();
  for (const gltf::Skin& skin : scene.model->skins) {
    json["skins"].push_back({{"name", skin.name},
                             {"joints", skin.joints.size()},
                             {"jointNames", nodeNames(*scene.model, skin.joints)}});
  }
  json["rigs"] = Json::array();
  for (const auto& [skin, rig] : scene.rigs) {
    json["rigs"].push_back({{"skin", skin},
                            {"writtenJoints", rig.packed.writtenJoints()},
                            {"drivenJoints", rig.packed.drivenJoints()},
                            {"drivenWeights", rig.packed.drivenWeights()},
                            {"drivenJointNames", nodeNames(*scene.model, rig.drivenNodes)},
                            {"twists", rig.view->twists.size()},
                            {"correctives", rig.view->correctives.size()},
                            {"chains", rig.view->chains.size()},
                            {"linear", rig.view->linears.size()},
                            {"largestErrorAtExamples", rig.packed.residual()}});
  }
  json["clips"] = Json::array();
  for (std::uint32_t number = 0; number < scene.model->clips.size(); ++number) {
    const gltf::Clip& clip = scene.model->clips[number];
    Json& entry = json["clips"].emplace_back();
    entry = {{"name", clip.name}, {"seconds", clip.duration}, {"channels", clip.channels.size()}};
    if (const std::size_t file = fileOfClip(scene, number); file > 0)
      entry["file"] = options.clips[file - 1];
  }
  json["warnings"] = scene.warnings;
  json["notes"] = scene.notes;
  return json;
}

void printText(const Json& json) {
  const auto text = [](const Json& value) { return samples::oneLine(value.get<std::string>()); };
  fmt::print("{} skinned primitives, {} skins, {} clips\n", json["meshes"].size(),
             json["skins"].size(), json["clips"].size());
  for (const Json& mesh : json["meshes"]) {
    fmt::print("mesh   {}\n", text(mesh["name"]));
    fmt::print(
        "       {} vertices, {} triangles, {}{}influences: up to {} of {} stored, skin {} with {} "
        "joints\n",
        mesh["vertices"].get<int>(), mesh["triangles"].get<int>(),
        mesh["normals"].get<bool>() ? "normals, " : "",
        mesh["tangents"].get<bool>() ? "tangents, " : "", mesh["influencesUsed"].get<int>(),
        mesh["influencesStored"].get<int>(), mesh["skin"].get<int>(), mesh["joints"].get<int>());
    if (mesh.contains("morphTargetNames") && !mesh["morphTargetNames"].empty())
      fmt::print("       morph targets {}\n", listed(mesh["morphTargetNames"]));
    for (const Json& problem : mesh["problems"]) {
      fmt::print("       {} ({} vertices): {}\n", text(problem["kind"]),
                 problem["vertices"].get<int>(), text(problem["message"]));
    }
  }
  for (std::size_t skin = 0; skin < json["skins"].size(); ++skin)
    fmt::print("skin   {}: joints {}\n", skin, listed(json["skins"][skin]["jointNames"]));
  for (const Json& rig : json["rigs"]) {
    fmt::print(
        "rig    of skin {}: {} joints and {} morph weights driven by {} twists, {} correctives, {} "
        "chains, {} linear drivers\n",
        rig["skin"].get<int>(), rig["drivenJoints"].get<int>(), rig["drivenWeights"].get<int>(),
        rig["twists"].get<int>(), rig["correctives"].get<int>(), rig["chains"].get<int>(),
        rig["linear"].get<int>());
    if (!rig["drivenJointNames"].empty())
      fmt::print("       drives joints {}\n", listed(rig["drivenJointNames"]));
  }
  std::size_t number = 0;
  for (const Json& clip : json["clips"]) {
    const std::string file =
        clip.contains("file")
            ? " of " + samples::inQuotes(clip["file"].get_ref<const std::string&>())
            : "";
    fmt::print("clip   {} {}{}: {:.3f} s, {} channels\n", number++,
               samples::inQuotes(clip["name"].get_ref<const std::string&>()), file,
               clip["seconds"].get<double>(), clip["channels"].get<int>());
  }
  for (const Json& note : json["notes"]) fmt::print("note   {}\n", text(note));
}

ExitStatus info(const InfoOptions& options) {
  const Result<Scene> scene =
      loadScene(samples::pathOf(options.model),
                {.strict = options.strict, .clips = options.clips, .rig = options.rig});
  if (!scene) return reportModelError(scene.error());
  const Json json = describe(*scene, options);
  if (options.json) {
    // Names come from a file: invalid UTF-8 in them is replaced.
    fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
  } else {
    printText(json);
  }
  return ExitStatus::done;
}

}  // namespace

Run addInfo(CLI::App& app) {
  CLI::App* command =
      app.add_subcommand("info", "List meshes, skins, influences, clips and all problems");
  const auto options = std::make_shared<InfoOptions>();
  command->add_option("MODEL", options->model, "A .gltf or .glb file")->required();
  addClipFiles(*command, options->clips);
  addRigFile(*command, options->rig);
  command->add_flag("--json", options->json, "Print JSON");
  command->add_flag("--strict", options->strict, strictHelp);
  return [options] { return info(*options); };
}

}  // namespace dermis::cli
