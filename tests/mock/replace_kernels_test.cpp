// `Context::replaceKernels` on the pretended driver: what is created and destroyed, and when.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "dermis/vulkan/context.h"
#include "dermis/vulkan/scene_recorder.h"
#include "mock_batch.h"
#include "mock_vulkan.h"
#include "plan/variant.h"
#include "plan_commands.h"

namespace dermis::test {
namespace {

using vulkan::KernelModule;

using Words = std::vector<std::uint32_t>;

/// Not looked into: the driver is not real.
const std::array<std::uint32_t, 1> skinB{0xb}, paletteB{0xb};

class ReplaceKernelsTest : public ::testing::Test {
 protected:
  ReplaceKernelsTest() {
    vulkan::DeviceDescription description = mock.description();
    description.kernelSource = {this, [](void* user, std::string_view name) -> Result<Words> {
                                  auto& test = *static_cast<ReplaceKernelsTest*>(user);
                                  ++test.asked;
                                  if (test.error) return *test.error;
                                  test.names.emplace_back(name);
                                  if (auto once = std::exchange(test.meanwhile, nullptr)) once();
                                  return Words{0xa};
                                }};
    context.emplace(*vulkan::Context::create(description));
    batch.batch.addJob(0, 0, Method::dualQuaternion, true);
    batch.makePlan(context->limits());
    for (const Variant& variant : variantsOf(batch.plan.pipelines())) {
      (variant.kernel == Kernel::palette ? palette : skin) =
          vulkan::pipelineDescription(variant.id())->module;
    }
  }

  /// The code of what a batch dispatches: the palette kernel, and the one that skins.
  std::vector<const std::uint32_t*> record() {
    Result<vulkan::Bindings> bindings = context->createBindings(batch.buffers());
    mock.dispatches.clear();
    const Result<void> done = context->record(commandBuffer, batch.plan, *bindings);
    EXPECT_TRUE(done.ok()) << (done ? "" : done.error().message);
    std::vector<const std::uint32_t*> code;
    for (const MockDispatch& dispatch : mock.dispatches) code.push_back(dispatch.code);
    return code;
  }

  MockVulkan mock;
  int asked = 0;
  std::vector<std::string> names;
  std::optional<Error> error;
  std::function<void()> meanwhile;  ///< called once, while a module is asked for
  std::optional<vulkan::Context> context;
  MockBatch batch;
  std::string palette, skin;
};

TEST_F(ReplaceKernelsTest, PipelinesAreOfTheSourceAndItsErrorsArePassedOn) {
  error = Error{ErrorCode::shaderError, "skin.comp:7: no"};
  const Result<void> failed = context->prepare(batch.plan.pipelines());
  ASSERT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().code, ErrorCode::shaderError);
  EXPECT_EQ(failed.error().message, "skin.comp:7: no");
  EXPECT_EQ(mock.alive["Pipeline"], 0);
  error.reset();
  ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
  EXPECT_NE(std::ranges::find(names, palette), names.end());
  EXPECT_NE(std::ranges::find(names, skin), names.end());
  EXPECT_EQ(mock.alive["Pipeline"], static_cast<int>(names.size()));
}

TEST_F(ReplaceKernelsTest, OldPipelinesStayUntilTheirFramesAreComplete) {
  ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
  const int count = mock.alive["Pipeline"];
  const std::vector<const std::uint32_t*> before = record();
  ASSERT_EQ(before.size(), 2u);

  const KernelModule module{skin, skinB};
  EXPECT_EQ(context->replaceKernels({&module, 1}, 5, 3).value(), 1u);
  EXPECT_EQ(mock.alive["Pipeline"], count + 1);
  EXPECT_EQ(record()[0], before[0]) << "the palette's is as it was";
  EXPECT_EQ(record()[1], skinB.data());

  EXPECT_EQ(context->replaceKernels({}, 6, 4).value(), 0u);
  EXPECT_EQ(mock.alive["Pipeline"], count + 1) << "another thread may have recorded frame 5";
  EXPECT_EQ(context->replaceKernels({}, 7, 5).value(), 0u);
  EXPECT_EQ(mock.alive["Pipeline"], count);
  EXPECT_EQ(record()[1], skinB.data());
  // Those that are still waiting go with the context.
  EXPECT_EQ(context->replaceKernels({&module, 1}, 8, 5).value(), 1u);
  context.reset();
  EXPECT_EQ(mock.aliveObjects(), 0);
}

TEST_F(ReplaceKernelsTest, AllAreReplacedOrNone) {
  ASSERT_TRUE(context->prepare(batch.plan.pipelines()).ok());
  const int count = mock.alive["Pipeline"];
  const std::vector<const std::uint32_t*> before = record();
  const std::array<KernelModule, 2> modules{{{palette, paletteB}, {skin, skinB}}};
  mock.failing = "vkCreateComputePipelines";
  mock.failAfter = 1;
  const Result<std::uint32_t> failed = context->replaceKernels(modules, 5, 3);
  ASSERT_FALSE(failed.ok());
  EXPECT_EQ(failed.error().code, ErrorCode::vulkanError);
  EXPECT_EQ(mock.alive["Pipeline"], count);
  EXPECT_EQ(mock.alive["ShaderModule"], 0);
  EXPECT_EQ(record(), before);
  mock.failing.clear();
  EXPECT_EQ(context->replaceKernels(modules, 5, 3).value(), 2u);
  EXPECT_EQ(record(), (std::vector<const std::uint32_t*>{paletteB.data(), skinB.data()}));
}

// As if another thread reloaded in the middle of `prepare`, which has the old module then.
TEST_F(ReplaceKernelsTest, APipelineThatIsBeingBuiltMeanwhileIsBuiltAgain) {
  const KernelModule module{skin, skinB};
  meanwhile = [&] { EXPECT_EQ(context->replaceKernels({&module, 1}, 5, 3).value(), 0u); };
  ASSERT_EQ(variantOf(batch.plan.pipelines().back()).kernel, Kernel::skin);
  ASSERT_TRUE(context->prepare(batch.plan.pipelines().last(1)).ok());
  EXPECT_EQ(asked, 2);
  EXPECT_EQ(mock.alive["Pipeline"], 1);
}

TEST_F(ReplaceKernelsTest, WhatCannotBeIsRefused) {
  const KernelModule module{skin, skinB};
  const Result<std::uint32_t> order = context->replaceKernels({&module, 1}, 5, 5);
  ASSERT_FALSE(order.ok());
  EXPECT_EQ(order.error().code, ErrorCode::invalidArgument);
  const KernelModule empty{skin, {}};
  const Result<std::uint32_t> nothing = context->replaceKernels({&empty, 1}, 5, 3);
  ASSERT_FALSE(nothing.ok());
  EXPECT_NE(nothing.error().message.find("'" + skin + "'"), std::string::npos);
  const vulkan::Context withoutSource = *vulkan::Context::create(mock.description());
  const Result<std::uint32_t> refused = withoutSource.replaceKernels({&module, 1}, 5, 3);
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::invalidArgument);
  EXPECT_TRUE(withoutSource.replaceKernels({}, 5, 3).ok());
}

}  // namespace
}  // namespace dermis::test
