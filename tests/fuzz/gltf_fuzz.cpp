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
    InfluenceSet set;
    const MeshView view = result->meshes[skinned.mesh].primitives[skinned.primitive].view(set);
    if (view.vertexCount == 0) std::abort();
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
