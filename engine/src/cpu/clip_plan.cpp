#include "cpu/clip_plan.h"

#include <algorithm>

#include "strict_floating_point.h"

namespace dermis::cpu {
namespace {

/// At least one.
constexpr std::size_t linesOf(std::size_t floats) {
  return floats / std::size(CacheLine().v) + 1;
}

/// The local transforms of a node in the memory of all.
class LocalsWriter {
 public:
  LocalsWriter(const PlanLocals& layout, std::vector<CacheLine>& lines) : layout_(layout) {
    lines.assign(linesOf(layout.size()), {});
    first_ = numbersOf(lines.data());
  }

  void set(std::size_t node, std::size_t path, std::span<const float> numbers) {
    const std::size_t place = placeOf(layout_, node, path);
    const std::size_t apart = path == 1 ? 1 : layout_.padded;
    for (std::size_t i = 0; i < numbers.size(); ++i) first_[place + i * apart] = numbers[i];
  }

  /// Of its first number. `path`: translation, rotation, scale.
  static std::size_t placeOf(const PlanLocals& layout, std::size_t node, std::size_t path) {
    if (path == 1) return layout.rotations() + 4 * node;
    return (path == 0 ? layout.translations() : layout.scales()) + node;
  }

 private:
  PlanLocals layout_;
  float* first_;
};

std::vector<CacheLine> restOf(const ClipBank& bank, const PlanLocals& layout, bool isDifference) {
  std::vector<CacheLine> lines;
  LocalsWriter writer(layout, lines);
  for (std::size_t i = 0; i < bank.header.nodeCount; ++i) {
    BankNode node = bank.node(i);
    if (isDifference) {
      std::ranges::fill(node.translation, 0.0f);
      std::ranges::copy(std::array{0.0f, 0.0f, 0.0f, 1.0f}, node.rotation);
      std::ranges::fill(node.scale, 1.0f);
    }
    writer.set(i, 0, node.translation);
    writer.set(i, 1, node.rotation);
    writer.set(i, 2, node.scale);
  }
  return lines;
}

PlanClass planClass(const ClipBank& bank, const BankClass& keys) {
  return {reinterpret_cast<const std::byte*>(bank.words.data() + keys.keys),
          std::size_t{keys.rowHalves} * 2, 1.0f / static_cast<float>(1u << keys.level),
          static_cast<float>(keys.keyCount - 2)};
}

PlanClip planClip(const ClipBank& bank, const BankClip& clip, const PlanLocals& layout) {
  PlanClip plan;
  plan.rate = clip.rate;
  plan.isAdditive = (clip.flags & 2) != 0;
  for (std::size_t i = 0; i < clip.classCount; ++i)
    plan.classes.push_back(planClass(bank, bank.keyClass(clip, i)));
  plan.base = restOf(bank, layout, plan.isAdditive);
  const std::size_t nodes = bank.header.nodeCount;
  for (std::size_t i = 0; i < 3 * nodes; ++i) {
    const std::uint32_t word = bank.words[clip.tracks + i];
    const std::size_t node = i / 3, path = i % 3;
    const std::size_t place = LocalsWriter::placeOf(layout, node, path);
    float* const base = numbersOf(plan.base.data()) + place;
    switch (static_cast<TrackKind>(word >> 30)) {
      case TrackKind::rest:
        break;
      case TrackKind::constant: {
        const std::size_t apart = path == 1 ? 1 : layout.padded;
        for (std::size_t k = 0; k < (path == 1 ? 4u : 3u); ++k)
          base[k * apart] = bank.number((word & 0x3fffffff) + k);
        break;
      }
      case TrackKind::animated: {
        const std::uint32_t number = word >> trackColumnBits & 255;
        const std::uint32_t column = word & ((1u << trackColumnBits) - 1);
        const BankClass keys = bank.keyClass(clip, number);
        const KeyFormat format = KeyFormat::of(keys.format);
        PlanTracks& to = plan.tracks[format.size + (format.isRotation ? 3 : 0)];
        const auto end = static_cast<std::int32_t>((column + 1) * format.halves() * 2);
        if (keys.jumps != 0) {
          to.jumps.push_back({static_cast<std::uint32_t>(to.tracks.size()), number,
                              std::size_t{keys.jumps} * 4 + column,
                              (std::size_t{keys.columnCount} + 3) / 4 * 4});
        }
        to.tracks.push_back(
            {end - 8, number, static_cast<std::uint32_t>(place), keys.ranges + 8 * column});
        break;
      }
    }
  }
  return plan;
}

}  // namespace

ClipPlan::ClipPlan(const PackedClips& packed) : bank(&packed) {
  const ClipBank from(packed);
  words = from.words;
  nodeCount = from.header.nodeCount;
  locals.padded = (nodeCount + nodesTogether - 1) / nodesTogether * nodesTogether;
  rest = restOf(from, locals, false);
  for (std::size_t i = 0; i < nodeCount; ++i) {
    const BankNode node = from.node(i);
    nodes.push_back({node.parent, node.fixed});
  }
  for (std::size_t i = 0; i < from.header.skinCount; ++i) {
    const BankSkin skin = from.skin(i);
    skins.push_back({skin.jointCount, skin.nodes, skin.matrices});
  }
  for (std::size_t i = 0; i < from.header.clipCount; ++i) {
    const PlanClip& clip = clips.emplace_back(planClip(from, from.clip(i), locals));
    mostClasses = std::max(mostClasses, clip.classes.size());
    for (std::size_t format = 0; format < keyFormats; ++format)
      mostTracks[format] = std::max(mostTracks[format], clip.tracks[format].tracks.size());
  }
  masks.resize(linesOf((std::size_t{from.header.maskCount} + 1) * locals.padded));
  float* const factors = numbersOf(masks.data());
  for (std::uint32_t mask = 0; mask <= from.header.maskCount; ++mask) {
    for (std::size_t node = 0; node < nodeCount; ++node)
      factors[mask * locals.padded + node] = from.mask(mask, node);
  }
}

void ClipScratch::prepare(const ClipPlan& plan) {
  const auto grow = [](auto& memory, std::size_t count) {
    if (memory.size() < count) memory.resize(count);
  };
  grow(times, plan.mostClasses);
  grow(locals, linesOf(plan.locals.size() * maxClipLayers + 4));
  grow(matrices, linesOf(plan.locals.padded * 12));
  grow(nodes, plan.nodeCount);
  for (std::size_t format = 0; format < keyFormats; ++format) {
    KeyBatch& batch = batches[format];
    const std::size_t count = plan.mostTracks[format] * maxClipLayers + nodesTogether;
    grow(batch.from, count);
    grow(batch.to, count);
    grow(batch.fractions, count);
    grow(batch.places, count);
    grow(batch.ranges, count);
  }
}

void samplePlainly(const ClipPlan& plan, const PackedLayers& layers, ClipScratch& scratch,
                   std::span<JointMatrix> poses) {
  const std::span<Affine<float>> nodes = std::span(scratch.nodes).first(plan.nodeCount);
  sampleNodes(*plan.bank, layers, nodes);
  for (std::uint32_t skin = 0; skin < plan.skins.size(); ++skin) {
    const std::uint32_t joints = plan.skins[skin].jointCount;
    poseSkin(*plan.bank, skin, nodes, poses.first(joints));
    poses = poses.subspan(joints);
  }
}

}  // namespace dermis::cpu
