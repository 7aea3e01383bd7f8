#include "cpu/morph.h"

#include <algorithm>
#include <bit>
#include <utility>

#include "strict_floating_point.h"

namespace dermis::cpu {

ActiveTarget activeTarget(const MeshData& mesh, const MorphWeight& morph) {
  const std::span<const std::uint32_t> words(mesh.packed);
  const auto header = abi::load<abi::MeshHeader>(words, 0);
  const std::size_t place = header.morphs + std::size_t{morph.target} * abi::MORPH_WORDS;
  return {.record = abi::load<abi::MorphRecord>(words, place), .weights = {morph.weight}};
}

void ActiveTargets::begin(const MeshData& mesh, std::span<std::span<const MorphWeight>> morphs) {
  number = ~std::uint32_t{0};
  all.clear();
  while (true) {
    MorphWeight next{~std::uint32_t{0}, 0};
    for (const std::span<const MorphWeight> rest : morphs) {
      if (!rest.empty()) next.target = std::min(next.target, rest.front().target);
    }
    if (next.target == ~std::uint32_t{0}) return;
    ActiveTarget target = activeTarget(mesh, next);
    bool isActive = false;
    for (std::size_t i = 0; i < morphs.size(); ++i) {
      std::span<const MorphWeight>& rest = morphs[i];
      if (!rest.empty() && rest.front().target == next.target) {
        target.weights[i] = rest.front().weight;
        rest = rest.subspan(1);
      }
      isActive = isActive || target.weights[i] != 0;
    }
    if (isActive) all.push_back(target);
  }
}

void displace(const Displacements& part, const BlockDisplacements& displacements, Lanes* positions,
              Lanes* normals, Lanes* tangents) {
  const std::uint32_t* word = part.words;
  for (std::uint32_t mask = part.mask; mask != 0; mask &= mask - 1) {
    const auto lane = static_cast<std::size_t>(std::countr_zero(mask));
    for (const auto& [attribute, lanes] : {std::pair{abi::MORPH_HAS_POSITIONS, positions},
                                           {abi::MORPH_HAS_NORMALS, normals},
                                           {abi::MORPH_HAS_TANGENTS, tangents}}) {
      if ((displacements.attributes & attribute) == 0) continue;
      for (std::size_t k = 0; lanes != nullptr && k < 3; ++k)
        lanes[k].v[lane] += displacements.target->weights[0] * std::bit_cast<float>(word[k]);
      word += 3;
    }
  }
}

}  // namespace dermis::cpu
