// Kernels compiled at run time: the same as those in the library, kept on disk, and what is
// refused.

#include "dermis/compilers.h"
#include "dermis/vulkan/context.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "dermis_kernels.h"
#include "dermis_kernels_recipes.h"
#include "shader_folder.h"

namespace dermis::test {
namespace {

namespace fs = std::filesystem;

using Words = std::vector<std::uint32_t>;

RuntimeCompiler compilerOf(const fs::path& folder, const fs::path& cache = {}) {
  Result<RuntimeCompiler> compiler = RuntimeCompiler::create(folder, cache);
  if (!compiler) throw std::runtime_error(compiler.error().message);
  return std::move(*compiler);
}

Result<Words> get(const RuntimeCompiler& compiler, std::string_view name) {
  const vulkan::KernelSource source = compiler.source();
  return source.get(source.user, name);
}

std::vector<fs::path> filesOf(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder))
    files.push_back(entry.path());
  std::ranges::sort(files);
  return files;
}

/// For each source, and with `macros` for each macro and each layout, the first module that has it.
std::vector<kernels::Recipe> oneForEach(bool macros) {
  std::vector<kernels::Recipe> chosen;
  std::set<std::string> seen;
  for (const kernels::Recipe& recipe : kernels::recipes) {
    std::istringstream words(macros ? std::string(recipe.source) + " " + recipe.macros +
                                          (recipe.scalarBlockLayout ? " scalar" : "")
                                    : recipe.source);
    bool isNew = false;
    for (std::string word; words >> word;) isNew |= seen.insert(word).second;
    if (isNew) chosen.push_back(recipe);
  }
  return chosen;
}

// Macros, scalar block layout and optimization are those of the build. At night it is all modules:
// runtime_compiler_exhaustive_test.cpp.
TEST(RuntimeCompilerTest, UnchangedSourcesGiveTheModulesOfTheLibrary) {
  const RuntimeCompiler compiler = compilerOf(kernelSources);
  const std::vector<kernels::Recipe> recipes = oneForEach(true);
  for (const kernels::Recipe& recipe : recipes) {
    const Result<Words> words = get(compiler, recipe.name);
    ASSERT_TRUE(words.ok()) << words.error().message;
    EXPECT_TRUE(std::ranges::equal(*words, kernels::find(recipe.name))) << recipe.name;
  }
  EXPECT_GE(recipes.size(), 10u);
  EXPECT_TRUE(std::ranges::any_of(recipes, &kernels::Recipe::scalarBlockLayout));
  EXPECT_EQ(compiler.compiledModules(), recipes.size());
}

// Line information of GLSL, not the debug information that glslang makes of scopes: with that,
// glslang 12 crashes in every kernel.
TEST(RuntimeCompilerTest, EveryKernelCompilesWithDebugInformation) {
  for (const kernels::Recipe& recipe : oneForEach(false)) {
    SCOPED_TRACE(recipe.name);
    ShaderCompilerOptions options;
    options.debugInfo = true;
    options.scalarBlockLayout = recipe.scalarBlockLayout;
    const fs::path path = fs::path(kernelSources) / recipe.source;
    std::ifstream file(path);
    std::ostringstream text;
    text << file.rdbuf();
    ShaderSource source{path.string(), text.str(), ShaderStage::compute, {}};
    std::istringstream macros(recipe.macros);
    for (std::string macro; macros >> macro;) source.defines.emplace_back(macro, "");
    EXPECT_TRUE(ShaderCompiler(options).compile(source).ok());
    const std::size_t main = source.text.find("void main() {\n");
    ASSERT_NE(main, std::string::npos);
    source.text.insert(main + 14, "  if (gl_LocalInvocationID.x > 2u) { nothing(); }\n");
    const Result<Words> broken = ShaderCompiler(options).compile(source);
    ASSERT_FALSE(broken.ok());
    const auto line =
        2 + std::ranges::count(source.text.begin(),
                               source.text.begin() + static_cast<std::ptrdiff_t>(main), '\n');
    EXPECT_NE(broken.error().message.find(':' + std::to_string(line) + ':'), std::string::npos)
        << broken.error().message;
  }
}

