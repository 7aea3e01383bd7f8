// The data of a mesh that skinning does not change.
#pragma once

#include <cstdint>
#include <span>

#include "kit/buffer.h"

namespace dermis::samples::render {

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

}  // namespace dermis::samples::render
