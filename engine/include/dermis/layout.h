// What is written: methods, formats, and how the attributes of skinned vertices are arranged.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "dermis/result.h"

// ---- How the attributes of skinned vertices are stored in the engine's vertex buffers.

namespace dermis {

/// The index of nothing, for example of the parent of a root.
inline constexpr std::uint32_t noIndex = 0xffffffff;

/// An axis-aligned box.
struct Box {
  float min[3] = {0, 0, 0};  ///< x, y, z
  float max[3] = {0, 0, 0};  ///< x, y, z
};

/// The format of one attribute. Components are consecutive and little-endian, without padding. All
/// formats round to nearest. The fourth component of `x4` formats is 1 for positions, 0 for
/// normals, and the handedness (1 or -1) for tangents.
///
/// - float16: IEEE 754 binary16. Ties round to even. Values that are too large become infinite.
/// - snorm8, snorm16: component c is stored as round(127 c) or round(32767 c). Positions are
///   relative to a box: c = (p - center) / (half of its size). Positions outside the box are
///   clamped, and counted in `InstanceResult`.
/// - octahedral: the direction is divided by |x| + |y| + |z|, and its lower half is folded outwards
///   (Meyer et al. 2010, "On floating-point normal vectors"). x and y are stored as snorm. A zero
///   vector has no encoding; it becomes (0, 0, 1).
/// - octahedral, for tangents: the sign of the second component is the handedness. Let L = 127 or
///   32767 be the maximum integer. y is stored as q = 1 + round((y + 1) / 2 · (L - 1)), from 1 to
///   L, and q is negated if the handedness is -1. To decode: y = 2 (|q| - 1) / (L - 1) - 1.
enum class VertexFormat : std::uint8_t {
  none = 0,  ///< the attribute is not written
  float32x3 = 1,
  float32x4 = 2,
  float16x3 = 3,
  float16x4 = 4,
  snorm16x3 = 5,
  snorm16x4 = 6,
  snorm8x3 = 7,  ///< `cpu::skin` only: no run with it is whole words (`OutputAttribute`)
  snorm8x4 = 8,
  octahedral16x2 = 9,
  octahedral8x2 = 10,
};

/// All formats except `none`.
inline constexpr std::array<VertexFormat, 10> allVertexFormats{
    VertexFormat::float32x3,    VertexFormat::float32x4, VertexFormat::float16x3,
    VertexFormat::float16x4,    VertexFormat::snorm16x3, VertexFormat::snorm16x4,
    VertexFormat::snorm8x3,     VertexFormat::snorm8x4,  VertexFormat::octahedral16x2,
    VertexFormat::octahedral8x2};

/// Bytes of one element; 0 for `none`.
constexpr std::uint32_t formatSize(VertexFormat format) {
  constexpr std::uint32_t sizes[] = {0, 12, 16, 6, 8, 6, 8, 3, 4, 4, 2};
  const auto index = static_cast<std::size_t>(format);
  return index < std::size(sizes) ? sizes[index] : 0;
}

/// Bytes of one component; 1 for `none`. For vertex input, the offset of an attribute must be a
/// multiple of it.
DERMIS_CORE_API std::uint32_t formatAlignment(VertexFormat format);

/// The name of the format, for example "snorm16x4".
DERMIS_CORE_API std::string_view formatName(VertexFormat format);

/// Whether positions in this format are relative to a box.
constexpr bool isSnormPosition(VertexFormat format) {
  return format == VertexFormat::snorm16x3 || format == VertexFormat::snorm16x4;
}

/// Whether positions may have this format: float32, float16 or snorm16.
constexpr bool isPositionFormat(VertexFormat format) {
  return format == VertexFormat::float32x3 || format == VertexFormat::float32x4 ||
         format == VertexFormat::float16x3 || format == VertexFormat::float16x4 ||
         isSnormPosition(format);
}
/// Whether normals may have this format: any except `none`.
constexpr bool isNormalFormat(VertexFormat format) {
  return formatSize(format) != 0;
}
/// Whether tangents may have this format: those with four components, and octahedral ones.
constexpr bool isTangentFormat(VertexFormat format) {
  return format == VertexFormat::float32x4 || format == VertexFormat::float16x4 ||
         format == VertexFormat::snorm16x4 || format == VertexFormat::snorm8x4 ||
         format == VertexFormat::octahedral16x2 || format == VertexFormat::octahedral8x2;
}

/// Decodes a position in double precision, for tests and tools. `data` points to `formatSize` bytes
/// and needs no alignment. `box` is used for snorm16 only; if it has no extent along an axis, all
/// values have the same coordinate there. Returns zeros if the format is not `isPositionFormat`.
DERMIS_CORE_API std::array<double, 3> decodePosition(VertexFormat format, const void* data,
                                                     const Box& box);
/// Decodes a normal, as `decodePosition`. An octahedral normal has unit length; any other has the
/// length that it was stored with. Returns zeros if the format is not `isNormalFormat`.
DERMIS_CORE_API std::array<double, 3> decodeNormal(VertexFormat format, const void* data);
/// Decodes a tangent, as `decodeNormal`: x, y, z and the handedness. Returns zeros if the format is
/// not `isTangentFormat`.
DERMIS_CORE_API std::array<double, 4> decodeTangent(VertexFormat format, const void* data);

// ---- Where the attributes of skinned vertices are written: offset and stride for one instance
// (`OutputAttribute`), or a layout for many instances (`VertexLayout`).

/// Where one attribute of the skinned vertices is written. Vertex v is at `offset + v * stride` in
/// the output buffer of that attribute. Bytes between attributes are never written.
///
/// Positions, normals and tangents, in this order, form a run if they follow each other without a
/// gap and have the same stride. An attribute alone is a run, too; previous positions always are.
///
/// Rules of batches and scenes. For `cpu::skin` there is none but the minimum of the stride.
/// - A run begins at a multiple of 4 bytes. Its length and its stride are multiples of 4. For
///   example, float16x3 and octahedral8x2 are a run of 8 bytes; float32x3 and octahedral8x2 twice
///   are one of 16. But float16x3 alone needs float16x4 instead.
/// - All attributes must go to one buffer (`Batch::isOneOutput`) if positions, normals and
///   tangents, as far as they are written, are one run of at least two attributes, or if the size
///   of one of the three is not a multiple of 4 bytes.
/// - If positions and normals are float32x3, normals directly follow positions, and both have the
///   same stride, a multiple of 8: the offset of the positions must be a multiple of 8, and both
///   must be in one buffer, wherever tangents are.
struct OutputAttribute {
  std::uint64_t offset = 0;                  ///< bytes
  std::uint32_t stride = 0;                  ///< bytes, at least `formatSize(format)`
  VertexFormat format = VertexFormat::none;  ///< `none`: the attribute is not written
};

/// The attributes of skinned vertices.
enum class Stream : std::uint8_t {
  positions = 0,
  normals = 1,
  tangents = 2,
  /// For motion vectors: the positions that the output had before they were overwritten, so the
  /// output must persist between frames. They cost a read and a write.
  previousPositions = 3,
};
inline constexpr std::size_t streamCount = 4;  ///< number of values of `Stream`

/// A value for each attribute: `values[Stream::normals]`.
template <typename T>
struct ByStream : std::array<T, streamCount> {
  using std::array<T, streamCount>::operator[];
  /// The value of one attribute.
  constexpr T& operator[](Stream stream) { return (*this)[static_cast<std::size_t>(stream)]; }
  /// The value of one attribute.
  constexpr const T& operator[](Stream stream) const {
    return (*this)[static_cast<std::size_t>(stream)];
  }
  /// The same value for all attributes.
  static constexpr ByStream all(const T& value) { return {{value, value, value, value}}; }
};

/// The attributes of skinned vertices, their formats and their arrangement. Method and layout
/// decide which pipelines are needed (`PipelineNeeds`).
struct VertexLayout {
  VertexFormat positions = VertexFormat::float32x3;  ///< `isPositionFormat`
  /// `isNormalFormat`, or `none`. It must be `none` if the mesh has no normals.
  VertexFormat normals = VertexFormat::none;
  /// `isTangentFormat`, or `none`. It must be `none` if the mesh has no tangents.
  VertexFormat tangents = VertexFormat::none;
  /// Whether there are previous positions, in the format of the positions. In a scene: those of the
  /// last committed frame (of the update before, if an instance `interpolates`); the current ones
  /// if it was not visible in that frame, or motion restarts.
  bool motion = false;
  /// If false, vertices are interleaved: one after the other, each with its position, normal,
  /// tangent and previous position at multiples of `formatAlignment`. If true, there is one
  /// attribute after the other, each at a multiple of 48 bytes.
  bool planar = false;
  /// For interleaved layouts: bytes from one vertex to the next. It may leave room for attributes
  /// of the engine after those of Dermis. 0: the minimum, rounded up to a multiple of 4.
  std::uint32_t stride = 0;

