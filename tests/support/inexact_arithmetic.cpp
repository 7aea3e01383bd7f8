#include "inexact_arithmetic.h"

#include <array>
#include <bit>
#include <map>
#include <set>
#include <utility>

namespace dermis::test {
namespace {

// Numbers of the SPIR-V specification.
enum Opcode : std::uint32_t {
  opExtInstImport = 11,
  opExtInst = 12,
  opCapability = 17,
  opTypeInt = 21,
  opTypeFloat = 22,
  opTypeVector = 23,
  opConstant = 43,
  opConstantComposite = 44,
  opFunction = 54,
  opLoad = 61,
  opDecorate = 71,
  opFConvert = 115,
  opBitcast = 124,
  opSNegate = 126,
  opFNegate = 127,
  opFAdd = 129,
  opFSub = 131,
  opIMul = 132,
  opFMul = 133,
  opFDiv = 136,
  opFRem = 140,
  opFMod = 141,
  opVectorTimesScalar = 142,
  opOuterProduct = 147,
  opDot = 148,
  opIsNan = 156,
  opIsSignBitSet = 160,
  opShiftRightLogical = 194,
  opBitwiseXor = 198,
  opBitwiseAnd = 199,
};
constexpr std::uint32_t glslSqrt = 31, glslInverseSqrt = 32, glslUMin = 38, glslFma = 50;
constexpr std::uint32_t float64 = 10;
constexpr std::uint32_t noContraction = 42;
constexpr std::size_t headerWords = 5;

using Words = std::span<const std::uint32_t>;

template <typename Visit>
void forEachInstruction(Words module, Visit visit) {
  for (std::size_t at = headerWords; at < module.size();) {
    const std::size_t length = module[at] >> 16;
    if (length == 0 || at + length > module.size()) return;
    visit(module[at] & 0xffff, module.subspan(at, length));
    at += length;
  }
}

class Patcher {
 public:
  Patcher(Words module, const Inexactness& inexactness)
      : module_(module), inexactness_(inexactness), bound_(module[3]) {}

  std::vector<std::uint32_t> run() {
    forEachInstruction(module_, [this](std::uint32_t opcode, Words words) { note(opcode, words); });
    out_.assign(module_.begin(), module_.begin() + headerWords);
    if (inexactness_.fuses) declareType(opCapability, {float64});
    forEachInstruction(module_, [this](std::uint32_t opcode, Words words) { copy(opcode, words); });
    out_[3] = bound_;
    return std::move(out_);
  }

  std::size_t patched() const { return patched_; }

 private:
  /// A type of floats, the same of unsigned integers, and constants of both.
  struct Type {
    std::uint32_t components = 1, integer = 0, wide = 0;
    std::map<std::uint32_t, std::uint32_t> integers, floats;
  };

  void note(std::uint32_t opcode, Words words) {
    if (opcode == opExtInstImport) glsl_ = words[1];
    if (opcode == opExtInst && words[3] == glsl_ && words[4] == glslFma) fmas_.insert(words[2]);
    if (opcode == opTypeFloat && words[2] == 32) types_[float_ = words[1]].components = 1;
    if (opcode == opTypeInt && words[2] == 32 && words[3] == 0) integer_ = words[1];
    if (opcode == opTypeVector && words[2] == float_) types_[words[1]].components = words[3];
    if (opcode == opTypeVector && words[2] == integer_) integerVectors_[words[3]] = words[1];
    if (inexactness_.flushesDenormals && mayBeDenormal(opcode, words))
      unflushed_[words[2]] = bound_++;
  }

  /// Whether the instruction loads or computes a float. Maxima, negations and the like have
  /// operands that were flushed.
  bool mayBeDenormal(std::uint32_t opcode, Words words) const {
    const bool computes = opcode >= opFAdd && opcode <= opVectorTimesScalar && opcode != opIMul;
    return (computes || opcode == opLoad || opcode == opBitcast || opcode == opExtInst) &&
           types_.contains(words[1]);
  }

  void copy(std::uint32_t opcode, Words words) {
    if (opcode == opFunction && !declared_) declare();
    if (opcode == opDecorate && words[2] == noContraction && unflushed_.contains(words[1])) {
      out_.insert(out_.end(), {words[0], unflushed_[words[1]], noContraction});
      return;
    }
    if (inexactness_.fuses && opcode == opDecorate && words[2] == noContraction &&
        fmas_.contains(words[1]))
      return;
    if (declared_ && words.size() > 2 && unflushed_.contains(words[2]) &&
        mayBeDenormal(opcode, words)) {
      flush(words);
      return;
    }
    const bool known = declared_ && types_.contains(words.size() > 2 ? words[1] : 0);
    const bool isGlsl = opcode == opExtInst && words[3] == glsl_;
    if (known && opcode == opFDiv) {
      err(words, inexactness_.division);
    } else if (known && isGlsl && words[4] == glslInverseSqrt) {
      err(words, inexactness_.inverseRoot);
    } else if (known && isGlsl && words[4] == glslSqrt) {
      takeRoot(words);
    } else if (known && isGlsl && words[4] == glslFma && inexactness_.fuses) {
      fuse(words);
    } else {
      out_.insert(out_.end(), words.begin(), words.end());
    }
  }

