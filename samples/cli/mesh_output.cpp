#include "mesh_output.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <system_error>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

namespace dermis::cli {
namespace {

glm::dvec3 vectorAt(const std::vector<float>& values, std::size_t index) {
  return glm::dvec3(values[index * 3], values[index * 3 + 1], values[index * 3 + 2]);
}

template <typename T>
void put(std::string& bytes, T value) {
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  bytes.append(raw, sizeof(T));
}

}  // namespace

std::vector<float> computeNormals(const std::vector<float>& positions,
                                  const std::vector<std::uint32_t>& triangles) {
  std::vector<glm::dvec3> sums(positions.size() / 3, glm::dvec3(0.0));
  for (std::size_t corner = 0; corner + 2 < triangles.size(); corner += 3) {
    const glm::dvec3 a = vectorAt(positions, triangles[corner]);
    const glm::dvec3 b = vectorAt(positions, triangles[corner + 1]);
    const glm::dvec3 c = vectorAt(positions, triangles[corner + 2]);
    const glm::dvec3 area = glm::cross(b - a, c - a);
    for (std::size_t i = 0; i < 3; ++i) sums[triangles[corner + i]] += area;
  }
  std::vector<float> normals;
  normals.reserve(positions.size());
  for (const glm::dvec3& sum : sums) {
    const double length = glm::length(sum);
    const glm::dvec3 normal =
        length > 0 && std::isfinite(length) ? sum / length : glm::dvec3(0, 0, 1);
    for (int i = 0; i < 3; ++i) normals.push_back(static_cast<float>(normal[i]));
  }
  return normals;
}

std::size_t countNonFinite(const OutputMesh& mesh) {
  std::size_t count = 0;
  for (std::size_t vertex = 0; vertex * 3 < mesh.positions.size(); ++vertex) {
    bool finite = true;
    for (std::size_t i = vertex * 3; i < vertex * 3 + 3; ++i) {
      finite &= std::isfinite(mesh.positions[i]) && std::isfinite(mesh.normals[i]);
    }
    if (!finite) ++count;
  }
  return count;
}

void append(OutputMesh& whole, const OutputMesh& part) {
  const auto base = static_cast<std::uint32_t>(whole.positions.size() / 3);
  whole.positions.insert(whole.positions.end(), part.positions.begin(), part.positions.end());
  whole.normals.insert(whole.normals.end(), part.normals.begin(), part.normals.end());
  for (const std::uint32_t index : part.triangles) whole.triangles.push_back(base + index);
}

Result<void> writePly(const std::filesystem::path& path, const OutputMesh& mesh) {
  std::string bytes = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment skinned by dermis\nelement vertex {}\n"
      "property float x\nproperty float y\nproperty float z\nproperty float nx\nproperty float "
      "ny\nproperty float nz\n"
      "element face {}\nproperty list uchar int vertex_indices\nend_header\n",
      mesh.positions.size() / 3, mesh.triangles.size() / 3);
  for (std::size_t vertex = 0; vertex * 3 < mesh.positions.size(); ++vertex) {
    for (std::size_t i = 0; i < 3; ++i) put(bytes, mesh.positions[vertex * 3 + i]);
    for (std::size_t i = 0; i < 3; ++i) put(bytes, mesh.normals[vertex * 3 + i]);
  }
  for (std::size_t corner = 0; corner < mesh.triangles.size(); corner += 3) {
    put(bytes, std::uint8_t{3});
    for (std::size_t i = 0; i < 3; ++i)
      put(bytes, static_cast<std::int32_t>(mesh.triangles[corner + i]));
  }

  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (file) return {};
  std::error_code error;
  if (std::filesystem::is_regular_file(path, error)) std::filesystem::remove(path, error);
  return Error{ErrorCode::ioError, fmt::format("{} cannot be written", path.string())};
}

}  // namespace dermis::cli
