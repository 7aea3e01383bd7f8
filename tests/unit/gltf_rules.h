// Files that each break one rule of glTF, with what Dermis and others make of them.
#pragma once

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "gltf_builder.h"

namespace dermis::test {

enum class Verdict {
  used,      ///< without a word: Dermis does not read what is wrong
  remarked,  ///< used with a note, even where strict: the glTF validator passes it
  found,     ///< used without a note: `validate` finds it
  noted,     ///< used with a note, an error where strict
  refused,   ///< an error
};

/// What three.js' GLTFLoader does, as tests/gltf_rules/three.mjs found.
enum class Three {
  loads,     ///< and skins to the same vertices as the file that breaks no rule
  misreads,  ///< loads something else
  refuses,
};

struct Violation {
  std::string name;  ///< of the file
  Verdict verdict;
  Three three;
  /// In the note, in the finding or in the error. Where three.js loads what is refused: the reason,
  /// after a '|'.
  std::string sentence;
  std::function<void(FileBuilder&)> change;
  /// Whether the same is skinned as by the file that breaks no rule.
  bool sameMeaning = true;
  /// What becomes of the GLB file, where the rule is one of GLB.
  std::function<void(std::vector<std::byte>&)> changeGlb = {};
};

/// The bytes of the file: GLB where it changes that.
std::vector<std::byte> bytesOf(const Violation& violation);

/// A skinned triangle that breaks no rule: indices, a morph target, inverse bind matrices, a clip.
/// Every accessor has the bufferView of its own number.
FileBuilder flawlessTriangle();

std::vector<Violation> violations();

}  // namespace dermis::test
