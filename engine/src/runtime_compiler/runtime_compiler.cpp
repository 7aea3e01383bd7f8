#include "dermis/compilers.h"

#include <algorithm>
#include <chrono>
#include <exception>
#include <fstream>
#include <iterator>
#include <map>
#include <mutex>
#include <set>
#include <string_view>
#include <system_error>
#include <utility>

#include "abi_text.h"
#include "dermis/vulkan/context.h"
#include "dermis_kernels_recipes.h"

namespace dermis {
namespace {

namespace fs = std::filesystem;

/// Detects changes of a file. The default value is that of a file that does not exist.
struct Stamp {
  fs::file_time_type time = fs::file_time_type::min();
  std::uintmax_t size = 0;

  bool operator==(const Stamp&) const = default;
};

Stamp stampOf(const fs::path& path) {
  std::error_code failure;
  const fs::file_time_type time = fs::last_write_time(path, failure);
  if (failure) return {};
  const std::uintmax_t size = fs::file_size(path, failure);
  return failure ? Stamp{} : Stamp{time, size};
}

Result<void> checkAbi(const fs::path& shaderFolder) {
  const fs::path path = shaderFolder / "abi.h";
  std::ifstream file(path, std::ios::binary);
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  if (!file) return Error{ErrorCode::ioError, "cannot read '" + path.string() + "'"};
  if (text == abiText) return {};
  return Error{ErrorCode::invalidArgument,
               "the library was compiled with an abi.h that differs from '" + path.string() +
                   "': use the kernels of this version, or compile the library again"};
}

std::vector<std::pair<std::string, std::string>> definesOf(const kernels::Recipe& recipe) {
  std::vector<std::pair<std::string, std::string>> defines;
  for (std::string_view rest = recipe.macros; !rest.empty();) {
    const std::size_t end = std::min(rest.find(' '), rest.size());
    defines.emplace_back(rest.substr(0, end), "");
    rest.remove_prefix(std::min(end + 1, rest.size()));
  }
  return defines;
}

/// A module that a Context has requested.
struct Module {
  const kernels::Recipe* recipe = nullptr;
  std::vector<std::uint32_t> words;  ///< SPIR-V that is in use
  std::set<fs::path> files;          ///< that it was compiled from
  bool isStale = false;              ///< A file has changed since the module was compiled.
};

ShaderCompilerOptions compilerOptions(const fs::path& cacheFolder, bool scalarBlockLayout) {
  ShaderCompilerOptions options;
  options.cacheFolder = cacheFolder;
  options.scalarBlockLayout = scalarBlockLayout;
  return options;
}

}  // namespace

struct RuntimeCompiler::State {
  State(fs::path shaders, const fs::path& cache)
      : shaderFolder(std::move(shaders)),
        compiler(compilerOptions(cache, false)),
        scalarCompiler(compilerOptions(cache, true)) {}

  Result<std::vector<std::uint32_t>> get(std::string_view name);
  Result<std::vector<std::uint32_t>> compile(Module& module);
  void watch(const fs::path& path, fs::file_time_type began);
  bool findStale();
  Result<Reload> reload(const vulkan::Context& context, std::uint64_t frame,
                        std::uint64_t completedFrame);

