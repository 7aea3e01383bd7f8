#include "kernel_instructions.h"

#include <unordered_map>
#include <vector>

#ifndef DERMIS_NO_SPIRV_TOOLS
#include <spirv-tools/optimizer.hpp>
#endif

namespace dermis::cli {

#ifndef DERMIS_NO_SPIRV_TOOLS

namespace {

// SPIR-V 1.3, section 3.32: first and last opcodes of the groups of instructions that are counted.
constexpr std::uint32_t opFunctionEnd = 56;
constexpr std::uint32_t opLoad = 61, opStore = 62;
constexpr std::uint32_t opConvertFToU = 109, opQuantizeToF16 = 116;
constexpr std::uint32_t opSNegate = 126, opSMulExtended = 152;
constexpr std::uint32_t opAny = 154, opFUnordGreaterThanEqual = 191;
constexpr std::uint32_t opShiftRightLogical = 194, opBitCount = 205;
constexpr std::uint32_t opAtomicLoad = 227, opAtomicXor = 242;

bool isCounted(std::uint32_t opcode) {
  const auto within = [opcode](std::uint32_t first, std::uint32_t last) {
    return opcode >= first && opcode <= last;
  };
  return opcode == opExtInst || within(opLoad, opStore) || within(opConvertFToU, opQuantizeToF16) ||
         within(opSNegate, opSMulExtended) || within(opAny, opFUnordGreaterThanEqual) ||
         within(opShiftRightLogical, opBitCount) || within(opAtomicLoad, opAtomicXor);
}

}  // namespace

std::vector<std::uint32_t> specializedSpirv(const vulkan::PipelineDescription& pipeline) {
  const std::vector<std::uint32_t>& constants = pipeline.constants;
  std::unordered_map<std::uint32_t, std::vector<std::uint32_t>> values;
  for (std::uint32_t id = 0; id < constants.size(); ++id) values[id] = {constants[id]};

  spvtools::Optimizer optimizer(SPV_ENV_VULKAN_1_1);
  optimizer.RegisterPass(spvtools::CreateSetSpecConstantDefaultValuePass(values));
  optimizer.RegisterPass(spvtools::CreateFreezeSpecConstantValuePass());
  optimizer.RegisterPass(spvtools::CreateFoldSpecConstantOpAndCompositePass());
  optimizer.RegisterPerformancePasses();
  spvtools::OptimizerOptions options;
  options.set_run_validator(false);
  std::vector<std::uint32_t> specialized;
  if (!optimizer.Run(pipeline.spirv.data(), pipeline.spirv.size(), &specialized, options))
    return {};
  return specialized;
}

std::optional<std::uint64_t> spirvInstructionCount(const vulkan::PipelineDescription& pipeline) {
  const std::vector<std::uint32_t> words = specializedSpirv(pipeline);
  constexpr std::size_t headerWords = 5;
  std::uint64_t count = 0;
  bool inFunction = false;
  for (std::size_t place = headerWords; place < words.size();) {
    const std::uint32_t opcode = words[place] & 0xffffu, length = words[place] >> 16;
    if (length == 0) return std::nullopt;
    if (opcode == opFunction) inFunction = true;
    if (opcode == opFunctionEnd) inFunction = false;
    if (inFunction && isCounted(opcode)) ++count;
    place += length;
  }
  if (count == 0) return std::nullopt;
  return count;
}

#else

std::vector<std::uint32_t> specializedSpirv(const vulkan::PipelineDescription&) {
  return {};
}

std::optional<std::uint64_t> spirvInstructionCount(const vulkan::PipelineDescription&) {
  return std::nullopt;
}

#endif

}  // namespace dermis::cli