TEST(RuntimeCompilerTest, ModulesAreKeptOnDiskAndDamageIsMended) {
  const ShaderFolder folder("cache");
  const fs::path cache = folder.path() / "cache";
  const auto modules = {"palette", "clear", "visibility"};
  const auto read = [&](std::uint32_t compiled, std::size_t problems) {
    RuntimeCompiler compiler = compilerOf(folder.path(), cache);
    for (const char* name : modules) {
      for (int twice = 0; twice < 2; ++twice) {
        const Result<Words> words = get(compiler, name);
        ASSERT_TRUE(words.ok()) << words.error().message;
        EXPECT_TRUE(std::ranges::equal(*words, kernels::find(name))) << name;
      }
    }
    EXPECT_EQ(compiler.compiledModules(), compiled);
    EXPECT_EQ(compiler.cachedModules(), modules.size() - compiled);
    const std::vector<std::string> told = compiler.takeCacheProblems();
    ASSERT_EQ(told.size(), problems);
    for (const std::string& problem : told) {
      EXPECT_NE(problem.find("wrong checksum and was deleted"), std::string::npos) << problem;
    }
    EXPECT_TRUE(compiler.takeCacheProblems().empty());
  };
  read(3, 0);
  ASSERT_EQ(filesOf(cache).size(), modules.size());
  read(0, 0);
  {
    std::fstream file(filesOf(cache)[1], std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(200);
    file.put('\x55');
    file.put('\xaa');
  }
  read(1, 1);
  read(0, 0);
}

TEST(RuntimeCompilerTest, WhatIsWrongWithTheFolderIsSaid) {
  const Result<RuntimeCompiler> nowhere = RuntimeCompiler::create("/nowhere");
  ASSERT_FALSE(nowhere.ok());
  EXPECT_EQ(nowhere.error().code, ErrorCode::ioError);
  EXPECT_NE(nowhere.error().message.find("/nowhere"), std::string::npos) << nowhere.error().message;

  const ShaderFolder folder("other_version");
  const RuntimeCompiler before = compilerOf(folder.path());
  folder.edit("abi.h", "BINDING_TABLES = 0u", "BINDING_TABLES = 7u");
  const Result<RuntimeCompiler> other = RuntimeCompiler::create(folder.path());
  ASSERT_FALSE(other.ok());
  EXPECT_EQ(other.error().code, ErrorCode::invalidArgument);
  EXPECT_NE(other.error().message.find("use the kernels of this version"), std::string::npos)
      << other.error().message;
  const Result<Words> late = get(before, "palette");
  ASSERT_FALSE(late.ok());
  EXPECT_EQ(late.error().code, ErrorCode::invalidArgument);
}

TEST(RuntimeCompilerTest, AModuleThatDoesNotCompileNamesFileAndLine) {
  const ShaderFolder folder("broken");
  const RuntimeCompiler compiler = compilerOf(folder.path());
  const int line =
      folder.edit("skin.comp", ShaderFolder::storedPosition, ShaderFolder::brokenPosition);
  const Result<Words> broken = get(compiler, "skin_texels");
  ASSERT_FALSE(broken.ok());
  EXPECT_EQ(broken.error().code, ErrorCode::shaderError);
  const std::string place = (folder.path() / "skin.comp").string() + ":" + std::to_string(line);
  EXPECT_NE(broken.error().message.find(place), std::string::npos) << broken.error().message;
  EXPECT_NE(broken.error().message.find("positron"), std::string::npos) << broken.error().message;
  EXPECT_NE(broken.error().message.find("(module skin_texels)"), std::string::npos);
  EXPECT_TRUE(get(compiler, "palette").ok()) << "it does not read that file";

  const Result<Words> unknown = get(compiler, "skim");
  ASSERT_FALSE(unknown.ok());
  EXPECT_EQ(unknown.error().code, ErrorCode::missingFeature);
  folder.edit("skin.comp", ShaderFolder::brokenPosition, ShaderFolder::storedPosition);
  EXPECT_TRUE(get(compiler, "skin_texels").ok());
}

}  // namespace
}  // namespace dermis::test
