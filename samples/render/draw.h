// One draw of a picture: skinned vertices, where Dermis wrote them, and how their surface looks.
#pragma once

#include <array>
#include <cstdint>

#include <vulkan/vulkan_core.h>

#include "dermis/types.h"
#include "dermis/vertex_format.h"
#include "geometry.h"

namespace dermis::samples::render {

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
  /// float32x3, float32x4 or float16x4. The barrier between what wrote them and the draw,
  /// `vulkan::outputScope(Consumer::vertexInput)`, is the caller's.
  VertexStream positions;
  /// Any that `isNormalFormat` allows, but three components of 1 or 2 bytes; or none: the surface
  /// is then flat between its edges.
  VertexStream normals;
  /// One float32 a vertex, 0 to 1, shown as a color instead of the base color: a heat map. Its
  /// format is not looked at; no buffer: there is none.
  VertexStream values;
  const Geometry* geometry = nullptr;  ///< as many vertices as are skinned
  Surface surface;
  JointMatrix transform;    ///< to the world: turned, moved, and scaled by one number
  bool isMirrored = false;  ///< The pose has turned the triangles inside out.
};

}  // namespace dermis::samples::render
