// One draw of a picture: skinned vertices in the buffer that Dermis wrote, and their surface.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include <vulkan/vulkan_core.h>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "kit/buffer.h"

namespace dermis::samples::render {

/// The data of a mesh that skinning does not change.
struct GeometryData {
  std::uint32_t vertexCount = 0;
  std::span<const std::uint32_t> triangles;  ///< 3 indices each, all below `vertexCount`
  std::span<const float> texcoords;          ///< 2 per vertex, or empty
  std::span<const float> colors;             ///< 4 per vertex, linear; empty: white
};

/// The layout in the vertex buffer.
struct StaticVertex {
  float texcoord[2];
  std::uint16_t color[4];
};
static_assert(sizeof(StaticVertex) == 16);

class Geometry {
 public:
  static Result<Geometry> create(Device& device, const GeometryData& data);

  VkBuffer vertices() const { return vertices_.handle(); }
  VkBuffer indices() const { return indices_.handle(); }
  std::uint32_t indexCount() const { return indexCount_; }

 private:
  MappedBuffer vertices_, indices_;
  std::uint32_t indexCount_ = 0;
};

/// An attribute of the vertices: vertex v at `offset + v * stride` of a buffer with
/// VK_BUFFER_USAGE_VERTEX_BUFFER_BIT.
struct VertexStream {
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
  std::uint32_t stride = 0;
  VertexFormat format = VertexFormat::none;  ///< `none`: there is no such attribute
};

enum class Transparency : std::uint8_t { opaque, mask, blend };

struct Surface {
  std::array<float, 4> baseColor{1, 1, 1, 1};  ///< linear, and alpha
  std::uint32_t texture = 0;                   ///< `Renderer::addTexture`; 0: white
  float metallic = 0;
  float roughness = 0.8f;
  Transparency transparency = Transparency::opaque;
  float alphaCutoff = 0.5f;
  bool isDoubleSided = false;
};

struct Draw {
  /// float32x3, float32x4 or float16x4. The caller must record the barrier between the writes and
  /// the draw, `vulkan::barrierBetween(Use::dermis, Use::vertexInput)`.
  VertexStream positions;
  /// Any format that `isNormalFormat` allows, except three components of 1 or 2 bytes; or none, for
  /// flat shading.
  VertexStream normals;
  /// Heat map: one float32 per vertex, from 0 to 1, shown as a color instead of the base color. The
  /// format is ignored. No buffer: no heat map.
  VertexStream values;
  const Geometry* geometry = nullptr;  ///< must have as many vertices as are skinned
  Surface surface;
  JointMatrix transform;    ///< to the world: rotation, translation and uniform scale
  bool isMirrored = false;  ///< the pose has turned the triangles inside out
};

/// The color of a value from 0 to 1 in sRGB: that of shaders/mesh.frag for a surface in uniform
/// white light.
std::array<std::uint8_t, 3> heatColor(float value);

/// Whether most joints of a pose mirror. Then skinning reverses the winding order.
bool isMirrored(std::span<const JointMatrix> pose);

}  // namespace dermis::samples::render
