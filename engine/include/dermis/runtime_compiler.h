// Compiles the kernels of dermis::vulkan from GLSL at run time, and again when a file changes. For
// developers of kernels. Built with DERMIS_RUNTIME_COMPILER=ON; links glslang.
//
//   RuntimeCompiler compiler = must(RuntimeCompiler::create({DERMIS_SHADER_DIR, cacheFolder}));
//   description.kernelSource = compiler.source();
//   Context context = must(Context::create(description));
//
//   // Between two frames:
//   if (Result<KernelReload> reload = compiler.reload(context, frame, completedFrame); !reload)
//     show(reload.error().message);  // "shaders/blend.glsl:31: ..."; the old kernels stay
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "dermis/export.h"
#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/kernels.h"

namespace dermis {

/// Folders of a `RuntimeCompiler`.
struct RuntimeCompilerOptions {
  /// DERMIS_SHADER_DIR, or a copy of that folder. It is only read.
  std::filesystem::path shaderFolder;
  /// Where compiled modules are kept between runs: `ShaderCompilerOptions::cacheFolder`.
  std::filesystem::path cacheFolder;
};

/// What a reload did.
struct KernelReload {
  /// Number of modules with a changed source file. Each was compiled again, or taken from the
  /// cache.
  std::uint32_t changed = 0;
  /// Names of the modules whose SPIR-V changed. The next `record` uses the new SPIR-V.
  std::vector<std::string> replaced;
  std::uint32_t pipelines = 0;  ///< number of pipelines that were created for these modules
};

/// Counts since the compiler was created.
struct RuntimeCompilerStatistics {
  std::uint32_t compiled = 0;   ///< modules that glslang compiled
  std::uint32_t fromCache = 0;  ///< modules that were taken from the cache folder
};

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
  /// Compiles nothing yet. Fails with `ioError` if the folder has no `abi.h`, and with
  /// `invalidArgument` if its `abi.h` differs from the one in this library: the folder is from
  /// another version.
  static Result<RuntimeCompiler> create(RuntimeCompilerOptions options);

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
  /// calls return an empty `KernelReload`. Fails with `ioError` if a file cannot be read, with
  /// `invalidArgument` if `abi.h` changed, and as `replaceKernels` does.
  ///
  /// A scene does not skin again because of a reload: instances at rest keep what the
  /// old kernels wrote until their pose is written.
  Result<KernelReload> reload(const vulkan::Context& context, std::uint64_t frame,
                              std::uint64_t completedFrame);

  /// How many modules were compiled, and how many came from the cache.
  RuntimeCompilerStatistics statistics() const;

  /// Problems of the cache folder since the last call, one sentence each. For example, an entry was
  /// damaged and made again, or cannot be read or written.
  std::vector<std::string> takeCacheProblems();

 private:
  RuntimeCompiler();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis
