#include "kit/batch_layout.h"

#include <algorithm>

namespace dermis::samples {
namespace {

using Attributes = std::array<OutputAttribute*, streamCount>;

/// Places the attributes of one instance after those that are in the outputs already.
class OutputPlacer {
 public:
  OutputPlacer(const OutputLayout& output, OutputSizes& sizes) : output_(output), sizes_(sizes) {}

  void place(Job& job, const Attributes& attributes) {
    const std::uint64_t vertices = job.mesh.vertexCount;
    const std::array<std::uint64_t*, streamCount> sizes{
        &sizes_.positions, &sizes_.normals, &sizes_.tangents, &sizes_.previousPositions};
    std::uint32_t vertexSize = output_.gap;
    for (const OutputAttribute* attribute : attributes) vertexSize += formatSize(attribute->format);
    std::uint32_t inVertex = 0;
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      OutputAttribute& attribute = *attributes[stream];
      const std::uint32_t size = formatSize(attribute.format);
      if (size == 0) continue;
      if (output_.arrangement == Arrangement::interleaved) {
        attribute.offset = sizes_.positions + inVertex;
        attribute.stride = vertexSize;
        inVertex += size;
      } else {
        std::uint64_t& end =
            output_.arrangement == Arrangement::separate ? *sizes[stream] : sizes_.positions;
        attribute.offset = end;
        attribute.stride = size + output_.gap;
        end = (end + vertices * attribute.stride + 3) / 4 * 4;
      }
    }
    if (output_.arrangement == Arrangement::interleaved) {
      // Kernels that store 8 bytes at a time need instances at multiples of 8 bytes.
      sizes_.positions = (sizes_.positions + vertices * vertexSize + 7) / 8 * 8;
    }
  }

 private:
  const OutputLayout& output_;
  OutputSizes& sizes_;
};

std::uint32_t addPose(BatchLayout& layout, std::span<const JointMatrix> pose, bool mayScale) {
  PoseDescription palette;
  palette.jointCount = static_cast<std::uint32_t>(pose.size());
  palette.matrixOffset = layout.posesSize;
  palette.mayScale = mayScale;
  layout.posesSize += pose.size_bytes();
  layout.poseDescriptions.push_back(palette);
  layout.poses.push_back(pose);
  return static_cast<std::uint32_t>(layout.poses.size() - 1);
}

}  // namespace

OutputAttribute attributeOf(const Job& job, std::size_t stream) {
  switch (static_cast<Stream>(stream)) {
    case Stream::normals:
      return job.normals;
    case Stream::tangents:
      return job.tangents;
    case Stream::previousPositions: {
      OutputAttribute attribute = job.previousPositions;
      attribute.format = job.motion == Motion::none ? VertexFormat::none : job.positions.format;
      return attribute;
    }
    default:
      return job.positions;
  }
}

BatchLayout layOutBatch(std::span<const SkinRequest> requests, const OutputLayout& output) {
  BatchLayout layout;
  layout.oneOutput = output.arrangement != Arrangement::separate;
  OutputPlacer placer(output, layout.outputs);
  for (const SkinRequest& request : requests) {
    const auto [entry, isNew] = layout.meshOffsets.try_emplace(request.mesh, layout.meshesSize);
    if (isNew) layout.meshesSize += request.mesh->bytes().size();

    Job job;
    job.mesh = request.mesh->info();
    job.meshOffset = entry->second;
    job.pose = addPose(layout, request.pose, request.mayScale);
    job.method = request.method;
    job.morphs = request.morphs;
    job.box = request.box;
    job.bounds = output.bounds;
    job.motion = output.motion;
    job.restartsMotion = request.restartsMotion;
    job.settles = request.settles;
    job.previousPose = job.pose;
    job.previousMorphs = request.previousMorphs;
    if (output.motion == Motion::reskinned && !request.previousPose.empty())
      job.previousPose = addPose(layout, request.previousPose, request.mayScale);
    job.positions.format = output.positions;
    if (job.mesh.hasNormals) job.normals.format = output.normals;
    if (job.mesh.hasTangents) job.tangents.format = output.tangents;
    if (output.motion != Motion::none) job.previousPositions.format = output.positions;
    placer.place(job, {&job.positions, &job.normals, &job.tangents, &job.previousPositions});
    layout.jobs.push_back(job);
  }
  if (layout.oneOutput) layout.outputs = OutputSizes::oneBuffer(layout.outputs.positions);
  return layout;
}

}  // namespace dermis::samples
