// Notes of a `Model` about its file: broken rules where the meaning of the file is clear, and what
// is left out. Notes are counted by kind, so that a file cannot produce a note per byte.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "gltf/failure.h"

namespace dermis::gltf {

enum class NoteKind : std::uint8_t {
  // Broken rules. The sentence says what Dermis does about each, unless it simply reads on.
  container,       ///< GLB lengths, padding and the order of chunks
  text,            ///< a byte order mark, zero bytes after the JSON
  version,         ///< asset.version 2 in another notation
  extensions,      ///< lists of extensions that do not fit together
  nullProperty,    ///< treated as absent
  emptyArray,      ///< likewise
  name,            ///< not a string
  reference,       ///< to an object that does not exist, if nothing reads it
  unused,          ///< faults in objects that nothing skinned or animated uses
  material,        ///< a value of the wrong type: the default is used
  bufferLength,    ///< more than there are bytes
  viewLength,      ///< 0, or beyond the buffer
  stride,          ///< not an allowed number, or in a place where none is allowed
  alignment,       ///< of components or attributes
  accessor,        ///< byteOffset without bufferView, normalized floats, count 0
  sparse,          ///< count 0, or indices that do not ascend
  format,          ///< of an accessor: not allowed there, but with only one meaning
  attribute,       ///< left out because of a fault; not one that skinning needs
  influenceSet,    ///< JOINTS_n without WEIGHTS_n after complete sets
  targetCount,     ///< primitives of a mesh with different numbers of morph targets
  weightCount,     ///< too many or too few default weights
  withoutMesh,     ///< skin or weights on a node without a mesh
  duplicate,       ///< the same entry twice in a list
  matrix,          ///< with other transforms, or with a fourth row
  decomposition,   ///< a node's matrix with shear, or that is singular
  rotation,        ///< a node's, not of unit length
  sceneNode,       ///< listed by a scene though it is not a root
  skeleton,        ///< joints without a common root, or a `skeleton` that is none
  jointOutside,    ///< of a skinned node whose scene does not contain the joint
  withoutJoints,   ///< a mesh of a skinned node
  keys,            ///< times that are negative or equal, splines of one key
  keyLength,       ///< a rotation not of unit length
  channel,         ///< without effect, or a duplicate
  animatedMatrix,  ///< decomposed
  // Remarks: never errors, even if strict.
  restOfFile,       ///< bytes after the GLB container
  restOfTriangles,  ///< indices that do not form a triangle
  extension,        ///< required, and ignored
  noPositions,
  noTimes,
  unmatched,      ///< of clips that are added: no node of the model has the name
  ambiguousName,  ///< several nodes have it
  otherTargets,   ///< weights for another number of morph targets
  unit,           ///< translations are scaled
  rigid,          ///< a mesh that hangs on a joint cannot be read
  image,
};

class Notes {
 public:
  /// `strict`: broken rules are errors.
  explicit Notes(bool strict) : strict_(strict) {}

  /// Counts a broken rule. The parts form the sentence about it, which names the place. If strict,
  /// throws `Failure` with that sentence instead.
  template <typename... Parts>
  void broken(NoteKind kind, const Parts&... parts) {
    if (strict_) failInvalid(parts...);
    remark(kind, parts...);
  }

  /// Counts something that is not an error, even if strict.
  template <typename... Parts>
  void remark(NoteKind kind, const Parts&... parts) {
    Tally& tally = tallies_[static_cast<std::size_t>(kind)];
    if (++tally.count == 1) tally.first = join(parts...);
  }

  /// Calls the function. If it throws a `Failure`, counts that as a broken rule, or rethrows it if
  /// strict or if it is `limitExceeded`. Returns whether there was no `Failure`.
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

  /// Calls the function, which checks or reads an object of the file. If nothing skinned or
  /// animated uses that object, a `Failure` is handled as in `tolerate`.
  template <typename Function>
  bool tolerateUnlessUsed(bool isUsed, Function function) {
    if (!isUsed)
      return tolerate(NoteKind::unused, "; ignored, since nothing skinned or animated uses it",
                      function);
    function();
    return true;
  }

  /// Adds a sentence for each kind: the first that was counted, and how many others there were.
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
