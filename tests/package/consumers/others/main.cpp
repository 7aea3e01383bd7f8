// Compiles the installed kernels at run time, and reads glTF from memory.
//
//   others_consumer SHADERS

#include <cstdio>
#include <filesystem>
#include <string_view>

#include "abi.h"
#include "dermis/gltf.h"
#include "dermis/shader_compiler.h"

namespace {

using namespace dermis;

int fail(const Error& error) {
  std::printf("%s\n", error.message.c_str());
  return 1;
}

Result<gltf::Model> read(std::string_view text) {
  return gltf::loadFromMemory(std::as_bytes(std::span(text)), {});
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  ShaderCompiler compiler;
  for (const char* kernel : {"palette.comp", "skin.comp"}) {
    const auto words = compiler.compileFile(std::filesystem::path(argv[1]) / kernel);
    if (!words) return fail(words.error());
    std::printf("%s: %zu words\n", kernel, words->size());
  }
  ShaderSource broken;
  broken.name = "broken.comp";
  broken.text = "#version 450\nvoid main() { nonsense }\n";
  const auto refused = compiler.compile(broken);
  if (refused || refused.error().code != ErrorCode::shaderError) return 3;
  std::printf("%s\n", refused.error().message.c_str());

  const Result<gltf::Model> model =
      read(R"({"asset": {"version": "2.0"}, "nodes": [{"name": "root"}]})");
  if (!model) return fail(model.error());
  if (model->nodes.size() != 1 || gltf::nodeGlobals(*model, gltf::none, 0).size() != 1) return 4;
  const Result<gltf::Model> nonsense = read("{");
  if (nonsense) return 5;
  std::printf("%s\n", nonsense.error().message.c_str());
  return abi::BINDING_COUNT == 4 ? 0 : 6;
}
