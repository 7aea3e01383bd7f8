// Prepares a glTF file for skinning: shared by `skin`, `verify` and `info`.
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

/// One skinned primitive of the scene. Primitives that stand in it several times share what was
/// prepared.
struct ScenePart {
  gltf::SkinnedPrimitive source;
  const gltf::Primitive* primitive = nullptr;
  std::string name;  ///< for messages: "node 3 'Fox', mesh 'fox1 primitive 0'"
  std::shared_ptr<const PreparedMesh> mesh;  ///< null without influences: it stays in bind pose
};

struct Scene {
  std::unique_ptr<gltf::Model> model;
  std::vector<ScenePart> parts;
  std::vector<std::string> warnings;  ///< what was repaired
  std::vector<std::string> remarks;   ///< what `validate` counted and `pack` deals with
  std::vector<std::string> notes;     ///< what was mended on reading, left out, or is not skinned
};

/// Whether every part has what the method needs.
bool allows(const Scene& scene, Method method);

/// Reads a model and packs its skinned primitives. Broken values are repaired with a warning, and
/// broken rules noted; both are refused where the preparation is strict. Fails with `limitExceeded`
/// if nodes, primitives and skins multiply to more memory than the file justifies.
Result<Scene> loadScene(const std::filesystem::path& path, const MeshPreparation& preparation);
/// The same for a binary glTF file in memory; `name` is what messages call it.
Result<Scene> loadScene(std::span<const std::byte> file, const std::string& name,
                        const MeshPreparation& preparation);

/// The clip that `--animation` means: a number, a name, "none" for the rest pose, nothing for clip
/// 0 or the rest pose. Fails with `invalidArgument` if there is no such clip.
Result<std::uint32_t> chooseClip(const gltf::Model& model,
                                 const std::optional<std::string>& wanted);

/// A scene at one time.
struct ScenePose {
  std::vector<std::vector<JointMatrix>> poses;   ///< by skin; empty if no part uses it
  std::vector<std::vector<MorphWeight>> morphs;  ///< by part: the active morph targets

  const std::vector<JointMatrix>& pose(const ScenePart& part) const {
    return poses[part.source.skin];
  }
};

ScenePose scenePose(const Scene& scene, std::uint32_t clip, double time);

}  // namespace dermis::cli
