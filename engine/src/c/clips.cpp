// Banks of clips, and figures.
#include <algorithm>
#include <cmath>
#include <deque>
#include <optional>

#include "convert.h"
#include "sources.h"

using namespace dermis;
using namespace dermis::c;

namespace {

dermis_clip_error errorTo(const ClipError& error) {
  return {error.translation, error.rotation, error.scale, error.weight};
}

}  // namespace

struct dermis_bank : Object {
  explicit dermis_bank(PackedClips packed, PackClipsReport of = {})
      : clips(std::move(packed)), report(std::move(of)), morphedNodes(clips.morphedNodes()) {
    for (std::uint32_t skin = 0; skin < clips.skinCount(); ++skin)
      jointCounts.push_back(clips.jointCount(skin));
    for (std::uint32_t i = 0; i < clips.clipCount(); ++i) {
      const ClipInfo info = clips.clip(i);
      infos.push_back({info.duration, info.wraps ? 0u : 1u, info.additive ? 1u : 0u});
    }
    for (const std::uint32_t node : morphedNodes) weightCounts.push_back(clips.weightCount(node));
  }

  PackedClips clips;
  PackClipsReport report;
  std::vector<std::uint32_t> jointCounts;
  std::vector<dermis_clip_info> infos;
  std::vector<std::uint32_t> morphedNodes, weightCounts;
};

extern "C" {

dermis_code dermis_pack_clips(const dermis_clips_source* callers, dermis_bank** bank,
                              dermis_error* error) {
  return guarded(error, [&] {
    const dermis_clips_source given = in(callers, "source");
    const ClipsOfCaller source(given);
    PackClipsOptions options;
    options.maxError = given.max_error;
    options.masks = source.masks;
    options.maxWeightError = given.max_weight_error;
    options.rootMotion = source.rootMotion;
    std::deque<JointBounds> bounds;
    std::vector<const JointBounds*> meshes;
    if (given.meshes != nullptr) {
      for (const dermis_mesh_view& mesh : inArray(given.meshes, given.skin_count, "meshes")) {
        const std::size_t joints = source.skeleton.skins[bounds.size()].joints.size();
        bounds.push_back(must(jointBounds(View(&mesh).mesh, static_cast<std::uint32_t>(joints))));
        meshes.push_back(&bounds.back());
      }
      options.meshes = meshes;
    }
    dermis_bank*& result = required(bank, "bank");
    PackClipsReport report;
    PackedClips clips = must(packClips(source.skeleton, source.clips, options, &report));
    result = new dermis_bank(std::move(clips), std::move(report));
  });
}

dermis_code dermis_bank_load(const void* bytes, size_t byte_count, dermis_bank** bank,
                             dermis_error* error) {
  return guarded(error, [&] {
    const auto all = array(static_cast<const std::byte*>(bytes), byte_count, "bytes");
    dermis_bank*& result = required(bank, "bank");
    result = new dermis_bank(must(PackedClips::fromBytes(all)));
  });
}

dermis_code dermis_bank_contents(const dermis_bank* bank, dermis_bank_info* info,
                                 dermis_error* error) {
  return guarded(error, [&] {
    const dermis_bank& known = required(bank, "bank");
    checkOut(info, "info");
    dermis_bank_info result{};
    result.node_count = known.clips.nodeCount();
    result.bytes = known.clips.bytes().data();
    result.byte_count = known.clips.bytes().size();
    result.skin_count = known.clips.skinCount();
    result.clip_count = known.clips.clipCount();
    result.mask_count = known.clips.maskCount();
    result.joint_counts = known.jointCounts.data();
    result.clips = known.infos.data();
    result.worst_error = known.report.worstError;
    result.max_error = known.report.maxError;
    result.slowest_rate = known.report.slowestRate;
    result.fastest_rate = known.report.fastestRate;
    result.key_count = known.report.keyCount;
    result.animated_tracks = known.report.animatedTracks;
    result.constant_tracks = known.report.constantTracks;
    result.worst = known.report.worst.c_str();
    result.has_root_motion = known.clips.hasRootMotion() ? 1 : 0;
    result.root_motion_error = errorTo(known.clips.rootMotionError());
    result.morphed_node_count = static_cast<std::uint32_t>(known.morphedNodes.size());
    result.morphed_nodes = known.morphedNodes.data();
    result.weight_counts = known.weightCounts.data();
    give(info, result);
  });
}

dermis_code dermis_node_error(const dermis_bank* bank, uint32_t node, dermis_clip_error* result,
                              dermis_error* error) {
  return guarded(error, [&] {
    const ClipError found = required(bank, "bank").clips.error(node);
    required(result, "result") = errorTo(found);
  });
}

dermis_code dermis_clip_time(const dermis_bank* bank, uint32_t clip, double time, uint32_t hold,
                             float* result, dermis_error* error) {
  return guarded(error, [&] {
    const PackedClips& clips = required(bank, "bank").clips;
    if (clip >= clips.clipCount()) fail("there is no clip " + std::to_string(clip));
    if (!std::isfinite(time)) fail("the time is not finite");
    required(result, "result") = clipTime(clips.clip(clip), time, hold != 0);
  });
}

dermis_code dermis_sample_pose(const dermis_bank* bank, const dermis_clip_layer* layers,
                               uint32_t layer_count, uint32_t skin, dermis_joint* joints,
                               uint32_t joint_count, dermis_error* error) {
  return guarded(error, [&] {
    std::vector<ClipLayer> all;
    appendLayers(array(layers, layer_count, "layers"), all);
    const std::span<dermis_joint> results = array(joints, joint_count, "joints");
    must(samplePose(required(bank, "bank").clips, all, skin,
                    {reinterpret_cast<JointMatrix*>(results.data()), results.size()}));
  });
}

dermis_code dermis_sample_weights(const dermis_bank* bank, const dermis_clip_layer* layers,
                                  uint32_t layer_count, uint32_t node, float* weights,
                                  uint32_t weight_count, dermis_error* error) {
  return guarded(error, [&] {
    std::vector<ClipLayer> all;
    appendLayers(array(layers, layer_count, "layers"), all);
    must(sampleWeights(required(bank, "bank").clips, all, node,
                       array(weights, weight_count, "weights")));
  });
}

dermis_code dermis_root_motion(const dermis_bank* bank, uint32_t clip, double from, double to,
                               uint32_t hold, double displacement[3], double* turn,
                               dermis_error* error) {
  return guarded(error, [&] {
    const RootMotion motion =
        must(rootMotion(required(bank, "bank").clips, clip, from, to, hold != 0));
    const std::span<double> results = array(displacement, 3, "displacement");
    double& turned = required(turn, "turn");
    std::ranges::copy(motion.displacement, results.begin());
    turned = motion.turn;
  });
}

dermis_code dermis_clip_box(const dermis_bank* bank, uint32_t clip, uint32_t skin,
                            const dermis_joint_bounds* bounds, dermis_method method,
                            dermis_promise promise, dermis_box* box, dermis_error* error) {
  return guarded(error, [&] {
    const PackedClips& source = required(bank, "bank").clips;
    const JointBounds& mesh = required(bounds, "bounds").bounds;
    dermis_box& result = required(box, "box");
    result =
        boxOf(must(clipBounds(source, clip, skin, mesh, methodOf(method), promiseOf(promise))));
  });
}

dermis_code dermis_blend_box(const dermis_bank* bank, const uint32_t* clips, uint32_t clip_count,
                             uint32_t skin, const dermis_joint_bounds* bounds, dermis_method method,
                             dermis_promise promise, dermis_box* box, dermis_error* error) {
  return guarded(error, [&] {
    const PackedClips& source = required(bank, "bank").clips;
    const JointBounds& mesh = required(bounds, "bounds").bounds;
    dermis_box& result = required(box, "box");
    result = boxOf(must(blendBounds(source, array(clips, clip_count, "clips"), skin, mesh,
                                    methodOf(method), promiseOf(promise))));
  });
}

dermis_code dermis_add_clips(dermis_scene* scene, const dermis_bank* bank, dermis_clips* clips,
                             dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    const PackedClips& added = required(bank, "bank").clips;
    dermis_clips& result = required(clips, "clips");
    result = handleTo<dermis_clips>(must(target.addClips(added)));
  });
}

