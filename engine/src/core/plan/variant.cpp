#include "plan/variant.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "abi.h"
#include "plan/check.h"

namespace dermis {

// -- What C++ and GLSL share.

static_assert(abi::METHOD_LINEAR == static_cast<std::uint32_t>(Method::linear));
static_assert(abi::METHOD_DUAL_QUATERNION == static_cast<std::uint32_t>(Method::dualQuaternion));
static_assert(abi::METHOD_DUAL_QUATERNION_ITERATIVE ==
              static_cast<std::uint32_t>(Method::dualQuaternionIterative));
static_assert(abi::METHOD_LOG_MATRIX == static_cast<std::uint32_t>(Method::logMatrix));
static_assert(abi::METHOD_SPHERICAL_BLEND == static_cast<std::uint32_t>(Method::sphericalBlend));
static_assert(abi::METHOD_QUATERNION_TRANSLATION ==
              static_cast<std::uint32_t>(Method::quaternionTranslation));
static_assert(abi::METHOD_BLENDED == static_cast<std::uint32_t>(Method::blended));
static_assert(abi::METHOD_CENTER_OF_ROTATION ==
              static_cast<std::uint32_t>(Method::centerOfRotation));
static_assert(abi::METHOD_BULGE_CONTROLLED == static_cast<std::uint32_t>(Method::bulgeControlled));
static_assert(abi::FORMAT_NONE == static_cast<std::uint32_t>(VertexFormat::none));
static_assert(abi::FORMAT_FLOAT32X3 == static_cast<std::uint32_t>(VertexFormat::float32x3));
static_assert(abi::FORMAT_FLOAT32X4 == static_cast<std::uint32_t>(VertexFormat::float32x4));
static_assert(abi::FORMAT_FLOAT16X3 == static_cast<std::uint32_t>(VertexFormat::float16x3));
static_assert(abi::FORMAT_FLOAT16X4 == static_cast<std::uint32_t>(VertexFormat::float16x4));
static_assert(abi::FORMAT_SNORM16X3 == static_cast<std::uint32_t>(VertexFormat::snorm16x3));
static_assert(abi::FORMAT_SNORM16X4 == static_cast<std::uint32_t>(VertexFormat::snorm16x4));
static_assert(abi::FORMAT_SNORM8X3 == static_cast<std::uint32_t>(VertexFormat::snorm8x3));
static_assert(abi::FORMAT_SNORM8X4 == static_cast<std::uint32_t>(VertexFormat::snorm8x4));
static_assert(abi::FORMAT_OCTAHEDRAL16X2 ==
              static_cast<std::uint32_t>(VertexFormat::octahedral16x2));
static_assert(abi::FORMAT_OCTAHEDRAL8X2 == static_cast<std::uint32_t>(VertexFormat::octahedral8x2));
// Records are read four words at a time.
static_assert(sizeof(abi::PaletteRecord) == abi::PALETTE_WORDS * 4);
static_assert(sizeof(abi::DrivenRecord) == abi::DRIVEN_WORDS * 4);
static_assert(sizeof(abi::GroupRecord) == abi::GROUP_WORDS * 4 && abi::GROUP_WORDS % 4 == 0);
static_assert(sizeof(abi::InstanceRecord) == abi::INSTANCE_WORDS * 4 &&
              abi::INSTANCE_WORDS % 4 == 0);
static_assert(sizeof(abi::ExtensionRecord) == abi::EXTENSION_WORDS * 4 &&
              abi::EXTENSION_WORDS % 4 == 0);
static_assert(sizeof(abi::CulledDispatchRecord) == abi::CULLED_DISPATCH_WORDS * 4);
static_assert(sizeof(abi::IndirectRecord) == abi::INDIRECT_WORDS * 4);
static_assert(sizeof(abi::ActiveMorph) == abi::ACTIVE_MORPH_WORDS * 4);
static_assert(sizeof(abi::MeshHeader) == abi::MESH_HEADER_WORDS * 4 &&
              abi::MESH_HEADER_WORDS % 4 == 0 && offsetof(abi::MeshHeader, positions) % 16 == 0);
static_assert(sizeof(abi::PositionRecord) == abi::VERTEX_WORDS * 4 && abi::VERTEX_WORDS == 4);
static_assert(sizeof(abi::InfluenceRecord) == abi::INFLUENCE_WORDS * 4);
static_assert(sizeof(abi::MorphRecord) == abi::MORPH_WORDS * 4 && abi::MORPH_WORDS == 4);
static_assert(sizeof(abi::MorphBlockRecord) == abi::MORPH_BLOCK_WORDS * 4 &&
              abi::MORPH_BLOCK_WORDS == 4);
static_assert(sizeof(abi::FigureRecord) == abi::FIGURE_WORDS * 4 && abi::FIGURE_WORDS % 4 == 0);
static_assert(sizeof(abi::BankRecord) == abi::BANK_WORDS * 4 && abi::BANK_WORDS == 4);
static_assert(sizeof(abi::BandRecord) == abi::BAND_WORDS * 4 && abi::BAND_WORDS == 4);
static_assert(sizeof(abi::StepRecord) == abi::STEP_WORDS * 4 && abi::STEP_WORDS % 4 == 0);
static_assert(sizeof(abi::CandidateRecord) == abi::CANDIDATE_WORDS * 4);
static_assert(sizeof(abi::RigRecord) == abi::RIG_WORDS * 4 && abi::RIG_WORDS % 4 == 0);
static_assert(sizeof(abi::MorphListRecord) == abi::MORPH_LIST_WORDS * 4 &&
              abi::MORPH_LIST_WORDS % 4 == 0);
// Public structures have the layout of the records that kernels write and read.
static_assert(sizeof(InstanceResult) == sizeof(abi::ResultRecord) &&
              offsetof(InstanceResult, clampedVertices) ==
                  offsetof(abi::ResultRecord, clampedVertices) &&
              offsetof(InstanceResult, orderedMax) == offsetof(abi::ResultRecord, maxX));
static_assert(sizeof(PoseStatus) == sizeof(abi::StatusRecord) &&
              offsetof(PoseStatus, nonRigidJoints) == offsetof(abi::StatusRecord, nonRigidJoints) &&
              offsetof(PoseStatus, undeclaredScale) ==
                  offsetof(abi::StatusRecord, undeclaredScale) &&
              offsetof(PoseStatus, nonFiniteJoints) ==
                  offsetof(abi::StatusRecord, nonFiniteJoints));

// -- IDs.

namespace {

/// Calls `field` with each member and its width in bits, from the lowest bits of an ID on.
template <typename AnyVariant, typename Field>
void visitFields(AnyVariant& variant, const Field& field) {
  field(variant.oneOutput, 1);
  field(variant.workgroupSize, 8);
  field(variant.instancesPerInvocation, 6);
  field(variant.fullInfluences, 1);
  field(variant.influences, 3);
  field(variant.staged, 1);
  field(variant.recordBytes, 6);
  field(variant.pairs, 1);
  field(variant.texels, 1);
  field(variant.scales, 1);
  field(variant.rigid, 1);
  field(variant.rigged, 1);
  field(variant.bounds, 1);
  field(variant.morphs, 1);
  field(variant.motion, 1);
  for (auto& isWide : variant.wide) field(isWide, 1);
  field(variant.tangents, 4);
  field(variant.normals, 4);
  field(variant.positions, 4);
  field(variant.method, 4);
  field(variant.kernel, 3);
}

}  // namespace

PipelineId Variant::id() const {
  std::uint64_t id = 0;
  unsigned shift = 0;
  visitFields(*this, [&](auto value, unsigned bits) {
    id |= static_cast<std::uint64_t>(value) << shift;
    shift += bits;
  });
  return PipelineId{id};
}

Variant variantOf(PipelineId id) {
  Variant variant;
  auto rest = static_cast<std::uint64_t>(id);
  visitFields(variant, [&]<typename Value>(Value& value, unsigned bits) {
    value = static_cast<Value>(rest & ((1u << bits) - 1));
    rest >>= bits;
  });
  return variant;
}

bool hasResults(const Variant& variant) {
  return variant.bounds || isSnormPosition(variant.positions);
}

// -- What a pipeline is built from.

std::vector<std::uint32_t> constantsOf(const Variant& variant) {
  std::vector<std::uint32_t> constants(abi::CONSTANT_COUNT);
  const auto set = [&constants](std::uint32_t id, auto value) {
    constants[id] = static_cast<std::uint32_t>(value);
  };
  set(abi::CONSTANT_WORKGROUP_SIZE, variant.workgroupSize);
  set(abi::CONSTANT_METHOD, variant.method);
  set(abi::CONSTANT_INFLUENCES, variant.influences);
  set(abi::CONSTANT_INSTANCES, variant.instancesPerInvocation);
  set(abi::CONSTANT_POSITION_FORMAT, variant.positions);
  set(abi::CONSTANT_NORMAL_FORMAT, variant.normals);
  set(abi::CONSTANT_TANGENT_FORMAT, variant.tangents);
  for (std::uint32_t stream = 0; stream < streamCount; ++stream)
    constants[abi::CONSTANT_WIDE] |= std::uint32_t{variant.wide[stream]} << stream;
  set(abi::CONSTANT_MOTION, variant.motion);
  set(abi::CONSTANT_MORPHS, variant.morphs);
  set(abi::CONSTANT_BOUNDS, variant.bounds);
  set(abi::CONSTANT_SCALES, variant.scales);
  set(abi::CONSTANT_RIGID, variant.rigid);
  set(abi::CONSTANT_RIGGED, variant.rigged);
  set(abi::CONSTANT_FULL, variant.fullInfluences);
  set(abi::CONSTANT_RECORD, variant.pairs ? abi::RECORD_IN_PAIRS : variant.recordBytes);
  return constants;
}

namespace {

/// These methods have separate modules: in one module, all other methods would take twice as long
/// to compile.
bool isAgainstBulge(Method method) {
  return method == Method::blended || method == Method::centerOfRotation ||
         method == Method::bulgeControlled;
}

}  // namespace

/// Must match the names in shaders/CMakeLists.txt.
std::string moduleName(const Variant& variant) {
  if (variant.kernel == Kernel::palette)
    return variant.method == Method::logMatrix ? "palette_logarithms" : "palette";
  if (variant.kernel == Kernel::clear) return "clear";
  if (variant.kernel == Kernel::visibility) return "visibility";
  if (variant.kernel == Kernel::morphLists) return "morph_lists";
  if (variant.kernel == Kernel::rig) return variant.texels ? "rig_texels" : "rig";
  if (variant.kernel == Kernel::sample) return variant.texels ? "sample_texels" : "sample";
  if (variant.kernel == Kernel::compose) return variant.texels ? "compose_texels" : "compose";
  std::string name = "skin";
  if (isForComparison(variant.method)) name += "_comparison";
  if (isAgainstBulge(variant.method)) name += "_bulge";
  if (variant.oneOutput) return name + "_one_output";
  if (variant.motion || hasResults(variant)) name += "_extras";
  if (variant.staged) return name + "_staged";
  if (variant.texels) return name + "_texels";
  return name;
}

std::string pipelineName(const Variant& variant) {
  if (variant.kernel == Kernel::palette) {
    return std::string("palette kernel for ") +
           (variant.method == Method::linear      ? "matrices"
            : variant.method == Method::logMatrix ? "logarithms"
                                                  : "dual quaternions") +
           (variant.scales  ? " with joints that scale"
            : variant.rigid ? " of rigid joints"
                            : "") +
           (variant.rigged ? " and driven joints" : "");
  }
  if (variant.kernel == Kernel::clear) return "clear kernel";
  if (variant.kernel == Kernel::morphLists) return "kernel that lists morph targets";
  if (variant.kernel == Kernel::rig) return "kernel that computes what rigs drive";
  if (variant.kernel == Kernel::sample) return "kernel that samples clips";
  if (variant.kernel == Kernel::compose) return "kernel that composes poses";
  if (variant.kernel == Kernel::visibility)
    return "visibility kernel for instances that are culled on the GPU";
  std::string text = "skin kernel for " + std::string(methodName(variant.method)) +
                     " with positions as " + std::string(formatName(variant.positions));
  if (variant.normals != VertexFormat::none)
    text += ", normals as " + std::string(formatName(variant.normals));
  if (variant.tangents != VertexFormat::none)
    text += ", tangents as " + std::string(formatName(variant.tangents));
  if (variant.motion) text += ", previous positions";
  if (variant.morphs) text += ", morph targets";
  if (variant.bounds) text += ", bounds";
  if (variant.recordBytes != 0)
    text += ", " + std::to_string(variant.recordBytes) +
            (variant.staged ? " bytes per vertex" : " bytes per store");
  if (variant.pairs) text += ", 8 bytes per store";
  text += std::string(", for ") + (variant.fullInfluences ? "exactly " : "") +
          (variant.influences == 0 ? std::string("any number of")
                                   : std::to_string(variant.influences)) +
          " influences";
  if (variant.scales) text += " and joints that scale";
  return text;
}

// -- The choice.

const char* streamName(std::size_t stream) {
  static constexpr std::array<const char*, streamCount> names{"positions", "normals", "tangents",
                                                              "previous positions"};
  return names[stream];
}

namespace {

bool hasActive(std::span<const MorphWeight> morphs) {
  return std::ranges::any_of(morphs, [](const MorphWeight& morph) { return morph.weight != 0; });
}

/// The members that depend on the outputs only.
Variant outputVariant(const Job& job) {
  Variant variant;
  variant.method = job.method;
  variant.positions = job.places[Stream::positions].format;
  variant.normals = job.places[Stream::normals].format;
  variant.tangents = job.places[Stream::tangents].format;
  variant.motion = job.places.hasMotion();
  variant.bounds = job.bounds;
  return variant;
}

}  // namespace

// The forms of a skin kernel: each earned its place in a benchmark on lavapipe
// (docs/performance.md). Anything else about the instances of a group is a branch in the kernel.
namespace {

/// Forms for few influences pay off if blending is most of the work.
bool hasFormsForFewInfluences(Method method) {
  return method == Method::linear || method == Method::dualQuaternion;
}

}  // namespace

void chooseForm(const FormNeeds& needs, Variant& variant) {
  variant.scales = needs.scales;
  variant.morphs = needs.morphs;
  variant.fullInfluences = false;
  if (needs.morphs || needs.influences > 4 || (variant.scales && isForComparison(variant.method))) {
    variant.influences = 0;
    variant.scales = true;
  } else if (variant.scales || !hasFormsForFewInfluences(variant.method)) {
    variant.influences = 4;
  } else {
    variant.influences =
        static_cast<std::uint8_t>(needs.influences <= 2 ? std::max(needs.influences, 1u) : 4);
    variant.fullInfluences = needs.full && needs.influences == 4;
  }
}

namespace {

/// Of positions, normals and tangents together.
std::uint32_t recordSize(const Job& job) {
  return formatSize(job.places[Stream::positions].format) +
         formatSize(job.places[Stream::normals].format) +
         formatSize(job.places[Stream::tangents].format);
}

/// Whether one store can write a whole vertex.
bool isRecord(const Job& job) {
  const std::uint32_t bytes = recordSize(job);
  return bytes == 8 || bytes == 12 || bytes == 16 || bytes == 24 || bytes == 32;
}

/// Bytes from the beginning of a vertex to an attribute that stands in it; 0 for others.
std::uint64_t placeInVertex(const OutputStreams& streams, std::size_t stream) {
  const std::uint64_t place = streams[stream].offset - streams[0].offset;
  return place < streams[0].stride ? place : 0;
}

/// Whether one store can write a whole attribute if vertices begin at multiples of its size.
bool isWide(const OutputStreams& streams, std::size_t index) {
  const OutputStream& stream = streams[index];
  const bool isVector = stream.size == 8 || stream.size == 12 || stream.size == 16;
  return isVector && stream.stride % stream.size == 0 &&
         placeInVertex(streams, index) % stream.size == 0;
}

/// Chooses the widest stores that strides and formats permit.
void widenStores(const Job& job, Variant& variant) {
  const OutputStreams streams = outputStreams(job);
  const std::uint32_t size = recordSize(job);
  if (isRecord(job) && standsTogether(streams) && job.places[Stream::positions].stride % size == 0)
    variant.recordBytes = static_cast<std::uint8_t>(size);
  for (std::size_t stream = 0; stream < streamCount; ++stream)
    variant.wide[stream] = isWide(streams, stream);
}

/// `DeviceLimits::stagedStores`.
bool canBeStaged(const Job& job, const OutputStreams& streams, const DeviceLimits& limits) {
  return limits.stagedStores && !limits.texelBuffers &&
         limits.maxStorageBuffersPerStage >= storageBuffersWanted &&
         (job.method == Method::linear || job.method == Method::dualQuaternion) &&
         !job.places.hasMotion() && !hasResult(job) && isRecord(job) &&
         job.places[Stream::positions].stride == recordSize(job) &&
         (recordSize(job) == streams[0].size || standsTogether(streams));
}

/// Whether each attribute begins at a multiple of what one store writes.
bool isAligned(const OutputStreams& streams, const Variant& variant) {
  if (variant.staged) return true;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (variant.wide[stream] && streams[stream].offset % streams[stream].size != 0) return false;
  }
  return variant.recordBytes == 0 || streams[0].offset % variant.recordBytes == 0;
}

/// The skin kernel for a job, except for the members that `chooseForm` sets. It has wide stores if
/// `areAligned`.
Variant layoutVariant(const Job& job, const DeviceLimits& limits, const Tuning& tuning,
                      bool areAligned) {
  Variant variant = outputVariant(job);
  variant.oneOutput = limits.maxStorageBuffersPerStage < storageBuffersWanted;
  variant.instancesPerInvocation = static_cast<std::uint8_t>(tuning.instancesPerInvocation);
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  if (canBeStaged(job, outputStreams(job), limits)) {
    variant.staged = true;
    variant.recordBytes = static_cast<std::uint8_t>(recordSize(job));
    return variant;
  }
  if (!storesWidely(limits)) return variant;
  variant.texels = true;
  if (areAligned) widenStores(job, variant);
  variant.pairs = variant.recordBytes == 0 && standsInPairs(job);
  return variant;
}

}  // namespace

