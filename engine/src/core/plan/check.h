// Checks the rules of a batch. Messages name the job or pose at fault.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "dermis/plan.h"
#include "dermis/result.h"
#include "plan/variant.h"

namespace dermis {

DERMIS_CORE_API Error invalid(std::string message);
/// "WHAT of VALUE is not a multiple of DIVISOR".
Error notAMultiple(const std::string& what, std::uint64_t value, std::uint64_t divisor);
/// For a number that is not a value of an enum: "WHAT is 7, which is not a value of Method".
template <typename Enum>
Error notAValue(const std::string& what, Enum value, const char* name) {
  return invalid(what + " is " + std::to_string(static_cast<unsigned>(value)) +
                 ", which is not a value of " + name);
}
/// For a buffer that is larger than `DeviceLimits::maxStorageBufferRange`.
Error tooLargeForRange(const std::string& name, std::uint64_t size, const DeviceLimits& limits);

/// The object at fault, at the beginning of a message: "job 17", "the instance".
struct Subject {
  static constexpr std::size_t noIndex = ~std::size_t{0};

  const char* kind = "job";
  std::size_t index = noIndex;

  DERMIS_CORE_API std::string name() const;
};

Result<void> checkLimits(const DeviceLimits& limits);

/// Whether the number is a value of `Method`.
DERMIS_CORE_API Result<void> checkMethod(Method method, const Subject& subject);
/// Whether the number is a value of `JointPromise`.
DERMIS_CORE_API Result<void> checkPromise(JointPromise promise, const Subject& subject);
/// Whether positions, normals and tangents may have these formats.
Result<void> checkFormats(VertexFormat positions, VertexFormat normals, VertexFormat tangents,
                          const Subject& subject);
/// Whether previous positions have the format of the positions, or none.
Result<void> checkPrevious(const VertexPlaces& places, const Subject& subject);
/// Whether all members have values that plans use.
DERMIS_CORE_API Result<void> checkVariant(const Variant& variant);
/// Whether it stands for such a variant.
DERMIS_CORE_API Result<void> checkPipeline(PipelineId id);
/// Where one vertex is placed with this layout. Fails unless kernels can store it.
Result<VertexPlaces> checkNeeds(const PipelineNeeds& needs);

/// Whether a packed mesh can have these sizes.
Result<void> checkMeshInfo(const MeshInfo& mesh, const Subject& subject);
Result<void> checkTuning(const Tuning& tuning);
Result<void> checkPose(const Batch& batch, const PoseDescription& pose, std::size_t index);
/// `streams`: those of the job. Does not check its runs.
DERMIS_CORE_API Result<void> checkJob(const Batch& batch, const Job& job,
                                      const OutputStreams& streams, const Subject& subject,
                                      const DeviceLimits& limits);
/// Whether kernels, which store whole words, can store the attributes (`OutputAttribute`).
Result<void> checkRuns(const Job& job, const OutputStreams& streams, const Subject& subject);
/// Whether positions in snorm16 can be relative to it.
DERMIS_CORE_API bool isBox(const Box& box);
/// snorm16 positions are (p − center) × inverse, with inverse = 1 / half the size.
struct BoxScale {
  float center[3], inverse[3];
};
DERMIS_CORE_API BoxScale boxScale(const Box& box);
DERMIS_CORE_API Result<void> checkMorphs(std::span<const MorphWeight> morphs,
                                         std::uint32_t targetCount, const Subject& subject);

}  // namespace dermis
