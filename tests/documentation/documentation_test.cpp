// Documents agree with the code: what they show is compiled or printed, and their links lead
// somewhere.
//
// With DERMIS_UPDATE_DOCUMENTS in the environment the test writes what is held to a source into the
// documents (tests/documentation/regenerate.sh).

#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "documents.h"
#include "generated_parts.h"
#include "run_command.h"
#include "test_data.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

bool isUpdating() {
  return std::getenv("DERMIS_UPDATE_DOCUMENTS") != nullptr;
}

/// Lines from the one with `first` to the one with `last`.
std::ptrdiff_t linesBetween(const std::string& text, const std::string& first,
                            const std::string& last) {
  const std::size_t begin = text.find(first), end = text.find(last, begin);
  if (begin == std::string::npos || end == std::string::npos) return -1;
  return 1 + std::count(text.begin() + static_cast<std::ptrdiff_t>(begin),
                        text.begin() + static_cast<std::ptrdiff_t>(end), '\n');
}

/// What begins an identifier, or is in it.
bool isWord(char letter) {
  return std::isalnum(static_cast<unsigned char>(letter)) != 0 || letter == '_';
}

/// The identifiers of code, without comments.
std::set<std::string> identifiers(const std::string& code) {
  std::set<std::string> found;
  std::istringstream lines(code);
  for (std::string line; std::getline(lines, line);) {
    line = line.substr(0, line.find("//"));
    for (std::size_t i = 0; i < line.size(); ++i) {
      const std::size_t begin = i;
      while (i < line.size() && isWord(line[i])) ++i;
      if (i > begin) found.insert(line.substr(begin, i - begin));
    }
  }
  return found;
}

/// The types of the public headers.
std::set<std::string> publicTypes() {
  static const std::regex type("(?:struct|class|enum class) (?:DERMIS_[A-Z_]+ )?([A-Za-z0-9]+).*");
  std::set<std::string> types{"attributeView", "pack", "placeVertices", "makePlan", "writeTables"};
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           std::filesystem::path(sourceFolder) / "engine/include")) {
    std::ifstream file(entry.path());
    std::smatch match;
    for (std::string line; std::getline(file, line);) {
      if (std::regex_match(line, match, type) && !match[1].str().starts_with("Vk"))
        types.insert(match[1]);
    }
  }
  return types;
}

/// The names that a page lists after `intro`, those in brackets not counted. All of them stand in
/// the code, and so do no other types of Dermis before its check.
std::size_t namesToLearn(const std::string& code, const std::string& page,
                         const std::string& intro) {
  const std::string text = readText(page);
  const std::size_t begin = text.find(intro);
  EXPECT_NE(begin, std::string::npos) << intro;
  if (begin == std::string::npos) return 0;
  const std::string list = text.substr(begin, text.find("\n\n", begin) - begin);
  const std::set<std::string> used = identifiers(code.substr(0, code.find("-- The check")));
  std::set<std::string> names;
  std::size_t counted = 0;
  for (std::size_t open = list.find('`', list.find(':')); open != std::string::npos;) {
    const std::size_t close = list.find('`', open + 1);
    const std::string name = list.substr(open + 1, close - open - 1);
    EXPECT_TRUE(used.contains(name)) << name;
    names.insert(name);
    if (open < list.find('(', list.find(':'))) ++counted;
    open = list.find('`', close + 1);
  }
  for (const std::string& type : publicTypes())
    EXPECT_EQ(names.contains(type), used.contains(type)) << type;
  return counted;
}

/// As GitHub names a heading in a link: "What is not due" is #what-is-not-due.
std::string anchor(const std::string& heading) {
  std::string name;
  for (const char letter : heading) {
    const auto byte = static_cast<unsigned char>(letter);
    if (letter == ' ') {
      name += '-';
    } else if (std::isalnum(byte) != 0 || letter == '-' || letter == '_' || byte >= 0x80) {
      name += static_cast<char>(std::tolower(byte));
    }
  }
  return name;
}

