// Prepares a glTF file for skinning: for the subcommands that load a model as a scene, and for the
// viewer.
#pragma once

#include <cstddef>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/result.h"
#include "prepared_mesh.h"

namespace dermis::cli {

/// One skinned primitive of the scene. Primitives that occur several times share the prepared mesh.
struct ScenePart {
  gltf::SkinnedPrimitive source;
  const gltf::Primitive* primitive = nullptr;
  std::string name;  ///< for messages: "node 3 'Fox', mesh 'fox1 primitive 0'"
  std::shared_ptr<const PreparedMesh> mesh;  ///< null if there are no influences: stays in bind
                                             ///< pose
};

struct Scene {
  std::unique_ptr<gltf::Model> model;
  std::vector<ScenePart> parts;
  std::vector<std::string> warnings;  ///< repairs, and centers of rotation that were not computed
  std::vector<std::string> remarks;   ///< problems that `validate` counts and `pack` handles
  std::vector<std::string> notes;     ///< problems that were repaired on reading, and what is left
                                      ///< out or not skinned
};

/// Whether every part has the data that the method needs.
bool allows(const Scene& scene, Method method);

/// Reads a model and packs its skinned primitives. Invalid values are repaired with a warning, and
/// broken rules give a note; if the preparation is strict, both are refused. Fails with
/// `limitExceeded` if the combinations of nodes, primitives and skins need more memory than the
/// size of the file justifies.
Result<Scene> loadScene(const std::filesystem::path& path, const MeshPreparation& preparation);
/// The same for a binary glTF file in memory; messages call it `name`.
Result<Scene> loadScene(std::span<const std::byte> file, const std::string& name,
                        const MeshPreparation& preparation);

/// The clip that the value of `--animation` selects: an index, a name, or "none" for the rest pose.
/// Without a value: clip 0, or the rest pose if there is no clip. Fails with `invalidArgument` if
/// there is no such clip.
Result<std::uint32_t> chooseClip(const gltf::Model& model,
                                 const std::optional<std::string>& wanted);

/// The pose of a scene at one time.
struct ScenePose {
  std::vector<std::vector<JointMatrix>> poses;   ///< by skin; empty if no part uses it
  std::vector<std::vector<MorphWeight>> morphs;  ///< by part: the active morph targets

  const std::vector<JointMatrix>& pose(const ScenePart& part) const {
    return poses[part.source.skin];
  }
};

ScenePose scenePose(const Scene& scene, std::uint32_t clip, double time);

}  // namespace dermis::cli
