// The golden poses of the test data: positions from three.js, and from Blender.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace dermis::test {

struct Golden {
  std::vector<double> values;  ///< linear positions, then dual-quaternion positions
  std::size_t vertices() const { return values.size() / 6; }
  double at(bool dualQuaternion, std::size_t vertex, std::size_t axis) const {
    return values[(dualQuaternion ? values.size() / 2 : 0) + vertex * 3 + axis];
  }
  /// The diagonal of the linear positions' box plus the largest coordinate.
  double size() const {
    double diagonal = 0, largest = 0;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      double low = HUGE_VAL, high = -HUGE_VAL;
      for (std::size_t vertex = 0; vertex < vertices(); ++vertex) {
        const double value = at(false, vertex, axis);
        if (std::isnan(value)) continue;
        low = std::min(low, value);
        high = std::max(high, value);
        largest = std::max(largest, std::abs(value));
      }
      diagonal = std::hypot(diagonal, high - low);
    }
    return diagonal + largest;
  }
};

inline Golden readGolden(const std::filesystem::path& path) {
  Golden golden;
  std::ifstream file(path, std::ios::binary);
  for (double value; file.read(reinterpret_cast<char*>(&value), sizeof(value));)
    golden.values.push_back(value);
  return golden;
}

/// All lines of the manifest. Poses of one model follow each other. `data` is what `testDataFolder`
/// returned.
inline std::vector<nlohmann::json> goldenManifest(const std::filesystem::path& data) {
  std::vector<nlohmann::json> entries;
  std::ifstream manifest(data / "golden" / "manifest.jsonl");
  for (std::string line; std::getline(manifest, line);)
    entries.push_back(nlohmann::json::parse(line));
  return entries;
}

}  // namespace dermis::test