Variant layoutVariant(const Job& job, const DeviceLimits& limits, const Tuning& tuning) {
  const Variant aligned = layoutVariant(job, limits, tuning, true);
  return isAligned(outputStreams(job), aligned) ? aligned
                                                : layoutVariant(job, limits, tuning, false);
}

FormNeeds formNeeds(const Job& job, bool mayScale) {
  const bool full = job.mesh.minInfluences == job.mesh.maxInfluences;
  return {job.mesh.maxInfluences, full, mayScale, hasActive(job.morphs)};
}

namespace {

/// Of an offset: a multiple of all that one store may write.
std::uint32_t residueOf(std::uint64_t offset) {
  return static_cast<std::uint32_t>(offset % 96);
}

/// How attributes are related: a bit for each that directly follows the one before it, and for each
/// that is in the vertex.
std::uint32_t relationsIn(const OutputStreams& streams) {
  std::uint64_t end = streams[0].offset;
  std::uint32_t relations = 0;
  for (std::size_t stream = 1; stream < streamCount; ++stream) {
    end += streams[stream - 1].size;
    const bool follows = streams[stream].offset == end;
    const bool isInVertex = streams[stream].offset - streams[0].offset < streams[0].stride;
    relations = relations << 2 | (follows ? 2u : 0u) | (isInVertex ? 1u : 0u);
  }
  return relations;
}

}  // namespace

