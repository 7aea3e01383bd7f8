// Plays the engine of skinned_crowd.h: makes a device, a mesh and poses, renders a few frames
// without drawing them, and holds every vertex of the last one against the reference.
//
//   dermis_embed [DEVICE]     a number or a part of a name, as in `dermis devices`
//
// Exit status: 0 done, 4 no usable device, 1 anything else.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdio>
#include <memory>
#include <string>
#include <vector>

#include "dermis/verify/accuracy.h"
#include "skinned_crowd.h"

namespace {

using namespace dermis;

constexpr std::uint32_t frameCount = 4, jointCount = 2, vertexCount = 66;

/// A vertex as the engine's assets have it. Views describe it; any other layout will do.
struct BindVertex {
  float position[3], normal[3];
  std::uint8_t joints[2], weights[2];
};
using Strip = std::array<BindVertex, vertexCount>;

/// A strip two units long: its lower end hangs on joint 0, its upper end on joint 1.
Strip makeStrip() {
  Strip strip{};
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    const float along = static_cast<float>(vertex / 2) / static_cast<float>(vertexCount / 2 - 1);
    const auto upper = static_cast<std::uint8_t>(std::lround(255 * along));
    strip[vertex] = {{vertex % 2 == 0 ? -0.25f : 0.25f, 2 * along, 0},
                     {0, 0, 1},
                     {0, 1},
                     {static_cast<std::uint8_t>(255 - upper), upper}};
  }
  return strip;
}

MeshView viewOf(const Strip& strip, InfluenceSet& influences) {
  constexpr std::uint32_t stride = sizeof(BindVertex);
  influences.joints = {strip[0].joints, vertexCount, stride, ComponentType::uint8, jointCount};
  influences.weights = {strip[0].weights, vertexCount, stride, ComponentType::unorm8, jointCount};
  MeshView view;
  view.name = "strip";
  view.vertexCount = vertexCount;
  view.positions = {strip[0].position, vertexCount, stride, ComponentType::float32, 3};
  view.normals = {strip[0].normal, vertexCount, stride, ComponentType::float32, 3};
  view.influenceSets = {&influences, 1};
  return view;
}

/// The joint matrices of all instances, each the joint's global transform × its inverse bind
/// matrix: everyone stands in a place of his own, the upper end turned by an angle of its own.
std::vector<JointMatrix> posesOf(std::uint32_t frame) {
  std::vector<JointMatrix> matrices;
  for (std::uint32_t instance = 0; instance < embed::instanceCount; ++instance) {
    const auto x = static_cast<float>(instance % 10), z = static_cast<float>(instance / 10);
    const float angle = 0.025f * static_cast<float>(instance) + 0.2f * static_cast<float>(frame);
    const float c = std::cos(angle), s = std::sin(angle);
    matrices.push_back({{{1, 0, 0, x}, {0, 1, 0, 0}, {0, 0, 1, z}}});
    matrices.push_back({{{c, 0, s, x}, {0, 1, 0, 0}, {-s, 0, c, z}}});
  }
  return matrices;
}

/// Records a frame, submits it and, unlike an engine, waits for it.
Result<void> renderFrame(samples::Device& engine, embed::Crowd& crowd, std::uint32_t frame,
                         std::span<const JointMatrix> matrices) {
  const VkCommandBuffer commandBuffer = engine.allocateCommandBuffer();
  VkCommandBufferBeginInfo begin{};
  begin.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  engine.functions().BeginCommandBuffer(commandBuffer, &begin);
  Result<void> done = embed::skinFrame(engine, crowd, crowd.frames[frame % embed::framesInFlight],
                                       matrices, commandBuffer);
  engine.functions().EndCommandBuffer(commandBuffer);
  if (done) done = engine.submitAndWait(commandBuffer);
  engine.freeCommandBuffer(commandBuffer);
  return done;
}

/// Holds an instance, as it stands in the vertex buffer, against the double-precision reference.
Result<Comparison> check(const embed::Crowd& crowd, const MeshView& mesh, std::uint32_t instance,
                         std::span<const JointMatrix> pose) {
  const Result<reference::SkinnedMesh> expected =
      reference::skin(mesh, pose, Method::dualQuaternion);
  if (!expected) return expected.error();
  constexpr std::uint32_t stride = sizeof(embed::SkinnedVertex);
  const std::byte* skinned =
      crowd.output.bytes().data() + std::size_t{instance} * vertexCount * stride;
  const auto attribute = [&](std::size_t offset, VertexFormat format) {
    return SkinnedAttribute{skinned + offset, vertexCount, stride, format};
  };
  SkinnedView view;
  view.positions = attribute(offsetof(embed::SkinnedVertex, position), VertexFormat::float32x3);
  view.normals = attribute(offsetof(embed::SkinnedVertex, normal), VertexFormat::octahedral16x2);
  return compareWithReference(*expected, view);
}

Result<void> run(samples::Device& engine) {
  const Strip strip = makeStrip();
  InfluenceSet influences;
  const MeshView mesh = viewOf(strip, influences);
  Result<embed::Crowd> crowd = embed::setUp(engine, mesh, jointCount);
  if (!crowd) return crowd.error();

  std::vector<JointMatrix> matrices;
  for (std::uint32_t frame = 0; frame < frameCount; ++frame) {
    matrices = posesOf(frame);
    if (Result<void> done = renderFrame(engine, *crowd, frame, matrices); !done) return done;
  }

  double worst = 0;
  for (std::uint32_t instance = 0; instance < embed::instanceCount; ++instance) {
    const auto pose = std::span(matrices).subspan(std::size_t{instance} * jointCount, jointCount);
    const Result<Comparison> comparison = check(*crowd, mesh, instance, pose);
    if (!comparison) return comparison.error();
    if (!comparison->passed()) {
      return Error{ErrorCode::invalidData, "instance " + std::to_string(instance) + ", vertex " +
                                               std::to_string(comparison->firstFailure) +
                                               " is outside its error bound"};
    }
    worst = std::max({worst, comparison->worstPosition, comparison->worstNormal});
  }
  std::printf("%s: %u frames of %u instances, %llu vertices in %u dispatches each\n",
              engine.info().name.c_str(), frameCount, embed::instanceCount,
              static_cast<unsigned long long>(crowd->plan.vertexCount()),
              crowd->plan.dispatchCount());
  std::printf("every vertex is right: the largest error is %.0f %% of its bound\n", 100 * worst);
  return {};
}

int fail(const Error& error, int status) {
  std::fprintf(stderr, "dermis_embed: error: %s\n", error.message.c_str());
  return status;
}

}  // namespace

int main(int argc, char** argv) {
  samples::DeviceOptions options;
  if (argc > 1) options.device = argv[1];
  const Result<std::unique_ptr<samples::Device>> engine = samples::Device::create(options);
  if (!engine) return fail(engine.error(), 4);
  if (Result<void> done = run(**engine); !done) return fail(done.error(), 1);
  return 0;
}
