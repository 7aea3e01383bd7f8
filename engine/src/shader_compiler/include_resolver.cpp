#include "shader_compiler/include_resolver.h"

#include "shader_compiler/file_io.h"

namespace dermis {

const IncludeFile* IncludeResolver::resolve(std::string_view name, std::string_view includingFile,
                                            IncludeForm form) {
  if (form == IncludeForm::quoted) {
    const std::filesystem::path folder = std::filesystem::path(includingFile).parent_path();
    if (const IncludeFile* file = load(folder / name)) return file;
  }
  for (const std::filesystem::path& folder : includeFolders_) {
    if (const IncludeFile* file = load(folder / name)) return file;
  }
  return nullptr;
}

const IncludeFile* IncludeResolver::load(const std::filesystem::path& path) {
  const std::string key = path.lexically_normal().string();
  const auto [place, isNew] = files_.try_emplace(key);
  if (isNew) {
    if (std::optional<std::string> text = readFile(key)) {
      place->second = IncludeFile{key, *std::move(text)};
      filesRead_.emplace_back(key);
    }
  }
  return place->second ? &*place->second : nullptr;
}

}  // namespace dermis
