// The code in README.md is code that is compiled: the marked regions of the samples, word for word.

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "test_paths.h"

namespace {

std::string readText(const std::string& path) {
  std::ifstream file(std::string(dermis::test::sourceFolder) + "/" + path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// The lines between "// [NAME]" and "// [/NAME]".
std::string region(const std::string& text, const std::string& name) {
  const std::string begin = "// [" + name + "]\n", end = "// [/" + name + "]";
  const std::size_t first = text.find(begin), last = text.find(end);
  if (first == std::string::npos || last == std::string::npos) return {};
  return text.substr(first + begin.size(), last - first - begin.size());
}

void expectRegions(const std::string& sample, const std::vector<std::string>& names) {
  const std::string readme = readText("README.md"), code = readText(sample);
  for (const std::string& name : names) {
    const std::string marked = region(code, name);
    ASSERT_FALSE(marked.empty()) << name;
    EXPECT_NE(readme.find("```cpp\n" + marked + "```"), std::string::npos)
        << "region " << name << " differs";
  }
}

TEST(DocumentationTest, TheReadmesCodeIsTheSamplesCode) {
  expectRegions("samples/embed/skinned_crowd.cpp", {"plan", "set-up", "frame"});
  expectRegions("samples/crowd/crowd.cpp", {"crowd-set-up", "crowd-add", "crowd-frame"});
}

}  // namespace
