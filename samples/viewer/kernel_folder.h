// Kernels from a folder of GLSL that somebody may be working on.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "dermis/result.h"
#include "dermis/vulkan/context.h"
#include "options.h"

namespace dermis::viewer {

struct KernelUpdate {
  bool isOther = false;  ///< what is skinned from now on may look otherwise
  std::string text;      ///< what was done, in a few words
};

class KernelFolder {
 public:
  virtual ~KernelFolder() = default;

  /// For the context; valid as long as this object lives.
  virtual vulkan::KernelSource source() const = 0;
  /// Looks for changed files, once all pictures before are complete. Nothing: there are none. Fails
  /// once if a kernel cannot be compiled; the old ones stay.
  virtual Result<std::optional<KernelUpdate>> reload(const vulkan::Context& context) = 0;
  /// How many modules there are, and where from.
  virtual std::string summary() const = 0;
};

#ifdef DERMIS_RUNTIME_COMPILER
/// That of `Options::shaders`.
Result<std::unique_ptr<KernelFolder>> openKernelFolder(const Options& options);
#endif

}  // namespace dermis::viewer
