// The kernels of dermis::vulkan compiled at run time from their GLSL, and compiled again when a
// file changes: for those who work on kernels. Built with DERMIS_RUNTIME_COMPILER=ON; links
// glslang.
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
  /// Modules that read a file that changed: compiled again, or taken from the cache.
  std::uint32_t compiled = 0;
  /// Those whose SPIR-V is another one now. It is in use from the next `record` on.
  std::vector<std::string> replaced;
  std::uint32_t pipelines = 0;  ///< that were created for them
};

/// Since the compiler was created.
struct RuntimeCompilerStatistics {
  std::uint32_t compiled = 0;   ///< modules, by glslang
  std::uint32_t fromCache = 0;  ///< modules that were taken from the cache folder
};

/// Gives a Context its kernels. Unchanged GLSL gives the modules that are in the library, word for
/// word. A module is compiled when `Context::prepare` first needs it.
///
/// `abi.h` is compiled into the library, too: it must not change. Nor must bindings, push constants
/// and specialization constants.
///
/// One object serves one Context, and must outlive it. It may be moved, but not during a call of
/// another thread. `prepare` may run on other threads during any call here.
class DERMIS_RUNTIME_COMPILER_API RuntimeCompiler {
 public:
  /// Compiles nothing. Fails with `ioError` if the folder has no `abi.h`, and with
  /// `invalidArgument` if that is not the one of this library: the folder is of another version.
  static Result<RuntimeCompiler> create(RuntimeCompilerOptions options);

  ~RuntimeCompiler();
  RuntimeCompiler(RuntimeCompiler&&) noexcept;
  RuntimeCompiler& operator=(RuntimeCompiler&&) noexcept;

  /// For `DeviceDescription::kernelSource`. If a kernel does not compile, `prepare` fails with
  /// `shaderError` and the message of `reload`.
  vulkan::KernelSource source() const;

  /// Looks for changed files, compiles the modules that read them, creates their pipelines, and
  /// swaps them by `Context::replaceKernels`, whose rules for `frame`, `completedFrame` and threads
  /// hold. One thread calls it, in every frame or now and then: replaced pipelines are destroyed by
  /// a later call. If nothing changed, it asks for the time and size of each file, and no more. It
  /// does nothing while `prepare` compiles on another thread.
  ///
  /// All changed modules are swapped, or none. It fails with `shaderError` if one does not compile:
  /// the message is glslang's first error, "FILE:LINE: text (module NAME)". All old kernels stay
  /// until a later call finds a change that mends it; calls until then return an empty
  /// `KernelReload`. Fails with `ioError` if a file cannot be read, `invalidArgument` if `abi.h`
  /// changed, and as `replaceKernels`.
  ///
  /// A `SkinningSystem` skins nothing again for it: instances at rest keep what the old kernels
  /// wrote, until their pose is written.
  Result<KernelReload> reload(const vulkan::Context& context, std::uint64_t frame,
                              std::uint64_t completedFrame);

  /// How many modules were compiled, and how many came from the cache.
  RuntimeCompilerStatistics statistics() const;

  /// What was wrong with the cache folder since the last call, a sentence each: an entry that was
  /// damaged and made again, or one that cannot be read or written.
  std::vector<std::string> takeCacheProblems();

 private:
  RuntimeCompiler();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis
