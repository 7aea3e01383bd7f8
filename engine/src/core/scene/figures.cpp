// Banks of clips, and figures: poses that the scene samples from clips.

#include <string>
#include <utility>

#include "scene/books.h"
#include "scene/slot_map.h"
#include "strict_floating_point.h"

namespace dermis {

Result<ClipsHandle> Scene::addClips(PackedClips clips) {
  SceneBooks& books = changed();
  SceneClips::Content content{std::move(clips), {}, {}};
  content.isRigid = rigidSkins(content.bank);
  Range bytes;
  if (!books.owner_.isCpu) {
    content.device = deviceClips(content.bank);
    const std::uint64_t bank = (content.bank.bytes().size() + unitBytes - 1) / unitBytes;
    const std::uint64_t size = bank * unitBytes + content.device.words.size() * 4;
    const Result<std::optional<Range>> found =
        books.take(books.meshStore_, size, packedMeshAlignment);
    if (!found) return found.error();
    if (!*found) {
      return SceneBooks::noRoom("the clips take " + std::to_string(size) + " bytes",
                                books.meshStore_, "bytes of meshes and clips");
    }
    bytes = **found;
  }
  const ClipsHandle handle =
      books.clips_.add({std::make_unique<const SceneClips::Content>(std::move(content)), bytes, 0});
  if (!books.owner_.isCpu) books.clipUploads_.push_back(handle);
  if (books.owner_.clipsAdded != nullptr)
    books.owner_.clipsAdded(books.owner_.user, books.clips_.at(handle.index).content->bank);
  return handle;
}

Result<void> Scene::removeClips(ClipsHandle handle) {
  SceneBooks& books = changed();
  const SceneClips* clips = books.clips_.find(handle);
  if (clips == nullptr) return unknownHandle("clips", handle);
  if (clips->users != 0) return isUsed("clips", handle.index, clips->users, "figure");
  if (!books.owner_.isCpu) books.retire(books.meshStore_.ranges, clips->bytes);
  if (books.owner_.clipsRemoved != nullptr)
    books.owner_.clipsRemoved(books.owner_.user, clips->content->bank);
  books.clips_.remove(handle);
  return {};
}

namespace {

/// Whether a rig fits a skin of a bank.
Result<void> checkRigOf(const PackedRig& rig, const PackedClips& bank, std::uint32_t skin) {
  if (rig.writtenJoints() != bank.jointCount(skin)) {
    return invalid("the rig of skin " + std::to_string(skin) + " has " +
                   std::to_string(rig.writtenJoints()) + " written joints, but the skin has " +
                   std::to_string(bank.jointCount(skin)));
  }
  if (rig.givenWeights() == 0 || bank.weightCount(rig.weightsOf()) == rig.givenWeights()) return {};
  return invalid("the rig of skin " + std::to_string(skin) + " takes " +
                 std::to_string(rig.givenWeights()) + " weights, but the clips have " +
                 std::to_string(bank.weightCount(rig.weightsOf())) + " of its node");
}

}  // namespace

Result<FigureHandle> Scene::addFigure(ClipsHandle handle, std::span<const RigHandle> rigs) {
  SceneBooks& books = changed();
  SceneClips* const clips = books.clips_.find(handle);
  if (clips == nullptr) return unknownHandle("clips", handle);
  const SceneClips::Content& content = *clips->content;
  const PackedClips& bank = content.bank;
  const bool onGpu = !books.owner_.isCpu;
  if (!rigs.empty() && rigs.size() != bank.skinCount()) {
    return invalid("there are " + std::to_string(rigs.size()) + " rigs for " +
                   std::to_string(bank.skinCount()) + " skins");
  }
  for (std::uint32_t skin = 0; skin < rigs.size(); ++skin) {
    if (!rigs[skin]) continue;
    const SceneRig* rig = books.rigs_.find(rigs[skin]);
    if (rig == nullptr) return unknownHandle("rig", rigs[skin]);
    if (Result<void> good = checkRigOf(*rig->rig, bank, skin); !good) return good.error();
  }
  std::uint64_t joints = 0;
  for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) joints += bank.jointCount(skin);
  SceneFigure figure;
  figure.clips = handle;
  const Result<std::optional<Range>> matrices = books.takeJoints(joints, onGpu, figure.buffer);
  if (!matrices) return matrices.error();
  if (!*matrices) return books.noJoints(bank.skinCount(), joints, onGpu);
  figure.joints = **matrices;
  if (onGpu) {
    const std::uint64_t units = std::uint64_t{content.device.matrixCount} * abi::UNITS_OF_TRANSFORM;
    Result<std::optional<Range>> taken{std::optional<Range>(Range())};
    if (units != 0) taken = books.take(books.unitStore_, units, 1);
    if (!taken || !*taken) {
      books.poseBuffers_[figure.buffer].joints.free(figure.joints);
      if (!taken) return taken.error();
      return SceneBooks::noRoom(
          "a figure needs " + std::to_string(units) + " units of 16 bytes of palettes",
          books.unitStore_, "units");
    }
    figure.matrices = **taken;
  }
  ScenePose pose;
  pose.writtenByGpu = onGpu;
  pose.buffer = figure.buffer;
  pose.joints = {figure.joints.offset, 0};
  for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) {
    pose.jointCount = pose.writtenJoints = pose.slotJoints = bank.jointCount(skin);
    bool isRigid = content.isRigid[skin];
    pose.rig = notUsed;
    if (!rigs.empty() && rigs[skin]) {
      const PackedRig& rig = *books.rigs_.at(rigs[skin].index).rig;
      pose.jointCount += rig.drivenJoints();
      pose.rig = rigs[skin].index;
      isRigid = isRigid && rig.isRigid();
    }
    if (Result<void> taken = books.takeDriven(pose, pose.rig); !taken) {
      for (const PoseHandle added : figure.poses) books.dropPose(added, true);
      books.poseBuffers_[figure.buffer].joints.free(figure.joints);
      if (figure.matrices.size != 0) books.unitStore_.ranges.free(figure.matrices);
      return taken.error();
    }
    pose.promise = isRigid ? JointPromise::rigid : JointPromise::scaling;
    pose.joints.size = pose.writtenJoints;
    figure.poses.push_back(books.poses_.add(pose));
    pose.joints.offset += pose.writtenJoints;
  }
  ++clips->users;
  const FigureHandle added = books.figures_.add(std::move(figure));
  for (const PoseHandle own : books.figures_.at(added.index).poses)
    books.poses_.at(own.index).figure = added.index;
  return added;
}

Result<void> Scene::removeFigure(FigureHandle handle) {
  SceneBooks& books = changed();
  const SceneFigure* figure = books.figures_.find(handle);
  if (figure == nullptr) return unknownHandle("figure", handle);
  for (const PoseHandle pose : figure->poses) {
    const std::uint32_t users = books.poses_.at(pose.index).users;
    if (users != 0) return isUsed("pose", pose.index, users);
  }
  for (const PoseHandle pose : figure->poses) books.dropPose(pose);
  books.retire(books.poseBuffers_[figure->buffer].joints, figure->joints);
  if (figure->matrices.size != 0) books.retire(books.unitStore_.ranges, figure->matrices);
  --books.clips_.at(figure->clips.index).users;
  books.figures_.remove(handle);
  return {};
}

Result<PoseHandle> Scene::pose(FigureHandle handle, std::uint32_t skin) const {
  const SceneFigure* figure = books_->figures_.find(handle);
  if (figure == nullptr) return unknownHandle("figure", handle);
  if (skin < figure->poses.size()) return PoseHandle(figure->poses[skin]);
  return Error{ErrorCode::invalidArgument,
               "figure " + std::to_string(handle.index) + " has no skin " + std::to_string(skin) +
                   "; its clips have " + std::to_string(figure->poses.size())};
}

Result<void> Scene::play(std::span<const FigurePlay> plays) {
  SceneBooks& books = changed();
  std::vector<PackedLayers>& packed = books.layersScratch_;
  packed.clear();
  for (std::size_t entry = 0; entry < plays.size(); ++entry) {
    const FigurePlay& play = plays[entry];
    if (entry + prefetchDistance < plays.size())
      books.figures_.prefetch(plays[entry + prefetchDistance].figure.index, 4);
    const auto refused = [&](const Error& error) {
      return Error{error.code, "entry " + std::to_string(entry) + ": " + error.message};
    };
    const SceneFigure* figure = books.figures_.find(play.figure);
    if (figure == nullptr) return refused(unknownHandle("figure", play.figure));
    const Result<PackedLayers> layers =
        packLayers(books.clips_.at(figure->clips.index).content->bank, play.layers, "");
    if (!layers) return refused(layers.error());
    packed.push_back(*layers);
  }
  for (std::size_t entry = 0; entry < plays.size(); ++entry) {
    SceneFigure& figure = books.figures_.at(plays[entry].figure.index);
    figure.layers = packed[entry];
    ++figure.version;
    for (const PoseHandle pose : figure.poses) ++books.poses_.at(pose.index).version;
    if (figure.listedIn == books.planNumber_ + 1) continue;
    figure.listedIn = books.planNumber_ + 1;
    books.posed_.insert(books.posed_.end(), figure.poses.begin(), figure.poses.end());
  }
  return {};
}

/// The node whose weights drive an instance; none while its pose belongs to no figure.
std::optional<BankMorphed> SceneBooks::findMorphed(const SceneInstance& instance) const {
  const std::uint32_t figure = poses_.at(instance.pose).figure;
  if (instance.morphWriter != MorphWriter::clips || figure == notUsed) return {};
  const SceneClips& clips = clips_.at(figures_.at(figure).clips.index);
  return ClipBank(clips.content->bank).morphedNode(instance.weightsOf);
}

