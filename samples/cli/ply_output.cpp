#include <fmt/format.h>

#include <bit>
#include <cstdint>

#include "mesh_formats.h"

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

}  // namespace

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

}  // namespace dermis::cli
