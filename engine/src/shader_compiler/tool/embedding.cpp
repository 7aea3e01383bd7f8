#include "shader_compiler/tool/embedding.h"

#include <array>
#include <cstdio>

namespace dermis::tool {
namespace {

constexpr std::size_t wordsPerLine = 8;

std::string hexadecimal(std::uint32_t word) {
  std::array<char, 16> text;
  const int length = std::snprintf(text.data(), text.size(), "0x%08xu,", word);
  return {text.data(), static_cast<std::size_t>(length)};
}

/// `text`, for the compiler to leave out where a macro of the module is defined.
std::string conditional(const EmbeddedModule& module, const std::string& text) {
  if (module.unless.empty()) return text;
  std::string condition;
  for (const std::string& macro : module.unless)
    condition += (condition.empty() ? "#if !defined(" : " && !defined(") + macro + ")";
  return condition + "\n" + text + "#endif\n";
}

std::string arrayOf(const EmbeddedModule& module) {
  std::string text = "constexpr std::uint32_t " + module.name + "_words[] = {";
  for (std::size_t index = 0; index < module.words.size(); ++index) {
    text += index % wordsPerLine == 0 ? "\n    " : " ";
    text += hexadecimal(module.words[index]);
  }
  return text + "\n};\n";
}

}  // namespace

std::string embeddingHeader(const std::string& cppNamespace,
                            const std::vector<EmbeddedModule>& modules) {
  std::string text =
      "// Made by dermis_embed_shaders.\n#pragma once\n\n#include <cstdint>\n#include <span>\n"
      "#include <string_view>\n\nnamespace " +
      cppNamespace + " {\n\n";
  for (const EmbeddedModule& module : modules) {
    text += conditional(module,
                        "extern const std::span<const std::uint32_t> " + module.name + "_spirv;\n");
  }
  text +=
      "\n// The module of that name; empty if there is none.\n"
      "std::span<const std::uint32_t> find(std::string_view name);\n";
  return text + "\n}  // namespace " + cppNamespace + "\n";
}

std::string embeddingSource(const std::string& cppNamespace, const std::string& headerName,
                            const std::vector<EmbeddedModule>& modules) {
  std::string text = "// Made by dermis_embed_shaders.\n#include \"" + headerName +
                     "\"\n\nnamespace " + cppNamespace + " {\nnamespace {\n\n";
  for (const EmbeddedModule& module : modules) text += conditional(module, arrayOf(module)) + "\n";
  text += "}  // namespace\n\n";
  for (const EmbeddedModule& module : modules) {
    text += conditional(module, "constinit const std::span<const std::uint32_t> " + module.name +
                                    "_spirv{" + module.name + "_words};\n");
  }
  text += "\nstd::span<const std::uint32_t> find(std::string_view name) {\n";
  for (const EmbeddedModule& module : modules)
    text += conditional(
        module, "  if (name == \"" + module.name + "\") return " + module.name + "_spirv;\n");
  text += "  return {};\n}\n";
  return text + "\n}  // namespace " + cppNamespace + "\n";
}

}  // namespace dermis::tool
