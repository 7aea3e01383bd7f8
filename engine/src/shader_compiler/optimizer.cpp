#include "shader_compiler/optimizer.h"

#include <glslang/SPIRV/spirv.hpp>
#include <map>
#include <set>

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

Result<void> validate(std::span<const std::uint32_t> words, bool scalarBlockLayout,
                      const std::string& name, const std::string& step) {
  FirstErrorMessage message;
  spvtools::SpirvTools tools(targetEnvironment);
  tools.SetMessageConsumer(message.consumer());
  spvtools::ValidatorOptions options;
  options.SetScalarBlockLayout(scalarBlockLayout);
  if (!tools.Validate(words.data(), words.size(), options)) return message.asError(name, step);
  return {};
}

// -- Which functions are inlined. Drivers inline all of them. If that is done before a module is
// optimized, it becomes three times as large; if nothing is, drivers take longer for each pipeline.

/// Maximum instructions of a function with several callers that is inlined. Measured on lavapipe
/// with 40: pipelines are built in 0.83 of the time that no inlining takes, as with any larger
/// number, and modules are 5 % larger. With 60 (2 % larger) loaders of records are inlined too: the
/// optimizer then removes the loads of members that a kernel does not use.
constexpr std::size_t mostInlined = 60;

struct Function {
  std::size_t place = 0;  ///< of its OpFunction
  std::size_t size = 0;   ///< instructions, with those of what is inlined in it
  std::vector<std::uint32_t> callees;
};

template <typename Visit>
void forEachInstruction(std::span<const std::uint32_t> words, const Visit& visit) {
  constexpr std::size_t headerWords = 5;
  for (std::size_t place = headerWords; place < words.size(); place += words[place] >> 16)
    visit(words[place] & 0xffffu, place);
}

std::map<std::uint32_t, Function> functionsOf(std::span<const std::uint32_t> words) {
  std::map<std::uint32_t, Function> functions;
  Function* current = nullptr;
  forEachInstruction(words, [&](std::uint32_t opcode, std::size_t place) {
    if (opcode == spv::OpFunction) {
      current = &functions[words[place + 2]];
      current->place = place;
    } else if (opcode == spv::OpFunctionEnd) {
      current = nullptr;
    } else if (current != nullptr) {
      ++current->size;
      if (opcode == spv::OpFunctionCall) current->callees.push_back(words[place + 3]);
    }
  });
  return functions;
}

/// Tells the optimizer to leave large functions with several callers as they are.
class InliningChoice {
 public:
  explicit InliningChoice(std::vector<std::uint32_t>& words)
      : words_(words), functions_(functionsOf(words)) {
    for (const auto& [id, function] : functions_) {
      for (const std::uint32_t callee : function.callees) ++callers_[callee];
    }
    for (const auto& [id, function] : functions_) choose(id);
  }

 private:
  /// Callees first: their size counts. A shader has no recursion.
  void choose(std::uint32_t id) {
    if (!done_.insert(id).second) return;
    Function& function = functions_[id];
    for (const std::uint32_t callee : function.callees) {
      choose(callee);
      if ((control(functions_[callee]) & spv::FunctionControlDontInlineMask) == 0)
        function.size += functions_[callee].size;
    }
    if (function.size > mostInlined && callers_[id] > 1)
      control(function) |= spv::FunctionControlDontInlineMask;
  }
  std::uint32_t& control(const Function& function) { return words_[function.place + 3]; }

  std::vector<std::uint32_t>& words_;
  std::map<std::uint32_t, Function> functions_;
  std::map<std::uint32_t, std::uint32_t> callers_;  ///< calls of each function
  std::set<std::uint32_t> done_;
};

/// Drivers are free to choose.
void forgetInliningChoice(std::vector<std::uint32_t>& words) {
  for (const auto& [id, function] : functionsOf(words))
    words[function.place + 3] &= ~std::uint32_t{spv::FunctionControlDontInlineMask};
}

/// SPIRV-Tools' performance passes, but for the choice of what is inlined.
void registerPasses(spvtools::Optimizer& optimizer) {
  using namespace spvtools;
  constexpr std::uint32_t mostMembers = 100;  // of a struct that is taken apart
  const auto removeLoadsAndStores = [&optimizer] {
    optimizer.RegisterPass(CreateLocalSingleBlockLoadStoreElimPass());
    optimizer.RegisterPass(CreateLocalSingleStoreElimPass());
    optimizer.RegisterPass(CreateAggressiveDCEPass());
  };
  optimizer.RegisterPass(CreateEliminateDeadFunctionsPass());
  optimizer.RegisterPass(CreateMergeReturnPass());
  optimizer.RegisterPass(CreateInlineExhaustivePass());
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
  const bool scalar = options.scalarBlockLayout;
  if (const auto valid = validate(words, scalar, name, "the compiler made invalid SPIR-V");
      !valid) {
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
  std::vector<std::uint32_t> input(words.begin(), words.end());
  if (options.optimize) InliningChoice{input};
  std::vector<std::uint32_t> optimized;
  if (!optimizer.Run(input.data(), input.size(), &optimized, runOptions)) {
    return message.asError(name, "the SPIR-V cannot be optimized");
  }
  forgetInliningChoice(optimized);
  if (const auto valid = validate(optimized, scalar, name, "the optimizer made invalid SPIR-V");
      !valid) {
    return valid.error();
  }
  return optimized;
}

std::string optimizerVersion() {
  return spvSoftwareVersionDetailsString();
}

}  // namespace dermis
