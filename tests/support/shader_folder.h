// A copy of the kernels' GLSL that a test may edit, as one who works on kernels does.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "test_paths.h"

namespace dermis::test {

class ShaderFolder {
 public:
  /// `name` tells the folders of tests that run at the same time apart.
  explicit ShaderFolder(const std::string& name)
      : path_(std::filesystem::path(::testing::TempDir()) / ("shaders_" + name)) {
    std::filesystem::remove_all(path_);
    std::filesystem::copy(kernelSources, path_, std::filesystem::copy_options::recursive);
  }
  ~ShaderFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ShaderFolder(const ShaderFolder&) = delete;
  ShaderFolder& operator=(const ShaderFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

  /// Replaces text that occurs exactly once in a file. Returns its line number.
  int edit(const std::string& file, const std::string& before, const std::string& after) const {
    const std::filesystem::path path = path_ / file;
    std::string text;
    {
      std::ifstream in(path, std::ios::binary);
      text.assign(std::istreambuf_iterator<char>(in), {});
    }
    const std::size_t place = text.find(before);
    if (place == std::string::npos || text.find(before, place + 1) != std::string::npos) {
      ADD_FAILURE() << file << " does not have '" << before << "' once";
      return 0;
    }
    text.replace(place, before.size(), after);
    std::ofstream(path, std::ios::binary) << text;
    return 1 + static_cast<int>(std::count(
                   text.begin(), text.begin() + static_cast<std::ptrdiff_t>(place), '\n'));
  }

  // Edits of skin.comp: all positions one to the right, and no GLSL any more.
  static constexpr const char* storedPosition = "vec4 v = vec4(position, 1.0);";
  static constexpr const char* movedPosition =
      "vec4 v = vec4(position + vec3(1.0, 0.0, 0.0), 1.0);";
  static constexpr const char* brokenPosition = "vec4 v = vec4(positron, 1.0);";

 private:
  std::filesystem::path path_;
};

}  // namespace dermis::test
