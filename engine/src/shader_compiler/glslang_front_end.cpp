#include "shader_compiler/glslang_front_end.h"

#include <glslang/Public/ResourceLimits.h>
#include <glslang/Public/ShaderLang.h>
#include <glslang/SPIRV/GlslangToSpv.h>

#include <array>
#include <mutex>

#include "shader_compiler/glslang_messages.h"
#include "shader_compiler/includer.h"

namespace dermis {
namespace {

// glslang counts its users itself, but not under a lock in every version. The lock and the count
// are constant-initialized and own no memory, so no destructor runs when the program ends.
class GlslangUse {
 public:
  GlslangUse() {
    const std::scoped_lock lock(mutex_);
    if (users_++ == 0) glslang::InitializeProcess();
  }
  ~GlslangUse() {
    const std::scoped_lock lock(mutex_);
    if (--users_ == 0) glslang::FinalizeProcess();
  }
  GlslangUse(const GlslangUse&) = delete;
  GlslangUse& operator=(const GlslangUse&) = delete;

 private:
  static inline constinit std::mutex mutex_;
  static inline constinit int users_ = 0;
};

EShLanguage languageOf(ShaderStage stage) {
  switch (stage) {
    case ShaderStage::compute:
      return EShLangCompute;
    case ShaderStage::vertex:
      return EShLangVertex;
    case ShaderStage::fragment:
      return EShLangFragment;
  }
  return EShLangCompute;
}

// The preamble stands before the text without moving its lines, and before its #version.
std::string preambleOf(const ShaderSource& source) {
  std::string preamble = "#extension GL_GOOGLE_include_directive : enable\n";
  for (const auto& [name, value] : source.defines) {
    preamble.append("#define ").append(name).append(" ").append(value).append("\n");
  }
  return preamble;
}

EShMessages messageFlags(bool debugInfo) {
  const int flags = EShMsgSpvRules | EShMsgVulkanRules;
  return static_cast<EShMessages>(debugInfo ? flags | EShMsgDebugInfo : flags);
}

// glslang keeps the pointers that it is given: this holds what they point to.
struct ShaderInput {
  explicit ShaderInput(const ShaderSource& source)
      : preamble(preambleOf(source)),
        texts{source.text.data()},
        lengths{static_cast<int>(source.text.size())},
        names{source.name.c_str()} {}

  std::string preamble;
  std::array<const char*, 1> texts;
  std::array<int, 1> lengths;
  std::array<const char*, 1> names;
};

void configure(glslang::TShader& shader, const ShaderInput& input) {
  shader.setStringsWithLengthsAndNames(input.texts.data(), input.lengths.data(), input.names.data(),
                                       1);
  shader.setPreamble(input.preamble.c_str());
  shader.setEnvInput(glslang::EShSourceGlsl, shader.getStage(), glslang::EShClientVulkan, 100);
  shader.setEnvClient(glslang::EShClientVulkan, glslang::EShTargetVulkan_1_1);
  shader.setEnvTarget(glslang::EShTargetSpv, glslang::EShTargetSpv_1_3);
}

std::vector<std::uint32_t> generate(const glslang::TIntermediate& intermediate, bool debugInfo,
                                    spv::SpvBuildLogger& logger) {
  glslang::SpvOptions options;
  options.generateDebugInfo = debugInfo;
  options.disableOptimizer = true;  // Ours keeps specialization constants and bindings.
  std::vector<unsigned int> words;
  glslang::GlslangToSpv(intermediate, words, &logger, &options);
  return {words.begin(), words.end()};
}

}  // namespace

std::shared_ptr<void> acquireGlslang() {
  return std::make_shared<GlslangUse>();
}

Result<FrontEndOutput> translateToSpirv(const ShaderSource& source, bool debugInfo,
                                        IncludeResolver& resolver) {
  const EShLanguage language = languageOf(source.stage);
  const ShaderInput input(source);
  const EShMessages messages = messageFlags(debugInfo);
  constexpr int defaultVersion = 450;  // Where the text has no #version.

  Includer includer(resolver, source.name);
  glslang::TShader shader(language);
  configure(shader, input);
  if (!shader.parse(GetDefaultResources(), defaultVersion, false, messages, includer)) {
    return Error{ErrorCode::shaderError, firstError(shader.getInfoLog(), source.name)};
  }

  glslang::TProgram program;  // After the shader: glslang wants it destroyed first.
  program.addShader(&shader);
  const glslang::TIntermediate* intermediate =
      program.link(messages) ? program.getIntermediate(language) : nullptr;
  if (intermediate == nullptr) {
    return Error{ErrorCode::shaderError, firstError(program.getInfoLog(), source.name)};
  }

  spv::SpvBuildLogger logger;
  FrontEndOutput output{generate(*intermediate, debugInfo, logger), includer.used()};
  // "Missing functionality" and the like: the module would not be what the text says.
  if (const std::string complaints = logger.getAllMessages();
      complaints.find("issing functionality") != std::string::npos ||
      complaints.find("error") != std::string::npos || output.words.empty()) {
    return Error{ErrorCode::shaderError, firstError(complaints, source.name)};
  }
  return output;
}

std::string frontEndVersion() {
  const glslang::Version version = glslang::GetVersion();
  return "glslang " + std::to_string(version.major) + "." + std::to_string(version.minor) + "." +
         std::to_string(version.patch) + version.flavor + " generator " +
         std::to_string(glslang::GetSpirvGeneratorVersion());
}

}  // namespace dermis
