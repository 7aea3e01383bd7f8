// SPIR-V modules as C++ source.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace dermis::tool {

struct EmbeddedModule {
  std::string name;  ///< A C++ identifier: the symbol is NAME_spirv.
  std::vector<std::uint32_t> words;
  std::vector<std::string> unless;  ///< Macros: the module is left out if one of them is defined.
};

/// Declares `extern const std::span<const std::uint32_t> NAME_spirv` for each module, and a
/// function that finds them by name.
std::string embeddingHeader(const std::string& cppNamespace,
                            const std::vector<EmbeddedModule>& modules);

/// Defines them, constant-initialized: usable before main, and from many threads.
std::string embeddingSource(const std::string& cppNamespace, const std::string& headerName,
                            const std::vector<EmbeddedModule>& modules);

}  // namespace dermis::tool
