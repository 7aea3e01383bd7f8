#include "documents.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <sstream>

#include "test_paths.h"

namespace dermis::test {
namespace {

/// The end of the lines from `begin` on that begin with `|`.
std::size_t endOfTable(const std::string& text, std::size_t begin) {
  std::size_t end = begin;
  while (end < text.size() && text[end] == '|') {
    const std::size_t line = text.find('\n', end);
    if (line == std::string::npos) return text.size();
    end = line + 1;
  }
  return end;
}

}  // namespace

std::vector<Document> allDocuments() {
  const std::filesystem::path folder = sourceFolder;
  std::vector<Document> documents;
  for (const char* name : {"README.md", "CHANGELOG.md", "SECURITY.md"})
    documents.push_back({name, readText(name)});
  for (const char* part : {"engine", "docs", "samples", "tests"}) {
    for (const auto& entry : std::filesystem::recursive_directory_iterator(folder / part)) {
      if (entry.path().extension() != ".md") continue;
      const std::string path = entry.path().lexically_relative(folder).generic_string();
      documents.push_back({path, readText(path)});
    }
  }
  return documents;
}

std::string readText(const std::string& path) {
  std::ifstream file(std::string(sourceFolder) + "/" + path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

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

std::vector<HeldPart> heldParts(const std::string& text) {
  std::vector<HeldPart> parts;
  for (const std::string kind : {"code", "help", "table"}) {
    const std::string opening = "<!-- " + kind + ": ", closing = " -->\n";
    for (std::size_t place = text.find(opening); place != std::string::npos;
         place = text.find(opening, place + 1)) {
      const std::size_t close = text.find(closing, place);
      HeldPart part{kind, text.substr(place + opening.size(), close - place - opening.size())};
      if (close != std::string::npos) {
        part.begin = close + closing.size();
        std::size_t end = part.begin;
        if (kind == "table") {
          end = endOfTable(text, part.begin);
        } else if (text.compare(part.begin, 3, "```") == 0) {
          part.begin = text.find('\n', part.begin) + 1;
          end = std::min(text.find("```\n", part.begin), text.size());
        }
        part.size = end - part.begin;
      }
      parts.push_back(part);
    }
  }
  std::ranges::sort(parts, {}, &HeldPart::begin);
  return parts;
}

}  // namespace dermis::test
