#include "kit/render/geometry.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace dermis::samples::render {
namespace {

std::uint16_t toUnorm16(float value) {
  // NaN becomes 0.
  return static_cast<std::uint16_t>(
      std::lround(std::clamp(value > 0 ? value : 0, 0.f, 1.f) * 65535));
}

StaticVertex vertexOf(const GeometryData& data, std::size_t index) {
  StaticVertex vertex{{0, 0}, {65535, 65535, 65535, 65535}};
  if (!data.texcoords.empty()) std::copy_n(&data.texcoords[index * 2], 2, vertex.texcoord);
  if (!data.colors.empty())
    std::transform(&data.colors[index * 4], &data.colors[index * 4] + 4, vertex.color, toUnorm16);
  return vertex;
}

}  // namespace

Result<Geometry> Geometry::create(Device& device, const GeometryData& data) {
  Geometry geometry;
  geometry.indexCount_ = static_cast<std::uint32_t>(data.triangles.size());
  Result<MappedBuffer> vertices = MappedBuffer::create(
      device, data.vertexCount * sizeof(StaticVertex), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
  if (!vertices) return vertices.error();
  geometry.vertices_ = std::move(*vertices);
  Result<MappedBuffer> indices =
      MappedBuffer::create(device, data.triangles.size_bytes(), VK_BUFFER_USAGE_INDEX_BUFFER_BIT);
  if (!indices) return indices.error();
  geometry.indices_ = std::move(*indices);

  std::byte* place = geometry.vertices_.bytes().data();
  for (std::size_t index = 0; index < data.vertexCount; ++index) {
    const StaticVertex vertex = vertexOf(data, index);
    std::memcpy(place + index * sizeof(vertex), &vertex, sizeof(vertex));
  }
  if (!data.triangles.empty()) {
    std::memcpy(geometry.indices_.bytes().data(), data.triangles.data(),
                data.triangles.size_bytes());
  }
  return geometry;
}

}  // namespace dermis::samples::render
