// The specialization of a kernel, for which a `PipelineId` stands; what a pipeline is built from;
// and which kernel an instance has.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "dermis/layout.h"
#include "dermis/plan.h"
#include "dermis/result.h"

namespace dermis {

/// The compute shaders of Dermis.
enum class Kernel : std::uint8_t {
  /// Converts poses to palettes: joints in the form that the skin kernel reads. These are dual
  /// quaternions, logarithms or matrices, and scale.
  palette = 0,
  skin = 1,        ///< skins instances
  visibility = 2,  ///< in a scene: chooses which of the instances culled on the GPU are skinned
  clear = 3,       ///< clears the results of instances that are skinned
  sample = 4,      ///< in a scene: samples the local transforms of figures from clips
  compose = 5,     ///< in a scene: makes the poses of figures from these
  morphLists = 6,  ///< in a scene: lists the active morph targets of weights that the GPU writes
  rig = 7,         ///< in a scene: computes what rigs drive
};

/// One specialization of a kernel, from which one pipeline is built.
///
/// `kernel`, `workgroupSize` and `oneOutput` apply to all kernels. The palette kernel also has
/// `method`, which is what joints are converted to (dualQuaternion: dual quaternions, logMatrix:
/// logarithms, linear: unchanged matrices), `scales`, and `rigid` and `rigged`, which only it has.
/// All other members apply to the skin kernel only.
struct Variant {
  Kernel kernel = Kernel::skin;
  Method method = Method::dualQuaternion;
  VertexFormat positions = VertexFormat::float32x3;
  VertexFormat normals = VertexFormat::none;
  VertexFormat tangents = VertexFormat::none;
  /// By `Stream`: whether one store writes the whole attribute, of 8, 12 or 16 bytes. Only with
  /// `texels`.
  ByStream<bool> wide{};
  bool motion = false;
  /// Whether instances have active morph targets.
  bool morphs = false;
  bool bounds = false;
  /// Whether joints may scale or shear (`JointPromise::scaling`).
  bool scales = false;
  /// Whether joints are taken for rigid (`JointPromise::rigid`).
  bool rigid = false;
  /// Whether poses have driven joints.
  bool rigged = false;
  /// Whether tables, meshes and palettes are read through uniform texel buffers, not storage
  /// buffers.
  bool texels = false;
  /// Whether each position is stored together with the normal that follows it, 8 bytes at a time.
  /// Only with `texels`, and if `recordBytes` is 0.
  bool pairs = false;
  /// If not 0: one store writes position, normal and tangent of a vertex, which are adjacent, and
  /// this is its size in bytes: 8, 12, 16, 24 or 32. Only with `staged` or `texels`.
  std::uint8_t recordBytes = 0;
  /// Whether vertices of `recordBytes` are stored 16 or 8 bytes at a time
  /// (`DeviceLimits::stagedStores`).
  bool staged = false;
  /// Maximum influences of a vertex: 1, 2, 4, or 0 for any number.
  std::uint8_t influences = 0;
  /// Whether every vertex has exactly `influences` influences.
  bool fullInfluences = false;
  std::uint8_t instancesPerInvocation = 1;
  std::uint16_t workgroupSize = 64;
  /// Whether all attributes are in one buffer, since the device has fewer than
  /// `storageBuffersWanted`.
  bool oneOutput = false;

  friend bool operator==(const Variant&, const Variant&) = default;
  /// Differs between any two variants that `checkVariant` accepts.
  DERMIS_CORE_API PipelineId id() const;
};

/// The variant for which an ID stands.
DERMIS_CORE_API Variant variantOf(PipelineId id);

/// Whether the kernel writes `InstanceResult`: if it has bounds, or positions in snorm16.
DERMIS_CORE_API bool hasResults(const Variant& variant);

/// `vulkan::PipelineDescription::name`.
DERMIS_CORE_API std::string pipelineName(const Variant& variant);
/// `vulkan::PipelineDescription::module`.
DERMIS_CORE_API std::string moduleName(const Variant& variant);
/// `vulkan::PipelineDescription::constants`.
DERMIS_CORE_API std::vector<std::uint32_t> constantsOf(const Variant& variant);

/// Whether a skin kernel writes an attribute.
inline bool writesStream(const Variant& variant, std::size_t stream) {
  switch (static_cast<Stream>(stream)) {
    case Stream::normals:
      return variant.normals != VertexFormat::none;
    case Stream::tangents:
      return variant.tangents != VertexFormat::none;
    case Stream::previousPositions:
      return variant.motion;
    default:
      return true;
  }
}

// -- Outputs of an instance.

/// One attribute of a job's output; `size` 0 if it is not wanted.
struct OutputStream {
  std::uint64_t offset = 0;
  std::uint32_t stride = 0;
  std::uint32_t size = 0;  ///< bytes of one element

