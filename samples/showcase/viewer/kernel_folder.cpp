#include "kernel_folder.h"

#include <fmt/format.h>

#include <cstdint>
#include <utility>

#include "dermis/runtime_compiler.h"

namespace dermis::viewer {
namespace {

std::string plural(std::size_t count, const char* what) {
  return fmt::format("{} {}{}", count, what, count == 1 ? "" : "s");
}

class CompiledFolder : public KernelFolder {
 public:
  explicit CompiledFolder(RuntimeCompiler compiler) : compiler_(std::move(compiler)) {}

  vulkan::KernelSource source() const override { return compiler_.source(); }

  Result<std::optional<KernelUpdate>> reload(const vulkan::Context& context) override {
    ++frame_;
    // [reload]
    // Called between two frames, with the next frame and the newest complete one.
    const Result<KernelReload> done = compiler_.reload(context, frame_, frame_ - 1);
    if (!done) return done.error();  // glslang's message, to show
    // [/reload]
    if (done->changed == 0) return std::optional<KernelUpdate>();
    KernelUpdate update;
    update.isOther = !done->replaced.empty();
    update.text = update.isOther ? "reloaded " + plural(done->replaced.size(), "kernel")
                                 : std::string("no kernel changed");
    return std::optional(std::move(update));
  }

  std::string summary() const override {
    const RuntimeCompilerStatistics statistics = compiler_.statistics();
    return fmt::format("{} compiled, {} from the cache", statistics.compiled, statistics.fromCache);
  }

 private:
  RuntimeCompiler compiler_;
  std::uint64_t frame_ = 0;
};

}  // namespace

Result<std::unique_ptr<KernelFolder>> openKernelFolder(const Options& options) {
  Result<RuntimeCompiler> compiler =
      RuntimeCompiler::create({options.shaders, options.shaderCache});
  if (!compiler) return compiler.error();
  return std::unique_ptr<KernelFolder>(std::make_unique<CompiledFolder>(std::move(*compiler)));
}

}  // namespace dermis::viewer
