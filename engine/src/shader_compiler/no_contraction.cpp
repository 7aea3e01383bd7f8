#include "shader_compiler/no_contraction.h"

#include <glslang/SPIRV/spirv.hpp>

#include <cstddef>
#include <map>
#include <set>
#include <string_view>

namespace dermis {
namespace {

constexpr std::size_t moduleHeaderLength = 5;
constexpr std::string_view glslInstructionSet = "GLSL.std.450";

using Words = std::span<const std::uint32_t>;

// Names of the arithmetic instructions that can be contracted; null for all others.
const char* contractableName(std::uint32_t opcode) {
  switch (opcode) {
    case spv::OpFAdd:
      return "OpFAdd";
    case spv::OpFSub:
      return "OpFSub";
    case spv::OpFMul:
      return "OpFMul";
    case spv::OpFDiv:
      return "OpFDiv";
    case spv::OpFRem:
      return "OpFRem";
    case spv::OpFMod:
      return "OpFMod";
    case spv::OpVectorTimesScalar:
      return "OpVectorTimesScalar";
    case spv::OpMatrixTimesScalar:
      return "OpMatrixTimesScalar";
    case spv::OpVectorTimesMatrix:
      return "OpVectorTimesMatrix";
    case spv::OpMatrixTimesVector:
      return "OpMatrixTimesVector";
    case spv::OpMatrixTimesMatrix:
      return "OpMatrixTimesMatrix";
    case spv::OpOuterProduct:
      return "OpOuterProduct";
    case spv::OpDot:
      return "OpDot";
    default:
      return nullptr;
  }
}

// The same for GLSL.std.450. The numbers are those of its specification (SPIR-V Extended
// Instructions for GLSL, version 1.00).
const char* contractableGlslName(std::uint32_t instruction) {
  switch (instruction) {
    case 11:
      return "Radians";
    case 12:
      return "Degrees";
    case 33:
      return "Determinant";
    case 34:
      return "MatrixInverse";
    case 46:
      return "FMix";
    case 49:
      return "SmoothStep";
    case 50:
      return "Fma";
    case 66:
      return "Length";
    case 67:
      return "Distance";
    case 68:
      return "Cross";
    case 69:
      return "Normalize";
    case 70:
      return "FaceForward";
    case 71:
      return "Reflect";
    case 72:
      return "Refract";
    default:
      return nullptr;
  }
}

// A literal string: bytes in the order of the words' low ends first, up to a zero.
std::string literalString(Words words) {
  std::string text;
  for (const std::uint32_t word : words) {
    for (std::uint32_t shift = 0; shift < 32; shift += 8) {
      const char byte = static_cast<char>((word >> shift) & 0xff);
      if (byte == '\0') return text;
      text.push_back(byte);
    }
  }
  return text;
}

// Reads a module front to back. Decorations, names and instruction sets all stand before the first
// function, so one pass suffices.
class Scanner {
 public:
  void visit(std::uint32_t opcode, Words operands) {
    switch (opcode) {
      case spv::OpDecorate:
        noteDecoration(operands);
        break;
      case spv::OpExtInstImport:
        noteInstructionSet(operands);
        break;
      case spv::OpString:
        noteName(operands, strings_);
        break;
      case spv::OpName:
        noteName(operands, names_);
        break;
      case spv::OpLine:
        noteLine(operands);
        break;
      case spv::OpNoLine:
        line_ = 0;
        break;
      case spv::OpFunction:
        enterFunction(operands);
        break;
      case spv::OpExtInst:
        checkGlslInstruction(operands);
        break;
      default:
        check(contractableName(opcode), operands);
        break;
    }
  }

  std::vector<ContractableInstruction> takeFound() { return std::move(found_); }

 private:
  void noteDecoration(Words operands) {
    if (operands.size() >= 2 && operands[1] == spv::DecorationNoContraction) {
      noContraction_.insert(operands[0]);
    }
  }

  void noteInstructionSet(Words operands) {
    if (operands.size() >= 2 && literalString(operands.subspan(1)) == glslInstructionSet) {
      glslInstructionSets_.insert(operands[0]);
    }
  }

  static void noteName(Words operands, std::map<std::uint32_t, std::string>& names) {
    if (operands.size() >= 2) names[operands[0]] = literalString(operands.subspan(1));
  }

