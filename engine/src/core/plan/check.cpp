#include "plan/check.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <initializer_list>
#include <string>

#include "abi.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

constexpr std::uint64_t matrixAlignment = 16;

Result<void> checkStreams(const Batch& batch, const Job& job, const OutputStreams& streams,
                          const Subject& subject) {
  const ByStream<std::uint64_t>& sizes = batch.outputSizes;
  for (std::size_t index = 0; index < streamCount; ++index) {
    const OutputStream& stream = streams[index];
    if (stream.size == 0) continue;
    if (stream.stride < stream.size) {
      return invalid(subject.name() + ": the stride " + std::to_string(stream.stride) + " of its " +
                     streamName(index) + " must be at least their size " +
                     std::to_string(stream.size));
    }
    const std::uint64_t length =
        std::uint64_t{job.mesh.vertexCount - 1} * stream.stride + stream.size;
    if (stream.offset > sizes[index] || length > sizes[index] - stream.offset) {
      return invalid(subject.name() + ": its " + streamName(index) +
                     " end outside their output buffer of " + std::to_string(sizes[index]) +
                     " bytes");
    }
  }
  return {};
}

Result<void> checkTogether(const Batch& batch, const Job& job, const OutputStreams& streams,
                           const Subject& subject) {
  const auto name = [&] {
    return subject.name() + ": its attributes are adjacent, with a stride of " +
           std::to_string(job.places[Stream::positions].stride);
  };
  if (!batch.isOneOutput &&
      (standsTogether(streams) || standsInPairs(job) ||
       shareWords(job.places[Stream::positions].format, job.places[Stream::normals].format,
                  job.places[Stream::tangents].format)))
    return invalid(name() + ": all attributes must go to one buffer (Batch::isOneOutput)");
  if (job.places[Stream::positions].offset % 8 != 0 && standsInPairs(job)) {
    return invalid(name() + ": positions must begin at a multiple of 8, not at " +
                   std::to_string(job.places[Stream::positions].offset));
  }
  return {};
}

}  // namespace

Result<void> checkMorphs(std::span<const MorphWeight> morphs, std::uint32_t targetCount,
                         const Subject& subject) {
  std::uint32_t highest = 0;
  for (std::size_t i = 0; i < morphs.size(); ++i) {
    const std::uint32_t target = morphs[i].target;
    if (target >= targetCount) {
      return invalid(subject.name() + ": there is no morph target " + std::to_string(target) +
                     " among the " + std::to_string(targetCount) + " of its mesh");
    }
    if (!std::isfinite(morphs[i].weight)) {
      return invalid(subject.name() + ": the weight of morph target " + std::to_string(target) +
                     " is not finite");
    }
    // Usually they are in order; then no search is needed.
    if (i == 0 || target > highest) {
      highest = target;
      continue;
    }
    for (std::size_t other = 0; other < i; ++other) {
      if (morphs[other].target == target)
        return invalid(subject.name() + " has morph target " + std::to_string(target) + " twice");
    }
  }
  return {};
}

BoxScale boxScale(const Box& box) {
  BoxScale scale;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double least = double{box.min[axis]}, greatest = double{box.max[axis]};
    scale.center[axis] = static_cast<float>((least + greatest) / 2);
    scale.inverse[axis] = static_cast<float>(2 / (greatest - least));
  }
  return scale;
}

bool isBox(const Box& box) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(box.min[axis]) || !std::isfinite(box.max[axis]) ||
        !(box.max[axis] > box.min[axis]) || !std::isfinite(2 / (box.max[axis] - box.min[axis])))
      return false;
  }
  return true;
}

Result<void> checkMeshInfo(const MeshInfo& mesh, const Subject& subject) {
  const std::uint64_t attributes =
      std::uint64_t{1} + mesh.hasNormals + mesh.hasTangents + mesh.hasCentersOfRotation;
  const std::uint64_t least = sizeof(abi::MeshHeader) + sizeof(abi::PositionRecord) +
                              mesh.vertexCount * attributes * sizeof(abi::PositionRecord);
  if (mesh.vertexCount != 0 && mesh.byteSize >= least && mesh.byteSize % packedMeshAlignment == 0)
    return {};
  return invalid(subject.name() + ": no packed mesh has " + std::to_string(mesh.vertexCount) +
                 " vertices in " + std::to_string(mesh.byteSize) + " bytes");
}

namespace {

Result<void> checkPoseOf(const Batch& batch, const Job& job, const Subject& subject) {
  const std::uint32_t pose = job.pose;
  if (pose >= batch.poses.size()) {
    return invalid(subject.name() + ": there is no pose " + std::to_string(pose) + " among " +
                   std::to_string(batch.poses.size()));
  }
  if (batch.poses[pose].jointCount < job.mesh.requiredJoints) {
    return invalid(subject.name() + ": its mesh needs a pose of " +
                   std::to_string(job.mesh.requiredJoints) + " joints, but pose " +
                   std::to_string(pose) + " has " + std::to_string(batch.poses[pose].jointCount));
  }
  return {};
}

Result<void> checkMotion(const Job& job, const Subject& subject) {
  if (Result<void> good = checkPrevious(job.places, subject); !good) return good;
  if (!job.places.hasMotion() && (job.settles || job.restartsMotion)) {
    return invalid(subject.name() +
                   " settles or restarts its motion, but has no previous positions");
  }
  return {};
}

}  // namespace

