#include "plan/check.h"

#include <bit>
#include <string>

namespace dermis {
namespace {

constexpr std::uint64_t matrixAlignment = 16;

/// Whether `count` elements of `stride` bytes from `offset` on end inside `size` bytes.
bool isInside(const OutputAttribute& attribute, std::uint32_t count, std::uint64_t size) {
  const std::uint64_t length = std::uint64_t{count - 1} * attribute.stride + outputAttributeSize;
  return attribute.offset <= size && length <= size - attribute.offset;
}

Result<void> checkAttribute(const OutputAttribute& attribute, const char* name,
                            std::uint32_t vertexCount, std::uint64_t outputSize,
                            std::size_t index) {
  if (attribute.offset % 4 != 0 || attribute.stride % 4 != 0 ||
      attribute.stride < outputAttributeSize) {
    return invalid(jobName(index) + ": the offset " + std::to_string(attribute.offset) +
                   " and stride " + std::to_string(attribute.stride) + " of its " + name +
                   " must be multiples of 4, the stride at least 12");
  }
  if (!isInside(attribute, vertexCount, outputSize)) {
    return invalid(jobName(index) + ": its " + name + " end outside the output buffer of " +
                   std::to_string(outputSize) + " bytes");
  }
  return {};
}

}  // namespace

Error invalid(std::string message) {
  return {ErrorCode::invalidArgument, std::move(message)};
}

std::string jobName(std::size_t index) {
  return "job " + std::to_string(index);
}

Result<void> checkJob(const Batch& batch, const Job& job, std::size_t index) {
  if (job.mesh.vertexCount == 0) return invalid(jobName(index) + " has no mesh");
  if (job.meshOffset % packedMeshAlignment != 0 || job.meshOffset > batch.meshesSize ||
      job.mesh.byteSize > batch.meshesSize - job.meshOffset) {
    return invalid(jobName(index) + ": a packed mesh of " + std::to_string(job.mesh.byteSize) +
                   " bytes cannot stand at byte " + std::to_string(job.meshOffset) +
                   " of a mesh buffer of " + std::to_string(batch.meshesSize));
  }
  if (job.palette >= batch.palettes.size()) {
    return invalid(jobName(index) + ": there is no palette " + std::to_string(job.palette) +
                   " among " + std::to_string(batch.palettes.size()));
  }
  if (batch.palettes[job.palette].jointCount < job.mesh.requiredJoints) {
    return invalid(jobName(index) + ": its mesh needs a palette of " +
                   std::to_string(job.mesh.requiredJoints) + " joints, palette " +
                   std::to_string(job.palette) + " has " +
                   std::to_string(batch.palettes[job.palette].jointCount));
  }
  if (methodName(job.method) == "unknown")
    return invalid(jobName(index) + ": its method is not one of Method");
  if (job.normals.stride != 0 && !job.mesh.hasNormals) {
    return invalid(jobName(index) + " wants normals, its mesh has none");
  }
  const std::uint32_t vertices = job.mesh.vertexCount;
  if (Result<void> good =
          checkAttribute(job.positions, "positions", vertices, batch.outputSize, index);
      !good) {
    return good;
  }
  if (job.normals.stride == 0) return {};
  return checkAttribute(job.normals, "normals", vertices, batch.outputSize, index);
}

Result<void> checkPalette(const Batch& batch, const Palette& palette, std::size_t index) {
  const std::string name = "palette " + std::to_string(index);
  if (palette.jointCount == 0 || palette.jointCount > maxPaletteJoints) {
    return invalid(name + " has " + std::to_string(palette.jointCount) +
                   " joints, it may have 1 to " + std::to_string(maxPaletteJoints));
  }
  if (palette.matrixOffset % matrixAlignment != 0 || palette.matrixOffset > batch.matricesSize ||
      std::uint64_t{palette.jointCount} * sizeof(JointMatrix) >
          batch.matricesSize - palette.matrixOffset) {
    return invalid(name + ": " + std::to_string(palette.jointCount) +
                   " matrices cannot stand at byte " + std::to_string(palette.matrixOffset) +
                   " of a matrices buffer of " + std::to_string(batch.matricesSize));
  }
  return {};
}

Result<void> checkLimits(const DeviceLimits& limits) {
  // Far below what Vulkan guarantees; what is asked here is that nothing below divides by zero.
  if (limits.maxWorkgroupCountX == 0 || limits.maxWorkgroupCountY == 0 ||
      limits.maxStorageBufferRange < 1024 ||
      !std::has_single_bit(limits.minStorageBufferOffsetAlignment) ||
      limits.minStorageBufferOffsetAlignment > limits.maxStorageBufferRange / 4) {
    return invalid("the limits are not those of a Vulkan device");
  }
  return {};
}

Result<void> checkTuning(const Tuning& tuning) {
  if (!std::has_single_bit(tuning.workgroupSize) || tuning.workgroupSize < 8 ||
      tuning.workgroupSize > 128) {
    return invalid("tuning: a workgroup has a power of two of invocations from 8 to 128, not " +
                   std::to_string(tuning.workgroupSize));
  }
  if (tuning.instancesPerInvocation < 1 || tuning.instancesPerInvocation > 16) {
    return invalid("tuning: an invocation skins 1 to 16 instances, not " +
                   std::to_string(tuning.instancesPerInvocation));
  }
  return {};
}

}  // namespace dermis
