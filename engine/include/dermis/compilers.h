// GLSL to SPIR-V by glslang: dermis::shader_compiler, and dermis::runtime_compiler, which uses it
// to reload the kernels of dermis::vulkan.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dermis/result.h"

namespace dermis::vulkan {
class Context;
struct KernelSource;
}  // namespace dermis::vulkan

// ---- Compiles GLSL to SPIR-V. The build compiles the kernels of Dermis with it. An engine may use
// it at run time.

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
/// is an error. Every `fma` becomes one operation (NoContraction). The optimization keeps
/// `precise`, and all specialization constants and bindings, even if they are not used.
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

// ---- Compiles the kernels of dermis::vulkan from GLSL at run time, and again when a file changes.
// For developers of kernels. Built with DERMIS_RUNTIME_COMPILER=ON; links glslang.
//
//   RuntimeCompiler compiler = must(RuntimeCompiler::create(DERMIS_SHADER_DIR, cacheFolder));
//   description.kernelSource = compiler.source();
//   Context context = must(Context::create(description));
//
//   // Between two frames:
//   const auto reload = compiler.reload(context, frame, completedFrame);
//   if (!reload)
//     show(reload.error().message);  // "shaders/blend.glsl:31: ..."; the old kernels stay

/// Supplies the kernels of a Context. Unchanged GLSL compiles to the same words as the modules in
/// the library. A module is compiled when `Context::prepare` first needs it.
///
/// Do not change `abi.h`, since it is compiled into the library, too. Do not change bindings, push
/// constants or specialization constants either.
///
/// One object serves one Context, and must outlive it. It may be moved, but not while another
/// thread calls a function of it. `prepare` may run on other threads during any call.
class DERMIS_RUNTIME_COMPILER_API RuntimeCompiler {
 public:
  /// What a reload did.
  struct Reload {
    /// Number of modules with a changed source file. Each was compiled again, or taken from the
    /// cache.
    std::uint32_t changed = 0;
    /// Names of the modules whose SPIR-V changed. The next `record` uses the new SPIR-V.
    std::vector<std::string> replaced;
    std::uint32_t pipelines = 0;  ///< number of pipelines that were created for these modules
  };

  /// Compiles nothing yet. `shaderFolder` is DERMIS_SHADER_DIR, or a copy of that folder; it is
  /// only read. `cacheFolder` keeps compiled modules between runs, as
  /// `ShaderCompilerOptions::cacheFolder`. Fails with `ioError` if the folder has no `abi.h`, and
  /// with `invalidArgument` if its `abi.h` differs from the one in this library: the folder is from
  /// another version.
  static Result<RuntimeCompiler> create(std::filesystem::path shaderFolder,
                                        std::filesystem::path cacheFolder = {});

  ~RuntimeCompiler();
  RuntimeCompiler(RuntimeCompiler&&) noexcept;
  RuntimeCompiler& operator=(RuntimeCompiler&&) noexcept;

  /// For `DeviceDescription::kernelSource`. If a kernel does not compile, `prepare` fails with
  /// `shaderError` and the message of `reload`.
  vulkan::KernelSource source() const;

  /// Looks for changed files, compiles the modules that use them, creates their pipelines, and
  /// swaps them with `Context::replaceKernels`. The rules of that function for `frame`,
  /// `completedFrame` and threads apply. One thread calls `reload`, in every frame or from time to
  /// time; a later call destroys the replaced pipelines. If nothing changed, it only reads the time
  /// and size of each file. It does not look for changes while `prepare` compiles on another
  /// thread.
  ///
  /// Either all changed modules are swapped or none. Fails with `shaderError` if one does not
  /// compile; the message is the first error of glslang, "FILE:LINE: text (module NAME)". All old
  /// kernels then stay in use until a later call finds another change and compiles it. Until then
  /// calls return an empty `Reload`. Fails with `ioError` if a file cannot be read, with
  /// `invalidArgument` if `abi.h` changed, and as `replaceKernels` does.
  ///
  /// A scene does not skin again because of a reload: instances at rest keep what the
  /// old kernels wrote until their pose is written.
  Result<Reload> reload(const vulkan::Context& context, std::uint64_t frame,
                        std::uint64_t completedFrame);

  std::uint32_t compiledModules() const;  ///< modules that glslang compiled so far
  std::uint32_t cachedModules() const;    ///< modules that came from the cache folder so far

  /// Problems of the cache folder since the last call, one sentence each. For example, an entry was
  /// damaged and made again, or cannot be read or written.
  std::vector<std::string> takeCacheProblems();

 private:
  RuntimeCompiler();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis
