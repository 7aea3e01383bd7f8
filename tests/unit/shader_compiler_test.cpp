#include "dermis/compilers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "shader_compiler/no_contraction.h"
#include "temporary_folder.h"

namespace {

namespace fs = std::filesystem;
using dermis::ErrorCode;
using dermis::ShaderCompiler;
using dermis::ShaderCompilerOptions;
using dermis::ShaderSource;
using Words = std::vector<std::uint32_t>;

const std::string header = "#version 450\nlayout(local_size_x = 8) in;\n";
const std::string buffer = "layout(std430, set = 0, binding = 0) buffer Out { float data[]; } o;\n";
const std::string trivial = header + buffer + "void main() { o.data[0] = 1.0; }\n";

class ShaderCompilerTest : public testing::Test {
 protected:
  fs::path write(const std::string& name, const std::string& text) const {
    return folder_.write(name, text);
  }

  ShaderSource source(const std::string& text) const {
    return {(folder_ / "main.comp").string(), text, dermis::ShaderStage::compute, {}};
  }

  ShaderCompilerOptions cached() const {
    ShaderCompilerOptions options;
    options.cacheFolder = folder_ / "cache" / "nested";
    return options;
  }

  fs::path onlyCacheEntry() const {
    std::vector<fs::path> entries;
    for (const auto& entry : fs::directory_iterator(cached().cacheFolder)) {
      entries.push_back(entry.path());
    }
    EXPECT_EQ(entries.size(), 1u);
    return entries.empty() ? fs::path() : entries.front();
  }

  /// An error in the text, of which the message says all this and begins with `start`.
  static void expectShaderError(const dermis::Result<Words>& result, const std::string& start,
                                std::initializer_list<std::string> parts = {}) {
    ASSERT_FALSE(result);
    EXPECT_EQ(result.error().code, ErrorCode::shaderError);
    const std::string& message = result.error().message;
    EXPECT_TRUE(message.starts_with(start)) << message;
    for (const std::string& part : parts)
      EXPECT_NE(message.find(part), std::string::npos) << message;
  }
  std::string main() const { return (folder_ / "main.comp").string(); }

  dermis::test::TemporaryFolder folder_;
};

std::string readAll(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

void writeAll(const fs::path& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary | std::ios::trunc) << bytes;
}

// How many instructions of a module have this opcode and, where given, this operand at its place.
std::size_t countInstructions(const Words& words, std::uint32_t opcode, std::size_t place = 0,
                              std::uint32_t operand = 0) {
  std::size_t count = 0;
  for (std::size_t at = 5; at < words.size(); at += words[at] >> 16) {
    if ((words[at] & 0xffff) != opcode) continue;
    if (place == 0 || words[at + place] == operand) ++count;
  }
  return count;
}

constexpr std::uint32_t opName = 5;
constexpr std::uint32_t opLine = 8;
constexpr std::uint32_t opSpecConstant = 50;
constexpr std::uint32_t opDecorate = 71;
constexpr std::uint32_t decorationSpecId = 1;
constexpr std::uint32_t decorationBinding = 33;

TEST_F(ShaderCompilerTest, CompilesForVulkan11) {
  ShaderCompiler compiler;
  const auto words = compiler.compile(source(trivial));
  ASSERT_TRUE(words) << words.error().message;
  EXPECT_EQ((*words)[0], 0x07230203u);
  EXPECT_EQ((*words)[1], 0x00010300u);
  EXPECT_FALSE(compiler.lastFromCache());
  EXPECT_TRUE(compiler.lastIncludes().empty());
}

TEST_F(ShaderCompilerTest, TheSameTextGivesTheSameWords) {
  ShaderCompiler first;
  ShaderCompiler second;
  const auto words = first.compile(source(trivial));
  ASSERT_TRUE(words);
  EXPECT_EQ(*words, *first.compile(source(trivial)));
  EXPECT_EQ(*words, *second.compile(source(trivial)));
}

TEST_F(ShaderCompilerTest, CompilesFilesByTheirEnding) {
  ShaderCompiler compiler;
  EXPECT_TRUE(compiler.compileFile(write("a.comp", trivial)));
  EXPECT_TRUE(compiler.compileFile(
      write("a.vert", "#version 450\nvoid main() { gl_Position = vec4(0.0); }\n")));
  EXPECT_TRUE(compiler.compileFile(write("a.frag",
                                         "#version 450\nlayout(location = 0) out vec4 color;\n"
                                         "void main() { color = vec4(1.0); }\n")));
  EXPECT_EQ(compiler.compileFile(write("a.txt", trivial)).error().code, ErrorCode::invalidArgument);
  const auto missing = compiler.compileFile(folder_ / "missing.comp");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::ioError);
  EXPECT_NE(missing.error().message.find("missing.comp"), std::string::npos);
  EXPECT_EQ(compiler.compileFile(folder_).error().code, ErrorCode::invalidArgument);
}

