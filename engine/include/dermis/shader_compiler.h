// Compiles GLSL to SPIR-V. The build compiles the kernels of Dermis with it. An engine may use it
// at run time.
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

/// The kind of a shader.
enum class ShaderStage : std::uint8_t { compute = 0, vertex = 1, fragment = 2 };

/// How shaders are compiled.
struct ShaderCompilerOptions {
  /// Folders to search for included files, in this order. `#include "name"` searches the folder of
  /// the including file first.
  std::vector<std::filesystem::path> includeFolders;
  /// Folder that keeps compiled modules between runs; empty for none. It is created when it is
  /// first needed. The key of an entry is a hash of all inputs: the text, every file it may
  /// include, the defines, the options and the compiler versions. Each entry has a checksum: a
  /// damaged entry is deleted and made again. Nothing else is deleted, so the folder grows until
  /// its owner empties it. That is safe at any time. Threads and processes may share the folder.
  std::filesystem::path cacheFolder;
  bool optimize = true;  ///< whether to run the performance passes of SPIRV-Tools, except inlining
  bool debugInfo = false;  ///< whether to keep names and line numbers
  /// Whether blocks may have the layout of GL_EXT_scalar_block_layout. The device must then have
  /// VkPhysicalDeviceScalarBlockLayoutFeatures enabled.
  bool scalarBlockLayout = false;
};

/// The source of one shader.
struct ShaderSource {
  /// A path such as "shaders/skin.comp", for messages. `#include "name"` searches its folder, or
  /// the current folder if it has none. It must not contain a quotation mark or a line break.
  std::string name;
  std::string text;
  ShaderStage stage = ShaderStage::compute;
  std::vector<std::pair<std::string, std::string>> defines;  ///< name, value
};

/// Compiles GLSL for Vulkan 1.1 (SPIR-V 1.3) and validates the result.
///
/// `#include` needs no `#extension` line. A file that is included twice needs an include guard,
/// since glslang ignores `#pragma once`. A file that includes itself, directly or through others,
/// is an error. The optimization keeps `precise` (NoContraction), and all specialization constants
/// and bindings, even if they are not used.
///
/// Not thread-safe: use one object per thread. All objects share the tables of glslang. The first
/// `compile` that finds no cache entry creates them, and the destructor of the last object frees
/// them.
class DERMIS_SHADER_COMPILER_API ShaderCompiler {
 public:
  /// Creates nothing yet.
  explicit ShaderCompiler(ShaderCompilerOptions options = {}) : options_(std::move(options)) {}

  /// Compiles a shader and returns SPIR-V words. Fails with
  /// - `shaderError` if it does not compile. The message is the first error of the compiler, as
  ///   "FILE:LINE: text", or "FILE: text" if it belongs to no line. FILE is the included file if
  ///   the error is in one;
  /// - `invalidArgument` if a define is not a name and one line of text, or if the name or stage of
  ///   the source is not valid.
  Result<std::vector<std::uint32_t>> compile(const ShaderSource& source);

  /// Reads a file and compiles it. The extension selects the stage: .comp, .vert or .frag. Fails as
  /// `compile` does, with `ioError`, and with `invalidArgument` for another extension.
  Result<std::vector<std::uint32_t>> compileFile(
      const std::filesystem::path& path,
      std::vector<std::pair<std::string, std::string>> defines = {});

  /// Whether the result of the last `compile` came from the cache folder.
  bool lastFromCache() const { return lastFromCache_; }

  /// What was wrong with the cache in the last `compile`, in one sentence; empty if nothing was.
  /// For example, an entry was damaged, or the folder cannot be written. The shader is compiled in
  /// any case.
  const std::string& lastCacheProblem() const { return lastCacheProblem_; }

  /// The files that the last `compile` included, each once, in the order in which it read them. A
  /// build, or a reload of shaders, watches these files. With a cache folder the list also has
  /// files whose `#include` is disabled by a condition. If `compile` failed, files after the error
  /// may be missing.
  const std::vector<std::filesystem::path>& lastIncludes() const { return lastIncludes_; }

 private:
  Result<std::vector<std::uint32_t>> compileUnguarded(const ShaderSource& source);

  ShaderCompilerOptions options_;
  std::shared_ptr<void> glslangUse_;  ///< keeps the tables of glslang between calls
  std::vector<std::filesystem::path> lastIncludes_;
  std::string lastCacheProblem_;
  bool lastFromCache_ = false;
};

}  // namespace dermis
