#include "system_test.h"

#include "batch_runner.h"

namespace dermis::test {

PackedMesh systemMesh(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t jointCount,
                      std::uint32_t influences) {
  OwnedMesh mesh = randomMesh(seed, vertexCount, jointCount, influences);
  addTangents(mesh, seed + 1);
  addMorphs(mesh, seed + 2, 3);
  return must(pack(mesh.view(), jointCount));
}

VertexLayout plainLayout() {
  VertexLayout layout;
  layout.normals = VertexFormat::float32x3;
  return layout;
}

VertexLayout motionLayout() {
  VertexLayout layout = plainLayout();
  layout.previousPositions = true;
  return layout;
}

std::set<std::uint32_t> indicesOf(std::span<const InstanceHandle> instances) {
  std::set<std::uint32_t> indices;
  for (const InstanceHandle instance : instances) {
    EXPECT_TRUE(indices.insert(instance.index).second) << "an instance is listed twice";
  }
  return indices;
}

vulkan::SkinningSystemDescription SystemTest::description() {
  vulkan::SkinningSystemDescription description;
  description.context = &context();
  description.meshBudget = 4 << 20;
  description.jointBudget = 4096;
  description.instanceBudget = 4096;
  description.boundsBudget = 256;
  description.outputBudget = 4 << 20;
  description.outputUsage = VK_BUFFER_USAGE_VERTEX_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT |
                            VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  return description;
}

Streams SystemTest::alone(const PackedMesh& mesh, std::span<const JointMatrix> pose,
                          const InstanceDescription& description,
                          std::span<const MorphWeight> morphs, bool mayScale) {
  samples::SkinRequest request{&mesh, pose, mayScale, description.method, morphs};
  request.box = description.box;
  samples::RunOptions options;
  options.output.positions = description.layout.positions;
  options.output.normals = description.layout.normals;
  options.output.tangents = description.layout.tangents;
  options.countUntouched = false;
  samples::BatchResult result =
      must(samples::runBatch(device(), context(), {&request, 1}, options));
  Streams streams = std::move(result.instances[0].streams);
  if (description.layout.previousPositions) streams[previousStream] = streams[positionStream];
  return streams;
}

void SystemTest::expectSkinned(const Streams& skinned, const Streams& expected) {
  for (std::size_t stream = 0; stream < previousStream; ++stream)
    EXPECT_TRUE(skinned[stream] == expected[stream]) << "stream " << stream;
}

SingleInstance::SingleInstance(samples::Device& device,
                               const vulkan::SkinningSystemDescription& system,
                               const VertexLayout& layout, std::uint32_t vertexCount)
    : packed(systemMesh(1, vertexCount)), engine(device, system) {
  engine.begin();
  description.mesh = engine.addMesh(packed);
  description.palette = engine.addPalette(systemPose(1));
  description.layout = layout;
  instance = engine.addInstance(description);
}

}  // namespace dermis::test