/// On the CPU: the active targets as of now.
void SceneBooks::sampleMorphs(SceneInstance& instance) {
  std::vector<MorphWeight>& active = instance.extras.morphs;
  active.clear();
  if (const std::optional<BankMorphed> node = findMorphed(instance)) {
    const SceneFigure& figure = figures_.at(poses_.at(instance.pose).figure);
    weightsScratch_.resize(node->count);
    sampleWeights(clips_.at(figure.clips.index).content->bank, figure.layers, *node,
                  weightsScratch_);
    for (std::uint32_t target = 0; target < node->count; ++target) {
      const float weight = weightsScratch_[target];
      if (weight != 0) active.push_back({target, weight});
    }
  }
  // The instances of a group have active targets, or none has any.
  if (active.empty()) active.push_back({0, 0});
}

/// For the GPU: what lists the active targets of the last of the work's instances.
void SceneBooks::listMorphs(const SceneInstance& instance) {
  Work::MorphList list{
      static_cast<std::uint32_t>(work_.instances.size() - 1), notUsed, notUsed, {}};
  const std::uint32_t drivenCount = drivenTargetsOf(instance);
  const std::optional<BankMorphed> node = findMorphed(instance);
  list.record.clips = abi::MORPH_LIST_NO_CLIPS;
  if (instance.morphWriter == MorphWriter::gpu) {
    list.buffer = instance.weightsBuffer;
    list.record.weights =
        static_cast<std::uint32_t>(instance.weights.offset * sizeof(JointMatrix) / sizeof(float));
    list.record.weightCount = instance.extras.writtenMorphs;
  } else if (node) {
    const SceneFigure& figure = figures_.at(poses_.at(instance.pose).figure);
    const SceneClips& clips = clips_.at(figure.clips.index);
    const auto& layers = figure.layers.layers;
    const auto bank = static_cast<std::uint32_t>(clips.bytes.offset / 4);
    list.record = {.extension = 0,
                   .list = 0,
                   .weightCount = instance.extras.writtenMorphs,
                   .weights = bank + node->rest,
                   .clips = bank,
                   .track = 3 * ClipBank(clips.content->bank).header.nodeCount + node->firstGroup,
                   .masks = bank + node->masks,
                   .layerCount = figure.layers.count,
                   .time0 = layers[0].time,
                   .layer0 = layers[0].bits,
                   .time1 = layers[1].time,
                   .layer1 = layers[1].bits,
                   .time2 = layers[2].time,
                   .layer2 = layers[2].bits,
                   .time3 = layers[3].time,
                   .layer3 = layers[3].bits,
                   .listed = 0,
                   .driven = 0,
                   .firstDriven = 0,
                   .drivenCount = 0};
  } else if (drivenCount == 0) {
    return;
  }
  if (drivenCount != 0) {
    const ScenePose& pose = poses_.at(instance.pose);
    list.drivenBuffer = pose.drivenBuffer;
    list.record.driven =
        static_cast<std::uint32_t>(drivenWord(pose, instance.extras.firstDrivenWeight));
    list.record.firstDriven = meshes_.at(instance.mesh.index).info.morphTargetCount - drivenCount;
    list.record.drivenCount = drivenCount;
  }
  work_.morphLists.push_back(list);
}

std::span<JointMatrix> SceneBooks::matricesOf(const SceneFigure& figure) {
  const std::span<JointMatrix> first = matricesOf(poses_.at(figure.poses[0].index));
  return {first.data(), static_cast<std::size_t>(figure.joints.size)};
}

/// For an instance that is skinned with one of its poses, or that may be, if the GPU decides. Those
/// that are skinned come first.
void SceneBooks::sampleFigure(std::uint32_t index, bool isNeeded) {
  SceneFigure& figure = figures_.at(index);
  if (figure.sampled == figure.version || figure.plannedIn == planNumber_) return;
  figure.isNeeded = isNeeded;
  figure.plannedIn = planNumber_;
  figure.place = static_cast<std::uint32_t>(sampling_.size());
  sampling_.push_back(index);
  if (owner_.isCpu) return;
  for (const PoseHandle pose : figure.poses) {
    if (poses_.at(pose.index).rig != notUsed) driveRig(pose.index, figure.place);
  }
}

/// For kernels.
void SceneBooks::gatherFigures() {
  if (owner_.isCpu) return;
  for (const std::uint32_t index : sampling_) {
    const SceneFigure& figure = figures_.at(index);
    const SceneClips& clips = clips_.at(figure.clips.index);
    const auto& layers = figure.layers.layers;
    const abi::FigureRecord record{
        .matrices = static_cast<std::uint32_t>(figure.matrices.offset),
        .poses = static_cast<std::uint32_t>(figure.joints.offset) * abi::UNITS_OF_MATRIX,
        .layerCount = figure.layers.count | (figure.isNeeded ? abi::FIGURE_NEEDED : 0u),
        .bank = notUsed,
        .time0 = layers[0].time,
        .layer0 = layers[0].bits,
        .time1 = layers[1].time,
        .layer1 = layers[1].bits,
        .time2 = layers[2].time,
        .layer2 = layers[2].bits,
        .time3 = layers[3].time,
        .layer3 = layers[3].bits};
    work_.addFigure(figure.buffer,
                    {&clips.content->device, static_cast<std::uint32_t>(clips.bytes.offset / 4),
                     static_cast<std::uint32_t>(clips.deviceOffset() / 4)},
                    record);
  }
}

}  // namespace dermis
