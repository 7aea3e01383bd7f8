#include "shader_compiler/include_scan.h"

#include <optional>
#include <utility>
#include <vector>

namespace dermis {
namespace {

struct IncludeDirective {
  std::string_view name;
  IncludeForm form;
};

void skipBlanks(std::string_view& line) {
  const std::size_t start = line.find_first_not_of(" \t\r\v\f");
  line.remove_prefix(start == std::string_view::npos ? line.size() : start);
}

bool consume(std::string_view& line, std::string_view token) {
  if (!line.starts_with(token)) return false;
  line.remove_prefix(token.size());
  skipBlanks(line);
  return true;
}

std::optional<IncludeDirective> parseIncludeDirective(std::string_view line) {
  skipBlanks(line);
  if (!consume(line, "#") || !consume(line, "include") || line.empty()) return std::nullopt;
  const bool isQuoted = line.front() == '"';
  if (!isQuoted && line.front() != '<') return std::nullopt;
  line.remove_prefix(1);
  const std::size_t end = line.find(isQuoted ? '"' : '>');
  if (end == std::string_view::npos) return std::nullopt;
  return IncludeDirective{line.substr(0, end),
                          isQuoted ? IncludeForm::quoted : IncludeForm::angled};
}

std::vector<IncludeDirective> findIncludeDirectives(std::string_view text) {
  std::vector<IncludeDirective> directives;
  while (!text.empty()) {
    const std::size_t end = text.find('\n');
    if (const auto directive = parseIncludeDirective(text.substr(0, end))) {
      directives.push_back(*directive);
    }
    text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  }
  return directives;
}

}  // namespace

std::set<std::string> hashIncludes(std::string_view text, const std::string& name,
                                   IncludeResolver& resolver, Hash128& hash) {
  std::set<std::string> paths;
  std::vector<std::pair<std::string_view, std::string>> unread = {{text, name}};
  while (!unread.empty()) {
    const auto [includingText, includingFile] = std::move(unread.back());
    unread.pop_back();
    for (const IncludeDirective& directive : findIncludeDirectives(includingText)) {
      const IncludeFile* file = resolver.resolve(directive.name, includingFile, directive.form);
      // The name with the path: a file that comes to stand in front of another changes the key.
      hash.add(directive.name);
      hash.add(file != nullptr ? file->path : std::string_view());
      if (file != nullptr && paths.insert(file->path).second) {
        hash.add(file->text);
        unread.emplace_back(file->text, file->path);
      }
    }
  }
  return paths;
}

}  // namespace dermis
