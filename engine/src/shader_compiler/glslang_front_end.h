// GLSL to SPIR-V, as glslang writes it: neither optimized nor validated.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "dermis/compilers.h"
#include "dermis/result.h"
#include "shader_compiler/include_resolver.h"

namespace dermis {

/// Holds glslang's process-wide tables; the last one that is released frees them. Thread-safe.
std::shared_ptr<void> acquireGlslang();

struct FrontEndOutput {
  std::vector<std::uint32_t> words;
  std::set<std::string> includedFiles;
};

/// Needs glslang acquired. Fails with `shaderError`, "FILE:LINE: text".
Result<FrontEndOutput> translateToSpirv(const ShaderSource& source, bool debugInfo,
                                        IncludeResolver& resolver);

/// The versions of glslang and of its SPIR-V generator, which the output of `translateToSpirv`
/// depends on.
std::string frontEndVersion();

}  // namespace dermis
