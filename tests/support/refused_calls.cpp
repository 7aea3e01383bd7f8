#include "refused_calls.h"

#include <filesystem>
#include <fstream>
#include <iterator>
#include <regex>

#include "test_paths.h"

namespace dermis::test {
namespace {

/// To the semicolon that ends it.
std::string statementAt(const std::string& text, std::size_t begin) {
  bool isInText = false;
  std::size_t end = begin;
  for (; end < text.size() && (isInText || text[end] != ';'); ++end) {
    if (text[end] == '"' && text[end - 1] != '\\') isInText = !isInText;
  }
  return text.substr(begin, end - begin);
}

void addTexts(const std::filesystem::path& file, std::set<std::string>& texts) {
  std::ifstream stream(file);
  std::string source{std::istreambuf_iterator<char>(stream), {}};
  source = std::regex_replace(source, std::regex("//[^\n]*"), "");
  source = std::regex_replace(source, std::regex("\"\\s*\n\\s*\""), "");  // one text in two lines
  static const std::regex error(
      "return (invalid|wrong|noRoom|notAValue)\\(|Error\\{ErrorCode|return \\{ErrorCode");
  static const std::regex literal("\"([^\"]*)\"");
  const std::sregex_iterator none;
  for (std::sregex_iterator found(source.begin(), source.end(), error); found != none; ++found) {
    const std::string statement = statementAt(source, static_cast<std::size_t>(found->position()));
    for (std::sregex_iterator part(statement.begin(), statement.end(), literal); part != none;
         ++part) {
      if ((*part)[1].length() >= 12) texts.insert((*part)[1]);
    }
  }
}

}  // namespace

std::set<std::string> errorTexts(const std::string& path) {
  const std::filesystem::path root = std::filesystem::path(sourceFolder) / "engine/src" / path;
  std::set<std::string> texts;
  if (!std::filesystem::is_directory(root)) {
    addTexts(root, texts);
    return texts;
  }
  for (const auto& entry : std::filesystem::directory_iterator(root)) addTexts(entry.path(), texts);
  return texts;
}

}  // namespace dermis::test
