#include "kit/character.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "kit/memory_left.h"
#include "kit/text.h"

namespace dermis::samples {
namespace {

/// Spends the memory of a part: the packed mesh and its views. Many nodes may use one mesh.
bool spendOnPart(const gltf::Primitive& primitive, std::uint64_t& memoryLeft) {
  std::uint64_t displacements = 0;
  for (const gltf::MorphTarget& target : primitive.morphTargets)
    displacements += target.vertices.size() + target.positions.size() + target.normals.size() +
                     target.tangents.size();
  const std::uint64_t perVertex = 64 + std::uint64_t{16} * primitive.influencesPerVertex();
  return spend(memoryLeft, 1, sizeof(Part)) &&
         spend(memoryLeft, primitive.vertexCount, perVertex) &&
         spend(memoryLeft, primitive.morphTargets.size(),
               sizeof(MorphTargetView) + 16 + primitive.vertexCount / 4) &&
         spend(memoryLeft, displacements, 2 * sizeof(float));
}

}  // namespace

Result<Character> Character::load(const std::filesystem::path& path,
                                  const CharacterOptions& options) {
  gltf::LoadOptions loadOptions;
  loadOptions.images = options.images;
  Result<gltf::Model> loaded = gltf::load(path, loadOptions);
  if (!loaded) return loaded.error();
  Character character;
  character.model_ = std::make_unique<gltf::Model>(std::move(*loaded));
  const gltf::Model& model = *character.model_;

  const Error tooMuch{ErrorCode::limitExceeded,
                      fmt::format("{}: it needs more memory than the limit for a file of this size",
                                  inQuotes(path.filename().string()))};
  std::vector<std::uint32_t>& skins = character.skins_;
  std::vector<std::uint32_t> numbers(model.skins.size(), noIndex);
  for (const gltf::SkinnedPrimitive& source : model.skinnedPrimitives) {
    const gltf::Primitive& primitive = model.meshes[source.mesh].primitives[source.primitive];
    if (primitive.influences.empty()) continue;
    if (!spendOnPart(primitive, character.model_->memoryLeft)) return tooMuch;
    const auto jointCount = static_cast<std::uint32_t>(model.skins[source.skin].joints.size());
    std::uint32_t& skin = numbers[source.skin];
    if (skin == noIndex) {
      skin = static_cast<std::uint32_t>(skins.size());
      skins.push_back(source.skin);
      character.jointCounts_.push_back(jointCount);
    }
    gltf::PrimitiveView view(primitive);
    Result<PackedMesh> packed = pack(view.mesh(), jointCount);
    if (!packed) return packed.error();
    character.parts_.push_back({&primitive, std::move(view), std::move(*packed), skin});
  }
  if (character.parts_.empty()) {
    return Error{ErrorCode::invalidData,
                 fmt::format("'{}' has no skinned mesh with joints and weights in its scene",
                             path.filename().string())};
  }
  character.clips_.resize(std::max<std::size_t>(model.clips.size(), 1));
  for (std::uint32_t clip = 0; clip < character.clipCount(); ++clip) {
    if (!character.sampleClip(clip, skins, options)) return tooMuch;
  }
  return character;
}

bool Character::sampleClip(std::uint32_t clip, std::span<const std::uint32_t> skins,
                           const CharacterOptions& options) {
  const bool isRest = model_->clips.empty();
  const double duration = isRest ? 0 : model_->clips[clip].duration;
  Clip& sampled = clips_[clip];
  sampled.tickCount = static_cast<std::uint32_t>(std::clamp(
      std::round(duration * options.ticksPerSecond), 1.0, static_cast<double>(options.maxTicks)));
  std::uint64_t joints = 0;
  for (const std::uint32_t count : jointCounts_) joints += count;
  // Each tick also computes the transforms of all nodes, which are not kept.
  if (!spend(model_->memoryLeft, sampled.tickCount,
             joints * sizeof(JointMatrix) + model_->nodes.size()))
    return false;
  for (std::uint32_t tick = 0; tick < sampled.tickCount; ++tick) {
    const std::vector<Transform> globals =
        gltf::nodeGlobals(*model_, isRest ? noIndex : clip, duration * tick / sampled.tickCount);
    for (const std::uint32_t skin : skins)
      sampled.poses.push_back(gltf::pose(*model_, skin, globals));
  }
  return true;
}

Skeleton Character::skeleton() const {
  Skeleton skeleton = gltf::skeleton(*model_);
  std::vector<SkeletonSkin> used;
  for (const std::uint32_t skin : skins_) used.push_back(skeleton.skins[skin]);
  skeleton.skins = std::move(used);
  return skeleton;
}

void Character::addLayers(const Playing& playing, std::vector<ClipLayer>& layers) const {
  if (model_->clips.empty()) return;
  const auto add = [&](PoseKey key, float weight) {
    const double duration = model_->clips[key.clip].duration;
    layers.push_back(
        {.clip = key.clip, .time = duration * key.tick / tickCount(key.clip), .weight = weight});
  };
  add(playing.pose, playing.weight);
  if (playing.fades()) add(playing.before, 1 - playing.weight);
}

std::uint64_t Character::vertexCount() const {
  std::uint64_t count = 0;
  for (const Part& part : parts_) count += part.packed.vertexCount();
  return count;
}

std::uint32_t Character::tickCount(std::uint32_t clip) const {
  return clips_[clip].tickCount;
}

std::span<const JointMatrix> Character::pose(PoseKey key, std::uint32_t skin) const {
  return clips_[key.clip].poses[key.tick * jointCounts_.size() + skin];
}

}  // namespace dermis::samples
