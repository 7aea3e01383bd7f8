// Where the vertices of a tile in bind pose are read from, and morph targets.
#pragma once

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "cpu/morph.h"
#include "cpu/tile_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Where the vertices of a tile are read from.
struct Source {
  const float *positions = nullptr, *normals = nullptr, *tangents = nullptr;
  const float *givenNormals = nullptr, *givenTangents = nullptr;
  const float *centers = nullptr, *shares = nullptr;
  bool isTile = false;  ///< the tile has them, but not centers and shares
};

/// How the vertices of a unit are read.
enum class From : std::uint8_t {
  lone,     ///< from a block of the mesh, into the lanes
  company,  ///< from a block of the mesh, the same for all lanes
  tile,     ///< from the tile: a vector for each component
};

/// Component `index` of `components` of a unit's vertices.
template <From from, class D>
DERMIS_INLINE Vec<D> loadComponent(D d, const float* first, std::size_t components,
                                   std::size_t index, std::size_t unit) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  constexpr std::size_t perBlock = from == From::lone ? blockVertices / lanes : blockVertices;
  const std::size_t component = (unit / perBlock * components + index) * blockVertices;
  if constexpr (from == From::tile) {
    return hn::Load(d, first + (unit * components + index) * lanes);
  } else if constexpr (from == From::company) {
    return hn::Set(d, first[component + unit % perBlock]);
  } else {
    return hn::Load(d, first + component + unit % perBlock * lanes);
  }
}
template <From from, class D>
DERMIS_INLINE Vec3<D> loadThree(D d, const float* first, std::size_t components, std::size_t unit) {
  return {loadComponent<from>(d, first, components, 0, unit),
          loadComponent<from>(d, first, components, 1, unit),
          loadComponent<from>(d, first, components, 2, unit)};
}

inline const float* blockOf(const std::vector<Lanes>& lanes, std::size_t components,
                            std::uint32_t block) {
  return lanes.empty() ? nullptr : numbersOf(&lanes[block * components]);
}

inline Source sourceOf(const MeshData& mesh, Method method, std::uint32_t block) {
  Source from;
  from.positions = blockOf(mesh.positions, 3, block);
  from.normals = blockOf(mesh.normals, 3, block);
  from.givenNormals = blockOf(mesh.givenNormals, 3, block);
  from.tangents = blockOf(mesh.tangents, 4, block);
  from.givenTangents = blockOf(mesh.givenTangents, 4, block);
  from.centers = blockOf(mesh.centers, 3, block);
  from.shares = method == Method::blended ? blockOf(mesh.dualQuaternionWeights, 1, block)
                                          : blockOf(mesh.bulgeStrengths, 1, block);
  return from;
}

/// Adds displacements of all vertices of a block. `components`: those that the target displaces,
/// positions before normals before tangents; null if not wanted.
inline HWY_ATTR void displaceAll(const std::uint32_t* words,
                                 const BlockDisplacements& displacements,
                                 Lanes* const* components) {
  const Wide d;
  const Vec<Wide> w = hn::Set(d, displacements.weight);
  const std::size_t size = displacements.size;
  for (std::size_t lane = 0; lane < blockVertices; lane += hn::MaxLanes(d)) {
    const auto* const from = reinterpret_cast<const float*>(words) + lane * size;
    const auto add = [&](std::size_t component, Vec<Wide> value) HWY_ATTR {
      if (components[component] == nullptr) return;
      float* const to = components[component]->v + lane;
      hn::Store(hn::Add(hn::Load(d, to), hn::Mul(w, value)), d, to);
    };
    if (size == 3) {
      Vec<Wide> x, y, z;
      hn::LoadInterleaved3(d, from, x, y, z);
      add(0, x);
      add(1, y);
      add(2, z);
      continue;
    }
    const Vec4<Wide> first = loadRows(d, from, size), last = loadRows(d, from + size - 4, size);
    add(0, first.x);
    add(1, first.y);
    add(2, first.z);
    add(3, first.w);
    if (size == 6) {  // the last four begin with two of the first
      add(4, last.z);
      add(5, last.w);
      continue;
    }
    add(4, loadRows(d, from + 4, size).x);
    add(5, last.x);
    add(6, last.y);
    add(7, last.z);
    add(8, last.w);
  }
}