  fs::path shaderFolder;
  std::mutex mutex;  ///< guards all members below: a thread may call `prepare` while another one
                     ///< reloads
  ShaderCompiler compiler, scalarCompiler;
  std::map<std::string, Module, std::less<>> modules;
  std::map<fs::path, Stamp> stamps;  ///< of the files of all modules
  std::uint32_t compiledModules = 0, cachedModules = 0;
  std::vector<std::string> cacheProblems;
};

/// If a file was written after `began`, the compiler may have read its earlier contents: the next
/// reload treats it as changed. The margin covers the time resolution of file systems.
void RuntimeCompiler::State::watch(const fs::path& path, fs::file_time_type began) {
  const Stamp stamp = stampOf(path);
  stamps.try_emplace(path, stamp.time < began - std::chrono::milliseconds(20) ? stamp : Stamp{});
}

Result<std::vector<std::uint32_t>> RuntimeCompiler::State::compile(Module& module) {
  const fs::path path = shaderFolder / module.recipe->source;
  const auto began = fs::file_time_type::clock::now();
  ShaderCompiler& used = module.recipe->scalarBlockLayout ? scalarCompiler : compiler;
  Result<std::vector<std::uint32_t>> words = used.compileFile(path, definesOf(*module.recipe));
  // After a failure the list of includes is incomplete, so the earlier files stay in it.
  if (words) module.files.clear();
  module.files.insert(path);
  module.files.insert(used.lastIncludes().begin(), used.lastIncludes().end());
  for (const fs::path& file : module.files) watch(file, began);
  if (!used.lastCacheProblem().empty()) cacheProblems.push_back(used.lastCacheProblem());
  if (!words) {
    Error error = words.error();
    error.message += " (module " + std::string(module.recipe->name) + ")";
    return error;
  }
  ++(used.lastFromCache() ? cachedModules : compiledModules);
  return words;
}

Result<std::vector<std::uint32_t>> RuntimeCompiler::State::get(std::string_view name) {
  const std::lock_guard lock(mutex);
  if (const auto known = modules.find(name); known != modules.end()) return known->second.words;
  const auto recipe = std::ranges::find(kernels::recipes, name, &kernels::Recipe::name);
  if (recipe == std::end(kernels::recipes)) {
    return Error{ErrorCode::missingFeature,
                 "this build of Dermis has no kernel '" + std::string(name) + "'"};
  }
  if (Result<void> good = checkAbi(shaderFolder); !good) return good.error();
  Module module;
  module.recipe = recipe;
  Result<std::vector<std::uint32_t>> words = compile(module);
  if (!words) return words;
  module.words = *words;
  modules.emplace(name, std::move(module));
  return words;
}

/// Marks modules as stale if a file of theirs has changed since the last call. Returns whether
/// there are any.
bool RuntimeCompiler::State::findStale() {
  std::set<fs::path> changed;
  for (auto& [path, stamp] : stamps) {
    const Stamp now = stampOf(path);
    if (std::exchange(stamp, now) != now) changed.insert(path);
  }
  if (changed.empty()) return false;
  bool found = false;
  for (auto& [name, module] : modules) {
    const bool isChanged = std::ranges::any_of(
        module.files, [&](const fs::path& file) { return changed.contains(file); });
    module.isStale |= isChanged;
    found |= isChanged;
  }
  return found;
}

Result<RuntimeCompiler::Reload> RuntimeCompiler::State::reload(const vulkan::Context& context,
                                                               std::uint64_t frame,
                                                               std::uint64_t completedFrame) {
  // Also destroys kernels that are no longer used.
  if (Result<std::uint32_t> done = context.replaceKernels({}, frame, completedFrame); !done)
    return done.error();
  Reload reload;
  // Held until the end, so that a `prepare` that finds the old kernels replaced gets the new ones.
  const std::unique_lock lock(mutex, std::try_to_lock);
  if (!lock || !findStale()) return reload;
  if (Result<void> good = checkAbi(shaderFolder); !good) return good.error();

  std::map<Module*, std::vector<std::uint32_t>> compiled;
  for (auto& [name, module] : modules) {
    if (!module.isStale) continue;
    Result<std::vector<std::uint32_t>> words = compile(module);
    if (!words) return words.error();
    compiled.emplace(&module, std::move(*words));
  }
  std::vector<vulkan::KernelModule> replaced;
  for (const auto& [module, words] : compiled) {
    if (words != module->words) replaced.push_back({module->recipe->name, words});
  }
  const Result<std::uint32_t> pipelines = context.replaceKernels(replaced, frame, completedFrame);
  if (!pipelines) return pipelines.error();

  reload.changed = static_cast<std::uint32_t>(compiled.size());
  reload.pipelines = *pipelines;
  for (const vulkan::KernelModule& module : replaced) reload.replaced.emplace_back(module.name);
  std::ranges::sort(reload.replaced);
  for (auto& [module, words] : compiled) {
    module->words = std::move(words);
    module->isStale = false;
  }
  return reload;
}

RuntimeCompiler::RuntimeCompiler() = default;
RuntimeCompiler::~RuntimeCompiler() = default;
RuntimeCompiler::RuntimeCompiler(RuntimeCompiler&&) noexcept = default;
RuntimeCompiler& RuntimeCompiler::operator=(RuntimeCompiler&&) noexcept = default;

Result<RuntimeCompiler> RuntimeCompiler::create(fs::path shaderFolder, fs::path cacheFolder) {
  try {
    if (Result<void> good = checkAbi(shaderFolder); !good) return good.error();
    RuntimeCompiler compiler;
    compiler.state_ = std::make_unique<State>(std::move(shaderFolder), std::move(cacheFolder));
    return compiler;
  } catch (const std::exception& exception) {
    return Error{ErrorCode::ioError, std::string("cannot read kernels: ") + exception.what()};
  }
}

vulkan::KernelSource RuntimeCompiler::source() const {
  return {state_.get(),
          [](void* user, std::string_view name) -> Result<std::vector<std::uint32_t>> {
            try {
              return static_cast<State*>(user)->get(name);
            } catch (const std::exception& exception) {
              return Error{ErrorCode::ioError,
                           std::string("cannot compile a kernel: ") + exception.what()};
            }
          }};
}

Result<RuntimeCompiler::Reload> RuntimeCompiler::reload(const vulkan::Context& context,
                                                        std::uint64_t frame,
                                                        std::uint64_t completedFrame) {
  try {
    return state_->reload(context, frame, completedFrame);
  } catch (const std::exception& exception) {
    return Error{ErrorCode::ioError, std::string("cannot compile kernels: ") + exception.what()};
  }
}

std::uint32_t RuntimeCompiler::compiledModules() const {
  const std::lock_guard lock(state_->mutex);
  return state_->compiledModules;
}

std::uint32_t RuntimeCompiler::cachedModules() const {
  const std::lock_guard lock(state_->mutex);
  return state_->cachedModules;
}

std::vector<std::string> RuntimeCompiler::takeCacheProblems() {
  const std::lock_guard lock(state_->mutex);
  return std::exchange(state_->cacheProblems, {});
}

}  // namespace dermis
