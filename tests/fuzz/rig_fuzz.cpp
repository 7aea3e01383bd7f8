// libFuzzer: any bytes as a rig, applied to a model of the sources. What is applied makes sense,
// and packs.
#include <dermis/gltf.h>
#include <dermis/mesh.h>
#include <dermis/rig.h>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <utility>
#include <vector>

using namespace dermis;

namespace {

void require(bool condition) {
  if (!condition) std::abort();
}

const gltf::Model& arm() {
  static const gltf::Model model = [] {
    auto loaded = gltf::load(DERMIS_SOURCE_DIR "/tests/fuzz/seeds/rig.gltf");
    require(loaded.ok());
    return std::move(*loaded);
  }();
  return model;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  gltf::Model model = arm();
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto rig = gltf::applyRig(model, 0, text);
  if (!rig) {
    // An error has a sentence, on one line, and the model is as it was.
    const std::string& message = rig.error().message;
    require(!message.empty() && message.size() < 1000 && message.find('\n') == std::string::npos);
    require(model.skins[0].joints.size() == arm().skins[0].joints.size());
    return 0;
  }
  const Result<PackedRig> packed = packRig(**rig);
  require(packed.ok() && PackedRig::fromBytes(packed->bytes()).ok());
  require(packed->writtenJoints() == model.skins[0].joints.size());
  std::vector<JointMatrix> driven(packed->drivenJoints());
  std::vector<float> given, weights(packed->givenWeights() + packed->drivenWeights());
  if (packed->givenWeights() != 0)
    given = gltf::morphWeights(model, (*rig)->weightsOf, gltf::none, 0);
  require(evaluateRig(*packed, gltf::pose(model, 0, gltf::none, 0), given, driven, weights).ok());
  const auto joints = static_cast<std::uint32_t>((*rig)->joints.size());
  for (const gltf::SkinnedPrimitive& skinned : model.skinnedPrimitives) {
    const gltf::Mesh& mesh = model.meshes[skinned.mesh];
    const gltf::PrimitiveView view(mesh.primitives[skinned.primitive]);
    require(validate(view.mesh(), joints).packable());
    const std::size_t targets = view.mesh().morphTargets.size();
    require(targets <= mesh.morphTargetCount ||
            targets == mesh.morphTargetCount + packed->drivenWeights());
    require(pack(view.mesh(), joints).ok());
  }
  return 0;
}