  std::uint64_t begin(std::uint64_t vertex) const { return offset + vertex * stride; }
  /// Of vertices before `vertexEnd`.
  std::uint64_t end(std::uint64_t vertexEnd) const { return begin(vertexEnd - 1) + size; }
};

using OutputStreams = ByStream<OutputStream>;

inline OutputStream outputStream(const OutputAttribute& attribute) {
  if (attribute.format == VertexFormat::none) return {};
  return {attribute.offset, attribute.stride, formatSize(attribute.format)};
}

inline OutputStreams outputStreams(const Job& job) {
  const ByStream<OutputAttribute>& attributes = job.places.attributes;
  return {{outputStream(attributes[0]), outputStream(attributes[1]), outputStream(attributes[2]),
           outputStream(attributes[3])}};
}

DERMIS_CORE_API const char* streamName(std::size_t stream);

/// Whether the kernel writes an `InstanceResult`: bounds, or the number of clamped vertices.
inline bool hasResult(const Job& job) {
  return job.bounds || isSnormPosition(job.places[Stream::positions].format);
}

// -- The choice of the kernel of an instance. It does not depend on a frame.

/// The form of a joint in the palettes buffer.
enum class PaletteForm : std::uint8_t { dualQuaternions, logarithms, matrices };
inline constexpr std::uint32_t paletteFormCount = 3;
inline constexpr std::uint32_t jointPromiseCount = 3;

/// The form that a method reads. In a batch, matrices are not copied to the palettes buffer but
/// read in place.
inline PaletteForm paletteForm(Method method) {
  if (method == Method::linear) return PaletteForm::matrices;
  return method == Method::logMatrix ? PaletteForm::logarithms : PaletteForm::dualQuaternions;
}

/// Matrices are copied, whether they scale or not.
Variant paletteVariant(PaletteForm form, JointPromise promise, bool rigged,
                       const DeviceLimits& limits, const Tuning& tuning);
/// The clear kernel, the visibility kernel, or the one that lists morph targets.
Variant variantOf(Kernel kernel, const DeviceLimits& limits, const Tuning& tuning);
/// Of the kernels that sample clips, and of those that compute what rigs drive.
Variant poseVariant(Kernel kernel, const DeviceLimits& limits, const Tuning& tuning);

/// The skin kernel for a job, except for the members that `chooseForm` sets. It depends on nothing
/// else in the batch.
Variant layoutVariant(const Job& job, const DeviceLimits& limits, const Tuning& tuning);

/// All inputs of `layoutVariant`, for one device and tuning. Consecutive instances mostly have the
/// same.
struct LayoutNeeds {
  LayoutNeeds() = default;
  LayoutNeeds(const Job& job, const OutputStreams& streams);
  bool areThoseOf(const Job& job, const OutputStreams& streams) const;

  Method method = Method::dualQuaternion;
  bool motion = false;
  bool bounds = false;
  VertexFormat positions = VertexFormat::none, normals = VertexFormat::none,
               tangents = VertexFormat::none;
  std::uint32_t relations = 0;
  ByStream<std::uint32_t> strides{}, residues{};
};

/// The inputs of `chooseForm`, besides the method.
struct FormNeeds {
  std::uint32_t influences = 0;  ///< maximum of a vertex
  bool full = false;             ///< every vertex has that many
  bool scales = false;           ///< a palette that the kernel reads may scale
  bool morphs = false;           ///< a morph target is active

  friend bool operator==(const FormNeeds&, const FormNeeds&) = default;
};

FormNeeds formNeeds(const Job& job, bool mayScale);
/// Sets `influences`, `fullInfluences`, `scales` and `morphs` of the variant.
void chooseForm(const FormNeeds& needs, Variant& variant);

/// Whether kernels on the device may store an attribute, or all of a vertex, at once.
inline bool storesWidely(const DeviceLimits& limits) {
  return limits.texelBuffers && limits.maxStorageBuffersPerStage >= storageBuffersWanted;
}

/// Whether the normals of a job directly follow its positions, both are float32x3, and their stride
/// is a multiple of 8. A kernel can then store them 8 bytes at a time.
inline bool standsInPairs(const Job& job) {
  return job.places[Stream::positions].format == VertexFormat::float32x3 &&
         job.places[Stream::normals].format == VertexFormat::float32x3 &&
         job.places[Stream::normals].offset == job.places[Stream::positions].offset + 12 &&
         job.places[Stream::normals].stride == job.places[Stream::positions].stride &&
         job.places[Stream::positions].stride % 8 == 0;
}

/// Whether attributes of these formats are joined before they are stored, since some are not whole
/// words.
constexpr bool shareWords(VertexFormat positions, VertexFormat normals, VertexFormat tangents) {
  return (formatSize(positions) | formatSize(normals) | formatSize(tangents)) % 4 != 0;
}

/// Whether a job has normals or tangents, and they directly follow the positions of each vertex. A
/// kernel may then store the whole vertex at once.
inline bool standsTogether(const OutputStreams& streams) {
  const OutputStream &positions = streams[0], &normals = streams[1], &tangents = streams[2];
  const std::uint64_t end = positions.offset + positions.size;
  const auto standsAt = [&](const OutputStream& stream, std::uint64_t offset) {
    return stream.size == 0 || (stream.offset == offset && stream.stride == positions.stride);
  };
  return normals.size + tangents.size != 0 && standsAt(normals, end) &&
         standsAt(tangents, end + normals.size);
}

}  // namespace dermis
