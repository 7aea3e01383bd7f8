#include "shader_compiler/optimizer.h"

#include <spirv-tools/libspirv.hpp>
#include <spirv-tools/optimizer.hpp>

namespace dermis {
namespace {

constexpr spv_target_env targetEnvironment = SPV_ENV_VULKAN_1_1;

// Keeps the first message that is an error: what follows is mostly its consequence.
class FirstErrorMessage {
 public:
  spvtools::MessageConsumer consumer() {
    return
        [this](spv_message_level_t level, const char*, const spv_position_t&, const char* message) {
          if (level <= SPV_MSG_ERROR && text_.empty()) text_ = message;
        };
  }

  Error asError(const std::string& name, const std::string& step) const {
    return Error{ErrorCode::shaderError, name + ": " + step + ": " + text_};
  }

 private:
  std::string text_;
};

Result<void> validate(std::span<const std::uint32_t> words, const std::string& name,
                      const std::string& step) {
  FirstErrorMessage message;
  spvtools::SpirvTools tools(targetEnvironment);
  tools.SetMessageConsumer(message.consumer());
  if (!tools.Validate(words.data(), words.size())) return message.asError(name, step);
  return {};
}

/// SPIRV-Tools' performance passes without inlining, which triples a module, and which drivers do
/// for themselves.
void registerPasses(spvtools::Optimizer& optimizer) {
  using namespace spvtools;
  constexpr std::uint32_t mostMembers = 100;  // of a struct that is taken apart
  const auto removeLoadsAndStores = [&optimizer] {
    optimizer.RegisterPass(CreateLocalSingleBlockLoadStoreElimPass());
    optimizer.RegisterPass(CreateLocalSingleStoreElimPass());
    optimizer.RegisterPass(CreateAggressiveDCEPass());
  };
  optimizer.RegisterPass(CreateEliminateDeadFunctionsPass());
  optimizer.RegisterPass(CreatePrivateToLocalPass());
  removeLoadsAndStores();
  optimizer.RegisterPass(CreateScalarReplacementPass(mostMembers));
  optimizer.RegisterPass(CreateLocalAccessChainConvertPass());
  removeLoadsAndStores();
  optimizer.RegisterPass(CreateSSARewritePass());
  optimizer.RegisterPass(CreateAggressiveDCEPass());
  optimizer.RegisterPass(CreateCCPPass());
  optimizer.RegisterPass(CreateAggressiveDCEPass());
  optimizer.RegisterPass(CreateRedundancyEliminationPass());
  optimizer.RegisterPass(CreateCombineAccessChainsPass());
  optimizer.RegisterPass(CreateSimplificationPass());
  optimizer.RegisterPass(CreateVectorDCEPass());
  optimizer.RegisterPass(CreateDeadInsertElimPass());
  optimizer.RegisterPass(CreateDeadBranchElimPass());
  optimizer.RegisterPass(CreateSimplificationPass());
  optimizer.RegisterPass(CreateIfConversionPass());
  optimizer.RegisterPass(CreateCopyPropagateArraysPass());
  optimizer.RegisterPass(CreateReduceLoadSizePass());
  optimizer.RegisterPass(CreateAggressiveDCEPass());
  optimizer.RegisterPass(CreateBlockMergePass());
  optimizer.RegisterPass(CreateRedundancyEliminationPass());
  optimizer.RegisterPass(CreateDeadBranchElimPass());
  optimizer.RegisterPass(CreateBlockMergePass());
  optimizer.RegisterPass(CreateSimplificationPass());
}

}  // namespace

Result<std::vector<std::uint32_t>> optimizeAndValidate(std::span<const std::uint32_t> words,
                                                       const OptimizerOptions& options,
                                                       const std::string& name) {
  // The passes trust their input.
  if (const auto valid = validate(words, name, "the compiler made invalid SPIR-V"); !valid) {
    return valid.error();
  }

  FirstErrorMessage message;
  spvtools::Optimizer optimizer(targetEnvironment);
  optimizer.SetMessageConsumer(message.consumer());
  if (!options.keepDebugInfo) optimizer.RegisterPass(spvtools::CreateStripDebugInfoPass());
  if (options.optimize) registerPasses(optimizer);

  spvtools::OptimizerOptions runOptions;
  runOptions.set_run_validator(false);
  runOptions.set_preserve_bindings(true);
  runOptions.set_preserve_spec_constants(true);
  std::vector<std::uint32_t> optimized;
  if (!optimizer.Run(words.data(), words.size(), &optimized, runOptions)) {
    return message.asError(name, "the SPIR-V cannot be optimised");
  }
  if (const auto valid = validate(optimized, name, "the optimiser made invalid SPIR-V"); !valid) {
    return valid.error();
  }
  return optimized;
}

std::string optimizerVersion() {
  return spvSoftwareVersionDetailsString();
}

}  // namespace dermis