  void noteLine(Words operands) {
    if (operands.size() < 2) return;
    file_ = operands[0];
    line_ = operands[1];
  }

  void enterFunction(Words operands) {
    function_ = operands.size() >= 2 ? operands[1] : 0;
    line_ = 0;
  }

  // Operands: type, result, set, instruction, arguments.
  void checkGlslInstruction(Words operands) {
    if (operands.size() >= 4 && glslInstructionSets_.contains(operands[2])) {
      check(contractableGlslName(operands[3]), operands);
    }
  }

  // Operands: type, result, ….
  void check(const char* name, Words operands) {
    if (name == nullptr || operands.size() < 2 || noContraction_.contains(operands[1])) return;
    found_.push_back({name, nameOf(function_, names_),
                      line_ != 0 ? nameOf(file_, strings_) : std::string(), line_});
  }

  static std::string nameOf(std::uint32_t id, const std::map<std::uint32_t, std::string>& names) {
    const auto place = names.find(id);
    return place != names.end() ? place->second : std::string();
  }

  std::set<std::uint32_t> noContraction_;
  std::set<std::uint32_t> glslInstructionSets_;
  std::map<std::uint32_t, std::string> strings_;
  std::map<std::uint32_t, std::string> names_;
  std::uint32_t function_ = 0;
  std::uint32_t file_ = 0;
  std::uint32_t line_ = 0;
  std::vector<ContractableInstruction> found_;
};

}  // namespace

Result<std::vector<ContractableInstruction>> findContractable(Words words) {
  const Error damaged{ErrorCode::invalidData, "the words are not a SPIR-V module"};
  if (words.size() < moduleHeaderLength || words[0] != spv::MagicNumber) return damaged;
  Scanner scanner;
  for (words = words.subspan(moduleHeaderLength); !words.empty();) {
    const std::size_t length = words[0] >> spv::WordCountShift;
    if (length == 0 || length > words.size()) return damaged;
    scanner.visit(words[0] & spv::OpCodeMask, words.subspan(1, length - 1));
    words = words.subspan(length);
  }
  return scanner.takeFound();
}

std::vector<std::uint32_t> decorateFma(Words words) {
  constexpr std::uint32_t fma = 50;
  std::set<std::uint32_t> sets, decorated;
  std::vector<std::uint32_t> added;
  std::size_t place = moduleHeaderLength;  // behind the last name and decoration
  for (std::size_t at = moduleHeaderLength; at < words.size();) {
    const std::size_t length = words[at] >> spv::WordCountShift;
    const std::uint32_t opcode = words[at] & spv::OpCodeMask;
    const Words operands = words.subspan(at + 1, length - 1);
    at += length;
    switch (opcode) {
      case spv::OpExtInstImport:
        if (literalString(operands.subspan(1)) == glslInstructionSet) sets.insert(operands[0]);
        break;
      case spv::OpDecorate:
        if (operands[1] == spv::DecorationNoContraction) decorated.insert(operands[0]);
        [[fallthrough]];
      case spv::OpName:
      case spv::OpMemberName:
      case spv::OpModuleProcessed:
      case spv::OpMemberDecorate:
      case spv::OpExecutionMode:
        place = at;
        break;
      case spv::OpExtInst:
        if (sets.contains(operands[2]) && operands[3] == fma && !decorated.contains(operands[1])) {
          added.insert(added.end(), {3u << spv::WordCountShift | spv::OpDecorate, operands[1],
                                     std::uint32_t{spv::DecorationNoContraction}});
        }
        break;
      default:
        break;
    }
  }
  std::vector<std::uint32_t> result(words.begin(), words.end());
  result.insert(result.begin() + static_cast<std::ptrdiff_t>(place), added.begin(), added.end());
  return result;
}

std::string describe(const ContractableInstruction& instruction, const std::string& name) {
  std::string text = instruction.file.empty() ? name : instruction.file;
  if (instruction.line != 0) text.append(":").append(std::to_string(instruction.line));
  text.append(": ").append(instruction.opcode);
  if (!instruction.function.empty()) text.append(" in '").append(instruction.function).append("'");
  return text.append(" is not decorated NoContraction");
}

}  // namespace dermis
