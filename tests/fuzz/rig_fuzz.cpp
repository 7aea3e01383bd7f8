// libFuzzer: any bytes as a rig's JSON, applied to a model of the sources: what is applied makes
// sense, and packs. Or, if the first byte is 0 or 1, as a packed rig: what is accepted can be
// evaluated.
#include <dermis/gltf.h>
#include <dermis/mesh.h>
#include <dermis/rig.h>

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "changed_blob.h"
#include "kernel_reads.h"

using namespace dermis;
using fuzz::require;

namespace {

const gltf::Model& arm() {
  static const gltf::Model model = [] {
    auto loaded = gltf::load(DERMIS_SOURCE_DIR "/tests/fuzz/seeds/rig.gltf");
    require(loaded.ok());
    return std::move(*loaded);
  }();
  return model;
}

/// That of the sources, which has a driver of each kind.
std::vector<std::uint32_t> makeGoodRig() {
  gltf::Model model = arm();
  std::ifstream file(DERMIS_SOURCE_DIR "/tests/fuzz/seeds/rig.json");
  const std::string text(std::istreambuf_iterator<char>(file), {});
  const auto rig = gltf::applyRig(model, 0, text);
  require(rig.ok());
  const Result<PackedRig> packed = packRig(**rig);
  require(packed.ok());
  return fuzz::wordsOf(packed->bytes());
}

/// Evaluated with memory that is as long as the rig says.
void evaluate(const PackedRig& rig) {
  const std::vector<JointMatrix> written(rig.writtenJoints());
  std::vector<JointMatrix> driven(rig.drivenJoints());
  const std::vector<float> given(rig.givenWeights(), 0.5f);
  std::vector<float> weights(given.size() + rig.drivenWeights());
  require(evaluateRig(rig, written, given, driven, weights).ok());
  for (std::size_t i = 0; i < given.size(); ++i) require(weights[i] == given[i]);
}

void readBlob(bool isChanged, std::span<const std::uint8_t> data) {
  static const std::vector<std::uint32_t> good = makeGoodRig();
  std::vector<std::uint32_t> words =
      isChanged ? fuzz::changedBlob(good, data) : fuzz::wordsOf(std::as_bytes(data));
  if (!isChanged && words.size() >= 4) {
    words[0] = good[0];
    words[1] = good[1];
    words[3] = static_cast<std::uint32_t>(words.size());
  }
  fuzz::putChecksumRight(words);
  const Result<PackedRig> rig = PackedRig::fromBytes(std::as_bytes(std::span(words)));
  if (rig)
    evaluate(*rig);
  else
    require(!rig.error().message.empty());
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size != 0 && data[0] < 2) {
    readBlob(data[0] == 1, {data + 1, size - 1});
    return 0;
  }
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
  if (packed->givenWeights() != 0) given = gltf::morphWeights(model, (*rig)->weightsOf, noIndex, 0);
  require(evaluateRig(*packed, gltf::pose(model, 0, noIndex, 0), given, driven, weights).ok());
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