dermis_code dermis_remove_clips(dermis_scene* scene, dermis_clips clips, dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).removeClips(handleOf(clips))); });
}

dermis_code dermis_add_figures(dermis_scene* scene, dermis_clips clips, const dermis_rig* rigs,
                               uint32_t rig_count, uint32_t count, dermis_figure* figures,
                               dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    const std::span<dermis_figure> results = array(figures, count, "figures");
    const ClipsHandle bank = handleOf(clips);
    std::vector<RigHandle> ofSkins;
    for (const dermis_rig& rig : array(rigs, rig_count, "rigs")) ofSkins.push_back(handleOf(rig));
    std::vector<FigureHandle> added;
    while (added.size() < count) {
      const Result<FigureHandle> figure = target.addFigure(bank, ofSkins);
      if (!figure) {
        for (const FigureHandle other : added) must(target.removeFigure(other));
        must(figure);
      }
      added.push_back(*figure);
    }
    for (std::size_t i = 0; i < added.size(); ++i) results[i] = handleTo<dermis_figure>(added[i]);
  });
}

dermis_code dermis_remove_figure(dermis_scene* scene, dermis_figure figure, dermis_error* error) {
  return guarded(error, [&] { must(changedScene(scene).removeFigure(handleOf(figure))); });
}

dermis_code dermis_figure_pose(const dermis_scene* scene, dermis_figure figure, uint32_t skin,
                               dermis_pose* pose, dermis_error* error) {
  return guarded(error, [&] {
    dermis_pose& result = required(pose, "pose");
    result = handleTo<dermis_pose>(must(sceneOf(scene).pose(handleOf(figure), skin)));
  });
}

dermis_code dermis_play_clips(dermis_scene* scene, const dermis_play* plays, uint32_t count,
                              dermis_error* error) {
  return guarded(error, [&] {
    Scene& target = changedScene(scene);
    const std::span<const dermis_play> all = array(plays, count, "plays");
    std::vector<ClipLayer> layers;
    std::vector<FigurePlay> converted;
    std::optional<Failure> failure;  // of the entry behind those that are converted
    for (std::size_t i = 0; i < all.size() && !failure; ++i) {
      try {
        const FigureHandle figure = handleOf(all[i].figure);
        appendLayers(array(all[i].layers, all[i].layer_count, "layers"), layers);
        converted.push_back({figure, {}});
      } catch (Failure& caught) {
        caught.message.insert(0, "entry " + std::to_string(i) + ": ");
        failure = std::move(caught);
      }
    }
    std::size_t first = 0;
    for (std::size_t i = 0; i < converted.size(); ++i) {
      converted[i].layers = std::span(layers).subspan(first, all[i].layer_count);
      first += all[i].layer_count;
    }
    if (failure) {
      // An entry without a figure: the scene plays none, and names an entry before it that is
      // wrong.
      const std::string own = "entry " + std::to_string(converted.size()) + ": ";
      converted.emplace_back();
      const Result<void> played = target.play(converted);
      if (played || played.error().message.starts_with(own)) throw *std::move(failure);
      must(played);
    }
    must(target.play(converted));
  });
}

}  // extern "C"