Error invalid(std::string message) {
  return {ErrorCode::invalidArgument, std::move(message)};
}

Error notAMultiple(const std::string& what, std::uint64_t value, std::uint64_t divisor) {
  return invalid(what + " of " + std::to_string(value) + " is not a multiple of " +
                 std::to_string(divisor));
}

Error tooLargeForRange(const std::string& name, std::uint64_t size, const DeviceLimits& limits) {
  return {ErrorCode::limitExceeded, "the " + name + " need " + std::to_string(size) +
                                        " bytes, more than a storage buffer range of " +
                                        std::to_string(limits.maxStorageBufferRange) +
                                        " bytes; split the batch"};
}

std::string Subject::name() const {
  std::string text = kind;
  if (index != noIndex) text.append(1, ' ').append(std::to_string(index));
  return text;
}

Result<void> checkMethod(Method method, const Subject& subject) {
  if (method <= allMethods.back()) return {};
  return notAValue(subject.name() + ": its method", method, "Method");
}

Result<void> checkPromise(JointPromise promise, const Subject& subject) {
  if (promise <= JointPromise::rigid) return {};
  return notAValue(subject.name() + ": its promise", promise, "JointPromise");
}

Result<void> checkVariant(const Variant& variant) {
  constexpr Subject subject{"the variant"};
  if (variant.kernel > Kernel::rig)
    return notAValue("the variant: its kernel", variant.kernel, "Kernel");
  if (Result<void> good = checkMethod(variant.method, subject); !good) return good;
  if (Result<void> good =
          checkFormats(variant.positions, variant.normals, variant.tangents, subject);
      !good)
    return good;
  const auto isOneOf = [](std::uint32_t value, std::initializer_list<std::uint32_t> values) {
    return std::ranges::find(values, value) != values.end();
  };
  const bool mayBeRigid = variant.kernel == Kernel::palette && !variant.scales;
  if (!isOneOf(variant.recordBytes, {0, 8, 12, 16, 24, 32}) ||
      !isOneOf(variant.influences, {0, 1, 2, 4}) || (variant.rigid && !mayBeRigid))
    return invalid("the variant's recordBytes, influences or rigid are none that a plan uses");
  return checkTuning({variant.workgroupSize, variant.instancesPerInvocation});
}

Result<void> checkPipeline(PipelineId id) {
  const Variant variant = variantOf(id);
  if (variant.id() == id && checkVariant(variant)) return {};
  return invalid("pipeline " + std::to_string(static_cast<std::uint64_t>(id)) +
                 " is none of this version of Dermis: `pipelines` lists them");
}

Result<VertexPlaces> checkNeeds(const PipelineNeeds& needs) {
  if (Result<void> good = checkMethod(needs.method, {"the instance"}); !good) return good.error();
  if (needs.promise) {
    if (Result<void> good = checkPromise(*needs.promise, {"the pose"}); !good) return good.error();
  }
  const Result<VertexPlaces> places = placeVertices(needs.layout, 1);
  if (!places) return places;
  Job job;
  job.places = *places;
  if (Result<void> good = checkRuns(job, outputStreams(job), {"the layout"}); !good)
    return good.error();
  return places;
}

