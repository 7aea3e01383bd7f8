// The documents of the repository, and the parts of them that are held to a source.
//
// A part follows a comment that names its source:
//
//   <!-- code: samples/minimal/main.cpp [load] -->    a block of C++: the lines between
//                                                      "// [load]" and "// [/load]" of that file
//   <!-- help: dermis skin -->                         a block: what the program prints for --help
//   <!-- table: pipelines -->                          a table, see generated_parts.cpp
#pragma once

#include <cstddef>
#include <string>
#include <vector>

namespace dermis::test {

struct Document {
  std::string path;  ///< from the repository's folder on
  std::string text;
};

/// All Markdown files but those of builds.
std::vector<Document> allDocuments();

/// A file of the repository.
std::string readText(const std::string& path);

/// Lines between "// [NAME]" and "// [/NAME]", without the indentation of these two; empty if there
/// are none.
std::string region(const std::string& text, const std::string& name);

/// A part that is held to its source.
struct HeldPart {
  std::string kind;                 ///< code, help, table
  std::string source;               ///< the rest of the comment
  std::size_t begin = 0, size = 0;  ///< of its lines in `Document::text`, fences not included
};

/// Those of a document, in their order. A part without an end has size 0.
std::vector<HeldPart> heldParts(const std::string& text);

}  // namespace dermis::test