LayoutNeeds::LayoutNeeds(const Job& job, const OutputStreams& streams)
    : method(job.method),
      motion(job.places.hasMotion()),
      bounds(job.bounds),
      positions(job.places[Stream::positions].format),
      normals(job.places[Stream::normals].format),
      tangents(job.places[Stream::tangents].format),
      relations(relationsIn(streams)) {
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    strides[stream] = streams[stream].stride;
    residues[stream] = residueOf(streams[stream].offset);
  }
}

/// Same result as making a LayoutNeeds of the job and comparing it, which would wait for its bytes
/// to be stored.
bool LayoutNeeds::areThoseOf(const Job& job, const OutputStreams& streams) const {
  if (job.method != method || job.places.hasMotion() != motion || job.bounds != bounds ||
      job.places[Stream::positions].format != positions ||
      job.places[Stream::normals].format != normals ||
      job.places[Stream::tangents].format != tangents)
    return false;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    if (streams[stream].stride != strides[stream] ||
        residueOf(streams[stream].offset) != residues[stream])
      return false;
  }
  return relationsIn(streams) == relations;
}

Variant variantOf(Kernel kernel, const DeviceLimits& limits, const Tuning& tuning) {
  Variant variant;
  variant.kernel = kernel;
  variant.oneOutput = limits.maxStorageBuffersPerStage < storageBuffersWanted;
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  return variant;
}

