// The GLB files that `dermis skin` writes, read by other means than it writes them, and held to
// those rules of glTF 2.0 that the official validator looks at and such a file can break.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace dermis::test {

/// A node, its mesh, and the one primitive of that.
struct GlbPart {
  std::string name;
  int mode = 0;
  std::vector<std::array<float, 3>> positions, normals;
  std::vector<std::array<float, 4>> tangents;        ///< or none
  std::map<std::string, std::vector<float>> others;  ///< TEXCOORD_n and COLOR_0, side by side
  std::vector<std::uint32_t> indices;
  nlohmann::json material;  ///< null where it has none
};

struct Glb {
  nlohmann::json json;
  std::vector<GlbPart> parts;
};

/// A rule that is broken is a failed expectation; a file that is not there, or lacks what it must
/// have, is an exception, which fails the test too.
Glb readGlb(const std::filesystem::path& path);

}  // namespace dermis::test
