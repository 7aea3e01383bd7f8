// The code in README.md is code that is compiled: the marked regions of the samples, word for word.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

#include "test_paths.h"

namespace {

std::string readText(const std::string& path) {
  std::ifstream file(std::string(dermis::test::sourceFolder) + "/" + path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// The lines between "// [NAME]" and "// [/NAME]", without the indentation of these two.
std::string region(const std::string& text, const std::string& name) {
  const std::string begin = "// [" + name + "]\n", end = "// [/" + name + "]";
  const std::size_t first = text.find(begin), last = text.find(end);
  if (first == std::string::npos || last == std::string::npos) return {};
  const std::size_t indentation = first - (text.rfind('\n', first) + 1);
  std::istringstream lines(text.substr(first + begin.size(), last - first - begin.size()));
  std::string marked;
  for (std::string line; std::getline(lines, line);) {
    if (line.find_first_not_of(' ') != std::string::npos || line.empty())
      marked += line.substr(std::min(indentation, line.size())) + '\n';
  }
  return marked;
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

/// Lines from the one with `first` to the one with `last`.
std::ptrdiff_t linesBetween(const std::string& text, const std::string& first,
                            const std::string& last) {
  const std::size_t begin = text.find(first), end = text.find(last, begin);
  if (begin == std::string::npos || end == std::string::npos) return -1;
  return 1 + std::count(text.begin() + static_cast<std::ptrdiff_t>(begin),
                        text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
}

/// The names that a section of engine/README.md lists, all of which stand in the code.
int namesToLearn(const std::string& code, const std::string& sample) {
  const std::string map = readText("engine/README.md");
  const std::size_t begin = map.find("`" + sample + "` is a whole program");
  if (begin == std::string::npos) return -1;
  std::string list = map.substr(begin, map.find("\n\n", begin) - begin);
  list = list.substr(list.find(':'));
  int count = 0;
  for (std::size_t place = list.find('`'); place != std::string::npos;
       place = list.find('`', place)) {
    const std::size_t close = list.find('`', place + 1);
    const std::string name = list.substr(place + 1, close - place - 1);
    EXPECT_NE(code.find(name), std::string::npos) << name;
    ++count;
    place = close + 1;
  }
  return count;
}

// How long the smallest programs are, and how much of the interface they need.
TEST(DocumentationTest, TheSmallestProgramsAreSmall) {
  const std::string code = readText("samples/minimal/main.cpp");
  const std::ptrdiff_t all = linesBetween(code, "vkCreateInstance", "comparison.passed()");
  EXPECT_GT(all, 0);
  EXPECT_LE(all, 150);
  const std::ptrdiff_t scene = linesBetween(code, "SkinningSystem::create", "scene.record");
  EXPECT_GT(scene, 0);
  EXPECT_LE(scene, 60);

  EXPECT_EQ(namesToLearn(code, "samples/minimal"), 13);
  EXPECT_EQ(namesToLearn(readText("samples/embed/main.cpp"), "samples/embed"), 20);
}

TEST(DocumentationTest, TheReadmesCodeIsTheSamplesCode) {
  expectRegions("samples/embed/main.cpp", {"needs", "set-up", "frame"});
  expectRegions("samples/crowd/crowd.cpp", {"crowd-set-up", "crowd-add", "crowd-frame"});
}

}  // namespace
