// What a `Model` says about its file: rules that are broken though the meaning is clear, and what
// is left out. Counted by kind, so that a file cannot make a note a byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "gltf/failure.h"

namespace dermis::gltf {

enum class NoteKind : std::uint8_t {
  // Broken rules. What Dermis does about each stands in the sentence, unless it is to read on.
  container,        ///< GLB lengths, padding and the order of chunks
  text,             ///< a byte order mark, zero bytes after the JSON
  version,          ///< asset.version 2 in another notation
  extensions,       ///< lists of extensions that do not fit together
  nullProperty,     ///< taken for an absent one
  emptyArray,       ///< likewise
  name,             ///< not a text
  reference,        ///< to what is not there, where nothing is read of it
  unused,           ///< faults of what nothing skinned or animated uses
  material,         ///< a value of the wrong kind: the default is taken
  bufferLength,     ///< more than there are
  viewLength,       ///< 0, or beyond the buffer
  stride,           ///< of a number or in a place that is not allowed
  alignment,        ///< of components or attributes
  accessor,         ///< byteOffset without bufferView, normalized floats, count 0
  sparse,           ///< count 0, indices that do not rise
  format,           ///< of an accessor: not allowed there, but of one meaning only
  attribute,        ///< left out: a fault of one that does not concern skinning
  influenceSet,     ///< JOINTS_n without WEIGHTS_n after complete sets
  targetCount,      ///< primitives of a mesh with different numbers of morph targets
  weightCount,      ///< too many or too few default weights
  withoutMesh,      ///< skin or weights on a node without a mesh
  duplicate,        ///< the same entry of a list twice
  matrix,           ///< with other transforms, or with a fourth row
  sceneNode,        ///< listed by a scene though it is not a root
  skeleton,         ///< joints without a common root
  keys,             ///< times that are negative or equal, splines of one key
  channel,          ///< without effect, or there twice
  animatedMatrix,   ///< taken apart
  restOfTriangles,  ///< indices that make no triangle
  // What is no fault of the file, or not of this one.
  noPositions,
  noTimes,
  image,
};

class Notes {
 public:
  /// `strict`: broken rules are errors.
  explicit Notes(bool strict) : strict_(strict) {}

  bool strict() const { return strict_; }

  /// Counts a broken rule under the sentence made of the parts, which names the place. Throws
  /// `Failure` with that sentence if strict.
  template <typename... Parts>
  void broken(NoteKind kind, const Parts&... parts) {
    if (strict_) failInvalid(parts...);
    remark(kind, parts...);
  }

  /// Counts what is not an error, even where strict.
  template <typename... Parts>
  void remark(NoteKind kind, const Parts&... parts) {
    Tally& tally = tallies_[static_cast<std::size_t>(kind)];
    if (++tally.count == 1) tally.first = join(parts...);
  }

  /// Calls the function. A `Failure` of it is counted as a broken rule, or thrown on where strict
  /// and where it says `limitExceeded`.
  /// Returns whether there was none.
  template <typename Function>
  bool tolerate(NoteKind kind, const char* consequence, Function function) {
    try {
      function();
      return true;
    } catch (const Failure& failure) {
      if (strict_ || failure.error.code == ErrorCode::limitExceeded) throw;
      remark(kind, failure.error.message, consequence);
      return false;
    }
  }

  /// Adds a sentence for each kind: the first that was counted, and how many more there were.
  void appendTo(std::vector<std::string>& sentences) const {
    for (const Tally& tally : tallies_) {
      if (tally.count == 0) continue;
      sentences.push_back(
          tally.count == 1 ? tally.first
                           : join(tally.first, " (and ", tally.count - 1, " more of this kind)"));
    }
  }

 private:
  struct Tally {
    std::string first;
    std::uint64_t count = 0;
  };
  static constexpr std::size_t kinds = static_cast<std::size_t>(NoteKind::image) + 1;

  bool strict_;
  std::array<Tally, kinds> tallies_;
};

}  // namespace dermis::gltf
