// A glTF file made ready for skinning: what `skin`, `verify` and `info` have in common.
#pragma once

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/pack.h"
#include "dermis/result.h"
#include "dermis/validate.h"

namespace dermis::cli {

/// One skinned primitive. Not movable: its views point into it.
struct ScenePart {
  ScenePart() = default;
  ScenePart(const ScenePart&) = delete;
  ScenePart& operator=(const ScenePart&) = delete;

  gltf::SkinnedPrimitive source;
  const gltf::Primitive* primitive = nullptr;
  std::string name;                      ///< "node 3 'Fox', mesh 'fox1' primitive 0"
  bool hasInfluences = false;            ///< without, it stays in bind pose
  MeshReport report;                     ///< of the mesh as the file has it
  std::optional<RepairedMesh> repaired;  ///< where `pack` would have refused it
  std::optional<PackedMesh> packed;      ///< where it has influences

  /// The mesh to skin: the repaired one where there is one.
  MeshView view() const { return repaired ? repaired->view() : original_; }

 private:
  friend Result<struct Scene> loadScene(const std::filesystem::path& path, bool strict);
  std::string meshName_;
  InfluenceSet set_;
  MeshView original_;
};

struct Scene {
  gltf::Model model;
  std::vector<std::unique_ptr<ScenePart>> parts;
  std::vector<std::string> warnings;  ///< what was repaired
  std::vector<std::string> notes;     ///< what was normalised, left out or not skinned
};

/// Reads a model and packs its skinned primitives. Broken values are repaired with a warning, or
/// refused where `strict`.
Result<Scene> loadScene(const std::filesystem::path& path, bool strict);

/// The clip that `--animation` means: a number, a name, "none" for the rest pose, nothing for clip
/// 0 or the rest pose. Fails with `invalidArgument` where there is no such clip.
Result<std::uint32_t> chooseClip(const gltf::Model& model,
                                 const std::optional<std::string>& wanted);

/// The palettes of all skins that the scene's parts use, by skin index; others stay empty.
std::vector<std::vector<JointMatrix>> scenePalettes(const Scene& scene, std::uint32_t clip,
                                                    double time);

}  // namespace dermis::cli
