// All stages. A few vertices of a company, or of a lone instance, pass through all of them at a
// time, so that what one hands to the next stays in the nearest cache. Every method, format and
// option is made of them.
#pragma once

#include <algorithm>
#include <span>
#include <type_traits>

#include "cpu/bind_inl.h"
#include "cpu/methods_inl.h"
#include "cpu/results_inl.h"
#include "cpu/store_inl.h"
#include "cpu/sums_inl.h"
#include "hwy/cache_control.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Whole blocks of a run.
struct Blocks {
  const Run& run;
  std::uint32_t first, end;
};

/// What instances that are skinned together have in common.
struct Common {
  Records records;
  bool isMorphed, hasResults;
  /// Whether vertices are encoded and stored as they are skinned, in whole blocks.
  bool isDirect;

  /// `lanes`: of a company, or 1.
  Common(const Task& task, const TaskInstance* const* instances, std::size_t count,
         std::size_t lanes)
      : records(recordsOf(task.places, instances, count, lanes)),
        isMorphed(!instances[0]->morphs.empty()),
        hasResults(
            std::any_of(instances, instances + count,
                        [](const TaskInstance* instance) { return instance->result != nullptr; })),
        isDirect(!hasResults && task.places.hasMotion() == records.keepsPositions &&
                 !isSnormPosition(task.places[Stream::positions].format)) {
    for (const Record& record : std::span(records.all).first(records.count)) {
      isDirect = isDirect && record.isDense && (lanes > 1 || byDenseSize(record, [](auto) {}));
    }
  }
};

/// The instances that are skinned together, and what is the same for all tiles.
struct Together {
  const Task& task;
  const TaskInstance* const* instances;  ///< of each lane, or the lone one
  std::size_t count;                     ///< without repetitions
  const Common& common;
  const Palette& palette;
  ActiveTargets& morphs;
};

/// Fetches what `storeTile` writes last: stores would wait for it. Always inlined: GCC removes
/// calls of a function that only prefetches.
HWY_INLINE HWY_ATTR void fetchOutput(const Together& together, std::size_t vertex,
                                     const VertexRange& range) {
  for (std::size_t number = 0; number < together.common.records.count; ++number) {
    const Stream stream = together.common.records.all[number].stream;
    const std::size_t stride = together.task.places[stream].stride;
    const std::size_t step = std::max<std::size_t>(stride, 64);
    for (std::size_t i = 0; i < together.count; ++i) {
      const std::byte* const place = together.instances[i]->outputs[stream] + vertex * stride;
      for (std::size_t byte = range.first * stride; byte < range.end * stride; byte += step)
        hwy::Prefetch(place + byte);
    }
  }
}

/// Calls `skin` with the method, and with whether there are scale/shear parts and tangents.
template <class Skin>
DERMIS_INLINE void byMethod(const Task& task, bool hasParts, const Skin& skin) {
  const auto byTangents = [&](auto method, auto scales) HWY_ATTR {
    if (task.places[Stream::tangents].format != VertexFormat::none)
      return skin(method, scales, std::true_type());
    skin(method, scales, std::false_type());
  };
  const auto byScale = [&](auto method) HWY_ATTR {
    hasParts ? byTangents(method, std::true_type()) : byTangents(method, std::false_type());
  };
  switch (task.method) {
    case Method::linear:
      return byTangents(std::integral_constant<Method, Method::linear>(), std::false_type());
    case Method::blended:
      return byScale(std::integral_constant<Method, Method::blended>());
    case Method::centerOfRotation:
      return byScale(std::integral_constant<Method, Method::centerOfRotation>());
    case Method::bulgeControlled:
      return byScale(std::integral_constant<Method, Method::bulgeControlled>());
    default:  // others have been refused
      return byScale(std::integral_constant<Method, Method::dualQuaternion>());
  }
}

