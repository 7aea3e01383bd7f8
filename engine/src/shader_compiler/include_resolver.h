// Which file an `#include` means, and what is in it.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace dermis {

struct IncludeFile {
  std::string path;
  std::string text;
};

enum class IncludeForm {
  quoted,  ///< `#include "name"`: the folder of the including file, then the include folders.
  angled   ///< `#include <name>`: the include folders only.
};

/// Reads each file once, so that the hash for the cache and the compilation after it see the same
/// text even if the file changes in between.
class IncludeResolver {
 public:
  explicit IncludeResolver(const std::vector<std::filesystem::path>& includeFolders)
      : includeFolders_(includeFolders) {}

  /// The file, owned by this object; null if there is none.
  const IncludeFile* resolve(std::string_view name, std::string_view includingFile,
                             IncludeForm form);

  /// All files that `resolve` found, in the order in which they were first found.
  const std::vector<std::filesystem::path>& filesRead() const { return filesRead_; }

 private:
  const IncludeFile* load(const std::filesystem::path& path);

  const std::vector<std::filesystem::path>& includeFolders_;
  std::map<std::string, std::optional<IncludeFile>> files_;  ///< By path; empty: not there.
  std::vector<std::filesystem::path> filesRead_;
};

}  // namespace dermis