TEST_F(ShaderCompilerTest, ErrorNamesFileAndLine) {
  expectShaderError(
      ShaderCompiler().compile(source(header + "void main() {\n  nowhere = 1.0;\n}\n")),
      main() + ":4: 'nowhere' : undeclared");
}

TEST_F(ShaderCompilerTest, OnlyTheFirstErrorIsReported) {
  ShaderCompiler compiler;
  const auto result =
      compiler.compile(source(header + "void main() {\n  first = 1.0;\n  second = 1.0;\n}\n"));
  ASSERT_FALSE(result);
  EXPECT_NE(result.error().message.find("'first'"), std::string::npos);
  EXPECT_EQ(result.error().message.find("second"), std::string::npos);
  EXPECT_EQ(result.error().message.find('\n'), std::string::npos);
}

TEST_F(ShaderCompilerTest, AnErrorWithoutALineNamesTheFile) {
  expectShaderError(ShaderCompiler().compile(source(header)), main() + ": ");  // No main.
}

TEST_F(ShaderCompilerTest, HostileTextIsAnError) {
  ShaderCompiler compiler;
  EXPECT_FALSE(compiler.compile(source("")));
  EXPECT_FALSE(compiler.compile(source("#version 999999\n")));
  EXPECT_FALSE(compiler.compile(source(std::string("\0\xff\xfe#", 4))));
  EXPECT_FALSE(compiler.compile(source(header + "void main() { /*")));
  EXPECT_FALSE(compiler.compile(source(header + "#include \"")));
}

TEST_F(ShaderCompilerTest, IncludesBesideTheIncludingFileThenFromTheFolders) {
  write("abi.h", "#define VALUE 1\n");
  write("other/abi.h", "#error the wrong one\n");
  write("other/folder/inner.glsl", "#include \"sibling.glsl\"\n#include <abi2.h>\n");
  write("other/folder/sibling.glsl", "float sibling() { return 2.0; }\n");
  write("other/abi2.h", "#define SECOND 2\n");
  ShaderCompilerOptions options;
  options.includeFolders = {folder_ / "nowhere", folder_ / "other"};
  ShaderCompiler compiler(options);
  const auto words =
      compiler.compile(source(header + buffer +
                              "#include \"abi.h\"\n#include \"folder/inner.glsl\"\n"
                              "void main() { o.data[VALUE] = sibling() + float(SECOND); }\n"));
  ASSERT_TRUE(words) << words.error().message;
  const std::vector<fs::path> expected = {folder_ / "abi.h", folder_ / "other/folder/inner.glsl",
                                          folder_ / "other/folder/sibling.glsl",
                                          folder_ / "other/abi2.h"};
  EXPECT_EQ(compiler.lastIncludes(), expected);
}

TEST_F(ShaderCompilerTest, ErrorInAnIncludeNamesTheInclude) {
  const fs::path inner = write("inner.glsl", "\n\nfloat broken() { return nowhere; }\n");
  expectShaderError(ShaderCompiler().compile(
                        source(header + "#include \"inner.glsl\"\nvoid main() { broken(); }\n")),
                    inner.string() + ":3: 'nowhere' : undeclared");
}

TEST_F(ShaderCompilerTest, LinesAfterAnIncludeAreStillRight) {
  write("inner.glsl", "// 1\n// 2\n// 3");
  expectShaderError(ShaderCompiler().compile(source(
                        header + "#include \"inner.glsl\"\nvoid main() {\n  nowhere = 1.0;\n}\n")),
                    main() + ":5: ");
}

TEST_F(ShaderCompilerTest, EmptyIncludeIsFine) {
  write("empty.glsl", "");
  ShaderCompiler compiler;
  EXPECT_TRUE(compiler.compile(source(header + "#include \"empty.glsl\"\nvoid main() {}\n")));
}

TEST_F(ShaderCompilerTest, MissingIncludeIsNamed) {
  expectShaderError(
      ShaderCompiler().compile(source(header + "#include \"missing.glsl\"\nvoid main() {}\n")),
      main() + ":3: ", {"missing.glsl", "no such file"});
}