  std::uint32_t emit(std::uint32_t opcode, std::uint32_t type,
                     std::initializer_list<std::uint32_t> operands, std::uint32_t result = 0) {
    if (result == 0) result = bound_++;
    out_.push_back(static_cast<std::uint32_t>(operands.size() + 3) << 16 | opcode);
    out_.insert(out_.end(), {type, result});
    out_.insert(out_.end(), operands);
    return result;
  }

  void declareType(std::uint32_t opcode, std::initializer_list<std::uint32_t> words) {
    out_.push_back(static_cast<std::uint32_t>(words.size() + 1) << 16 | opcode);
    out_.insert(out_.end(), words);
  }

  /// What the changed operations need, before the first function.
  void declare() {
    declared_ = true;
    if (integer_ == 0) declareType(opTypeInt, {integer_ = bound_++, 32, 0});
    if (inexactness_.fuses && float_ != 0)
      declareType(opTypeFloat, {types_[float_].wide = bound_++, 64});
    for (auto& [id, type] : types_) {
      std::uint32_t& vector = integerVectors_[type.components];
      if (type.components == 1) vector = integer_;
      if (vector == 0) {
        vector = bound_++;
        declareType(opTypeVector, {vector, integer_, type.components});
      }
      type.integer = vector;
      if (inexactness_.fuses && type.components > 1)
        declareType(opTypeVector, {type.wide = bound_++, types_[float_].wide, type.components});
      for (const std::uint32_t value :
           {0x7f800000u, 0x7f000000u, 0x80000000u, 0x00800000u, 23u, 0u, multiplier}) {
        type.integers[value] = constant(integer_, type.integer, type.components, value);
      }
      for (const float value : {1.0f, 0x1p-22f}) {
        const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
        type.floats[bits] = constant(float_, id, type.components, bits);
      }
    }
  }

  std::uint32_t constant(std::uint32_t scalar, std::uint32_t vector, std::uint32_t components,
                         std::uint32_t bits) {
    const std::uint32_t single = emit(opConstant, scalar, {bits});
    if (components == 1) return single;
    out_.push_back((3 + components) << 16 | opConstantComposite);
    out_.insert(out_.end(), {vector, bound_});
    out_.insert(out_.end(), components, single);
    return bound_++;
  }

  /// The instruction, and after it its result moved by two units in the last place: by 2^-22 of the
  /// power of two below it. Zero stays zero, infinity infinite.
  void err(Words words, Side side) {
    if (side == Side::none) {
      out_.insert(out_.end(), words.begin(), words.end());
      return;
    }
    const std::uint32_t exact = bound_++;
    out_.insert(out_.end(), words.begin(), words.end());
    out_[out_.size() - words.size() + 2] = exact;
    move(words[1], exact, side, words[2]);
    ++patched_;
  }

  /// The instruction, and after it its result with all bits 0 if those of its exponent are.
  void flush(Words words) {
    Type& type = types_[words[1]];
    const std::uint32_t exact = unflushed_[words[2]];
    out_.insert(out_.end(), words.begin(), words.end());
    out_[out_.size() - words.size() + 2] = exact;
    const std::uint32_t bits = emit(opBitcast, type.integer, {exact});
    const std::uint32_t exponent =
        emit(opBitwiseAnd, type.integer, {bits, type.integers[0x7f800000]});
    const std::uint32_t least =
        emit(opExtInst, type.integer, {glsl_, glslUMin, exponent, type.integers[0x00800000]});
    const std::uint32_t isNormal =
        emit(opShiftRightLogical, type.integer, {least, type.integers[23]});
    const std::uint32_t mask = emit(opSNegate, type.integer, {isNormal});
    const std::uint32_t flushed = emit(opBitwiseAnd, type.integer, {bits, mask});
    emit(opBitcast, words[1], {flushed}, words[2]);
    ++patched_;
  }

