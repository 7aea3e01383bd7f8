#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <limits>
#include <optional>
#include <set>
#include <string_view>

#include "dermis/compilers.h"
#include "shader_compiler/cache.h"
#include "shader_compiler/file_io.h"
#include "shader_compiler/glslang_front_end.h"
#include "shader_compiler/hash.h"
#include "shader_compiler/include_resolver.h"
#include "shader_compiler/include_scan.h"
#include "shader_compiler/no_contraction.h"
#include "shader_compiler/optimizer.h"

namespace dermis {
namespace {

// To be raised when this library itself makes other SPIR-V from the same text.
constexpr std::uint64_t pipelineVersion = 2;

Error invalidArgument(std::string message) {
  return Error{ErrorCode::invalidArgument, std::move(message)};
}

bool isIdentifier(std::string_view text) {
  constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_";
  constexpr std::string_view lettersAndDigits =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz_0123456789";
  return !text.empty() && letters.find(text.front()) != std::string_view::npos &&
         text.find_first_not_of(lettersAndDigits) == std::string_view::npos;
}

bool hasLineBreak(std::string_view text) {
  return text.find_first_of("\r\n") != std::string_view::npos;
}

Result<void> checkSource(const ShaderSource& source) {
  if (source.name.find('"') != std::string::npos || hasLineBreak(source.name)) {
    return invalidArgument("a shader's name contains a quotation mark or a line break");
  }
  if (source.stage > ShaderStage::fragment) {
    return invalidArgument("the stage of shader '" + source.name +
                           "' is not a value of ShaderStage");
  }
  if (source.text.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    return invalidArgument("shader '" + source.name + "' is longer than 2 GiB");
  }
  for (const auto& [name, value] : source.defines) {
    if (!isIdentifier(name) || hasLineBreak(value) || value.ends_with('\\')) {
      return invalidArgument("define '" + name + "' of shader '" + source.name +
                             "' is not a name and one line of text");
    }
  }
  return {};
}

std::optional<ShaderStage> stageOfEnding(const std::filesystem::path& path) {
  const std::filesystem::path ending = path.extension();
  if (ending == ".comp") return ShaderStage::compute;
  if (ending == ".vert") return ShaderStage::vertex;
  if (ending == ".frag") return ShaderStage::fragment;
  return std::nullopt;
}

Hash128 hashOf(const ShaderSource& source, const ShaderCompilerOptions& options) {
  Hash128 hash;
  hash.addWord(pipelineVersion);
  hash.add(frontEndVersion());
  hash.add(optimizerVersion());
  hash.addWord(options.optimize ? 1 : 0);
  hash.addWord(options.debugInfo ? 1 : 0);
  hash.addWord(options.scalarBlockLayout ? 1 : 0);
  hash.addWord(static_cast<std::uint64_t>(source.stage));
  hash.add(source.name);
  hash.add(source.text);
  hash.addWord(source.defines.size());
  for (const auto& [name, value] : source.defines) {
    hash.add(name);
    hash.add(value);
  }
  return hash;
}

// The cache folder as one call of `compile` sees it.
class CacheUse {
 public:
  CacheUse(const ShaderSource& source, const ShaderCompilerOptions& options,
           IncludeResolver& resolver)
      : cache_(options.cacheFolder) {
    Hash128 hash = hashOf(source, options);
    hashedFiles_ = hashIncludes(source.text, source.name, resolver, hash);
    key_ = hash.value();
  }

  CacheLookup load() const { return cache_.load(key_); }

  /// What kept the module from being stored; empty if nothing did. A module with an include that
  /// is not in the key is not stored: its change would go unnoticed.
  std::string store(const FrontEndOutput& translated,
                    const std::vector<std::uint32_t>& words) const {
    if (!std::includes(hashedFiles_.begin(), hashedFiles_.end(), translated.includedFiles.begin(),
                       translated.includedFiles.end())) {
      return "not cached: an #include is not written on one line without comments";
    }
    const Result<void> stored = cache_.store(key_, words);
    return stored ? std::string() : stored.error().message;
  }

 private:
  Cache cache_;
  CacheKey key_{};
  std::set<std::string> hashedFiles_;
};

}  // namespace

Result<std::vector<std::uint32_t>> ShaderCompiler::compile(const ShaderSource& source) {
  lastFromCache_ = false;
  lastCacheProblem_.clear();
  lastIncludes_.clear();
  // What the standard library may throw (memory, paths) must not cross the interface.
  try {
    return compileUnguarded(source);
  } catch (const std::exception& exception) {
    return Error{ErrorCode::shaderError, source.name + ": " + exception.what()};
  }
}

Result<std::vector<std::uint32_t>> ShaderCompiler::compileFile(
    const std::filesystem::path& path, std::vector<std::pair<std::string, std::string>> defines) {
  try {
    const std::optional<ShaderStage> stage = stageOfEnding(path);
    if (!stage) {
      return invalidArgument("shader '" + path.string() +
                             "' does not end in .comp, .vert or .frag");
    }
    std::optional<std::string> text = readFile(path);
    if (!text) return Error{ErrorCode::ioError, "cannot read shader '" + path.string() + "'"};
    return compile({path.string(), *std::move(text), *stage, std::move(defines)});
  } catch (const std::exception& exception) {
    return Error{ErrorCode::ioError, std::string("cannot read a shader: ") + exception.what()};
  }
}

Result<std::vector<std::uint32_t>> ShaderCompiler::compileUnguarded(const ShaderSource& source) {
  if (const Result<void> usable = checkSource(source); !usable) return usable.error();

  IncludeResolver resolver(options_.includeFolders);
  std::optional<CacheUse> cache;
  if (!options_.cacheFolder.empty()) {
    cache.emplace(source, options_, resolver);
    CacheLookup found = cache->load();
    lastIncludes_ = resolver.filesRead();
    lastCacheProblem_ = std::move(found.problem);
    if (!found.words.empty()) {
      lastFromCache_ = true;
      return std::move(found.words);
    }
  }

  if (!glslangUse_) glslangUse_ = acquireGlslang();
  const Result<FrontEndOutput> translated = translateToSpirv(source, options_.debugInfo, resolver);
  lastIncludes_ = resolver.filesRead();
  if (!translated) return translated.error();
  Result<std::vector<std::uint32_t>> words = optimizeAndValidate(
      decorateFma(translated->words),
      {options_.optimize, options_.debugInfo, options_.scalarBlockLayout}, source.name);
  if (words && cache) {
    const std::string problem = cache->store(*translated, *words);
    if (!problem.empty()) {
      lastCacheProblem_ += (lastCacheProblem_.empty() ? "" : "; ") + problem;
    }
  }
  return words;
}

}  // namespace dermis
