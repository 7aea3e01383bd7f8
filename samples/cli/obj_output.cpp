#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <set>
#include <utility>

#include "kit/plain_text.h"
#include "mesh_formats.h"

namespace dermis::cli {
namespace {

/// Makes a name one word. A backslash would join two lines, and a number sign would start a
/// comment.
std::string oneWord(const std::string& name) {
  std::string word = samples::plainLine(name);
  std::replace_if(
      word.begin(), word.end(), [](char c) { return c == ' ' || c == '\\' || c == '#'; }, '_');
  return word;
}

std::string uniqueName(const std::string& name, std::size_t part, std::set<std::string>& taken) {
  std::string unique = oneWord(name);
  while (!taken.insert(unique).second) unique += fmt::format("_{}", part);
  return unique;
}

class ObjWriter {
 public:
  void add(const OutputPart& part, const std::string& name) {
    const std::vector<std::vector<float>>& texcoords = part.primitive->texcoords;
    put("o {}\n", name);
    addVectors("v", part.positions);
    if (!texcoords.empty()) addTexcoords(texcoords[0]);
    addVectors("vn", part.normals);
    addFaces(part.primitive->triangles, !texcoords.empty());
    vertices_ += part.positions.size() / 3;
    texcoords_ += texcoords.empty() ? 0 : texcoords[0].size() / 2;
  }

  std::string take() { return std::move(text_); }

 private:
  template <typename... Values>
  void put(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text_), format, std::forward<Values>(values)...);
  }

  void addVectors(const char* keyword, const std::vector<float>& values) {
    for (std::size_t i = 0; i + 2 < values.size(); i += 3) {
      put("{} {} {} {}\n", keyword, values[i], values[i + 1], values[i + 2]);
    }
  }

  void addTexcoords(const std::vector<float>& values) {
    for (std::size_t i = 0; i + 1 < values.size(); i += 2) {
      const float u = std::isfinite(values[i]) ? values[i] : 0;
      const float v = std::isfinite(values[i + 1]) ? values[i + 1] : 0;
      put("vt {} {}\n", u, 1 - v);
    }
  }

  /// Indices start at 1 and continue through all parts. Normals have the indices of their vertices.
  /// Those of texture coordinates are lower if an earlier part has none.
  void addFaces(const std::vector<std::uint32_t>& triangles, bool hasTexcoords) {
    for (std::size_t corner = 0; corner + 2 < triangles.size(); corner += 3) {
      text_ += 'f';
      for (std::size_t i = corner; i < corner + 3; ++i) {
        const std::size_t vertex = vertices_ + triangles[i] + 1;
        if (hasTexcoords) {
          put(" {}/{}/{}", vertex, texcoords_ + triangles[i] + 1, vertex);
        } else {
          put(" {}//{}", vertex, vertex);
        }
      }
      text_ += '\n';
    }
  }

  std::string text_ = "# skinned by dermis\n";
  std::size_t vertices_ = 0;   ///< of the parts before
  std::size_t texcoords_ = 0;  ///< likewise
};

}  // namespace

std::string objFile(const OutputMesh& mesh) {
  ObjWriter writer;
  std::set<std::string> taken;
  for (std::size_t i = 0; i < mesh.parts.size(); ++i) {
    writer.add(mesh.parts[i], uniqueName(mesh.parts[i].name, i, taken));
  }
  return writer.take();
}

}  // namespace dermis::cli
