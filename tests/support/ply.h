// The PLY files that `dermis skin` writes, read by other means than it writes them.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace dermis::test {

struct Ply {
  std::vector<std::array<float, 3>> positions, normals;
  std::vector<std::array<std::int32_t, 3>> faces;
};

/// Nothing where the file is not exactly what the contract says: binary little endian, x y z nx ny
/// nz, triangles.
std::optional<Ply> readPly(const std::filesystem::path& path);

}  // namespace dermis::test
