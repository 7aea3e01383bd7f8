#include "system_test.h"

#include <cstring>

#include "dermis/verify.h"
#include "kit/batch_runner.h"
#include "verify/joint.h"

namespace dermis::test {
namespace {

/// A pose without the scale that its palette does not declare: each joint turned by the rotation of
/// its polar decomposition.
Pose rotationsOf(std::span<const JointMatrix> pose) {
  Pose rotations(pose.begin(), pose.end());
  for (JointMatrix& joint : rotations) {
    glm::dmat3 matrix;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column) matrix[column][row] = double{joint.m[row][column]};
    }
    const glm::dmat3 rotation = reference::polarParts(matrix).rotation;
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        joint.m[row][column] = static_cast<float>(rotation[column][row]);
    }
  }
  return rotations;
}

/// The kernels of both tiers are the same: what the other one gives must be right, too.
void expectReference(const samples::SkinnedVertices& skinned, const samples::SkinRequest& request) {
  OwnedMesh* const source = sourceOf(*request.mesh);
  ASSERT_NE(source, nullptr) << "not a mesh of systemMesh";
  const bool isTurnedOnly =
      request.promise != JointPromise::scaling && request.method != Method::linear;
  const Pose rotations = isTurnedOnly ? rotationsOf(request.pose) : Pose();
  const std::span<const JointMatrix> pose = isTurnedOnly ? rotations : request.pose;
  const reference::SkinnedMesh expected =
      must(reference::skin(source->view(), pose, request.method, request.morphs));
  const Exemptions exemptions{exemptionsOf(expected).onlyFinite, 0};
  const Comparison comparison = must(compareWithReference(expected, skinned.view(), exemptions));
  EXPECT_TRUE(comparison.passed())
      << "the first is vertex " << comparison.firstFailure << "; positions "
      << comparison.worstPosition << ", normals " << comparison.worstNormal << ", tangents "
      << comparison.worstTangent << " of the bound";
  EXPECT_EQ(comparison.compared + comparison.exempt.onlyFinite, expected.positions.size());
  EXPECT_LE(comparison.exempt.onlyFinite, expected.positions.size() / 100);
}

}  // namespace

vulkan::SceneRecorderDescription SystemTest::description() {
  vulkan::SceneRecorderDescription description;
  description.scene.meshCapacity = Capacity::fixed(4 << 20);
  description.scene.jointCapacity = Capacity::fixed(4096);
  description.scene.instanceCapacity = Capacity::fixed(4096);
  description.scene.boundsCapacity = Capacity::fixed(256);
  description.scene.outputCapacity = Capacity::fixed(4 << 20);
  description.outputUsage = VK_BUFFER_USAGE_VERTEX_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  return description;
}

Streams SystemTest::alone(const PackedMesh& mesh, std::span<const JointMatrix> pose,
                          const InstanceDescription& description,
                          std::span<const MorphWeight> morphs, JointPromise promise) {
  samples::SkinRequest request{&mesh, pose, promise, description.method, morphs};
  request.box = description.box;
  samples::RunOptions options;
  options.output.positions = description.layout.positions;
  options.output.normals = description.layout.normals;
  options.output.tangents = description.layout.tangents;
  options.countUntouched = false;
  samples::BatchResult result =
      must(samples::runBatch(device(), context(), {&request, 1}, options));
  expectReference(result.instances[0], request);
  Streams streams = std::move(result.instances[0].streams);
  if (description.layout.motion) streams[previousStream] = streams[positionStream];
  return streams;
}

void SystemTest::expectSkinned(const Streams& skinned, const Streams& expected) {
  for (std::size_t stream = 0; stream < previousStream; ++stream)
    EXPECT_TRUE(skinned[stream] == expected[stream]) << "stream " << stream;
}

SingleInstance::SingleInstance(samples::Device& device, const vulkan::Context& context,
                               const vulkan::SceneRecorderDescription& system,
                               const VertexLayout& layout, std::uint32_t vertexCount)
    : packed(systemMesh(1, vertexCount)), engine(device, context, system) {
  engine.begin();
  description.mesh = engine.addMesh(packed);
  description.pose = engine.addPose(systemPose(1));
  description.layout = layout;
  instance = engine.addInstance(description);
}

}  // namespace dermis::test
