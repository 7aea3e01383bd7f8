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

  /// Goes on by some numbers of each component, and by some vertices of the mesh.
  void advance(std::size_t numbers, std::size_t vertices) {
    const auto move = [](const float*& place, std::size_t floats) {
      if (place != nullptr) place += floats;
    };
    for (const float** const place : {&positions, &normals, &givenNormals})
      move(*place, 3 * numbers);
    move(tangents, 4 * numbers);
    move(givenTangents, 4 * numbers);
    move(centers, 3 * vertices);
    move(shares, vertices);
  }
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
  const Vec<Wide> w = hn::Set(d, displacements.target->weights[0]);
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

/// Morphs a block of a lone instance, and puts it into the units of the tile from `unit` on.
template <class D>
inline HWY_ATTR void morphLone(D d, const MeshData& mesh, std::uint32_t number,
                               ActiveTargets& active, std::size_t unit, Tile<D>& tile) {
  const bool normals = !mesh.normals.empty(), tangents = !mesh.tangents.empty();
  MorphedBlock& block = tile.block;
  std::copy_n(mesh.positions.data() + number * std::size_t{3}, 3, block.positions);
  if (normals) std::copy_n(mesh.givenNormals.data() + number * std::size_t{3}, 3, block.normals);
  if (tangents) {
    std::copy_n(mesh.givenTangents.data() + number * std::size_t{4}, 3, block.tangents);
    block.tangents[3] = mesh.tangents[number * std::size_t{4} + 3];
  }
  morphBlock(mesh, number, active, block);
  for (std::size_t first = 0; first < blockVertices; first += hn::MaxLanes(d), ++unit) {
    const auto load = [&](const Lanes* from, std::size_t count, Vec<D>* to) HWY_ATTR {
      for (std::size_t c = 0; c < count; ++c) to[c] = hn::Load(d, from[c].v + first);
    };
    load(block.positions, 3, tile.positions[unit]);
    if (normals) load(block.normals, 3, tile.givenNormals[unit]);
    if (!tangents) continue;
    load(block.tangents, 3, tile.givenTangents[unit]);
    load(block.tangents + 3, 1, tile.tangents[unit] + 3);
  }
}

/// Morphs a block of a company, with the weights of its members in the lanes: each vertex stays in
/// registers while all targets displace it.
template <class D>
inline HWY_ATTR void morphCompany(D d, const MeshData& mesh, std::uint32_t number,
                                  ActiveTargets& active, std::size_t unit, Tile<D>& tile) {
  const bool normals = !mesh.normals.empty(), tangents = !mesh.tangents.empty();
  const Source from = sourceOf(mesh, Method::dualQuaternion, number);
  active.find(mesh, number * blockVertices / abi::MORPH_BLOCK_VERTICES);
  active.parts.clear();
  for (const BlockDisplacements& displacements : active.displacements) {
    const Displacements part = partOf(displacements, number);
    if (part.mask != 0) active.parts.push_back(part);
  }
  for (std::size_t vertex = 0; vertex < blockVertices; ++vertex, ++unit) {
    Vec3<D> position = loadThree<From::company>(d, from.positions, 3, vertex);
    Vec3<D> normal = position, tangent = position;
    if (normals) normal = loadThree<From::company>(d, from.givenNormals, 3, vertex);
    if (tangents) tangent = loadThree<From::company>(d, from.givenTangents, 4, vertex);
    for (Displacements& part : active.parts) {
      if ((part.mask >> vertex & 1) == 0) continue;
      const Vec<D> w = hn::Load(d, part.of->target->weights);
      const auto isActive = hn::Ne(w, hn::Zero(d));
      const auto add = [&](std::uint32_t attribute, Vec3<D>& to) HWY_ATTR {
        if ((part.of->attributes & attribute) == 0) return;
        const auto* const by = reinterpret_cast<const float*>(part.words);
        const Vec3<D> displacement{hn::Set(d, by[0]), hn::Set(d, by[1]), hn::Set(d, by[2])};
        to = choose3(isActive, add3(to, scale3(displacement, w)), to);
        part.words += 3;
      };
      add(abi::MORPH_HAS_POSITIONS, position);
      add(abi::MORPH_HAS_NORMALS, normal);
      add(abi::MORPH_HAS_TANGENTS, tangent);
    }
    setThree(tile.positions[unit], position);
    if (normals) setThree(tile.givenNormals[unit], normal);
    if (!tangents) continue;
    setThree(tile.givenTangents[unit], tangent);
    tile.tangents[unit][3] = loadComponent<From::company>(d, from.tangents, 4, 3, vertex);
  }
}

/// Morphs the vertices of a tile for instances that have active targets.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void morphTile(D d, const MeshData& mesh, std::uint32_t firstBlock,
                                     std::uint32_t blockEnd, ActiveTargets& active, Tile<D>& tile,
                                     Source& from) {
  const bool normals = !mesh.normals.empty(), tangents = !mesh.tangents.empty();
  std::size_t units = 0;
  for (std::uint32_t number = firstBlock; number < blockEnd; ++number) {
    if constexpr (isLone) {
      morphLone(d, mesh, number, active, units, tile);
    } else {
      morphCompany(d, mesh, number, active, units, tile);
    }
    units += unitsOf<isLone, D>;
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
