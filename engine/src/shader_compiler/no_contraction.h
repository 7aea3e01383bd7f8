// Finds floating-point arithmetic whose bits a driver may change from one pipeline to the next.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dermis/export.h"
#include "dermis/result.h"

namespace dermis {

/// An instruction that a driver, or SPIRV-Tools before it, may fuse with others or reorder.
struct ContractableInstruction {
  std::string opcode;      ///< "OpFMul"
  std::string function;    ///< Its name where the module has debug information, otherwise empty.
  std::string file;        ///< As above.
  std::uint32_t line = 0;  ///< As above; 0: not known.
};

/// Every instruction of a module that is made of additions and multiplications of floats and is not
/// decorated NoContraction, which is what GLSL's `precise` becomes.
///
/// What counts is what SPIR-V calls arithmetic (OpFAdd to OpDot; the specification, 3.42.13) and
/// the functions of GLSL.std.450 that are defined as sums of products (`length`, `mix`, `fma`, …):
/// glslang decorates none of those, nor OpDot and OpFMod, so that a kernel has to write them out.
/// Left out is what rounds at most once, whatever the compiler does: negation, `abs`, `min`,
/// conversions, comparisons; and what is one operation of the device: `sqrt`, `inversesqrt`, `sin`.
///
/// Decorations through OpGroupDecorate, which no GLSL compiler writes, are not seen. Fails with
/// `invalidData` if the words are no SPIR-V module in the machine's byte order.
DERMIS_SHADER_COMPILER_API Result<std::vector<ContractableInstruction>> findContractable(
    std::span<const std::uint32_t> words);

/// "FILE:LINE: OpFMul in 'blend(vf4;' is not decorated NoContraction", with what is known of it;
/// `name` is the source's.
DERMIS_SHADER_COMPILER_API std::string describe(const ContractableInstruction& instruction,
                                                const std::string& name);

}  // namespace dermis
