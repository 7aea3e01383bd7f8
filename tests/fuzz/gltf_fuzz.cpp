// libFuzzer: any bytes as a glTF file, without a folder, so that no file is opened. What loads is
// sampled and viewed as well.
#include <dermis/gltf.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>

using namespace dermis;

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto result = gltf::loadFromMemory(std::as_bytes(std::span(data, size)), {});
  if (!result) {
    // An error has a sentence, on one line.
    const std::string& message = result.error().message;
    if (message.empty() || message.find('\n') != std::string::npos) std::abort();
    return 0;
  }
  for (const gltf::SkinnedPrimitive& skinned : result->skinnedPrimitives) {
    const gltf::Mesh& mesh = result->meshes[skinned.mesh];
    const gltf::PrimitiveView view(mesh.primitives[skinned.primitive]);
    if (view.mesh().vertexCount == 0) std::abort();
    if (view.mesh().morphTargets.size() != mesh.morphTargetCount) std::abort();
    const std::uint32_t clip = result->clips.empty() ? gltf::none : 0;
    if (morphWeights(*result, skinned.node, clip, 0.5).size() != mesh.morphTargetCount)
      std::abort();
  }
  // A hostile file may have very many clips and skins: a few of them will do.
  for (std::uint32_t clip = 0; clip < result->clips.size() && clip < 4; ++clip) {
    const auto globals = gltf::nodeGlobals(*result, clip, result->clips[clip].duration / 2);
    if (globals.size() != result->nodes.size()) std::abort();
    for (std::uint32_t skin = 0; skin < result->skins.size() && skin < 4; ++skin) {
      const auto palette = gltf::palette(*result, skin, globals);
      if (palette.size() != result->skins[skin].joints.size()) std::abort();
    }
  }
  return 0;
}
