#include "kit/stored_mesh.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <glm/gtc/packing.hpp>

namespace dermis::samples {
namespace {

/// Integer formats store values from −1 to 1 (unorm: 0 to 1), so positions and displacements are
/// divided by this.
constexpr double positionRange = 2;

template <typename T>
void put(std::byte* place, T value) {
  std::memcpy(place, &value, sizeof(T));
}

void putReal(std::byte* place, ComponentType type, double value) {
  switch (type) {
    case ComponentType::float16:
      return put(place, glm::packHalf1x16(static_cast<float>(value)));
    case ComponentType::snorm8:
      return put(place, static_cast<std::int8_t>(std::lround(value * 127)));
    case ComponentType::snorm16:
      return put(place, static_cast<std::int16_t>(std::lround(value * 32767)));
    case ComponentType::unorm8:
      return put(place, static_cast<std::uint8_t>(std::lround(value * 255)));
    case ComponentType::unorm16:
      return put(place, static_cast<std::uint16_t>(std::lround(value * 65535)));
    default:
      return put(place, static_cast<float>(value));
  }
}

void putUnsigned(std::byte* place, ComponentType type, std::uint32_t value) {
  switch (type) {
    case ComponentType::uint8:
      return put(place, static_cast<std::uint8_t>(value));
    case ComponentType::uint16:
      return put(place, static_cast<std::uint16_t>(value));
    default:
      return put(place, value);
  }
}

bool isInteger(ComponentType type) {
  return type == ComponentType::snorm16 || type == ComponentType::unorm16;
}

}  // namespace

AttributeView StoredMesh::store(const std::vector<float>& values, std::uint32_t components,
                                ComponentType type, double scale) {
  if (values.empty()) return {};
  const auto count = static_cast<std::uint32_t>(values.size() / components);
  const std::uint32_t stride = components * componentSize(type) + formats_.gap;
  std::vector<std::byte>& bytes = arrays_.emplace_back(std::size_t{count} * stride);
  for (std::uint32_t element = 0; element < count; ++element) {
    for (std::uint32_t component = 0; component < components; ++component) {
      double value = static_cast<double>(values[std::size_t{element} * components + component]);
      value /= scale;
      if (type == ComponentType::unorm16) value = value / 2 + 0.5;
      putReal(bytes.data() + std::size_t{element} * stride + component * componentSize(type), type,
              value);
    }
  }
  return {bytes.data(), count, stride, type, components};
}

AttributeView StoredMesh::storeShares(const std::vector<float>& values) {
  if (values.empty()) return {};
  const std::uint32_t stride = componentSize(formats_.weights) + formats_.gap;
  std::vector<std::byte>& bytes = arrays_.emplace_back(values.size() * stride);
  for (std::size_t vertex = 0; vertex < values.size(); ++vertex)
    putReal(bytes.data() + vertex * stride, formats_.weights, static_cast<double>(values[vertex]));
  return {bytes.data(), vertexCount_, stride, formats_.weights, 1};
}

StoredMesh::StoredMesh(const OwnedMesh& mesh, const InputFormats& formats)
    : vertexCount_(mesh.vertexCount()), formats_(formats) {
  const double scale = isInteger(formats.positions) ? positionRange : 1;
  positions_ = store(mesh.positions, 3, formats.positions, scale);
  normals_ = store(mesh.normals, 3, formats.directions, 1);
  tangents_ = store(mesh.tangents, 4, formats.directions, 1);
  dualQuaternionWeights_ = storeShares(mesh.dualQuaternionWeights);
  bulgeStrengths_ = storeShares(mesh.bulgeStrengths);
  centersOfRotation_ = store(mesh.centersOfRotation, 3, ComponentType::float32, 1);

  const std::uint32_t influences = mesh.influencesPerVertex;
  for (std::uint32_t first = 0; first < influences; first += formats.setSize) {
    const std::uint32_t size = std::min(formats.setSize, influences - first);
    const std::uint32_t jointStride = size * componentSize(formats.joints) + formats.gap;
    const std::uint32_t weightStride = size * componentSize(formats.weights) + formats.gap;
    std::vector<std::byte> joints(std::size_t{vertexCount_} * jointStride);
    std::vector<std::byte> weights(std::size_t{vertexCount_} * weightStride);
    for (std::uint32_t vertex = 0; vertex < vertexCount_; ++vertex) {
      for (std::uint32_t slot = 0; slot < size; ++slot) {
        const std::size_t source = std::size_t{vertex} * influences + first + slot;
        putUnsigned(joints.data() + std::size_t{vertex} * jointStride +
                        slot * componentSize(formats.joints),
                    formats.joints, mesh.joints[source]);
        putReal(weights.data() + std::size_t{vertex} * weightStride +
                    slot * componentSize(formats.weights),
                formats.weights, static_cast<double>(mesh.weights[source]));
      }
    }
    InfluenceSet& set = sets_.emplace_back();
    set.joints = {joints.data(), vertexCount_, jointStride, formats.joints, size};
    set.weights = {weights.data(), vertexCount_, weightStride, formats.weights, size};
    arrays_.push_back(std::move(joints));
    arrays_.push_back(std::move(weights));
  }

  const ComponentType displacements =
      formats.positions == ComponentType::unorm16 ? ComponentType::snorm16 : formats.positions;
  for (const OwnedMorph& morph : mesh.morphs) {
    MorphTargetView& target = morphs_.emplace_back();
    target.vertices = morphVertices_.emplace_back(morph.vertices);
    target.positions = store(morph.positions, 3, displacements, scale);
    target.normals = store(morph.normals, 3, formats.directions, 1);
    target.tangents = store(morph.tangents, 3, formats.directions, 1);
    const auto factor = static_cast<float>(scale);
    target.positionScale = {factor, factor, factor};
  }
}

MeshView StoredMesh::view() const {
  MeshView mesh;
  mesh.name = "random";
  mesh.vertexCount = vertexCount_;
  mesh.positions = positions_;
  if (isInteger(formats_.positions)) {
    // unorm16 goes from 0 to 1, snorm16 from -1 to 1.
    const bool isUnsigned = formats_.positions == ComponentType::unorm16;
    const auto range = static_cast<float>(positionRange);
    mesh.positionScale.fill(isUnsigned ? 2 * range : range);
    mesh.positionOffset.fill(isUnsigned ? -range : 0);
  }
  mesh.normals = normals_;
  mesh.tangents = tangents_;
  mesh.influenceSets = sets_;
  mesh.morphTargets = morphs_;
  mesh.dualQuaternionWeights = dualQuaternionWeights_;
  mesh.bulgeStrengths = bulgeStrengths_;
  mesh.centersOfRotation = centersOfRotation_;
  return mesh;
}

}  // namespace dermis::samples
