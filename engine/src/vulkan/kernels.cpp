#include "dermis/vulkan/context.h"

#include <cstddef>
#include <string>

#include "abi.h"
#include "dermis_kernels.h"
#include "plan/check.h"
#include "vulkan/pipelines.h"

namespace dermis::vulkan {

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

namespace {

/// These methods have separate modules: in one module they would double the compile time of all
/// other methods.
bool isAgainstBulge(Method method) {
  return method == Method::blended || method == Method::centerOfRotation ||
         method == Method::bulgeControlled;
}

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

PipelineDescription descriptionOf(const Variant& variant) {
  PipelineDescription description;
  description.name = pipelineName(variant);
  description.module = moduleName(variant);
  description.spirv = kernels::find(description.module);
  description.constants = constantsOf(variant);
  description.storageBuffers = variant.oneOutput ? abi::MIN_BINDING_COUNT : abi::BINDING_COUNT;
  description.texelBuffers = variant.texels ? abi::TEXEL_BINDING_COUNT : 0;
  return description;
}

Result<PipelineDescription> pipelineDescription(PipelineId id) {
  if (Result<void> good = checkPipeline(id); !good) return good.error();
  PipelineDescription description = descriptionOf(variantOf(id));
  if (!description.spirv.empty()) return description;
  return Error{ErrorCode::missingFeature,
               "this build of Dermis has no kernel '" + description.module + "'"};
}

}  // namespace dermis::vulkan
