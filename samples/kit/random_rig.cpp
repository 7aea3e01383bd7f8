#include "kit/random_rig.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include <glm/geometric.hpp>
#include <glm/gtc/packing.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>

namespace dermis::samples {
namespace {

class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  std::uint32_t below(std::uint32_t count) {
    return std::uniform_int_distribution<std::uint32_t>(0, count - 1)(engine_);
  }
  glm::dvec3 direction() {
    std::normal_distribution<double> normal;
    return glm::normalize(glm::dvec3(normal(engine_), normal(engine_), normal(engine_)));
  }
  glm::dquat rotation() {
    std::normal_distribution<double> normal;
    return glm::normalize(
        glm::dquat(normal(engine_), normal(engine_), normal(engine_), normal(engine_)));
  }

 private:
  std::mt19937 engine_;
};

glm::dmat3 diagonal(double x, double y, double z) {
  return glm::dmat3(glm::dvec3(x, 0, 0), glm::dvec3(0, y, 0), glm::dvec3(0, 0, z));
}

glm::dmat3 scaleShear(Random& random, Rigidity rigidity) {
  if (rigidity == Rigidity::rigid) return glm::dmat3(1.0);
  if (rigidity == Rigidity::uniformScale) return glm::dmat3(random.between(0.5, 100));
  if (rigidity == Rigidity::mirrored && random.below(2) == 0) {
    // A reflection and nothing else, the commonest mirror: its columns are orthonormal.
    glm::dmat3 mirror(1.0);
    const auto axis = static_cast<int>(random.below(3));
    mirror[axis][axis] = -1;
    return mirror;
  }
  const glm::dmat3 frame = glm::mat3_cast(random.rotation());
  const glm::dmat3 stretch =
      diagonal(random.between(0.5, 2), random.between(0.5, 2), random.between(0.5, 2));
  if (rigidity == Rigidity::mirroredAlongOneAxis) {
    // Factors down to 0.01 make some of the joints nearly flat.
    const glm::dmat3 mirror = diagonal(1, random.between(0.1, 2), -random.between(0.01, 2));
    return frame * mirror * glm::transpose(frame);
  }
  const glm::dmat3 symmetric = frame * stretch * glm::transpose(frame);
  return rigidity == Rigidity::mirrored ? symmetric * -1.0 : symmetric;
}

void append(std::vector<float>& values, const glm::dvec3& vector, double scale = 1) {
  for (int i = 0; i < 3; ++i) values.push_back(static_cast<float>(scale * vector[i]));
}

void addMethodInputs(OwnedMesh& mesh, Random random) {
  const auto share = [&random] {
    return static_cast<float>(std::clamp(random.between(-0.2, 1.2), 0.0, 1.0));
  };
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
    mesh.dualQuaternionWeights.push_back(share());
    mesh.bulgeStrengths.push_back(share());
    append(mesh.centersOfRotation, random.direction(), random.between(0, 1));
  }
}

AttributeView vectors(const std::vector<float>& values, std::uint32_t components) {
  if (values.empty()) return {};
  return attributeView(values.data(), static_cast<std::uint32_t>(values.size() / components),
                       components);
}

}  // namespace

MeshView OwnedMesh::view() {
  MeshView mesh;
  mesh.name = name;
  mesh.vertexCount = vertexCount();
  mesh.positions = vectors(positions, 3);
  mesh.normals = vectors(normals, 3);
  mesh.tangents = vectors(tangents, 4);
  set.joints = {joints.data(), vertexCount(), influencesPerVertex * 4, ComponentType::uint32,
                influencesPerVertex};
  set.weights = attributeView(weights.data(), vertexCount(), influencesPerVertex);
  mesh.influenceSets = {&set, 1};
  mesh.dualQuaternionWeights = vectors(dualQuaternionWeights, 1);
  mesh.bulgeStrengths = vectors(bulgeStrengths, 1);
  mesh.centersOfRotation = vectors(centersOfRotation, 3);
  morphViews.clear();
  for (const OwnedMorph& morph : morphs) {
    MorphTargetView& target = morphViews.emplace_back();
    target.vertices = morph.vertices;
    target.positions = vectors(morph.positions, 3);
    target.normals = vectors(morph.normals, 3);
    target.tangents = vectors(morph.tangents, 3);
  }
  mesh.morphTargets = morphViews;
  return mesh;
}

void addTangents(OwnedMesh& mesh, std::uint32_t seed) {
  Random random(seed);
  for (std::uint32_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
    append(mesh.tangents, random.direction());
    mesh.tangents.push_back(random.below(2) == 0 ? -1.0f : 1.0f);
  }
}

void addMorphs(OwnedMesh& mesh, std::uint32_t seed, std::uint32_t count) {
  Random random(seed);
  for (std::uint32_t target = 0; target < count; ++target) {
    OwnedMorph& morph = mesh.morphs.emplace_back();
    for (std::uint32_t vertex = 0; vertex < mesh.vertexCount(); ++vertex) {
      if (random.below(3) != 0 && !(vertex == 0 && target == 0)) continue;
      morph.vertices.push_back(vertex);
      append(morph.positions, random.direction(), 0.3);
      if (!mesh.normals.empty()) append(morph.normals, random.direction(), 0.3);
      if (!mesh.tangents.empty()) append(morph.tangents, random.direction(), 0.3);
    }
    // An empty list of vertices would mean all of them.
    if (morph.vertices.empty()) {
      morph.vertices = {0};
      append(morph.positions, random.direction(), 0.3);
    }
  }
}

OwnedMesh randomMesh(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t jointCount,
                     std::uint32_t influences, bool normals) {
  Random random(seed);
  OwnedMesh mesh;
  mesh.influencesPerVertex = influences;
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    const glm::dvec3 normal = random.direction();
    for (int i = 0; i < 3; ++i) mesh.positions.push_back(static_cast<float>(random.between(-1, 1)));
    if (normals) {
      for (int i = 0; i < 3; ++i) mesh.normals.push_back(static_cast<float>(normal[i]));
    }
    const std::uint32_t used = random.below(50) == 0 ? 0 : 1 + random.below(influences);
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      mesh.joints.push_back(random.below(jointCount));
      mesh.weights.push_back(slot < used ? static_cast<float>(random.between(0.01, 1)) : 0.0f);
    }
  }
  addMethodInputs(mesh, Random(seed + 1));
  return mesh;
}

std::vector<JointMatrix> randomPose(std::uint32_t seed, std::uint32_t jointCount, Rigidity rigidity,
                                    double reach) {
  Random random(seed);
  std::vector<JointMatrix> pose(jointCount);
  for (JointMatrix& matrix : pose) {
    const glm::dmat3 linear = glm::mat3_cast(random.rotation()) * scaleShear(random, rigidity);
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        matrix.m[row][column] = static_cast<float>(linear[column][row]);
      matrix.m[row][3] = static_cast<float>(random.between(-reach, reach));
    }
  }
  return pose;
}

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
