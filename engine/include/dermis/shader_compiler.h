// GLSL to SPIR-V. The build compiles Dermis' own kernels with it; an engine may use it at run time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dermis/export.h"
#include "dermis/result.h"

namespace dermis {

enum class ShaderStage : std::uint8_t { compute, vertex, fragment };

struct ShaderCompilerOptions {
  /// Where `#include` is looked up, in this order; for `#include "name"` after the folder of the
  /// including file, for `#include <name>` only here.
  std::vector<std::filesystem::path> includeFolders;
  /// Where compiled modules are kept between runs; empty for nowhere. Created when first needed.
  /// Entries are found by a hash of everything that goes in (text, every file it may include,
  /// defines, options, compiler versions) and carry a checksum: a damaged one is thrown away and
  /// made again. Nothing else is ever deleted: the folder grows until its owner empties it, which
  /// is safe at any time, as is sharing it between threads and processes.
  std::filesystem::path cacheFolder;
  bool optimize = true;    ///< Run SPIRV-Tools' performance passes, but for inlining.
  bool debugInfo = false;  ///< Keep names and line numbers.
  /// Blocks may have the layout of GL_EXT_scalar_block_layout. The device that gets the module must
  /// have VkPhysicalDeviceScalarBlockLayoutFeatures enabled.
  bool scalarBlockLayout = false;
};

struct ShaderSource {
  /// For messages, and its folder for includes: "shaders/skin.comp". A name without a folder
  /// includes from the current one. A quotation mark or a line break in it is refused.
  std::string name;
  std::string text;
  ShaderStage stage = ShaderStage::compute;
  std::vector<std::pair<std::string, std::string>> defines;  ///< name, value
};

/// Compiles GLSL for Vulkan 1.1 (SPIR-V 1.3) and validates the result.
///
/// `#include` needs no `#extension` line. A file that is included twice needs an include guard, as
/// glslang ignores `#pragma once`; a file that includes itself, even through others, is refused.
/// `precise` (NoContraction), specialisation constants and bindings survive the optimisation, those
/// that nothing uses as well.
///
/// Not thread-safe: one object a thread. Objects share glslang's tables, which the first `compile`
/// makes and the last object's destructor frees; a cache hit does not need them.
class DERMIS_SHADER_COMPILER_API ShaderCompiler {
 public:
  explicit ShaderCompiler(ShaderCompilerOptions options = {}) : options_(std::move(options)) {}

  /// SPIR-V words. Fails with
  /// - `shaderError`: the message is the compiler's first error as "FILE:LINE: text", where FILE is
  ///   the included file if the error is in one; "FILE: text" where it belongs to no line.
  /// - `invalidArgument`: a define that is not a name and one line of text, or an impossible name.
  Result<std::vector<std::uint32_t>> compile(const ShaderSource& source);

  /// Reads the file, takes the stage from its ending (.comp, .vert, .frag) and compiles it.
  /// Fails with `ioError` too, and with `invalidArgument` for another ending.
  Result<std::vector<std::uint32_t>> compileFile(
      const std::filesystem::path& path,
      std::vector<std::pair<std::string, std::string>> defines = {});

  /// Whether the last `compile` was answered from the cache folder.
  bool lastFromCache() const { return lastFromCache_; }

  /// What was wrong with the cache in the last `compile`, in one sentence, or empty: an entry that
  /// was damaged and made again, or a folder or an entry that cannot be read, made or written. None
  /// of it keeps a shader from being compiled.
  const std::string& lastCacheProblem() const { return lastCacheProblem_; }

  /// The files that the last `compile` read for `#include`, each once, in the order of reading:
  /// what a build, or a reload of shaders, has to watch. With a cache folder it also has the files
  /// behind conditions that were false. Filled as far as compiling came when it fails.
  const std::vector<std::filesystem::path>& lastIncludes() const { return lastIncludes_; }

 private:
  Result<std::vector<std::uint32_t>> compileUnguarded(const ShaderSource& source);

  ShaderCompilerOptions options_;
  std::shared_ptr<void> glslangUse_;  ///< Keeps glslang's tables between calls.
  std::vector<std::filesystem::path> lastIncludes_;
  std::string lastCacheProblem_;
  bool lastFromCache_ = false;
};

}  // namespace dermis