Variant poseVariant(Kernel kernel, const DeviceLimits& limits, const Tuning& tuning) {
  Variant variant = variantOf(kernel, limits, tuning);
  variant.texels = storesWidely(limits);
  // A workgroup has the nodes of a figure: those beyond the last cost lavapipe as much as others.
  if (variant.texels && kernel != Kernel::rig) variant.workgroupSize = 8;
  return variant;
}

Variant paletteVariant(PaletteForm form, JointPromise promise, bool rigged,
                       const DeviceLimits& limits, const Tuning& tuning) {
  Variant variant = variantOf(Kernel::palette, limits, tuning);
  variant.method = form == PaletteForm::matrices     ? Method::linear
                   : form == PaletteForm::logarithms ? Method::logMatrix
                                                     : Method::dualQuaternion;
  variant.scales = promise == JointPromise::scaling && form != PaletteForm::matrices;
  variant.rigid = promise == JointPromise::rigid && form != PaletteForm::matrices;
  variant.rigged = rigged;
  return variant;
}

namespace {

/// The values that are possible for all instances.
struct FormRanges {
  FormRanges() = default;
  FormRanges(const std::optional<MeshInfo>& mesh, std::optional<JointPromise> promise) {
    if (mesh) influences = {mesh->maxInfluences};
    if (mesh) full = {mesh->minInfluences == mesh->maxInfluences};
    if (mesh && mesh->morphTargetCount == 0) morphs = {false};
    if (promise) promises = {*promise};
    if (promise) scales = {*promise == JointPromise::scaling};
  }

