// Kernels from a folder of GLSL files that may be edited while the viewer runs.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "options.h"

namespace dermis::viewer {

struct KernelUpdate {
  bool isOther = false;  ///< vertices skinned from now on may differ
  std::string text;      ///< a short description of what was done
};

class KernelFolder {
 public:
  virtual ~KernelFolder() = default;

  /// For the context. Valid while this object lives.
  virtual vulkan::KernelSource source() const = 0;
  /// Looks for changed files; call when all earlier pictures are complete. Returns nothing if no
  /// file has changed. Fails once if a kernel cannot be compiled; the old kernels stay.
  virtual Result<std::optional<KernelUpdate>> reload(const vulkan::Context& context) = 0;
  /// The numbers of kernels that were compiled and that came from the cache.
  virtual std::string summary() const = 0;
};

#ifdef DERMIS_RUNTIME_COMPILER
/// Opens the folder of `Options::shaders`.
Result<std::unique_ptr<KernelFolder>> openKernelFolder(const Options& options);
#endif

}  // namespace dermis::viewer
