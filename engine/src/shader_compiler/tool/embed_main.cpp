// dermis_embed_shaders: what the build runs to make kernels part of a library. See
// cmake/DermisShaders.cmake, which is its only user.
#include <cstdio>
#include <cstring>
#include <exception>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dermis/compilers.h"
#include "shader_compiler/file_io.h"
#include "shader_compiler/no_contraction.h"
#include "shader_compiler/tool/embedding.h"

namespace dermis::tool {
namespace {

constexpr std::string_view usage =
    "usage: dermis_embed_shaders compile --input FILE --output FILE.spv\n"
    "           [--include FOLDER]... [--define NAME[=VALUE]]... [--require-no-contraction]\n"
    "           [--scalar-block-layout] [--depfile FILE --depfile-target FILE]\n"
    "       dermis_embed_shaders embed --namespace NAME --header FILE --source FILE\n"
    "           [--module NAME=FILE.spv [--unless MACRO]...]...\n";

using Pair = std::pair<std::string, std::string>;

struct Module {
  std::string name, path;
  std::vector<std::string> unless;
};

struct Arguments {
  std::string command;
  std::string input;
  std::string output;
  std::string depfile;
  std::string depfileTarget;
  std::string cppNamespace;
  std::string header;
  std::string source;
  std::vector<std::filesystem::path> includeFolders;
  std::vector<Pair> defines;
  std::vector<Module> modules;
  bool requireNoContraction = false;
  bool scalarBlockLayout = false;
};

Pair splitAtEquals(const std::string& text) {
  const std::size_t equals = text.find('=');
  if (equals == std::string::npos) return {text, ""};
  return {text.substr(0, equals), text.substr(equals + 1)};
}

// Stores one option; false for one that is not known.
bool store(Arguments& arguments, std::string_view option, const std::string& value) {
  const std::pair<std::string_view, std::string*> texts[] = {
      {"--input", &arguments.input},
      {"--output", &arguments.output},
      {"--depfile", &arguments.depfile},
      {"--depfile-target", &arguments.depfileTarget},
      {"--namespace", &arguments.cppNamespace},
      {"--header", &arguments.header},
      {"--source", &arguments.source},
  };
  for (const auto& [name, text] : texts) {
    if (option == name) {
      *text = value;
      return true;
    }
  }
  if (option == "--include") {
    arguments.includeFolders.emplace_back(value);
  } else if (option == "--define") {
    arguments.defines.push_back(splitAtEquals(value));
  } else if (option == "--module") {
    auto [name, path] = splitAtEquals(value);
    arguments.modules.push_back({std::move(name), std::move(path), {}});
  } else if (option == "--unless" && !arguments.modules.empty()) {
    arguments.modules.back().unless.push_back(value);
  } else {
    return false;
  }
  return true;
}

std::optional<Arguments> parse(const std::vector<std::string>& words) {
  if (words.empty()) return std::nullopt;
  Arguments arguments;
  arguments.command = words[0];
  for (std::size_t index = 1; index < words.size(); ++index) {
    if (words[index] == "--require-no-contraction") {
      arguments.requireNoContraction = true;
    } else if (words[index] == "--scalar-block-layout") {
      arguments.scalarBlockLayout = true;
    } else if (index + 1 == words.size() || !store(arguments, words[index], words[index + 1])) {
      return std::nullopt;
    } else {
      ++index;
    }
  }
  return arguments;
}

int fail(const std::string& message) {
  std::fprintf(stderr, "%s\n", message.c_str());
  return 1;
}

// The form that make and Ninja read: blanks, '#' and '$' are escaped.
std::string escapedForDepfile(const std::filesystem::path& path) {
  std::string escaped;
  for (const char character : path.string()) {
    if (character == ' ' || character == '#') escaped.push_back('\\');
    if (character == '$') escaped.push_back('$');
    escaped.push_back(character);
  }
  return escaped;
}

Result<void> writeDepfile(const Arguments& arguments,
                          const std::vector<std::filesystem::path>& includes) {
  std::string text = escapedForDepfile(arguments.depfileTarget) + ":";
  text += " \\\n  ";
  text += escapedForDepfile(std::filesystem::absolute(arguments.input));
  for (const std::filesystem::path& include : includes) {
    text += " \\\n  ";
    text += escapedForDepfile(std::filesystem::absolute(include).lexically_normal());
  }
  return writeFileAtomically(arguments.depfile, text + "\n");
}

ShaderCompilerOptions optionsFor(const Arguments& arguments) {
  ShaderCompilerOptions options;
  options.includeFolders = arguments.includeFolders;
  options.scalarBlockLayout = arguments.scalarBlockLayout;
  return options;
}

// The instructions of the same source compiled with names and lines, and without inlining, which
// would name `main` for all of them.
std::vector<ContractableInstruction> locateContractable(const Arguments& arguments) {
  ShaderCompilerOptions options = optionsFor(arguments);
  options.optimize = false;
  options.debugInfo = true;
  ShaderCompiler compiler(std::move(options));
  const auto words = compiler.compileFile(arguments.input, arguments.defines);
  if (!words) return {};
  auto found = findContractable(*words);
  return found ? *std::move(found) : std::vector<ContractableInstruction>();
}

Result<void> requireNoContraction(const Arguments& arguments,
                                  const std::vector<std::uint32_t>& words) {
  const auto contractable = findContractable(words);
  if (!contractable) return contractable.error();
  if (contractable->empty()) return {};
  std::vector<ContractableInstruction> located = locateContractable(arguments);
  if (located.empty()) located = *contractable;
  std::string message;
  for (const ContractableInstruction& instruction : located) {
    message += describe(instruction, arguments.input) + "\n";
  }
  return Error{
      ErrorCode::shaderError,
      message + arguments.input +
          ": declare what these compute `precise`; write out `dot`, `mod`, `length`, `mix` and "
          "the like, which glslang cannot make precise"};
}

std::string bytesOf(const std::vector<std::uint32_t>& words) {
  std::string bytes(words.size() * sizeof(std::uint32_t), '\0');
  std::memcpy(bytes.data(), words.data(), bytes.size());
  return bytes;
}

int compile(const Arguments& arguments) {
  ShaderCompiler compiler(optionsFor(arguments));
  const auto words = compiler.compileFile(arguments.input, arguments.defines);
  if (!words) return fail(words.error().message);
  if (arguments.requireNoContraction) {
    const Result<void> precise = requireNoContraction(arguments, *words);
    if (!precise) return fail(precise.error().message);
  }
  const Result<void> written = writeFileAtomically(arguments.output, bytesOf(*words));
  if (!written) return fail(written.error().message);
  if (arguments.depfile.empty()) return 0;
  const Result<void> listed = writeDepfile(arguments, compiler.lastIncludes());
  return listed ? 0 : fail(listed.error().message);
}

std::optional<EmbeddedModule> readModule(const Module& source) {
  const std::optional<std::string> bytes = readFile(source.path);
  if (!bytes || bytes->empty() || bytes->size() % sizeof(std::uint32_t) != 0) return std::nullopt;
  EmbeddedModule module{source.name,
                        std::vector<std::uint32_t>(bytes->size() / sizeof(std::uint32_t)),
                        source.unless};
  std::memcpy(module.words.data(), bytes->data(), bytes->size());
  return module;
}

int embed(const Arguments& arguments) {
  std::vector<EmbeddedModule> modules;
  for (const Module& source : arguments.modules) {
    std::optional<EmbeddedModule> module = readModule(source);
    if (!module) return fail("cannot read SPIR-V from '" + source.path + "'");
    modules.push_back(*std::move(module));
  }
  const std::string headerName = std::filesystem::path(arguments.header).filename().string();
  const std::pair<std::string, std::string> files[] = {
      {arguments.header, embeddingHeader(arguments.cppNamespace, modules)},
      {arguments.source, embeddingSource(arguments.cppNamespace, headerName, modules)},
  };
  for (const auto& [path, text] : files) {
    const Result<void> written = writeFileAtomically(path, text);
    if (!written) return fail(written.error().message);
  }
  return 0;
}

int run(const std::vector<std::string>& words) {
  const std::optional<Arguments> arguments = parse(words);
  if (arguments && arguments->command == "compile") return compile(*arguments);
  if (arguments && arguments->command == "embed") return embed(*arguments);
  std::fputs(usage.data(), stderr);
  return 2;
}

}  // namespace
}  // namespace dermis::tool

int main(int argumentCount, char** argumentValues) {
  try {
    return dermis::tool::run({argumentValues + 1, argumentValues + argumentCount});
  } catch (const std::exception& exception) {
    std::fprintf(stderr, "dermis_embed_shaders: %s\n", exception.what());
    return 1;
  }
}