TEST_F(ShaderCompilerTest, FoldersAndDevicesAreNoIncludes) {
  ShaderCompiler compiler;
  fs::create_directories(folder_ / "folder");
  EXPECT_FALSE(compiler.compile(source(header + "#include \"folder\"\nvoid main() {}\n")));
  EXPECT_FALSE(compiler.compile(source(header + "#include \"/dev/zero\"\nvoid main() {}\n")));
}

TEST_F(ShaderCompilerTest, IncludeCycleIsNamed) {
  write("a.glsl", "#include \"b.glsl\"\n#include \"b.glsl\"\n");
  const fs::path b = write("b.glsl", "\n#include \"a.glsl\"\n#include \"a.glsl\"\n");
  for (const ShaderCompilerOptions& options : {ShaderCompilerOptions(), cached()}) {
    expectShaderError(
        ShaderCompiler(options).compile(source(header + "#include \"a.glsl\"\nvoid main() {}\n")),
        b.string() + ":2: ", {"includes itself"});
  }
  expectShaderError(ShaderCompiler().compileFile(
                        write("self.comp", header + "#include \"self.comp\"\nvoid main() {}\n")),
                    "", {"includes itself"});
}

TEST_F(ShaderCompilerTest, IncludesThatGrowWithoutACycleAreStopped) {
  for (int level = 0; level < 40; ++level) {
    const std::string next = "#include \"level" + std::to_string(level + 1) + ".glsl\"\n";
    std::string text = next;
    text += next;
    text += std::string(std::size_t{1} << 20, '\n');
    write("level" + std::to_string(level) + ".glsl", text);
  }
  write("level40.glsl", "\n");
  expectShaderError(
      ShaderCompiler().compile(source(header + "#include \"level0.glsl\"\nvoid main() {}\n")), "",
      {"64 MiB"});
}

TEST_F(ShaderCompilerTest, DefinesReachTheText) {
  ShaderSource shader = source(header + buffer +
                               "#ifndef FLAG\n#error no flag\n#endif\n"
                               "void main() { o.data[0] = VALUE; }\n");
  ShaderCompiler compiler;
  EXPECT_FALSE(compiler.compile(shader));
  shader.defines = {{"FLAG", ""}, {"VALUE", "(1.0 + 2.0)"}};
  EXPECT_TRUE(compiler.compile(shader));
}

TEST_F(ShaderCompilerTest, DefinesThatAreNotOneNameAndOneLineAreRefused) {
  ShaderCompiler compiler;
  const std::vector<std::pair<std::string, std::string>> wrong = {
      {"", "1"}, {"A B", "1"}, {"1A", "1"}, {"A", "1\n#error"}, {"A", "1 \\"}};
  for (const auto& define : wrong) {
    ShaderSource shader = source(trivial);
    shader.defines = {define};
    const auto result = compiler.compile(shader);
    ASSERT_FALSE(result) << define.first << '=' << define.second;
    EXPECT_EQ(result.error().code, ErrorCode::invalidArgument);
  }
  ShaderSource shader = source(trivial);
  shader.name = "a\"\n.comp";
  EXPECT_EQ(compiler.compile(shader).error().code, ErrorCode::invalidArgument);
}

TEST_F(ShaderCompilerTest, SpecialisationConstantsAndBindingsSurvive) {
  ShaderCompiler compiler;
  const auto words = compiler.compile(
      source(header + buffer +
             "layout(constant_id = 3) const uint used = 4;\n"
             "layout(constant_id = 7) const uint unused = 5;\n"
             "layout(std430, set = 0, binding = 9) buffer Unused { float data[]; } u;\n"
             "void main() { for (uint i = 0; i < used; ++i) o.data[i] = 1.0; }\n"));
  ASSERT_TRUE(words) << words.error().message;
  EXPECT_EQ(countInstructions(*words, opSpecConstant), 2u);
  EXPECT_EQ(countInstructions(*words, opDecorate, 2, decorationSpecId), 2u);
  EXPECT_EQ(countInstructions(*words, opDecorate, 2, decorationBinding), 2u);
}

TEST_F(ShaderCompilerTest, DebugInformationIsKeptOnDemand) {
  for (const bool optimize : {false, true}) {
    ShaderCompilerOptions options;
    options.optimize = optimize;
    const auto without = ShaderCompiler(options).compile(source(trivial));
    options.debugInfo = true;
    const auto with = ShaderCompiler(options).compile(source(trivial));
    ASSERT_TRUE(without);
    ASSERT_TRUE(with);
    EXPECT_EQ(countInstructions(*without, opLine), 0u);
    EXPECT_EQ(countInstructions(*without, opName), 0u);
    EXPECT_GT(countInstructions(*with, opLine), 0u);
    EXPECT_GT(countInstructions(*with, opName), 0u);
  }
}

TEST_F(ShaderCompilerTest, OptimizingMakesItShorter) {
  const ShaderSource shader =
      source(header + buffer +
             "float twice(float x) { float y = x; y = y + x; return y; }\n"
             "void main() { float z = twice(o.data[1]); o.data[0] = twice(z); }\n");
  ShaderCompilerOptions options;
  const auto optimized = ShaderCompiler(options).compile(shader);
  options.optimize = false;
  const auto plain = ShaderCompiler(options).compile(shader);
  ASSERT_TRUE(optimized);
  ASSERT_TRUE(plain);
  EXPECT_LT(optimized->size(), plain->size());
}

TEST_F(ShaderCompilerTest, ManyObjectsOnManyThreads) {
  const auto expected = ShaderCompiler().compile(source(trivial));
  ASSERT_TRUE(expected);
  std::atomic<int> right = 0;
  std::vector<std::thread> threads;
  threads.reserve(4);
  for (int index = 0; index < 4; ++index) {
    threads.emplace_back([&] {
      for (int round = 0; round < 3; ++round) {
        ShaderCompiler compiler(cached());
        const auto words = compiler.compile(source(trivial));
        if (words && *words == *expected && compiler.lastCacheProblem().empty()) ++right;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(right, 12);
  onlyCacheEntry();  // No temporary file is left over.
}

TEST_F(ShaderCompilerTest, SecondCompilationComesFromTheCache) {
  ShaderCompiler first(cached());
  const auto made = first.compile(source(trivial));
  ASSERT_TRUE(made);
  EXPECT_FALSE(first.lastFromCache());
  EXPECT_EQ(first.lastCacheProblem(), "");
  ShaderCompiler second(cached());
  const auto found = second.compile(source(trivial));
  ASSERT_TRUE(found);
  EXPECT_TRUE(second.lastFromCache());
  EXPECT_EQ(*made, *found);
}

TEST_F(ShaderCompilerTest, FailuresAreNotCached) {
  ShaderCompiler compiler(cached());
  EXPECT_FALSE(compiler.compile(source("broken")));
  EXPECT_FALSE(compiler.compile(source("broken")));
  EXPECT_FALSE(compiler.lastFromCache());
  EXPECT_FALSE(fs::exists(cached().cacheFolder));
}

TEST_F(ShaderCompilerTest, EverythingThatGoesInIsPartOfTheKey) {
  write("value.h", "#define VALUE 1.0\n");
  ShaderSource shader =
      source(header + buffer + "#include \"value.h\"\nvoid main() { o.data[0] = VALUE; }\n");
  const auto isCached = [&](const ShaderCompilerOptions& options) {
    ShaderCompiler compiler(options);
    const auto words = compiler.compile(shader);
    EXPECT_TRUE(words);
    return compiler.lastFromCache();
  };
  ShaderCompilerOptions options = cached();
  EXPECT_FALSE(isCached(options));
  EXPECT_TRUE(isCached(options));
  write("value.h", "#define VALUE 2.0\n");
  EXPECT_FALSE(isCached(options));
  shader.defines = {{"A", "1"}};
  EXPECT_FALSE(isCached(options));
  shader.defines = {{"A", "2"}};
  EXPECT_FALSE(isCached(options));
  options.debugInfo = true;
  EXPECT_FALSE(isCached(options));
  options.optimize = false;
  EXPECT_FALSE(isCached(options));
  shader.text += "// A comment.\n";
  EXPECT_FALSE(isCached(options));
  EXPECT_TRUE(isCached(options));
}

TEST_F(ShaderCompilerTest, AFileThatComesToStandInFrontChangesTheKey) {
  write("later/value.h", "#define VALUE 1.0\n");
  ShaderCompilerOptions options = cached();
  options.includeFolders = {folder_ / "sooner", folder_ / "later"};
  const ShaderSource shader =
      source(header + buffer + "#include <value.h>\nvoid main() { o.data[0] = VALUE; }\n");
  ShaderCompiler compiler(options);
  const auto before = compiler.compile(shader);
  write("sooner/value.h", "#define VALUE 2.0\n");
  const auto after = compiler.compile(shader);
  ASSERT_TRUE(before);
  ASSERT_TRUE(after);
  EXPECT_FALSE(compiler.lastFromCache());
  EXPECT_NE(*before, *after);
}

TEST_F(ShaderCompilerTest, AnIncludeThatHidesFromTheKeyIsNotCached) {
  write("value.h", "#define VALUE 1.0\n");
  const ShaderSource shader =
      source(header + buffer + "#/**/include \"value.h\"\nvoid main() { o.data[0] = VALUE; }\n");
  ShaderCompiler compiler(cached());
  ASSERT_TRUE(compiler.compile(shader));
  EXPECT_NE(compiler.lastCacheProblem(), "");
  write("value.h", "#define VALUE 2.0\n");
  ASSERT_TRUE(compiler.compile(shader));
  EXPECT_FALSE(compiler.lastFromCache());
}

// Each damage has to be noticed, removed and repaired, whatever it hits.
TEST_F(ShaderCompilerTest, DamagedCacheEntriesAreNoticedAndMadeAgain) {
  ShaderCompiler compiler(cached());
  const auto expected = compiler.compile(source(trivial));
  ASSERT_TRUE(expected);
  const fs::path entry = onlyCacheEntry();
  const std::string intact = readAll(entry);

  std::vector<std::string> damaged = {"",
                                      "D",
                                      intact.substr(0, 35),
                                      intact.substr(0, 36),
                                      intact.substr(0, intact.size() - 1),
                                      intact + '\0',
                                      std::string(intact.size(), '\0')};
  for (std::size_t at = 0; at < intact.size(); at += at < 64 ? 1 : 37) {
    std::string flipped = intact;
    flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
    damaged.push_back(flipped);
  }
  std::string foreign = intact;
  foreign[4] = 99;
  damaged.push_back(foreign);

  for (const std::string& bytes : damaged) {
    writeAll(entry, bytes);
    const auto again = compiler.compile(source(trivial));
    ASSERT_TRUE(again);
    EXPECT_EQ(*again, *expected);
    EXPECT_FALSE(compiler.lastFromCache());
    EXPECT_NE(compiler.lastCacheProblem().find("was deleted"), std::string::npos);
    ASSERT_EQ(readAll(entry), intact);
  }
  EXPECT_TRUE(compiler.compile(source(trivial)));
  EXPECT_TRUE(compiler.lastFromCache());
  EXPECT_EQ(compiler.lastCacheProblem(), "");
}

TEST_F(ShaderCompilerTest, AnEntryUnderAnotherNameIsNotUsed) {
  ShaderCompiler compiler(cached());
  ASSERT_TRUE(compiler.compile(source(trivial)));
  const fs::path entry = onlyCacheEntry();
  const std::string other = readAll(entry);
  fs::remove(entry);
  const ShaderSource shader = source(header + "void main() {}\n");
  const auto expected = compiler.compile(shader);
  ASSERT_TRUE(expected);
  writeAll(onlyCacheEntry(), other);
  const auto again = compiler.compile(shader);
  ASSERT_TRUE(again);
  EXPECT_EQ(*again, *expected);
  EXPECT_NE(compiler.lastCacheProblem(), "");
}

TEST_F(ShaderCompilerTest, ACacheFolderThatCannotBeMadeDoesNoHarm) {
  ShaderCompilerOptions options;
  options.cacheFolder = write("a_file", "") / "cache";  // Not even root can make this one.
  ShaderCompiler compiler(options);
  const auto words = compiler.compile(source(trivial));
  ASSERT_TRUE(words) << words.error().message;
  EXPECT_NE(compiler.lastCacheProblem().find("a_file"), std::string::npos);
}

TEST_F(ShaderCompilerTest, ACacheEntryThatCannotBeReplacedDoesNoHarm) {
  ShaderCompiler compiler(cached());
  ASSERT_TRUE(compiler.compile(source(trivial)));
  const fs::path entry = onlyCacheEntry();
  fs::remove(entry);
  fs::create_directories(entry / "not_empty");
  ASSERT_TRUE(compiler.compile(source(trivial)));
  EXPECT_FALSE(compiler.lastFromCache());
  EXPECT_NE(compiler.lastCacheProblem(), "");
  onlyCacheEntry();  // No temporary file is left over.
}

TEST_F(ShaderCompilerTest, ContractableArithmeticIsFound) {
  ShaderCompilerOptions options;
  options.debugInfo = true;
  options.optimize = false;  // SPIRV-Tools itself contracts `a * b + a`, to an Fma.
  ShaderCompiler compiler(options);
  const auto find = [&](const std::string& statement) {
    const auto words = compiler.compile(
        source(header + buffer + "void main() {\n  float a = o.data[1], b = o.data[2];\n" +
               statement + "\n  o.data[0] = r;\n}\n"));
    EXPECT_TRUE(words) << words.error().message;
    const auto instructions = dermis::findContractable(*words);
    std::string opcodes;
    for (const auto& found : *instructions) {
      EXPECT_EQ(found.line, 6u);
      EXPECT_EQ(found.file, (folder_ / "main.comp").string());
      EXPECT_EQ(found.function, "main");
      opcodes += found.opcode + ' ';
    }
    return opcodes;
  };
  EXPECT_EQ(find("float r = a * b + a;"), "OpFMul OpFAdd ");
  EXPECT_EQ(find("float r = a / b - a;"), "OpFDiv OpFSub ");
  EXPECT_EQ(find("float r = (vec2(a, b) * a).y;"), "OpVectorTimesScalar ");
  EXPECT_EQ(find("float r = (mat2(a, b, a, b) * vec2(a, b)).x;"), "OpMatrixTimesVector ");
  EXPECT_EQ(find("float r = dot(vec2(a, b), vec2(b, a));"), "OpDot ");
  EXPECT_EQ(find("float r = mix(a, b, 0.25);"), "FMix ");
  EXPECT_EQ(find("float r = length(vec2(a, b));"), "Length ");
  EXPECT_EQ(find("precise float r = mod(a, b);"), "OpFMod ");

  EXPECT_EQ(find("precise float r = a * b + a;"), "");
  EXPECT_EQ(find("precise float r = a / b - a;"), "");
  EXPECT_EQ(find("float r = fma(a, b, a);"), "");  // the compiler decorates it
  EXPECT_EQ(find("precise vec2 v = vec2(a, b) * a; float r = v.y;"), "");
  EXPECT_EQ(find("float r = -a;"), "");
  EXPECT_EQ(find("float r = abs(min(a, b));"), "");
  EXPECT_EQ(find("float r = inversesqrt(a);"), "");
  EXPECT_EQ(find("float r = float(uint(a) + 3u * uint(b));"), "");
}

TEST_F(ShaderCompilerTest, WhatTheOptimizerContractsIsFound) {
  const auto words = ShaderCompiler().compile(
      source(header + buffer + "void main() { o.data[0] = o.data[1] * o.data[2] + o.data[3]; }\n"));
  ASSERT_TRUE(words);
  EXPECT_FALSE(dermis::findContractable(*words)->empty());
}

TEST_F(ShaderCompilerTest, PreciseSurvivesInliningAndUnrolling) {
  const auto words = ShaderCompiler().compile(
      source(header + buffer +
             "layout(constant_id = 0) const uint count = 4;\n"
             "float blend(float x, float y) { precise float r = x * y + x; return r; }\n"
             "void main() {\n  precise float sum = 0.0;\n"
             "  for (uint i = 0; i < count; ++i) sum = sum + blend(o.data[i], 2.0);\n"
             "  for (int i = 0; i < 3; ++i) sum = blend(sum, o.data[i]) - 1.0;\n"
             "  o.data[0] = sum;\n}\n"));
  ASSERT_TRUE(words) << words.error().message;
  const auto found = dermis::findContractable(*words);
  ASSERT_TRUE(found);
  EXPECT_TRUE(found->empty());
}

TEST_F(ShaderCompilerTest, ContractableInstructionsAreDescribed) {
  EXPECT_EQ(dermis::describe({"OpFMul", "blend(f1;", "a.glsl", 12}, "main.comp"),
            "a.glsl:12: OpFMul in 'blend(f1;' is not decorated NoContraction");
  EXPECT_EQ(dermis::describe({"OpFMul", "", "", 0}, "main.comp"),
            "main.comp: OpFMul is not decorated NoContraction");
}

TEST_F(ShaderCompilerTest, WordsThatAreNoModuleAreRefused) {
  EXPECT_FALSE(dermis::findContractable({}));
  EXPECT_FALSE(dermis::findContractable(Words{1, 2, 3, 4, 5, 6}));
  auto words = ShaderCompiler().compile(source(trivial));
  ASSERT_TRUE(words);
  words->back() = 0;  // An instruction of length 0.
  EXPECT_EQ(dermis::findContractable(*words).error().code, ErrorCode::invalidData);
  words->back() = 0xffff0000u;  // One that is longer than the module.
  EXPECT_FALSE(dermis::findContractable(*words));
}

}  // namespace