inline HWY_ATTR void morphBlock(const MeshData& mesh, std::uint32_t number, ActiveTargets& active,
                                MorphedBlock& block) {
  active.find(mesh, number * blockVertices / abi::MORPH_BLOCK_VERTICES);
  Lanes* const noLanes = nullptr;
  Lanes* const normals = mesh.normals.empty() ? noLanes : block.normals;
  Lanes* const tangents = mesh.tangents.empty() ? noLanes : block.tangents;
  for (const BlockDisplacements& displacements : active.displacements) {
    const Displacements part = partOf(displacements, number);
    if (part.mask == 0) continue;
    if (part.mask != 0xff) {
      displace(part, displacements, block.positions, normals, tangents);
      continue;
    }
    Lanes* components[9];
    std::size_t count = 0;
    for (const auto& [attribute, lanes] : {std::pair{abi::MORPH_HAS_POSITIONS, block.positions},
                                           {abi::MORPH_HAS_NORMALS, normals},
                                           {abi::MORPH_HAS_TANGENTS, tangents}}) {
      if ((displacements.attributes & attribute) == 0) continue;
      for (std::size_t k = 0; k < 3; ++k)
        components[count++] = lanes == nullptr ? nullptr : lanes + k;
    }
    displaceAll(part.words, displacements, components);
  }
}

/// Morphs the vertices of a tile for instances that have active targets. `active`: those of each.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void morphTile(D d, const MeshData& mesh, std::uint32_t firstBlock,
                                     std::uint32_t blockEnd, ActiveTargets* active,
                                     std::size_t count, Tile<D>& tile, Source& from) {
  constexpr std::size_t lanes = hn::MaxLanes(d), step = isLone ? lanes : 4;
  const bool normals = !mesh.normals.empty(), tangents = !mesh.tangents.empty();
  const float* blocks[lanes];
  for (std::size_t i = 0; i < lanes; ++i)
    blocks[i] = numbersOf(tile.blocks[std::min(i, count - 1)].positions);
  std::size_t units = 0;
  for (std::size_t number = firstBlock; number < blockEnd; ++number) {
    for (std::size_t i = 0; i < count; ++i) {
      MorphedBlock& block = tile.blocks[i];
      std::copy_n(mesh.positions.data() + number * 3, 3, block.positions);
      if (normals) std::copy_n(mesh.givenNormals.data() + number * 3, 3, block.normals);
      if (tangents) {
        std::copy_n(mesh.givenTangents.data() + number * 4, 3, block.tangents);
        block.tangents[3] = mesh.tangents[number * 4 + 3];
      }
      morphBlock(mesh, static_cast<std::uint32_t>(number), active[i], block);
    }
    // Component `component` of a morphed block, to component `to(unit)` of its units.
    const auto spread = [&](std::size_t component, const auto& to) HWY_ATTR {
      for (std::size_t vertex = 0; vertex < blockVertices; vertex += step) {
        const std::size_t offset = component * blockVertices + vertex;
        if constexpr (isLone) {
          to(units + vertex / lanes) = hn::Load(d, blocks[0] + offset);
        } else {
          const Vec4<D> four = gatherRows(d, blocks, offset);
          to(units + vertex) = four.x;
          to(units + vertex + 1) = four.y;
          to(units + vertex + 2) = four.z;
          to(units + vertex + 3) = four.w;
        }
      }
    };
    for (std::size_t c = 0; c < 3; ++c) {
      spread(c, [&](std::size_t unit) -> Vec<D>& { return tile.positions[unit][c]; });
      if (normals)
        spread(3 + c, [&](std::size_t unit) -> Vec<D>& { return tile.givenNormals[unit][c]; });
      if (tangents)
        spread(6 + c, [&](std::size_t unit) -> Vec<D>& { return tile.givenTangents[unit][c]; });
    }
    if (tangents) spread(9, [&](std::size_t unit) -> Vec<D>& { return tile.tangents[unit][3]; });
    units += blockVertices / unitVertices<isLone, D>;
  }
  const Vec3<D> none{hn::Zero(d), hn::Zero(d), hn::Zero(d)};
  const auto unitVector = [&](const Vec<D>* given, Vec<D>* to) HWY_ATTR {
    const Vec3<D> unit = unitOr(d, Vec3<D>{given[0], given[1], given[2]}, none);
    to[0] = unit.x;
    to[1] = unit.y;
    to[2] = unit.z;
  };
  for (std::size_t unit = 0; unit < units; ++unit) {
    if (normals) unitVector(tile.givenNormals[unit], tile.normals[unit]);
    if (tangents) unitVector(tile.givenTangents[unit], tile.tangents[unit]);
  }
  const auto first = [](const auto& vectors) { return reinterpret_cast<const float*>(vectors); };
  from.positions = first(tile.positions);
  from.normals = first(tile.normals);
  from.givenNormals = first(tile.givenNormals);
  from.tangents = first(tile.tangents);
  from.givenTangents = first(tile.givenTangents);
  from.isTile = true;
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
