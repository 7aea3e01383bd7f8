// What the kernels ask of a driver's arithmetic, in their SPIR-V.

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include "inexact_arithmetic.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

namespace fs = std::filesystem;

std::vector<std::uint32_t> readModule(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> bytes{std::istreambuf_iterator<char>(file), {}};
  std::vector<std::uint32_t> words(bytes.size() / 4);
  std::memcpy(words.data(), bytes.data(), words.size() * 4);
  return words;
}

// Division, `sqrt` and `inversesqrt` are less exact than IEEE 754 wants, and the bounds count on it
// (AccuracySearchTest). Anything else would be an error that they do not know; and a driver may
// take OpIsNan and OpIsInf for false, since no kernel declares SignedZeroInfNanPreserve.
TEST(KernelModulesTest, NoOperationIsLeftToTheDriver) {
  std::size_t kernels = 0;
  for (const fs::directory_entry& entry : fs::directory_iterator(fs::path(kernelModules))) {
    const std::string name = entry.path().stem().string();
    if (entry.path().extension() != ".spv" || name.ends_with(".unchecked")) continue;
    ++kernels;
    const std::vector<std::uint32_t> words = readModule(entry.path());
    ASSERT_GT(words.size(), 5u) << name;
    EXPECT_EQ(words[0], 0x07230203u) << name;
    for (const std::string& operation : uncertainOperations(words)) {
      ADD_FAILURE() << name << ": " << operation;
    }
  }
  EXPECT_GE(kernels, 20u);
}

}  // namespace
}  // namespace dermis::test
