// Where the vertices of a tile in bind pose are read from, and morph targets.
#pragma once

#include <algorithm>
#include <cstring>
#include <utility>
#include <vector>

#include "cpu/morph.h"
#include "cpu/tile_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Where the vertices of a tile are read from. In the mesh a vertex is the same for all instances.
struct Source {
  const float *positions = nullptr, *normals = nullptr, *tangents = nullptr;
  const float *givenNormals = nullptr, *givenTangents = nullptr;
  const float *centers = nullptr, *shares = nullptr;
  bool isWhole = false;  ///< a vector for each component, except of centers and shares
};

/// Component `index` of `components` of a unit's vertices.
template <bool isWhole, class D>
DERMIS_INLINE Vec<D> loadComponent(D d, const float* first, std::size_t components,
                                   std::size_t index, std::size_t unit) {
  if constexpr (isWhole) {
    return hn::Load(d, first + (unit * components + index) * hn::MaxLanes(d));
  } else {
    return hn::LoadDup128(d,
                          first + (unit / 2 * components + index) * blockVertices + unit % 2 * 4);
  }
}
template <bool isWhole, class D>
DERMIS_INLINE Vec3<D> loadThree(D d, const float* first, std::size_t components, std::size_t unit) {
  return {loadComponent<isWhole>(d, first, components, 0, unit),
          loadComponent<isWhole>(d, first, components, 1, unit),
          loadComponent<isWhole>(d, first, components, 2, unit)};
}

inline const float* blockOf(const std::vector<Lanes>& lanes, std::size_t components,
                            std::uint32_t block) {
  return lanes.empty() ? nullptr : numbersOf(&lanes[block * components]);
}

inline Source sourceOf(const MeshData& mesh, Method method, std::uint32_t block, bool isLone) {
  Source from;
  from.positions = blockOf(mesh.positions, 3, block);
  from.normals = blockOf(mesh.normals, 3, block);
  from.givenNormals = blockOf(mesh.givenNormals, 3, block);
  from.tangents = blockOf(mesh.tangents, 4, block);
  from.givenTangents = blockOf(mesh.givenTangents, 4, block);
  from.centers = blockOf(mesh.centers, 3, block);
  from.shares = method == Method::blended ? blockOf(mesh.dualQuaternionWeights, 1, block)
                                          : blockOf(mesh.bulgeStrengths, 1, block);
  from.isWhole = isLone;
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

/// Morphs the blocks of a tile for instances that have active targets.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void morphTile(D d, const MeshData& mesh, std::uint32_t firstBlock,
                                     std::uint32_t blockEnd, ActiveTargets* active, Tile<D>& tile,
                                     Source& from) {
  const auto scatter = [&](const Lanes& lanes, std::size_t unit, std::size_t i, Vec<D>* to) {
    // The memory of a vector is its lanes, in order.
    auto* const memory = reinterpret_cast<std::byte*>(to);
    if constexpr (isLone) {
      std::memcpy(memory, lanes.v, sizeof(lanes.v));
    } else {
      std::memcpy(memory + i * 16, lanes.v + unit % 2 * 4, 16);
    }
  };
  constexpr std::size_t unitsEach = isLone ? 1 : 2;
  const std::size_t units =
      std::min<std::size_t>((blockEnd - firstBlock) * unitsEach, Tile<D>::most);
  const bool normals = !mesh.normals.empty(), tangents = !mesh.tangents.empty();
  for (std::size_t i = 0; i < (isLone ? 1 : blocksOf<D>); ++i) {
    for (std::size_t k = 0; k < units / unitsEach; ++k) {
      MorphedBlock& block = tile.blocks[k];
      const std::size_t number = firstBlock + k;
      std::copy_n(mesh.positions.data() + number * 3, 3, block.positions);
      if (normals) std::copy_n(mesh.givenNormals.data() + number * 3, 3, block.normals);
      if (tangents) {
        std::copy_n(mesh.givenTangents.data() + number * 4, 3, block.tangents);
        block.tangents[3] = mesh.tangents[number * 4 + 3];
      }
      morphBlock(mesh, firstBlock + static_cast<std::uint32_t>(k), active[i], block);
    }
    for (std::size_t unit = 0; unit < units; ++unit) {
      const MorphedBlock& block = tile.blocks[unit / unitsEach];
      for (std::size_t c = 0; c < 3; ++c) {
        scatter(block.positions[c], unit, i, &tile.positions[unit][c]);
        if (normals) scatter(block.normals[c], unit, i, &tile.givenNormals[unit][c]);
        if (tangents) scatter(block.tangents[c], unit, i, &tile.givenTangents[unit][c]);
      }
      if (tangents) scatter(block.tangents[3], unit, i, &tile.tangents[unit][3]);
    }
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
  from.isWhole = true;
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
