// The code in README.md is code that is compiled: the marked regions of samples/embed, word for
// word.

#include <gtest/gtest.h>

#include <fstream>
#include <string>

namespace {

std::string readText(const std::string& path) {
  std::ifstream file(std::string(DERMIS_SOURCE_DIR) + "/" + path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// The lines between "// [NAME]" and "// [/NAME]".
std::string region(const std::string& text, const std::string& name) {
  const std::string begin = "// [" + name + "]\n", end = "// [/" + name + "]";
  const std::size_t first = text.find(begin), last = text.find(end);
  if (first == std::string::npos || last == std::string::npos) return {};
  return text.substr(first + begin.size(), last - first - begin.size());
}

TEST(DocumentationTest, TheReadmesCodeIsTheSamplesCode) {
  const std::string readme = readText("README.md"),
                    sample = readText("samples/embed/skinned_crowd.cpp");
  for (const char* name : {"plan", "set-up", "frame"}) {
    const std::string code = region(sample, name);
    ASSERT_FALSE(code.empty()) << name;
    EXPECT_NE(readme.find("```cpp\n" + code + "```"), std::string::npos)
        << "region " << name << " differs";
  }
}

}  // namespace