/// Of all headings. Lines in blocks of code are none.
std::set<std::string> anchors(const std::string& text) {
  std::set<std::string> names;
  std::istringstream lines(text);
  bool isCode = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```")) isCode = !isCode;
    const std::size_t title = line.find_first_not_of('#');
    if (!isCode && title != 0 && title != std::string::npos && line[title] == ' ')
      names.insert(anchor(line.substr(title + 1)));
  }
  return names;
}

/// What stands between "](" and ")", outside of blocks of code.
std::vector<std::string> links(const std::string& text) {
  std::vector<std::string> found;
  std::istringstream lines(text);
  bool isCode = false;
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```")) isCode = !isCode;
    if (isCode) continue;
    for (std::size_t place = line.find("]("); place != std::string::npos;
         place = line.find("](", place + 1))
      found.push_back(line.substr(place + 2, line.find(')', place) - place - 2));
  }
  return found;
}

TEST(DocumentationTest, LinksLeadSomewhere) {
  std::map<std::string, std::set<std::string>> headings;
  for (const Document& document : allDocuments()) headings[document.path] = anchors(document.text);
  const std::filesystem::path root = sourceFolder;
  std::size_t checked = 0;
  for (const Document& document : allDocuments()) {
    for (const std::string& link : links(document.text)) {
      if (link.find("://") != std::string::npos) continue;
      const std::string file = link.substr(0, link.find('#'));
      const std::filesystem::path folder = std::filesystem::path(document.path).parent_path();
      const std::string target =
          file.empty() ? document.path : (folder / file).lexically_normal().generic_string();
      EXPECT_TRUE(std::filesystem::exists(root / target)) << document.path << ": " << link;
      if (const std::size_t hash = link.find('#'); hash != std::string::npos) {
        EXPECT_TRUE(headings[target].contains(link.substr(hash + 1)))
            << document.path << ": " << link;
      }
      ++checked;
    }
  }
  EXPECT_GT(checked, 50u);
}

TEST(DocumentationTest, WhatIsShownIsWhatItsSourceSays) {
  for (const Document& document : allDocuments()) {
    std::string text = document.text;
    const std::vector<HeldPart> parts = heldParts(text);
    // From the last on, so that those before it stay where they are.
    for (auto part = parts.rbegin(); part != parts.rend(); ++part) {
      SCOPED_TRACE(document.path + ": " + part->kind + ": " + part->source);
      if (part->source == "trust" && !testDataFolder()) continue;  // counts models
      const std::string expected = generate(*part), shown = text.substr(part->begin, part->size);
      ASSERT_FALSE(expected.empty());
      if (part->kind == "help" ? withoutLayout(expected) == withoutLayout(shown)
                               : expected == shown)
        continue;
      if (isUpdating()) {
        text.replace(part->begin, part->size, expected);
      } else {
        EXPECT_EQ(shown, expected) << "tests/documentation/regenerate.sh mends it";
      }
    }
    if (text != document.text)
      std::ofstream(std::string(sourceFolder) + "/" + document.path) << text;
  }
}

/// Blocks of C++ that no source is named for.
TEST(DocumentationTest, AllCodeIsCompiled) {
  std::size_t blocks = 0;
  for (const Document& document : allDocuments()) {
    const std::vector<HeldPart> parts = heldParts(document.text);
    const std::string fence = "```cpp\n";
    for (std::size_t place = document.text.find(fence); place != std::string::npos;
         place = document.text.find(fence, place + 1)) {
      EXPECT_TRUE(std::ranges::any_of(parts,
                                      [&](const HeldPart& part) {
                                        return part.kind == "code" &&
                                               part.begin == place + fence.size();
                                      }))
          << document.path << ": " << document.text.substr(place, 200);
      ++blocks;
    }
  }
  EXPECT_GE(blocks, 10u);
}

/// The manual of the command has a section for each subcommand.
TEST(DocumentationTest, TheManualIsComplete) {
  const std::string overview = generate({"help", "dermis"}), manual = readText("docs/command.md");
  const std::size_t list = overview.rfind(":\n");  // the heading above the subcommands
  ASSERT_NE(list, std::string::npos);
  std::istringstream lines(overview.substr(list + 2));
  int commands = 0;
  for (std::string line; std::getline(lines, line);) {
    if (!line.starts_with("  ") || line.starts_with("   ")) continue;  // continued
    const std::string name = line.substr(2, line.find(' ', 2) - 2);
    EXPECT_NE(manual.find("<!-- help: dermis " + name + " -->\n```"), std::string::npos) << name;
    ++commands;
  }
  EXPECT_EQ(commands, 8);
}