Result<void> checkJob(const Batch& batch, const Job& job, const OutputStreams& streams,
                      const Subject& subject, const DeviceLimits& limits) {
  if (job.mesh.vertexCount == 0) return invalid(subject.name() + " has no mesh");
  if (Result<void> good = checkMeshInfo(job.mesh, subject); !good) return good;
  if (job.meshOffset % packedMeshAlignment != 0)
    return notAMultiple(subject.name() + ": its meshOffset", job.meshOffset, packedMeshAlignment);
  if (job.meshOffset > batch.meshesSize || job.mesh.byteSize > batch.meshesSize - job.meshOffset) {
    return invalid(subject.name() + ": its packed mesh of " + std::to_string(job.mesh.byteSize) +
                   " bytes at offset " + std::to_string(job.meshOffset) +
                   " ends after the mesh buffer of " + std::to_string(batch.meshesSize) + " bytes");
  }
  if (Result<void> good = checkPoseOf(batch, job, subject); !good) return good;
  if (Result<void> good = checkMethod(job.method, subject); !good) return good;
  if (isForComparison(job.method) && !limits.comparisonMethods) {
    return Error{ErrorCode::missingFeature,
                 subject.name() +
                     ": this Dermis was built without the comparison methods "
                     "(DERMIS_COMPARISON_METHODS), " +
                     "such as " + std::string(methodName(job.method))};
  }
  if (needsCentersOfRotation(job.method) && !job.mesh.hasCentersOfRotation) {
    return invalid(subject.name() + ": " + std::string(methodName(job.method)) +
                   " needs centers of rotation, but its mesh has none");
  }
  if (Result<void> good =
          checkFormats(job.places[Stream::positions].format, job.places[Stream::normals].format,
                       job.places[Stream::tangents].format, subject);
      !good)
    return good;
  if (job.places[Stream::normals].format != VertexFormat::none && !job.mesh.hasNormals)
    return invalid(subject.name() + " has normals in its output, but its mesh has none");
  if (job.places[Stream::tangents].format != VertexFormat::none && !job.mesh.hasTangents)
    return invalid(subject.name() + " has tangents in its output, but its mesh has none");
  if (Result<void> good = checkMotion(job, subject); !good) return good;
  if (!job.morphs.empty()) {
    if (Result<void> good = checkMorphs(job.morphs, job.mesh.morphTargetCount, subject); !good)
      return good;
  }
  if (isSnormPosition(job.places[Stream::positions].format) && !isBox(job.box)) {
    return invalid(subject.name() +
                   ": the box of its snorm16 positions must be finite, with sides longer than 0");
  }
  if (hasResult(job) && limits.maxStorageBuffersPerStage < storageBuffersWanted) {
    return Error{ErrorCode::limitExceeded,
                 subject.name() + " has bounds or snorm16 positions, which a device with " +
                     std::to_string(limits.maxStorageBuffersPerStage) +
                     " storage buffers per stage does not support"};
  }
  if (Result<void> good = checkTogether(batch, job, streams, subject); !good) return good;
  return checkStreams(batch, job, streams, subject);
}

Result<void> checkPose(const Batch& batch, const PoseDescription& pose, std::size_t index) {
  // Made only for errors, since this function runs for every pose of every plan.
  const auto name = [index] { return "pose " + std::to_string(index); };
  if (Result<void> good = checkPromise(pose.promise, {"pose", index}); !good) return good;
  if (pose.jointCount == 0 || pose.jointCount > maxPoseJoints) {
    return invalid(name() + " has " + std::to_string(pose.jointCount) +
                   " joints, but it may have 1 to " + std::to_string(maxPoseJoints));
  }
  if (pose.matrixOffset % matrixAlignment != 0)
    return notAMultiple(name() + ": its matrixOffset", pose.matrixOffset, matrixAlignment);
  if (pose.matrixOffset > batch.posesSize ||
      std::uint64_t{pose.jointCount} * sizeof(JointMatrix) > batch.posesSize - pose.matrixOffset) {
    return invalid(name() + ": its " + std::to_string(pose.jointCount) + " matrices at offset " +
                   std::to_string(pose.matrixOffset) + " end after the poses buffer of " +
                   std::to_string(batch.posesSize) + " bytes");
  }
  return {};
}

Result<void> checkLimits(const DeviceLimits& limits) {
  // Far below what Vulkan guarantees: this only prevents divisions by zero.
  if (limits.maxWorkgroupCountX == 0 || limits.maxWorkgroupCountY == 0)
    return invalid("DeviceLimits::maxWorkgroupCountX and Y must be at least 1");
  if (limits.maxStorageBufferRange < 1024) {
    return invalid("DeviceLimits::maxStorageBufferRange must be at least 1024 bytes, not " +
                   std::to_string(limits.maxStorageBufferRange));
  }
  if (!std::has_single_bit(limits.minStorageBufferOffsetAlignment) ||
      limits.minStorageBufferOffsetAlignment > limits.maxStorageBufferRange / 4) {
    return invalid(
        "DeviceLimits::minStorageBufferOffsetAlignment must be a power of two and at most a "
        "quarter "
        "of maxStorageBufferRange, not " +
        std::to_string(limits.minStorageBufferOffsetAlignment));
  }
  return {};
}

Result<void> checkTuning(const Tuning& tuning) {
  if (!std::has_single_bit(tuning.workgroupSize) || tuning.workgroupSize < 8 ||
      tuning.workgroupSize > 128) {
    return invalid("Tuning::workgroupSize must be a power of two from 8 to 128, not " +
                   std::to_string(tuning.workgroupSize));
  }
  if (tuning.instancesPerInvocation < 1 || tuning.instancesPerInvocation > 32) {
    return invalid("Tuning::instancesPerInvocation must be from 1 to 32, not " +
                   std::to_string(tuning.instancesPerInvocation));
  }
  if (!std::has_single_bit(tuning.verticesPerInvocation) || tuning.verticesPerInvocation > 16) {
    return invalid("Tuning::verticesPerInvocation must be a power of two from 1 to 16, not " +
                   std::to_string(tuning.verticesPerInvocation));
  }
  return {};
}

}  // namespace dermis
