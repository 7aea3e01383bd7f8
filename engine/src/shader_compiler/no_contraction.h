// Finds floating-point arithmetic whose bits a driver may change from one pipeline to the next.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "dermis/result.h"

namespace dermis {

/// An instruction that a driver, or SPIRV-Tools before it, may fuse with others or reorder.
struct ContractableInstruction {
  std::string opcode;      ///< "OpFMul"
  std::string function;    ///< Its name if the module has debug information, otherwise empty.
  std::string file;        ///< As above.
  std::uint32_t line = 0;  ///< As above; 0: not known.
};

/// Every floating-point instruction of a module that can be contracted and is not decorated
/// NoContraction, which is what GLSL's `precise` becomes.
///
/// These are SPIR-V's arithmetic instructions on floats (OpFAdd to OpDot; the specification,
/// 3.42.13) and functions of GLSL.std.450 that consist of such arithmetic (`length`, `mix`, `fma`,
/// …). glslang decorates none of those functions, nor OpDot and OpFMod, so kernels must write them
/// out. Operations that round at most once however they are compiled are left out (negation, `abs`,
/// `min`, conversions, comparisons), and so are single operations of the device (`sqrt`,
/// `inversesqrt`, `sin`).
///
/// Decorations through OpGroupDecorate, which no GLSL compiler writes, are not seen. Fails with
/// `invalidData` if the words are not a SPIR-V module in the machine's byte order.
DERMIS_SHADER_COMPILER_API Result<std::vector<ContractableInstruction>> findContractable(
    std::span<const std::uint32_t> words);

/// Decorates every Fma of GLSL.std.450 NoContraction, which makes it one operation with the same
/// result in every pipeline of a device. glslang does not, not even for `precise`. `words` are a
/// valid module.
DERMIS_SHADER_COMPILER_API std::vector<std::uint32_t> decorateFma(
    std::span<const std::uint32_t> words);

/// "FILE:LINE: OpFMul in 'blend(vf4;' is not decorated NoContraction", with what is known of it;
/// `name` is the source's.
DERMIS_SHADER_COMPILER_API std::string describe(const ContractableInstruction& instruction,
                                                const std::string& name);

}  // namespace dermis
