// The models of the test data.
#pragma once

#include <algorithm>
#include <filesystem>
#include <set>
#include <string>
#include <vector>

namespace dermis::test {

/// All that are not broken on purpose, sorted. `data` is what `testDataFolder` returned.
inline std::vector<std::filesystem::path> modelFiles(const std::filesystem::path& data) {
  static const std::set<std::string> extensions = {".gltf", ".glb", ".vrm"};
  std::vector<std::filesystem::path> found;
  for (const auto& file : std::filesystem::recursive_directory_iterator(data / "models")) {
    if (extensions.contains(file.path().extension().string()) &&
        file.path().generic_string().find("/negative_") == std::string::npos)
      found.push_back(file.path());
  }
  std::ranges::sort(found);
  return found;
}

}  // namespace dermis::test