  void move(std::uint32_t id, std::uint32_t exact, Side side, std::uint32_t result) {
    Type& type = types_[id];
    const std::uint32_t bits = emit(opBitcast, type.integer, {exact});
    const std::uint32_t exponent =
        emit(opBitwiseAnd, type.integer, {bits, type.integers[0x7f800000]});
    const std::uint32_t finite =
        emit(opExtInst, type.integer, {glsl_, glslUMin, exponent, type.integers[0x7f000000]});
    const std::uint32_t power = emit(opBitcast, id, {finite});
    const std::uint32_t step =
        emit(opFMul, id, {power, type.floats[std::bit_cast<std::uint32_t>(0x1p-22f)]});
    std::uint32_t sign = type.integers[side == Side::down ? 0x80000000 : 0];
    if (side == Side::mixed) {
      const std::uint32_t hash = emit(opIMul, type.integer, {bits, type.integers[multiplier]});
      sign = emit(opBitwiseAnd, type.integer, {hash, type.integers[0x80000000]});
    }
    const std::uint32_t stepBits = emit(opBitcast, type.integer, {step});
    const std::uint32_t signedBits = emit(opBitwiseXor, type.integer, {stepBits, sign});
    const std::uint32_t signedStep = emit(opBitcast, id, {signedBits});
    emit(opFAdd, id, {exact, signedStep}, result);
  }

  /// The product of two floats is exact in double precision, and so the sum is rounded once; but
  /// for the rare case in which rounding to double and then to float is not the same.
  void fuse(Words words) {
    const std::uint32_t wide = types_[words[1]].wide;
    const auto widened = [&](std::uint32_t id) { return emit(opFConvert, wide, {id}); };
    const std::uint32_t a = widened(words[5]), b = widened(words[6]), c = widened(words[7]);
    const std::uint32_t product = emit(opFMul, wide, {a, b});
    emit(opFConvert, words[1], {emit(opFAdd, wide, {product, c})}, words[2]);
    ++patched_;
  }

  /// 1 / inversesqrt(x).
  void takeRoot(Words words) {
    if (inexactness_.division == Side::none && inexactness_.inverseRoot == Side::none) {
      out_.insert(out_.end(), words.begin(), words.end());
      return;
    }
    const std::uint32_t inverse = bound_++;
    const std::array<std::uint32_t, 6> inverseRoot{words[0], words[1],        inverse,
                                                   words[3], glslInverseSqrt, words[5]};
    err(inverseRoot, inexactness_.inverseRoot);
    const std::uint32_t one = types_[words[1]].floats[std::bit_cast<std::uint32_t>(1.0f)];
    const std::array<std::uint32_t, 5> division{5u << 16 | opFDiv, words[1], words[2], one,
                                                inverse};
    err(division, inexactness_.division);
  }

  static constexpr std::uint32_t multiplier = 0x9e3779b1;  // spreads the low bits to the sign

  Words module_;
  Inexactness inexactness_;
  std::uint32_t bound_, glsl_ = 0, float_ = 0, integer_ = 0;
  std::map<std::uint32_t, Type> types_;
  std::map<std::uint32_t, std::uint32_t> integerVectors_;
  std::set<std::uint32_t> fmas_;                      ///< ids of their results
  std::map<std::uint32_t, std::uint32_t> unflushed_;  ///< ids of results before they are flushed
  std::vector<std::uint32_t> out_;
  std::size_t patched_ = 0;
  bool declared_ = false;
};

/// GLSL.std.450: rounding, absolute values, signs, minima, maxima, clamps, bits; `Sqrt`,
/// `InverseSqrt` and `Fma`, which are dealt with.
bool isCertainGlsl(std::uint32_t instruction) {
  static const std::set<std::uint32_t> certain{1,  2,  3,  4,  5,  6,  7,  8,  9,
                                               31, 32, 37, 38, 39, 40, 41, 42, 43,
                                               44, 45, 50, 73, 74, 75, 79, 80, 81};
  return certain.contains(instruction);
}

bool isCertain(std::uint32_t opcode) {
  const bool arithmetic = opcode >= opFNegate && opcode <= opDot;
  const bool unlisted = opcode == opFRem || opcode == opFMod ||
                        (opcode > opVectorTimesScalar && opcode <= opOuterProduct) ||
                        opcode == opDot;
  const bool floatTest = opcode >= opIsNan && opcode <= opIsSignBitSet;
  return !(arithmetic && unlisted) && !floatTest;
}

}  // namespace

std::vector<std::uint32_t> makeInexact(Words module, const Inexactness& inexactness,
                                       std::size_t* patched) {
  Patcher patcher(module, inexactness);
  std::vector<std::uint32_t> result = patcher.run();
  if (patched != nullptr) *patched += patcher.patched();
  return result;
}

std::vector<std::string> uncertainOperations(Words module) {
  std::vector<std::string> found;
  forEachInstruction(module, [&](std::uint32_t opcode, Words words) {
    if (opcode == opExtInst && !isCertainGlsl(words[4])) {
      found.push_back("GLSL.std.450 " + std::to_string(words[4]));
    }
    if (!isCertain(opcode)) found.push_back("opcode " + std::to_string(opcode));
  });
  return found;
}

}  // namespace dermis::test