/// How units are read from the mesh. If there are eight lanes, its blocks are as units of the tile.
template <bool isLone, class D>
inline constexpr From fromMesh = !isLone                              ? From::company
                                 : hn::MaxLanes(D()) == blockVertices ? From::tile
                                                                      : From::lone;

/// What the vertices from a block on are skinned by.
inline Skinning skinningOf(const Together& together, const Run& run, std::uint32_t block) {
  const Task& task = together.task;
  const MeshData& mesh = *task.mesh;
  const std::uint64_t slot = run.slotOf(block);
  return {together.palette,
          Slots{mesh.jointNumbers.data() + slot, mesh.pairNumbers.data() + slot,
                mesh.weights.data() + slot, run.influences},
          sourceOf(mesh, task.method, block),
          task.places[Stream::normals].format != VertexFormat::none};
}

/// The positions from `vertex` on that become the previous ones.
template <bool isLone, class D>
inline HWY_ATTR Kept<D> keptOf(D d, const Together& together, std::size_t vertex) {
  const OutputAttribute& positions = together.task.places[Stream::positions];
  Kept<D> kept{{}, positions.stride, formatSize(positions.format) / 4, {}};
  for (std::size_t lane = 0; lane < hn::MaxLanes(d); ++lane) {
    const TaskInstance& instance = *together.instances[isLone ? 0 : lane];
    kept.at[lane] =
        instance.outputs[Stream::positions] + (vertex + (isLone ? lane : 0)) * kept.stride;
    kept.restarts[lane] = instance.restartsMotion ? 1.0f : 0.0f;
  }
  return kept;
}

/// Where blocks of all runs of the mesh are stored directly.
template <bool isLone, class D>
inline HWY_ATTR Direct<D> directOf(D d, const Together& together) {
  Direct<D> direct{together.task.places, together.common.records, {}, {}};
  if (direct.records.keepsPositions) direct.kept = keptOf<isLone>(d, together, 0);
  for (std::size_t i = 0; i < direct.records.count; ++i) {
    for (std::size_t lane = 0; lane < (isLone ? 1 : hn::MaxLanes(d)); ++lane) {
      direct.to[i][lane] =
          reinterpret_cast<float*>(together.instances[lane]->outputs[direct.records.all[i].stream]);
    }
  }
  return direct;
}

/// Encodes the attributes of a tile that begins at `vertex`, and stores them.
template <bool isLone, class D>
inline HWY_ATTR void storeTile(D d, const Together& together, std::size_t vertex, std::size_t units,
                               const VertexRange& range, Tile<D>& tile) {
  const VertexPlaces& places = together.task.places;
  encodeUnits(d, places, units, tile.slots);
  // The previous positions are those in the output, or those that are stored now.
  const auto copyPositions = [&](bool restart) HWY_ATTR {
    if (!places.hasMotion() || together.common.records.keepsPositions) return;
    for (std::size_t i = 0; i < together.count; ++i) {
      const TaskInstance& instance = *together.instances[i];
      if (instance.restartsMotion == restart)
        keepPositions(together.task, instance, vertex + range.first, vertex + range.end);
    }
  };
  copyPositions(false);
  if (together.common.records.keepsPositions) {
    Kept<D> kept = keptOf<isLone>(d, together, vertex);
    for (std::size_t unit = 0; unit < units; ++unit) {
      const std::size_t first = unit * unitVertices<isLone, D>;
      if constexpr (isLone) {
        // Other vertices may be another thread's.
        for (std::size_t lane = 0; lane < hn::MaxLanes(d); ++lane) {
          const std::size_t own = std::clamp(first + lane, range.first, range.end - 1);
          kept.at[lane] =
              together.instances[0]->outputs[Stream::positions] + (vertex + own) * kept.stride;
        }
        keepUnit(d, kept, 0, tile.slots[unit]);
      } else if (first >= range.first && first < range.end) {
        keepUnit(d, kept, first * kept.stride, tile.slots[unit]);
      }
    }
  }
  for (std::size_t number = 0; number < together.common.records.count; ++number) {
    const Record& record = together.common.records.all[number];
    const std::size_t stride = places[record.stream].stride;
    constexpr std::size_t lanes = isLone ? 1 : hn::MaxLanes(d);
    std::byte* to[lanes];
    for (std::size_t i = 0; i < lanes; ++i)
      to[i] = together.instances[i]->outputs[record.stream] + vertex * stride;
    if constexpr (isLone) {
      storeRecord(d, record, stride, to[0], range, tile);
    } else {
      storeRecord(d, record, stride, to, range, tile);
    }
  }
  copyPositions(true);
}