  friend bool operator==(const VertexLayout&, const VertexLayout&) = default;
};

/// Where the attributes of all vertices of an instance are. `placeVertices` returns it.
struct VertexPlaces {
  /// Positions are required. Previous positions have the same format, or `none`.
  ByStream<OutputAttribute> attributes;
  std::uint64_t size = 0;  ///< bytes of all vertices
  /// Bytes: the offset of the vertices must be a multiple of this, which need not be a power of
  /// two. For interleaved layouts it is the stride, so that a draw can use `firstVertex`.
  std::uint64_t alignment = 1;

  /// Whether there are previous positions.
  bool hasMotion() const {
    return attributes[Stream::previousPositions].format != VertexFormat::none;
  }
  /// One attribute.
  OutputAttribute& operator[](Stream stream) { return attributes[stream]; }
  /// One attribute.
  const OutputAttribute& operator[](Stream stream) const { return attributes[stream]; }
};

/// Places `vertexCount` vertices at byte `offset` of a buffer. Fails with `invalidArgument`
/// - if a member of the layout is none of the values that it may have;
/// - if the stride is too small, or the layout is planar and has a stride;
/// - if `offset` is not a multiple of `VertexPlaces::alignment`.
DERMIS_CORE_API Result<VertexPlaces> placeVertices(const VertexLayout& layout,
                                                   std::uint32_t vertexCount,
                                                   std::uint64_t offset = 0);

// ---- The methods by which the joints of a vertex are blended.

/// How the joints of a vertex are blended. All methods use the same meshes and poses. If joints
/// scale or shear, all methods except `linear` blend in two phases: first the scale and shear parts
/// are blended linearly and applied in bind space, then the rigid parts are blended by the method.
/// docs/methods.md describes each.
enum class Method : std::uint8_t {
  /// Linear blend skinning: blends the joint matrices. The mesh collapses where joints twist.
  linear = 0,
  /// Dual-quaternion linear blending, DLB (Kavan et al. 2007, section 4). The mesh bulges where
  /// joints bend.
  dualQuaternion = 1,
  /// Dual-quaternion iterative blending, DIB (Kavan et al. 2008): refines the result of DLB in at
  /// most 20 steps. For comparison.
  dualQuaternionIterative = 2,
  /// Blends the logarithms of the rigid parts as matrices (Cordier and Magnenat-Thalmann 2005,
  /// Alexa 2002). May rotate the long way round. For comparison.
  logMatrix = 3,
  /// Spherical blend skinning (Kavan and Žára 2005): blends quaternions about a center of rotation
  /// that is computed for each vertex and pose. For comparison.
  sphericalBlend = 4,
  /// Blends quaternions and translations separately (Hejl 2004). The mesh tears at vertices whose
  /// joints do not meet. For comparison.
  quaternionTranslation = 5,
  /// Interpolates between `linear` and `dualQuaternion`, by `MeshView::dualQuaternionWeights`.
  blended = 6,
  /// Blends quaternions about centers of rotation that are computed once, at import (Le and Hodgins
  /// 2016). Does not collapse, and bulges less. Requires `MeshView::centersOfRotation`.
  centerOfRotation = 7,
  /// `dualQuaternion`, moved towards `centerOfRotation` by `MeshView::bulgeStrengths`. Requires
  /// `MeshView::centersOfRotation`.
  bulgeControlled = 8,
};

/// All methods, in the order of `Method`.
inline constexpr std::array<Method, 9> allMethods{
    Method::linear,    Method::dualQuaternion,   Method::dualQuaternionIterative,
    Method::logMatrix, Method::sphericalBlend,   Method::quaternionTranslation,
    Method::blended,   Method::centerOfRotation, Method::bulgeControlled};

/// Whether the method requires `MeshView::centersOfRotation`.
constexpr bool needsCentersOfRotation(Method method) {
  return method == Method::centerOfRotation || method == Method::bulgeControlled;
}

/// Whether the method is meant for comparison, not for use in an engine. The library may have been
/// built without its kernels (`DERMIS_COMPARISON_METHODS`).
constexpr bool isForComparison(Method method) {
  return method == Method::dualQuaternionIterative || method == Method::logMatrix ||
         method == Method::sphericalBlend || method == Method::quaternionTranslation;
}

/// The method's name on the command line and in reports: "linear", "dual_quaternion",
/// "dual_quaternion_iterative", "log_matrix", "spherical_blend", "quaternion_translation",
/// "blended", "center_of_rotation", "bulge_controlled".
DERMIS_CORE_API std::string_view methodName(Method method);

/// The method of that name; empty if there is none.
DERMIS_CORE_API std::optional<Method> methodFromName(std::string_view name);

}  // namespace dermis
