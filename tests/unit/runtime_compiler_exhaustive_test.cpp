// Every module, compiled at run time: the very words that are in the library.

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>

#include "dermis/compilers.h"
#include "dermis/vulkan/context.h"
#include "dermis_kernels.h"
#include "dermis_kernels_recipes.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

TEST(RuntimeCompilerExhaustiveTest, UnchangedSourcesGiveTheModulesOfTheLibrary) {
  const Result<RuntimeCompiler> compiler = RuntimeCompiler::create(kernelSources);
  ASSERT_TRUE(compiler.ok()) << compiler.error().message;
  const vulkan::KernelSource source = compiler->source();
  for (const kernels::Recipe& recipe : kernels::recipes) {
    const auto words = source.get(source.user, recipe.name);
    ASSERT_TRUE(words.ok()) << words.error().message;
    EXPECT_TRUE(std::ranges::equal(*words, kernels::find(recipe.name))) << recipe.name;
  }
  EXPECT_GE(std::size(kernels::recipes), 20u);
}

}  // namespace
}  // namespace dermis::test
