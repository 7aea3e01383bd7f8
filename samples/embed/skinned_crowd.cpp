#include "skinned_crowd.h"

#include <algorithm>
#include <cstddef>
#include <utility>

using namespace dermis;

namespace embed {
namespace {

// [plan]
/// What is written for each vertex, and by which rule: known while loading, so pipelines are, too.
const PipelineNeeds needs{.method = Method::dualQuaternion,
                          .layout = {.positions = VertexFormat::float32x3,
                                     .normals = VertexFormat::octahedral16x2,
                                     .stride = sizeof(SkinnedVertex)}};

/// Says who is skinned by which pose, and to where: as often as that changes.
Result<void> planCrowd(Crowd& crowd) {
  const std::uint64_t poseSize = crowd.jointCount * sizeof(JointMatrix);
  const std::uint64_t instanceSize = crowd.mesh.vertexCount() * sizeof(SkinnedVertex);
  crowd.poses.resize(instanceCount);
  crowd.jobs.resize(instanceCount);
  for (std::uint32_t instance = 0; instance < instanceCount; ++instance) {
    PoseDescription& pose = crowd.poses[instance];
    pose.jointCount = crowd.jointCount;
    pose.matrixOffset = instance * poseSize;

    const Result<VertexPlaces> places =
        placeVertices(needs.layout, crowd.mesh.vertexCount(), instance * instanceSize);
    if (!places) return places.error();
    Job& job = crowd.jobs[instance];
    job.mesh = crowd.mesh.info();
    job.pose = instance;
    job.method = needs.method;
    job.place(*places);
  }
  Batch batch;
  batch.poses = crowd.poses;
  batch.jobs = crowd.jobs;
  batch.meshesSize = crowd.mesh.bytes().size();
  batch.posesSize = instanceCount * poseSize;
  batch.outputs = OutputSizes::oneBuffer(instanceCount * instanceSize);
  return makePlan(batch, crowd.context.limits(), crowd.context.tuning(), crowd.plan);
}
// [/plan]

/// The engine makes its buffers as large, and for what use, as the plan says.
Result<void> makeBuffer(samples::Device& engine, const Plan& plan, BufferRole role,
                        samples::MappedBuffer& buffer) {
  const BufferRequirement wanted = plan.buffer(role);
  const VkBufferUsageFlags ownUsage =
      role == BufferRole::positions ? VK_BUFFER_USAGE_VERTEX_BUFFER_BIT : 0;
  Result<samples::MappedBuffer> made =
      samples::MappedBuffer::create(engine, wanted.size, wanted.usage | ownUsage);
  if (!made) return made.error();
  buffer = std::move(*made);
  return {};
}

void recordBarrier(const samples::Device& engine, VkCommandBuffer commandBuffer,
                   const vulkan::Dependency& dependency) {
  const VkMemoryBarrier barrier = vulkan::memoryBarrier(dependency);
  engine.functions().CmdPipelineBarrier(commandBuffer, dependency.source.stages,
                                        dependency.destination.stages, 0, 1, &barrier, 0, nullptr,
                                        0, nullptr);
}

}  // namespace

// [set-up]
Result<Crowd> setUp(samples::Device& engine, const MeshView& mesh, std::uint32_t jointCount) {
  // Lends Dermis a VkDevice and says what is enabled on it. Nothing else is made or used.
  Result<vulkan::Context> context = vulkan::Context::create(engine.description());
  if (!context) return context.error();
  Result<PackedMesh> packed = pack(mesh, jointCount);
  if (!packed) return packed.error();
  Crowd crowd{std::move(*context), std::move(*packed), jointCount, {}, {}, {}, {}, {}, {}};

  // The plan of the largest batch there will be says what buffers to make.
  if (Result<void> done = planCrowd(crowd); !done) return done.error();
  if (Result<void> done = crowd.context.prepare(needs); !done) return done.error();

  for (const auto& [role, buffer] :
       {std::pair{BufferRole::meshes, &crowd.meshes}, {BufferRole::positions, &crowd.output}}) {
    if (Result<void> done = makeBuffer(engine, crowd.plan, role, *buffer); !done)
      return done.error();
  }
  std::ranges::copy(crowd.mesh.bytes(), crowd.meshes.bytes().begin());

  for (Frame& frame : crowd.frames) {
    for (const auto& [role, buffer] : {std::pair{BufferRole::poses, &frame.poses},
                                       {BufferRole::tables, &frame.tables},
                                       {BufferRole::palettes, &frame.palettes}}) {
      if (Result<void> done = makeBuffer(engine, crowd.plan, role, *buffer); !done)
        return done.error();
    }
    Result<vulkan::Bindings> bindings =
        crowd.context.createBindings({crowd.meshes.range(),
                                      frame.poses.range(),
                                      frame.tables.range(),
                                      frame.palettes.range(),
                                      vulkan::OutputBuffers::oneBuffer(crowd.output.range()),
                                      {}});
    if (!bindings) return bindings.error();
    frame.bindings = std::move(*bindings);
  }
  return crowd;
}
// [/set-up]

// [frame]
Result<void> skinFrame(const samples::Device& engine, Crowd& crowd, Frame& frame,
                       std::span<const JointMatrix> matrices, VkCommandBuffer commandBuffer) {
  std::ranges::copy(std::as_bytes(matrices), frame.poses.bytes().begin());
  if (Result<void> done = planCrowd(crowd); !done) return done;
  if (Result<void> done = writeTables(crowd.plan, frame.tables.bytes()); !done) return done;

  // The barriers at the edges are the engine's: only it knows what stands before and after.
  recordBarrier(engine, commandBuffer, vulkan::inputScope(vulkan::PreviousUse::previousRecord));
  if (Result<void> done = crowd.context.record(commandBuffer, crowd.plan, frame.bindings); !done)
    return done;
  // This program reads the vertices back; one that draws them says Consumer::vertexInput.
  recordBarrier(engine, commandBuffer, vulkan::outputScope(vulkan::Consumer::hostRead));
  return {};
}
// [/frame]

}  // namespace embed
