#include "mesh_output.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <iterator>
#include <set>
#include <utility>

#include "kit/file_name.h"
#include "kit/output_file.h"
#include "kit/text.h"

namespace dermis::cli {
namespace {

static_assert(std::endian::native == std::endian::little, "the file is little-endian");

template <typename T>
void put(std::string& bytes, T value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof(T));
}

std::string header(const OutputMesh& mesh) {
  std::size_t vertices = 0, faces = 0;
  for (const OutputPart& part : mesh.parts) {
    vertices += part.positions.size() / 3;
    faces += part.primitive->triangles.size() / 3;
  }
  return fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment skinned by dermis\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float "
      "ny\nproperty float nz\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      vertices, faces);
}

/// Binary little-endian PLY: float x y z nx ny nz, then the faces. All parts are one mesh.
std::string plyFile(const OutputMesh& mesh) {
  std::string bytes = header(mesh);
  for (const OutputPart& part : mesh.parts) {
    for (std::size_t vertex = 0; vertex * 3 < part.positions.size(); ++vertex) {
      for (std::size_t i = 0; i < 3; ++i) put(bytes, part.positions[vertex * 3 + i]);
      for (std::size_t i = 0; i < 3; ++i) put(bytes, part.normals[vertex * 3 + i]);
    }
  }
  std::size_t firstVertex = 0;
  for (const OutputPart& part : mesh.parts) {
    const std::vector<std::uint32_t>& triangles = part.primitive->triangles;
    for (std::size_t corner = 0; corner + 2 < triangles.size(); corner += 3) {
      put(bytes, std::uint8_t{3});
      for (std::size_t i = 0; i < 3; ++i)
        put(bytes, static_cast<std::int32_t>(firstVertex + triangles[corner + i]));
    }
    firstVertex += part.positions.size() / 3;
  }
  return bytes;
}

/// Makes a name one word. A backslash would join two lines, and a number sign would start a
/// comment.
std::string oneWord(const std::string& name) {
  std::string word = samples::oneLine(name);
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
    const std::vector<gltf::SharedArray<float>>& texcoords = part.primitive->texcoords;
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

/// Wavefront OBJ: one object for each part, with v, vn and, if the part has TEXCOORD_0, vt. The
/// origin of vt is at the bottom left, that of glTF at the top left. Numbers are the shortest that
/// read back as the same float. Names are unique and have no spaces, since some readers end a name
/// at the first space and some merge objects of the same name. There is no material library, since
/// the factors of glTF differ from those of MTL.
std::string objFile(const OutputMesh& mesh) {
  ObjWriter writer;
  std::set<std::string> taken;
  for (std::size_t i = 0; i < mesh.parts.size(); ++i) {
    writer.add(mesh.parts[i], uniqueName(mesh.parts[i].name, i, taken));
  }
  return writer.take();
}

}  // namespace

std::optional<OutputFormat> outputFormat(std::string_view fileName) {
  if (samples::hasEnding(fileName, ".ply")) return OutputFormat::ply;
  if (samples::hasEnding(fileName, ".obj")) return OutputFormat::obj;
  if (samples::hasEnding(fileName, ".glb")) return OutputFormat::glb;
  return std::nullopt;
}

std::string partName(const gltf::Model& model, const gltf::SkinnedPrimitive& source) {
  const gltf::Mesh& mesh = model.meshes[source.mesh];
  std::string name = model.nodes[source.node].name;
  if (name.empty()) name = mesh.name;
  if (name.empty()) name = fmt::format("node {}", source.node);
  return mesh.primitives.size() == 1 ? name : fmt::format("{}.{}", name, source.primitive);
}

std::size_t countNonFinite(const OutputMesh& mesh) {
  std::size_t count = 0;
  for (const OutputPart& part : mesh.parts) {
    for (std::size_t vertex = 0; vertex * 3 < part.positions.size(); ++vertex) {
      bool finite = true;
      for (std::size_t i = vertex * 3; i < vertex * 3 + 3; ++i) {
        finite &= std::isfinite(part.positions[i]) && std::isfinite(part.normals[i]);
      }
      if (!finite) ++count;
    }
  }
  return count;
}

bool holdsNonFinite(OutputFormat format) {
  return format == OutputFormat::ply;
}

bool holdsTangents(OutputFormat format) {
  return format == OutputFormat::glb;
}

Result<void> writeMesh(const std::filesystem::path& path, OutputFormat format,
                       const OutputMesh& mesh) {
  if (format == OutputFormat::glb) {
    const std::vector<std::byte> bytes = glbFile(mesh);
    if (!bytes.empty()) return samples::writeFile(path, bytes);
    return Error{ErrorCode::limitExceeded,
                 fmt::format("{} would be larger than 4 GiB, the limit of GLB", path.string())};
  }
  const std::string bytes = format == OutputFormat::ply ? plyFile(mesh) : objFile(mesh);
  return samples::writeFile(path, bytes);
}

}  // namespace dermis::cli
