// Packs, plans and skins with dermis::core, and prints numbers for everything that crosses the
// interface: two builds of this program must print the same.

#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <numeric>
#include <vector>

#include "dermis/dermis.h"

namespace {

using namespace dermis;

constexpr std::uint32_t vertexCount = 200, jointCount = 5;

/// FNV-1a.
std::uint64_t hashOf(std::span<const std::byte> bytes) {
  std::uint64_t hash = 0xcbf29ce484222325u;
  for (const std::byte byte : bytes)
    hash = (hash ^ static_cast<std::uint64_t>(byte)) * 0x100000001b3u;
  return hash;
}

void print(const char* name, std::uint64_t value) {
  std::printf("%s %016llx\n", name, static_cast<unsigned long long>(value));
}

struct Vertex {
  float position[3], normal[3], weights[3];
  std::uint8_t joints[3];
};

std::vector<Vertex> makeVertices() {
  std::vector<Vertex> vertices(vertexCount);
  for (std::uint32_t i = 0; i < vertexCount; ++i) {
    const float f = static_cast<float>(i);
    vertices[i] = {{std::sin(f), 0.01f * f, std::cos(f)},
                   {std::sin(f), 0, std::cos(f)},
                   {0.5f, 0.25f, 0.125f * static_cast<float>(i % 3)},
                   {static_cast<std::uint8_t>(i % 5), static_cast<std::uint8_t>(i % 4),
                    static_cast<std::uint8_t>(i % 3)}};
  }
  return vertices;
}

std::vector<JointMatrix> makePose() {
  std::vector<JointMatrix> pose(jointCount);
  for (std::uint32_t joint = 0; joint < jointCount; ++joint) {
    const float angle = 0.7f * static_cast<float>(joint);
    const float c = std::cos(angle), s = std::sin(angle);
    pose[joint] = {{{c, -s, 0, 0.1f * angle}, {s, c, 0, 0}, {0, 0, 1.25f, -angle}}};
  }
  return pose;
}

void printSizes() {
  std::printf("sizes %zu %zu %zu %zu %zu %zu %zu %zu %zu %zu %zu %zu %zu\n", sizeof(JointMatrix),
              sizeof(AttributeView), sizeof(MeshView), sizeof(PackedMesh), sizeof(Palette),
              sizeof(Job), sizeof(Batch), sizeof(Dispatch), sizeof(Plan), sizeof(Comparison),
              sizeof(reference::Conditioning), sizeof(reference::SkinnedMesh),
              sizeof(RepairedMesh));
}

/// Rounded, for the arithmetic of GLM is the engine's own.
void printGlm() {
  const glm::dvec3 axis(0, 0, 1);
  const DualQuatd q = fromRotationTranslation(glm::angleAxis(0.5, axis), glm::dvec3(1, 2, 3));
  const glm::dvec3 p = transformPoint(screwInterpolate(q, q * q, 0.3), glm::dvec3(1, 1, 1));
  glm::mat4 matrix(1.0f);
  matrix[3] = glm::vec4(4, 5, 6, 1);
  const JointMatrix joint = toJointMatrix(matrix);
  const glm::mat4x3 back = toGlm(joint);
  std::printf("glm %.5f %.5f %.5f, %.1f %.1f %.1f %.1f\n", p.x, p.y, p.z,
              static_cast<double>(joint.m[0][3]), static_cast<double>(joint.m[1][3]),
              static_cast<double>(joint.m[2][3]), static_cast<double>(back[3].y));
}

int fail(const Error& error) {
  std::printf("%s: %s\n", std::string(errorCodeName(error.code)).c_str(), error.message.c_str());
  return 1;
}

}  // namespace

int main() {
  printSizes();
  printGlm();

  const std::vector<Vertex> vertices = makeVertices();
  const Vertex& first = vertices[0];
  constexpr std::uint32_t stride = sizeof(Vertex);
  InfluenceSet influences;
  influences.joints = {first.joints, vertexCount, stride, ComponentType::uint8, 3};
  influences.weights = {first.weights, vertexCount, stride, ComponentType::float32, 3};
  MeshView mesh;
  mesh.name = "mesh";
  mesh.vertexCount = vertexCount;
  mesh.positions = {first.position, vertexCount, stride, ComponentType::float32, 3};
  mesh.normals = {first.normal, vertexCount, stride, ComponentType::float32, 3};
  mesh.influenceSets = {&influences, 1};
  for (const Finding& finding : validate(mesh, jointCount).findings)
    std::printf("%s: %llu\n", problemName(finding.problem),
                static_cast<unsigned long long>(finding.count));

  const Result<PackedMesh> packed = pack(mesh, jointCount);
  if (!packed) return fail(packed.error());
  print("packed", hashOf(packed->bytes()));
  const Result<PackedMesh> loaded = PackedMesh::fromBytes(packed->bytes());
  if (!loaded) return fail(loaded.error());

  const Palette palette{jointCount, 0, true};
  std::vector<Job> jobs(3);
  for (std::uint32_t index = 0; index < jobs.size(); ++index) {
    jobs[index].mesh = loaded->info();
    jobs[index].method = index == 1 ? Method::linear : Method::dualQuaternion;
    jobs[index].positions = {std::uint64_t{index} * vertexCount * 24, 24};
    jobs[index].normals = {std::uint64_t{index} * vertexCount * 24 + 12, 24};
  }
  Batch batch;
  batch.palettes = {&palette, 1};
  batch.jobs = jobs;
  batch.meshesSize = loaded->bytes().size();
  batch.matricesSize = jointCount * sizeof(JointMatrix);
  batch.outputSize = std::uint64_t{jobs.size()} * vertexCount * 24;
  Plan planned;
  if (Result<void> done = makePlan(batch, DeviceLimits{}, Tuning{}, planned); !done)
    return fail(done.error());
  std::vector<std::byte> tables(planned.buffer(BufferRole::tables).size);
  if (Result<void> done = writeTables(planned, tables); !done) return fail(done.error());
  std::printf("dispatches %zu\n", planned.dispatches().size());
  print("tables", hashOf(tables));

  const std::vector<JointMatrix> pose = makePose();
  for (const Method method : allMethods) {
    const Result<reference::SkinnedMesh> skinned = reference::skin(mesh, pose, method);
    if (!skinned) return fail(skinned.error());
    print(std::string(methodName(method)).c_str(),
          hashOf(std::as_bytes(std::span(skinned->positions))) ^
              hashOf(std::as_bytes(std::span(skinned->normals))));
    double bounds = 0;
    for (const reference::Conditioning& conditioning : skinned->conditioning)
      bounds += positionBound(method, conditioning) + normalBound(method, conditioning);
    std::printf("bounds %.17g\n", bounds);

    std::vector<float> rounded;
    for (const reference::Double3& position : skinned->positions)
      for (const double coordinate : position) rounded.push_back(static_cast<float>(coordinate));
    const Result<Comparison> comparison =
        compare(*skinned, floatAttribute(rounded.data(), vertexCount, 3), {}, method);
    if (!comparison) return fail(comparison.error());
    std::printf("compared %llu, %s\n", static_cast<unsigned long long>(comparison->compared),
                comparison->passed() ? "passed" : "failed");
  }
  return 0;
}
