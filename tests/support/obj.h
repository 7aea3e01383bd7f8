// The OBJ files that `dermis skin` writes, read by other means than it writes them.
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace dermis::test {

struct ObjCorner {
  std::size_t position = 0, normal = 0;  ///< from 0 on, in `Obj`'s arrays
  std::optional<std::size_t> texcoord;
};

struct ObjObject {
  std::string name;
  std::size_t firstPosition = 0, positions = 0, texcoords = 0, normals = 0;
  std::vector<std::array<ObjCorner, 3>> faces;
};

struct Obj {
  std::vector<std::array<float, 3>> positions, normals;
  std::vector<std::array<float, 2>> texcoords;
  std::vector<ObjObject> objects;
};

/// Nothing where a line is not a comment, o, v, vt, vn or f as they must be, or a face points
/// outside its object.
std::optional<Obj> readObj(const std::filesystem::path& path);

}  // namespace dermis::test