/// Skins blocks of a run into the tile, or stores them directly.
template <bool isLone, class D>
inline HWY_ATTR void skinBlocks(D d, const Together& together, const Blocks& blocks,
                                const Direct<D>* direct, Tile<D>& tile) {
  Skinning by = skinningOf(together, blocks.run, blocks.first);
  if (together.common.isMorphed) {
    morphTile<isLone>(d, *together.task.mesh, blocks.first, blocks.end, together.morphs, tile,
                      by.from);
  }
  const std::size_t units = (blocks.end - blocks.first) * unitsOf<isLone, D>;
  const std::size_t vertex = std::size_t{blocks.first} * blockVertices;
  byMethod(together.task, by.palette.scales, [&](auto method, auto scales, auto tangents) HWY_ATTR {
    by.from.isTile ? skinUnits<isLone, method(), scales(), tangents(), From::tile>(
                         d, by, units, direct, vertex, tile)
                   : skinUnits<isLone, method(), scales(), tangents(), fromMesh<isLone, D>>(
                         d, by, units, direct, vertex, tile);
  });
}

/// Skins a tile. Only vertices in the range are stored and count for results.
template <bool isLone, class D>
inline HWY_ATTR void skinTile(D d, const Together& together, const Blocks& blocks,
                              const VertexRange& range, Tile<D>& tile, Findings<D>& findings) {
  const Task& task = together.task;
  const std::size_t units = (blocks.end - blocks.first) * unitsOf<isLone, D>;
  const std::size_t vertex = std::size_t{blocks.first} * blockVertices;
  fetchOutput(together, vertex, range);
  skinBlocks<isLone, D>(d, together, blocks, nullptr, tile);
  if (together.common.hasResults) findBounds<isLone>(d, tile, units, range, findings);
  if (isSnormPosition(task.places[Stream::positions].format))
    relateToBoxes<isLone>(d, together.instances, units, range, tile, findings);
  storeTile<isLone>(d, together, vertex, units, range, tile);
}

/// Skins the vertices of a run that are in the range: whole blocks directly.
template <bool isLone, class D>
inline HWY_ATTR void skinDirectly(D d, const Together& together, const Direct<D>& direct,
                                  const Blocks& blocks, const VertexRange& range, Tile<D>& tile,
                                  Findings<D>& findings) {
  const auto whole = static_cast<std::uint32_t>((range.first + blockVertices - 1) / blockVertices);
  const auto end = static_cast<std::uint32_t>(range.end / blockVertices);
  const auto skinPart = [&](std::uint32_t block, std::size_t first, std::size_t last) HWY_ATTR {
    const std::uint32_t number = blocks.first + block;
    skinTile<isLone>(d, together, {blocks.run, number, number + 1}, {first, last}, tile, findings);
  };
  if (range.first != std::size_t{whole} * blockVertices)
    skinPart(0, range.first, std::min<std::size_t>(range.end, blockVertices));
  // Morphed vertices come from the tile.
  const std::uint32_t most = together.common.isMorphed ? tileBlocks<isLone, D> : end;
  for (std::uint32_t block = whole; block < end; block += most) {
    skinBlocks<isLone>(
        d, together, {blocks.run, blocks.first + block, blocks.first + std::min(block + most, end)},
        &direct, tile);
  }
  if (end >= whole && range.end != std::size_t{end} * blockVertices)
    skinPart(end, 0, range.end - std::size_t{end} * blockVertices);
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
