#include "ply.h"

#include <cstring>
#include <fstream>
#include <sstream>
#include <string>

namespace dermis::test {
namespace {

template <typename T>
T take(const std::string& bytes, std::size_t& place) {
  T value;
  std::memcpy(&value, bytes.data() + place, sizeof(T));
  place += sizeof(T);
  return value;
}

}  // namespace

std::optional<Ply> readPly(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(file)), std::istreambuf_iterator<char>());
  const std::string end = "end_header\n";
  const std::size_t header = bytes.find(end);
  if (header == std::string::npos) return std::nullopt;

  std::size_t vertices = 0, faces = 0;
  std::string properties;
  std::istringstream lines(bytes.substr(0, header));
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("element vertex ")) vertices = std::stoul(line.substr(15));
    if (line.starts_with("element face ")) faces = std::stoul(line.substr(13));
    if (line.starts_with("property ")) properties += line.substr(9) + ";";
    if (line.starts_with("format ") && line != "format binary_little_endian 1.0")
      return std::nullopt;
  }
  if (properties !=
      "float x;float y;float z;float nx;float ny;float nz;list uchar int vertex_indices;") {
    return std::nullopt;
  }
  std::size_t place = header + end.size();
  if (bytes.size() != place + vertices * 24 + faces * 13) return std::nullopt;
  Ply ply;
  for (std::size_t vertex = 0; vertex < vertices; ++vertex) {
    ply.positions.push_back(take<std::array<float, 3>>(bytes, place));
    ply.normals.push_back(take<std::array<float, 3>>(bytes, place));
  }
  for (std::size_t face = 0; face < faces; ++face) {
    if (take<std::uint8_t>(bytes, place) != 3) return std::nullopt;
    ply.faces.push_back(take<std::array<std::int32_t, 3>>(bytes, place));
  }
  return ply;
}

}  // namespace dermis::test
