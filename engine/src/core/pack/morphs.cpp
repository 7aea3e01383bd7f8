#include "pack/morphs.h"

#include <bit>
#include <span>

#include "abi.h"
#include "attribute.h"

namespace dermis {
namespace {

/// A target's displacements, read by element.
class Displacements {
 public:
  Displacements(const MeshView& mesh, const MorphTargetView& target) : target_(target) {
    if (target.positions && anyOf(abi::MORPH_HAS_POSITIONS))
      attributes_ |= abi::MORPH_HAS_POSITIONS;
    if (mesh.normals && target.normals && anyOf(abi::MORPH_HAS_NORMALS))
      attributes_ |= abi::MORPH_HAS_NORMALS;
    if (mesh.tangents && target.tangents && anyOf(abi::MORPH_HAS_TANGENTS))
      attributes_ |= abi::MORPH_HAS_TANGENTS;
  }

  std::uint32_t attributes() const { return attributes_; }

  std::uint32_t count() const {
    if (!target_.vertices.empty()) return static_cast<std::uint32_t>(target_.vertices.size());
    for (const AttributeView* view : {&target_.positions, &target_.normals, &target_.tangents}) {
      if (*view) return view->count;
    }
    return 0;
  }
  std::uint32_t vertex(std::uint32_t element) const {
    return target_.vertices.empty() ? element : target_.vertices[element];
  }
  bool isZero(std::uint32_t element) const {
    for (const std::uint32_t attribute :
         {abi::MORPH_HAS_POSITIONS, abi::MORPH_HAS_NORMALS, abi::MORPH_HAS_TANGENTS}) {
      if ((attributes_ & attribute) != 0 && !isZero(attribute, element)) return false;
    }
    return true;
  }
  void append(std::uint32_t element, std::vector<std::uint32_t>& words) const {
    for (const std::uint32_t attribute :
         {abi::MORPH_HAS_POSITIONS, abi::MORPH_HAS_NORMALS, abi::MORPH_HAS_TANGENTS}) {
      if ((attributes_ & attribute) == 0) continue;
      for (std::uint32_t component = 0; component < 3; ++component)
        words.push_back(std::bit_cast<std::uint32_t>(load(attribute, element, component)));
    }
  }

 private:
  float load(std::uint32_t attribute, std::uint32_t element, std::uint32_t component) const {
    if (attribute == abi::MORPH_HAS_POSITIONS)
      return loadMorphPosition(target_, element, component);
    return loadFloat(attribute == abi::MORPH_HAS_NORMALS ? target_.normals : target_.tangents,
                     element, component);
  }
  bool isZero(std::uint32_t attribute, std::uint32_t element) const {
    return load(attribute, element, 0) == 0 && load(attribute, element, 1) == 0 &&
           load(attribute, element, 2) == 0;
  }
  bool anyOf(std::uint32_t attribute) const {
    for (std::uint32_t element = 0; element < count(); ++element) {
      if (!isZero(attribute, element)) return true;
    }
    return false;
  }

  const MorphTargetView& target_;
  std::uint32_t attributes_ = 0;
};

void appendTarget(const Displacements& displacements, std::size_t record,
                  std::vector<std::uint32_t>& words) {
  std::vector<std::uint32_t> elements;
  if (displacements.attributes() != 0) {
    for (std::uint32_t element = 0; element < displacements.count(); ++element) {
      if (!displacements.isZero(element)) elements.push_back(element);
    }
  }
  if (elements.empty()) return;

  const auto blockOf = [&](std::uint32_t element) {
    return displacements.vertex(element) / abi::MORPH_BLOCK_VERTICES;
  };
  const std::uint32_t firstBlock = blockOf(elements.front());
  const std::uint32_t blockCount = blockOf(elements.back()) - firstBlock + 1;
  const std::size_t blocks = words.size();
  words.resize(blocks + std::size_t{blockCount} * abi::MORPH_BLOCK_WORDS, 0u);
  words[record + abi::MORPH_FIRST_BLOCK] = firstBlock;
  words[record + abi::MORPH_BLOCK_COUNT] = blockCount;
  words[record + abi::MORPH_BLOCKS] = static_cast<std::uint32_t>(blocks);
  words[record + abi::MORPH_ATTRIBUTES] = displacements.attributes();
  for (const std::uint32_t element : elements) {
    const std::size_t block =
        blocks + std::size_t{blockOf(element) - firstBlock} * abi::MORPH_BLOCK_WORDS;
    const std::uint32_t lane = displacements.vertex(element) % abi::MORPH_BLOCK_VERTICES;
    if (words[block] == 0 && words[block + 1] == 0) {
      words[block + abi::MORPH_BLOCK_DISPLACEMENTS] = static_cast<std::uint32_t>(words.size());
    }
    words[block + abi::MORPH_BLOCK_MASK + lane / 32] |= 1u << lane % 32;
    displacements.append(element, words);
  }
}

}  // namespace

std::uint32_t appendMorphs(const MeshView& mesh, std::vector<std::uint32_t>& words) {
  const std::size_t records = words.size();
  words.resize(records + mesh.morphTargets.size() * abi::MORPH_WORDS, 0u);
  for (std::size_t target = 0; target < mesh.morphTargets.size(); ++target) {
    appendTarget(Displacements(mesh, mesh.morphTargets[target]),
                 records + target * abi::MORPH_WORDS, words);
  }
  return static_cast<std::uint32_t>(records);
}

}  // namespace dermis
