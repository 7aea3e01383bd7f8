// A character of a crowd: its packed meshes, and its clips as poses. In an engine both are assets.
#pragma once

#include <compare>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "dermis/clips.h"
#include "dermis/gltf.h"
#include "dermis/mesh.h"
#include "dermis/result.h"

namespace dermis::samples {

/// A skinned primitive of the file: body, hair, shirt, …
struct Part {
  const gltf::Primitive* source = nullptr;
  gltf::PrimitiveView primitive;
  PackedMesh packed;
  std::uint32_t skin = 0;  ///< index into `Character::jointCounts`
};

/// A moment of a clip.
struct PoseKey {
  std::uint32_t clip = 0;
  std::uint32_t tick = 0;

  friend auto operator<=>(const PoseKey&, const PoseKey&) = default;
};

/// What a figure plays: a moment of a clip, which may fade in over what it played before.
struct Playing {
  PoseKey pose;
  PoseKey before;
  float weight = 1;  ///< of `pose`; `before` has the rest

  bool fades() const { return weight < 1; }

  friend auto operator<=>(const Playing&, const Playing&) = default;
};

struct CharacterOptions {
  double ticksPerSecond = 30;
  std::uint32_t maxTicks = 120;  ///< of a clip; a longer clip is played faster
  bool images = false;           ///< whether to read the images of its materials
};

class Character {
 public:
  /// Fails as `gltf::load` and `pack` do, with `invalidData` if nothing is skinned, and with
  /// `limitExceeded` if its nodes, primitives, skins and clips together need more memory than the
  /// size of the file justifies.
  static Result<Character> load(const std::filesystem::path& path,
                                const CharacterOptions& options = {});

  const gltf::Model& model() const { return *model_; }
  const std::vector<Part>& parts() const { return parts_; }
  /// For each skin that a part uses: its number of joints. Parts with the same skin share its pose.
  const std::vector<std::uint32_t>& jointCounts() const { return jointCounts_; }
  std::uint64_t vertexCount() const;  ///< of all parts

  std::uint32_t clipCount() const { return static_cast<std::uint32_t>(clips_.size()); }
  std::uint32_t tickCount(std::uint32_t clip) const;
  std::span<const JointMatrix> pose(PoseKey key, std::uint32_t skin) const;

  /// Its skeleton, with the skins of `jointCounts`.
  Skeleton skeleton() const;
  /// Appends the layers of what a figure plays: up to two, and none if the file has no clips.
  void addLayers(const Playing& playing, std::vector<ClipLayer>& layers) const;

 private:
  /// A clip, sampled once. Figures at the same tick of a clip have the same pose.
  struct Clip {
    std::uint32_t tickCount = 1;
    std::vector<std::vector<JointMatrix>> poses;  ///< by tick, then skin
  };

  Character() = default;
  /// Returns false if its poses need more memory than the size of the file justifies.
  bool sampleClip(std::uint32_t clip, std::span<const std::uint32_t> skins,
                  const CharacterOptions& options);

  std::unique_ptr<gltf::Model> model_;  ///< parts point into it
  std::vector<Part> parts_;
  std::vector<std::uint32_t> jointCounts_;
  std::vector<std::uint32_t> skins_;  ///< numbers in the file, as `jointCounts_`
  std::vector<Clip> clips_;
};

}  // namespace dermis::samples
