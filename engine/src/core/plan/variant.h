// The specialization of a kernel, for which a `PipelineId` stands.
#pragma once

#include <cstdint>

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

}  // namespace dermis