  std::vector<std::uint32_t> influences{1, 2, 4, 5};
  std::vector<bool> full{false, true}, morphs{false, true}, scales{false, true};
  std::vector<JointPromise> promises{JointPromise::scaling, JointPromise::scaleIgnored,
                                     JointPromise::rigid};
};

/// The kernels before the skin kernel.
std::vector<Variant> earlierVariants(const Job& job, const FormRanges& ranges,
                                     const DeviceLimits& limits, const Tuning& tuning) {
  std::vector<Variant> variants;
  const PaletteForm form = paletteForm(job.method);
  for (const JointPromise promise : ranges.promises) {
    if (form != PaletteForm::matrices)
      variants.push_back(paletteVariant(form, promise, false, limits, tuning));
  }
  if (hasResult(job)) variants.push_back(variantOf(Kernel::clear, limits, tuning));
  return variants;
}

/// All forms of a kernel.
void appendForms(Variant variant, const FormRanges& ranges, std::vector<Variant>& variants) {
  for (const std::uint32_t influences : ranges.influences) {
    for (const bool scales : ranges.scales) {
      for (const bool morphs : ranges.morphs) {
        for (const bool full : ranges.full) {
          chooseForm({influences, full, scales, morphs}, variant);
          if (std::ranges::find(variants, variant) == variants.end()) variants.push_back(variant);
        }
      }
    }
  }
}

std::vector<PipelineId> idsOf(std::span<const Variant> variants) {
  std::vector<PipelineId> ids;
  for (const Variant& variant : variants) ids.push_back(variant.id());
  return ids;
}

}  // namespace

