// All stages. A few vertices of several instances, or of a lone one, pass through all of them at a
// time, so that what one hands to the next stays in the nearest cache. Every method, format and
// option is made of them. plain_inl.h joins them for the common case, with the same operations in
// the same order.
#pragma once

#include <algorithm>
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

/// The instances of a vector, and what is the same for all tiles.
struct Company {
  const Task& task;
  const TaskInstance* const* instances;
  std::size_t count;
  const Palette& palette;
  ActiveTargets* morphs;  ///< of each instance
  Records records = recordsOf(task.places, instances, count);
  bool isMorphed = !instances[0]->morphs.empty();
  bool hasResults = std::any_of(instances, instances + count, [](const TaskInstance* instance) {
    return instance->result != nullptr;
  });
};

/// Fetches what `storeTile` writes last: stores would wait for it. Always inlined: GCC removes
/// calls of a function that only prefetches.
HWY_INLINE HWY_ATTR void fetchOutput(const Company& company, std::size_t vertex,
                                     const VertexRange& range) {
  for (std::size_t number = 0; number < company.records.count; ++number) {
    const Stream stream = company.records.all[number].stream;
    const std::size_t stride = company.task.places[stream].stride;
    const std::size_t step = std::max<std::size_t>(stride, 64);
    for (std::size_t i = 0; i < company.count; ++i) {
      const std::byte* const place = company.instances[i]->outputs[stream] + vertex * stride;
      for (std::size_t byte = range.first * stride; byte < range.end * stride; byte += step)
        hwy::Prefetch(place + byte);
    }
  }
}

/// Blends what the method needs.
template <bool isLone, class D>
inline HWY_ATTR void blendTile(D d, Method method, const Palette& palette, const Slots& slots,
                               std::size_t units, Tile<D>& tile) {
  if (method == Method::centerOfRotation) {
    sumUnits<isLone, 1, false>(d, palette.pairs, nullptr, slots.pairs, slots, units,
                               tile.dualQuaternions);
  } else if (method != Method::linear) {
    sumUnits<isLone, 2, false>(d, palette.pairs, nullptr, slots.pairs, slots, units,
                               tile.dualQuaternions);
  }
  if (palette.scales) {
    sumUnits<isLone, 2, true>(d, palette.partPairs, palette.parts, slots.pairs, slots, units,
                              tile.parts);
  }
  if (needsRows(method))
    sumUnits<isLone, 3, false>(d, palette.rows, nullptr, slots.joints, slots, units, tile.rows);
}

/// Chooses among the versions of `skinUnits`.
template <bool isLone, class D>
inline HWY_ATTR void skinByMethod(D d, const Task& task, const Palette& palette, const Source& from,
                                  std::size_t units, Tile<D>& tile) {
  const Method method = task.method;
  const bool normals = task.places[Stream::normals].format != VertexFormat::none;
  const bool tangents = task.places[Stream::tangents].format != VertexFormat::none;
  const auto skin = [&](auto formula, auto scales, auto withTangents) HWY_ATTR {
    if (isLone || from.isWhole) {
      skinUnits<formula(), scales(), withTangents(), true, isLone>(d, method, palette.isModerate,
                                                                   from, normals, units, tile);
    } else {
      skinUnits<formula(), scales(), withTangents(), false, isLone>(d, method, palette.isModerate,
                                                                    from, normals, units, tile);
    }
  };
  const auto byTangents = [&](auto formula, auto scales) HWY_ATTR {
    tangents ? skin(formula, scales, std::true_type()) : skin(formula, scales, std::false_type());
  };
  const auto byScale = [&](auto formula) HWY_ATTR {
    palette.scales ? byTangents(formula, std::true_type()) : byTangents(formula, std::false_type());
  };
  if (method == Method::linear) {
    byTangents(std::integral_constant<Formula, Formula::linear>(), std::false_type());
  } else if (method == Method::dualQuaternion) {
    byScale(std::integral_constant<Formula, Formula::turned>());
  } else {
    byScale(std::integral_constant<Formula, Formula::other>());
  }
}

/// Encodes the attributes of a tile that begins at `vertex`, and stores them.
template <bool isLone, class D>
inline HWY_ATTR void storeTile(D d, const Company& company, std::size_t vertex, std::size_t units,
                               const VertexRange& range, Tile<D>& tile) {
  const VertexPlaces& places = company.task.places;
  encodeUnits<Stream::positions>(d, places[Stream::positions].format, units, tile);
  encodeUnits<Stream::normals>(d, places[Stream::normals].format, units, tile);
  encodeUnits<Stream::tangents>(d, places[Stream::tangents].format, units, tile);
  // The previous positions are those in the output, or those that are stored now.
  const auto copyPositions = [&](bool restart) HWY_ATTR {
    if (!places.hasMotion()) return;
    for (std::size_t i = 0; i < company.count; ++i) {
      const TaskInstance& instance = *company.instances[i];
      if (instance.restartsMotion == restart)
        keepPositions(company.task, instance, vertex + range.first, vertex + range.end);
    }
  };
  copyPositions(false);
  for (std::size_t number = 0; number < company.records.count; ++number) {
    const Record& record = company.records.all[number];
    const std::size_t stride = places[record.stream].stride;
    std::byte* to[blocksOf<D>];
    for (std::size_t i = 0; i < company.count; ++i)
      to[i] = company.instances[i]->outputs[record.stream] + vertex * stride;
    storeRecord<isLone>(d, record, stride, to, range, tile);
  }
  copyPositions(true);
}

/// Skins a tile. Only vertices in the range are stored and count for results.
template <bool isLone, class D>
inline HWY_ATTR void skinTile(D d, const Company& company, const Blocks& blocks,
                              const VertexRange& range, Tile<D>& tile, Findings<D>& findings) {
  const Task& task = company.task;
  const MeshData& mesh = *task.mesh;
  const std::size_t units = (blocks.end - blocks.first) * (isLone ? 1 : 2);
  const std::size_t vertex = std::size_t{blocks.first} * blockVertices;
  fetchOutput(company, vertex, range);
  const std::uint64_t slot = blocks.run.slotOf(blocks.first);
  blendTile<isLone>(d, task.method, company.palette,
                    {mesh.jointNumbers.data() + slot, mesh.pairNumbers.data() + slot,
                     mesh.weights.data() + slot, blocks.run.influences},
                    units, tile);
  Source from = sourceOf(mesh, task.method, blocks.first, isLone);
  if (company.isMorphed) {
    morphTile<isLone>(d, mesh, blocks.first, blocks.end, company.morphs, tile, from);
  }
  skinByMethod<isLone>(d, task, company.palette, from, units, tile);
  if (company.hasResults) findBounds<isLone>(d, tile, units, range, findings);
  if (isSnormPosition(task.places[Stream::positions].format))
    relateToBoxes<isLone>(d, company.instances, units, range, tile, findings);
  storeTile<isLone>(d, company, vertex, units, range, tile);
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
