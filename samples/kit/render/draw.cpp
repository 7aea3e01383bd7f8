#include "kit/render/draw.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
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

namespace {

/// Linear; the same as in shaders/mesh.frag.
constexpr std::array<std::array<float, 3>, 5> stops{{{0.10f, 0.13f, 0.22f},
                                                     {0.05f, 0.32f, 0.42f},
                                                     {0.25f, 0.60f, 0.30f},
                                                     {0.90f, 0.65f, 0.10f},
                                                     {0.75f, 0.05f, 0.03f}}};

std::uint8_t encoded(float linear) {
  const float value =
      linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
  return static_cast<std::uint8_t>(std::lround(255 * std::clamp(value, 0.f, 1.f)));
}

}  // namespace

std::array<std::uint8_t, 3> heatColor(float value) {
  const float place = std::clamp(value, 0.f, 1.f) * 4;
  const std::size_t stop = std::min(static_cast<std::size_t>(place), std::size_t{3});
  const float share = place - static_cast<float>(stop);
  std::array<std::uint8_t, 3> color{};
  for (std::size_t i = 0; i < 3; ++i)
    color[i] = encoded(std::lerp(stops[stop][i], stops[stop + 1][i], share));
  return color;
}

namespace {

float determinant(const JointMatrix& matrix) {
  const auto& m = matrix.m;
  return m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
         m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
         m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
}

}  // namespace

bool isMirrored(std::span<const JointMatrix> pose) {
  const auto mirrored =
      std::ranges::count_if(pose, [](const JointMatrix& joint) { return determinant(joint) < 0; });
  return static_cast<std::size_t>(mirrored) * 2 > pose.size();
}

}  // namespace dermis::samples::render