Result<std::vector<PipelineId>> pipelines(const Job& job, const DeviceLimits& limits,
                                          const Tuning& tuning) {
  if (Result<void> good = checkLimits(limits); !good) return good.error();
  if (Result<void> good = checkTuning(tuning); !good) return good.error();
  if (Result<void> good = checkVariant(outputVariant(job)); !good) return good.error();
  if (Result<void> good = checkPrevious(job.places, {"the job"}); !good) return good.error();
  if (Result<void> good = checkRuns(job, outputStreams(job), {"the job"}); !good)
    return good.error();
  const FormRanges ranges;
  std::vector<Variant> variants = earlierVariants(job, ranges, limits, tuning);
  for (const bool areAligned : {false, true})
    appendForms(layoutVariant(job, limits, tuning, areAligned), ranges, variants);
  return idsOf(variants);
}

Result<std::vector<PipelineId>> pipelines(const PipelineNeeds& needs, const DeviceLimits& limits,
                                          const Tuning& tuning) {
  if (Result<void> good = checkLimits(limits); !good) return good.error();
  if (Result<void> good = checkTuning(tuning); !good) return good.error();
  const Result<VertexPlaces> places = checkNeeds(needs);
  if (!places) return places.error();
  Job job;
  job.method = needs.method;
  job.bounds = needs.bounds;
  job.places = *places;
  const FormRanges ranges(needs.mesh, needs.promise);
  std::vector<Variant> variants = earlierVariants(job, ranges, limits, tuning);
  const PaletteForm form = paletteForm(job.method);
  const bool isCopied = form == PaletteForm::matrices;  // in a scene
  if (isCopied)
    variants.push_back(paletteVariant(form, JointPromise::scaling, false, limits, tuning));
  if (needs.rigs) {
    variants.push_back(poseVariant(Kernel::rig, limits, tuning));
    for (const JointPromise promise : ranges.promises) {
      const Variant rigged = paletteVariant(form, promise, true, limits, tuning);
      if (std::ranges::find(variants, rigged) == variants.end()) variants.push_back(rigged);
    }
  }
  // `placeVertices` aligns what it places.
  appendForms(layoutVariant(job, limits, tuning), ranges, variants);
  for (const Kernel kernel : {Kernel::sample, Kernel::compose}) {
    if (needs.figures) variants.push_back(poseVariant(kernel, limits, tuning));
  }
  if (needs.morphsOnGpu) variants.push_back(variantOf(Kernel::morphLists, limits, tuning));
  if (needs.culledOnGpu) variants.push_back(variantOf(Kernel::visibility, limits, tuning));
  return idsOf(variants);
}

}  // namespace dermis
