// Prepares a glTF file for skinning: for the subcommands that load a model as a scene, and for the
// viewer.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/result.h"
#include "dermis/rig.h"
#include "kit/batch_runner.h"
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

/// A file whose clips the model has.
struct ClipFile {
  std::filesystem::path path;   ///< as given
  std::uint32_t firstClip = 0;  ///< its clips end where those of the next file begin
};

/// The rig of a skin.
struct SceneRig {
  std::shared_ptr<const RigView> view;
  PackedRig packed;
  std::vector<std::uint32_t> drivenNodes;  ///< of joints of the skin
};

struct Scene {
  std::unique_ptr<gltf::Model> model;
  std::map<std::uint32_t, SceneRig> rigs;  ///< by skin
  std::vector<ClipFile> clipFiles;         ///< the model's own file, then those of `--clips`
  std::vector<ScenePart> parts;
  std::vector<std::string> warnings;  ///< repairs, and centers of rotation that were not computed
  std::vector<std::string> remarks;   ///< problems that `validate` counts and `pack` handles
  std::vector<std::string> notes;     ///< problems that were repaired on reading, and what is left
                                      ///< out or not skinned
};

/// The number of joints of a pose: those of the skin, and those that its rig drives.
std::uint32_t jointCount(const Scene& scene, std::uint32_t skin);

/// Whether every part has the data that the method needs.
bool allows(const Scene& scene, Method method);

/// Reads a model, adds the clips of other files, applies rigs, and packs its skinned primitives.
/// Invalid values
/// are repaired with a warning, and broken rules give a note; if the preparation is strict, both
/// are refused. Fails with `limitExceeded` if the combinations of nodes, primitives and skins need
/// more memory than the size of the file justifies.
Result<Scene> loadScene(const std::filesystem::path& path, const MeshPreparation& preparation);
/// The same for a binary glTF file in memory, without other files; messages call it `name`.
Result<Scene> loadScene(std::span<const std::byte> file, const std::string& name,
                        const MeshPreparation& preparation);

/// The number of the file that a clip comes from.
std::size_t fileOfClip(const Scene& scene, std::uint32_t clip);

/// The clip that the value of `--animation` selects: an index, a name, FILE:NAME with a file as
/// given or without its folder, or "none" for the rest pose. Without a value: clip 0, or the rest
/// pose if there is no clip. Fails with `invalidArgument` if there is no such clip, or if several
/// files have it.
Result<std::uint32_t> chooseClip(const Scene& scene, const std::optional<std::string>& wanted);

/// The pose of a scene at one time, with what its rigs drive.
struct ScenePose {
  std::vector<std::vector<JointMatrix>> poses;   ///< by skin; empty if no part uses it
  std::vector<std::vector<MorphWeight>> morphs;  ///< by part: the active morph targets

  const std::vector<JointMatrix>& pose(const ScenePart& part) const {
    return poses[part.source.skin];
  }
};

/// What the rig of a skin reads at one time.
samples::RigInput rigInput(const Scene& scene, std::uint32_t skin, std::uint32_t clip, double time);

ScenePose scenePose(const Scene& scene, std::uint32_t clip, double time);

}  // namespace dermis::cli
