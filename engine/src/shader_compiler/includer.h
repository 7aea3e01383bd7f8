// Adapts IncludeResolver to glslang's interface.
#pragma once

#include <glslang/Public/ShaderLang.h>

#include <cstddef>
#include <deque>
#include <set>
#include <string>
#include <vector>

#include "shader_compiler/include_resolver.h"

namespace dermis {

class Includer final : public glslang::TShader::Includer {
 public:
  /// `mainFile`: the name of the source that is compiled, which no file may include either.
  Includer(IncludeResolver& resolver, std::string mainFile);

  IncludeResult* includeLocal(const char* headerName, const char* includerName,
                              std::size_t depth) override;
  IncludeResult* includeSystem(const char* headerName, const char* includerName,
                               std::size_t depth) override;
  void releaseInclude(IncludeResult* result) override;

  /// The paths of all files that were included.
  const std::set<std::string>& used() const { return used_; }

 private:
  IncludeResult* include(const char* headerName, const char* includerName, IncludeForm form);
  IncludeResult* refuse(std::string reason);
  std::string objectionTo(const IncludeFile& file) const;
  bool isOpen(const std::string& path) const;
  std::string describeCycle(const std::string& path) const;

  IncludeResolver& resolver_;
  // Owned here, not freed in releaseInclude: after an error glslang does not call it for every one.
  std::deque<IncludeResult> results_;
  std::deque<std::string> reasons_;
  std::string mainFile_;
  std::vector<const IncludeResult*> open_;  ///< The files being read now, outermost first.
  std::string refusal_;  ///< Why includeLocal refused the last name; empty if it did not.
  std::set<std::string> used_;
  std::size_t includedBytes_ = 0;
};

}  // namespace dermis
