// What stands in the SPIR-V of kernels, where no test on a device could find it missing: drivers
// for CPUs run the invocations of a workgroup in an order that hides races.

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "abi.h"
#include "dermis_kernels.h"
#include "dermis_kernels_recipes.h"

namespace dermis::test {
namespace {

// The SPIR-V specification, section 3.
constexpr std::uint32_t opEntryPoint = 15, opConstant = 43, opFunction = 54, opFunctionCall = 57,
                        opLoad = 61, opStore = 62, opAccessChain = 65, opDecorate = 71,
                        opControlBarrier = 224;
constexpr std::uint32_t decorationBinding = 33;
constexpr std::uint32_t acquireRelease = 0x8, uniformMemory = 0x40, workgroupMemory = 0x100;

/// An instruction's operands, behind the word that names it.
struct Instruction {
  std::uint32_t opcode = 0;
  std::span<const std::uint32_t> operands;
};

std::vector<Instruction> instructionsOf(std::span<const std::uint32_t> module) {
  constexpr std::size_t headerWords = 5;
  std::vector<Instruction> instructions;
  for (std::size_t word = headerWords; word < module.size();) {
    const std::size_t count = module[word] >> 16;
    if (count == 0 || count > module.size() - word) break;
    instructions.push_back({module[word] & 0xffff, module.subspan(word + 1, count - 1)});
    word += count;
  }
  return instructions;
}

/// Reads and writes of the tables, and barriers.
struct Event {
  enum class Kind { load, store, barrier } kind;
  std::uint32_t semantics = 0;  ///< of a barrier
};

/// What a module does from its entry point on, calls in their place, in the order in which blocks
/// stand.
class Trace {
 public:
  explicit Trace(std::span<const std::uint32_t> module) {
    std::uint32_t entry = 0, function = 0;
    for (const Instruction& instruction : instructionsOf(module)) {
      const auto& [opcode, operands] = instruction;
      if (opcode == opEntryPoint) entry = operands[1];
      if (opcode == opConstant) constants_[operands[1]] = operands[2];
      if (opcode == opDecorate && operands[1] == decorationBinding &&
          operands[2] == abi::BINDING_TABLES)
        tables_.insert(operands[0]);
      if (opcode == opFunction) function = operands[1];
      if (function != 0) functions_[function].push_back(instruction);
    }
    follow(entry);
  }
  const std::vector<Event>& events() const { return events_; }

 private:
  void follow(std::uint32_t function) {
    for (const auto& [opcode, operands] : functions_.at(function)) {
      if (opcode == opFunctionCall) follow(operands[2]);
      if (opcode == opAccessChain && tables_.contains(operands[2])) tables_.insert(operands[1]);
      if (opcode == opLoad && tables_.contains(operands[2])) events_.push_back({Event::Kind::load});
      if (opcode == opStore && tables_.contains(operands[0]))
        events_.push_back({Event::Kind::store});
      if (opcode == opControlBarrier)
        events_.push_back({Event::Kind::barrier, constants_.at(operands[2])});
    }
  }

  std::map<std::uint32_t, std::uint32_t> constants_;
  std::set<std::uint32_t> tables_;  // the variables, and pointers into them
  std::map<std::uint32_t, std::vector<Instruction>> functions_;
  std::vector<Event> events_;
};

// An invocation overwrites the record that another one has read: between the two stands the first
// barrier, which must order storage buffers besides shared memory.
TEST(KernelTest, RecordsAreReadBeforeOthersOverwriteThem) {
  std::size_t loads = 0, storesBefore = 0, storesBehind = 0, barriers = 0;
  const Trace trace(kernels::visibility_spirv);
  for (const auto& [kind, semantics] : trace.events()) {
    if (kind == Event::Kind::barrier && barriers++ == 0) {
      EXPECT_EQ(semantics, acquireRelease | uniformMemory | workgroupMemory);
    }
    if (kind == Event::Kind::load && barriers == 0) ++loads;
    if (kind == Event::Kind::store) ++(barriers == 0 ? storesBefore : storesBehind);
  }
  EXPECT_GT(loads, 0u);
  EXPECT_EQ(storesBefore, 0u);
  EXPECT_GT(storesBehind, 0u);
  EXPECT_GT(barriers, 1u);
}

/// All modules, by the names that shaders/CMakeLists.txt gives them.
std::vector<std::string> moduleNames() {
  std::vector<std::string> names;
  for (const kernels::Recipe& recipe : kernels::recipes) names.push_back(recipe.name);
  return names;
}

// All others, those of clips and rigs among them, promise to have none: their invocations do not
// depend on each other, and may return early.
TEST(KernelTest, FewKernelsHaveBarriersOrSharedMemory) {
  constexpr std::uint32_t opVariable = 59, workgroupStorage = 4;
  const std::set<std::string> allowed{"palette", "palette_logarithms", "visibility", "skin_staged"};
  const std::vector<std::string> names = moduleNames();
  for (const std::string needed :
       {"sample", "sample_texels", "compose", "compose_texels", "rig", "rig_texels", "morph_lists"})
    EXPECT_EQ(std::ranges::count(names, needed), 1) << needed;
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    std::size_t barriers = 0, shared = 0;
    for (const auto& [opcode, operands] : instructionsOf(kernels::find(name))) {
      if (opcode == opControlBarrier) ++barriers;
      if (opcode == opVariable && operands[2] == workgroupStorage) ++shared;
    }
    EXPECT_EQ(barriers > 0, allowed.contains(name));
    EXPECT_EQ(shared > 0, allowed.contains(name));
  }
}

// What a device must have: a workgroup of any subgroup size, which may flush denormals. A kernel
// that asked for more would not be portable, or slow where a driver has to pretend.
TEST(KernelTest, AsksForNoSubgroupsAndNoFloatControls) {
  constexpr std::uint32_t opCapability = 17, opExecutionMode = 16;
  // Matrix, Shader, Int64, SampledBuffer.
  const std::set<std::uint32_t> allowed{0, 1, 11, 46};
  constexpr std::uint32_t localSize = 17;
  for (const std::string& name : moduleNames()) {
    SCOPED_TRACE(name);
    const std::span<const std::uint32_t> module = kernels::find(name);
    ASSERT_FALSE(module.empty());
    for (const auto& [opcode, operands] : instructionsOf(module)) {
      if (opcode == opCapability) {
        EXPECT_TRUE(allowed.contains(operands[0])) << operands[0];
      }
      if (opcode == opExecutionMode) {
        EXPECT_EQ(operands[1], localSize);
      }
    }
  }
}

}  // namespace
}  // namespace dermis::test
