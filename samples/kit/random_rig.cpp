#include "kit/random_rig.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>
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
  return floatAttribute(values.data(), static_cast<std::uint32_t>(values.size() / components),
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
  set.weights = floatAttribute(weights.data(), vertexCount(), influencesPerVertex);
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

}  // namespace dermis::samples