/// All public headers, and what a build offers.
std::string everythingThatHasAName() {
  std::string text;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           std::filesystem::path(sourceFolder) / "engine/include")) {
    if (entry.is_regular_file())
      text += readText("engine/include/" +
                       std::filesystem::relative(
                           entry.path(), std::filesystem::path(sourceFolder) / "engine/include")
                           .generic_string());
  }
  for (const char* file :
       {"samples/minimal/main.cpp", "cmake/DermisInstall.cmake", "engine/src/c/CMakeLists.txt"})
    text += readText(file);
  return text;
}

/// The page for a first integration: short, and every name, file and command in it exists. Its code
/// and its numbers are held to their sources.
TEST(DocumentationTest, TheQuickReferenceIsTrue) {
  const std::string page = readText("docs/quick-reference.md"), known = everythingThatHasAName();
  EXPECT_LE(std::ranges::count(page, '\n'), 150);
  const std::set<std::string> components{"core", "cpu", "gltf", "verify", "vulkan"};
  const std::regex span("`([^`\n]+)`"), word("[A-Za-z_][A-Za-z0-9_]*");
  std::string prose;
  bool isCode = false;
  std::istringstream lines(page);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("```"))
      isCode = !isCode;
    else if (!isCode)
      prose += line + '\n';
  }
  int names = 0;
  for (std::sregex_iterator found(prose.begin(), prose.end(), span), end; found != end; ++found) {
    const std::string text = (*found)[1];
    if (text.ends_with(".h")) {
      EXPECT_TRUE(std::filesystem::exists(std::string(sourceFolder) + "/engine/include/" + text))
          << text;
    } else if (text.starts_with("find_package") || text == "add_subdirectory" ||
               text.starts_with("dermis::") || text.starts_with("dermis-")) {
      // The tests of the package use them.
    } else if (text == "dermis" || text == "cdef" ||
               (text.starts_with("dermis_") && components.contains(text.substr(7)))) {
      // pkg-config: package.pkg_config
    } else {
      for (std::sregex_iterator part(text.begin(), text.end(), word); part != end; ++part) {
        EXPECT_TRUE(std::regex_search(known, std::regex("\\b" + part->str() + "\\b"))) << text;
        ++names;
      }
    }
  }
  EXPECT_GE(names, 35);

  int commands = 0;
  std::istringstream commandLines(page.substr(page.rfind("```sh")));
  for (std::string line; std::getline(commandLines, line);) {
    if (!line.starts_with("dermis ")) continue;
    const std::filesystem::path output = std::filesystem::temp_directory_path() / "quick.ply";
    std::vector<std::string> called;
    std::istringstream words(line);
    for (std::string argument; words >> argument;) {
      called.push_back(called.empty()          ? dermisProgram
                       : argument == "MODEL"   ? std::string(sampleModels) + "/bar.glb"
                       : argument == "OUT.ply" ? output.string()
                                               : argument);
    }
    if (line.find("verify") != std::string::npos) called.insert(called.end(), {"--device", "cpu"});
    const CommandResult result = runCommand(called);
    EXPECT_EQ(result.status, 0) << line << '\n' << result.output;
    ++commands;
  }
  EXPECT_GE(commands, 3);
}

// How long the first page and the smallest programs are, and how much of the interface they need.
TEST(DocumentationTest, WhatIsReadFirstIsShort) {
  const std::string readme = readText("README.md");
  EXPECT_LE(std::ranges::count(readme, '\n'), 152);

  const std::string code = readText("samples/minimal/main.cpp");
  const std::ptrdiff_t all = linesBetween(code, "vkCreateInstance", "comparison.passed()");
  EXPECT_GT(all, 0);
  EXPECT_LE(all, 150);
  std::ptrdiff_t shown = 0;
  for (const HeldPart& part : heldParts(readme)) {
    if (part.source.starts_with("samples/minimal/main.cpp"))
      shown +=
          std::count(readme.begin() + static_cast<std::ptrdiff_t>(part.begin),
                     readme.begin() + static_cast<std::ptrdiff_t>(part.begin + part.size), '\n');
  }
  EXPECT_GT(shown, 30);
  EXPECT_LE(shown, 60);

  EXPECT_EQ(namesToLearn(code, "README.md", "It needs 22 names of Dermis"), 22u);
  EXPECT_EQ(namesToLearn(readText("samples/embed/main.cpp"), "docs/integration.md",
                         "`samples/embed` needs 26"),
            26u);
}

}  // namespace
}  // namespace dermis::test
