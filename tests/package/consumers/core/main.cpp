// Packs, bounds, plans and skins with dermis::core, and prints numbers for everything that crosses
// the interface: two builds of this program must print the same.

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <string>
#include <vector>

#include <glm/mat4x3.hpp>
#include <glm/mat4x4.hpp>

#include "dermis/layout.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"
#include "dermis/verify.h"

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

/// A vertex as the engine's assets have it.
struct BindVertex {
  float position[3], normal[3], tangent[4], weights[3];
  std::uint8_t joints[3];
  std::uint8_t bulgeStrength;
  float center[3];
};

/// A vertex as the engine draws it: 20 bytes, all of them filled by Dermis.
struct SkinnedVertex {
  std::int16_t position[4];  ///< within a box that every instance has for itself
  std::int8_t normal[4];
  std::int16_t tangent[4];
};

/// A ring of columns, with a morph target that lifts every fourth vertex and turns its normal.
struct Model {
  std::vector<BindVertex> vertices{vertexCount};
  std::vector<std::uint32_t> lifted;
  std::vector<float> lift, turn;
  InfluenceSet influences;
  MorphTargetView morphTarget;

  Model() {
    for (std::uint32_t i = 0; i < vertexCount; ++i) {
      const float f = static_cast<float>(i);
      vertices[i] = {{std::sin(f), 0.01f * f, std::cos(f)},
                     {std::sin(f), 0, std::cos(f)},
                     {std::cos(f), 0, -std::sin(f), i % 2 == 0 ? 1.0f : -1.0f},
                     {0.5f, 0.25f, 0.125f * static_cast<float>(i % 3)},
                     {static_cast<std::uint8_t>(i % 5), static_cast<std::uint8_t>(i % 4),
                      static_cast<std::uint8_t>(i % 3)},
                     static_cast<std::uint8_t>(i),
                     {0, 0.01f * f, 0}};
      if (i % 4 != 0) continue;
      lifted.push_back(i);
      lift.insert(lift.end(), {0, 0.5f, 0});
      turn.insert(turn.end(), {0, 0.25f, 0});
    }
  }

  /// Valid while the model lives and stays where it is.
  MeshView view() {
    constexpr std::uint32_t stride = sizeof(BindVertex);
    const BindVertex& first = vertices[0];
    influences.joints = {first.joints, vertexCount, stride, ComponentType::uint8, 3};
    influences.weights = attributeView(first.weights, vertexCount, 3, stride);
    const auto displaced = static_cast<std::uint32_t>(lifted.size());
    morphTarget.vertices = lifted;
    morphTarget.positions = attributeView(lift.data(), displaced, 3);
    morphTarget.normals = attributeView(turn.data(), displaced, 3);
    MeshView mesh;
    mesh.name = "ring";
    mesh.vertexCount = vertexCount;
    mesh.positions = attributeView(first.position, vertexCount, 3, stride);
    mesh.normals = attributeView(first.normal, vertexCount, 3, stride);
    mesh.tangents = attributeView(first.tangent, vertexCount, 4, stride);
    mesh.influenceSets = {&influences, 1};
    mesh.morphTargets = {&morphTarget, 1};
    mesh.dualQuaternionWeight = 0.75f;
    mesh.bulgeStrengths = {&first.bulgeStrength, vertexCount, stride, ComponentType::unorm8, 1};
    mesh.centersOfRotation = attributeView(first.center, vertexCount, 3, stride);
    return mesh;
  }
};

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
  for (const std::size_t size : {sizeof(JointMatrix),
                                 sizeof(AttributeView),
                                 sizeof(MorphTargetView),
                                 sizeof(MeshView),
                                 sizeof(MeshInfo),
                                 sizeof(PackedMesh),
                                 sizeof(PoseDescription),
                                 sizeof(OutputAttribute),
                                 sizeof(Job),
                                 sizeof(Batch),
                                 sizeof(Command),
                                 sizeof(Plan),
                                 sizeof(SceneDescription),
                                 sizeof(InstanceDescription),
                                 sizeof(InstanceResult),
                                 sizeof(JointBounds),
                                 sizeof(SkinnedView),
                                 sizeof(Comparison),
                                 sizeof(Exemptions),
                                 sizeof(reference::VertexBounds),
                                 sizeof(reference::SkinnedMesh),
                                 sizeof(RepairedMesh)})
    std::printf("%zu ", size);
  std::printf("bytes\n");
}

void printGlm() {
  glm::mat4 matrix(1.0f);
  matrix[3] = glm::vec4(4, 5, 6, 1);
  const JointMatrix joint = toJointMatrix(matrix);
  const glm::mat4x3 back = toColumns<glm::mat4x3>(joint);
  std::printf("glm %.1f %.1f %.1f %.1f\n", static_cast<double>(joint.m[0][3]),
              static_cast<double>(joint.m[1][3]), static_cast<double>(joint.m[2][3]),
              static_cast<double>(back[3].y));
}

Error wrong(const char* what) {
  return {ErrorCode::invalidData, what};
}

void printBox(const Box& box) {
  std::printf("box");
  for (int axis = 0; axis < 3; ++axis) {
    std::printf(" %.9g..%.9g", static_cast<double>(box.min[axis]),
                static_cast<double>(box.max[axis]));
  }
  std::printf("\n");
}

bool holds(const Box& box, const reference::Double3& point) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!(box.min[axis] <= point[axis] && point[axis] <= box.max[axis])) return false;
  }
  return true;
}

/// One instance a method, in the vertices that the engine draws.
Result<void> planBatch(const MeshInfo& info, const Box& box) {
  const PoseDescription palette{jointCount, 0, JointPromise::scaling};
  const MorphWeight morph{0, 0.75f};
  std::vector<Job> jobs;
  for (const Method method : allMethods) {
    const std::uint64_t first = jobs.size() * vertexCount * sizeof(SkinnedVertex);
    const auto attribute = [first](std::size_t offset, VertexFormat format) {
      return OutputAttribute{first + offset, sizeof(SkinnedVertex), format};
    };
    Job& job = jobs.emplace_back();
    job.mesh = info;
    job.method = method;
    job.places[Stream::positions] =
        attribute(offsetof(SkinnedVertex, position), VertexFormat::snorm16x4);
    job.places[Stream::normals] =
        attribute(offsetof(SkinnedVertex, normal), VertexFormat::snorm8x4);
    job.places[Stream::tangents] =
        attribute(offsetof(SkinnedVertex, tangent), VertexFormat::snorm16x4);
    job.box = box;
    job.morphs = {&morph, 1};
    job.bounds = true;
  }
  Batch batch;
  batch.poses = {&palette, 1};
  batch.jobs = jobs;
  batch.meshesSize = info.byteSize;
  batch.posesSize = jointCount * sizeof(JointMatrix);
  batch.outputSizes.fill(jobs.size() * vertexCount * sizeof(SkinnedVertex));
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  const Tuning tuning;
  Plan plan;
  if (Result<void> done = makePlan(batch, limits, tuning, plan); !done) return done;
  std::vector<std::byte> tables(plan.buffer(BufferRole::tables).size);
  if (Result<void> done = writeTables(plan, tables); !done) return done;
  std::printf("%u dispatches of %zu pipelines, results at %llu\n", plan.dispatchCount(),
              plan.pipelines().size(),
              static_cast<unsigned long long>(plan.resultOffset(1).value()));
  print("tables", hashOf(tables));

  // What an engine prepares that knows nothing but its vertex and the methods that it uses.
  std::vector<PipelineId> foreseen;
  for (const Job& job : jobs) {
    const std::vector<PipelineId> ofMethod = *pipelines(job, limits, tuning);
    foreseen.insert(foreseen.end(), ofMethod.begin(), ofMethod.end());
  }
  for (const PipelineId id : plan.pipelines()) {
    if (std::find(foreseen.begin(), foreseen.end(), id) == foreseen.end())
      return wrong("`pipelines` does not foresee a pipeline of the plan");
  }
  return {};
}

/// `value` from -1 to 1 as a normalized integer.
template <typename Integer>
Integer toSnorm(double value) {
  return static_cast<Integer>(std::lround(value * std::numeric_limits<Integer>::max()));
}

/// What a kernel would write, from the reference's vertices.
std::vector<SkinnedVertex> quantize(const reference::SkinnedMesh& skinned, const Box& box) {
  std::vector<SkinnedVertex> vertices(vertexCount);
  for (std::size_t i = 0; i < vertexCount; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double low = box.min[axis], high = box.max[axis];
      const double center = (low + high) / 2, half = (high - low) / 2;
      vertices[i].position[axis] =
          toSnorm<std::int16_t>((skinned.positions[i][axis] - center) / half);
      vertices[i].normal[axis] = toSnorm<std::int8_t>(skinned.normals[i][axis]);
      vertices[i].tangent[axis] = toSnorm<std::int16_t>(skinned.tangents[i][axis]);
    }
    vertices[i].position[3] = 32767;
    vertices[i].tangent[3] = toSnorm<std::int16_t>(skinned.tangents[i][3]);
  }
  return vertices;
}

/// Skins by the reference, stores that as an engine would, and holds it against the contract.
Result<void> skinAndCompare(const MeshView& mesh, const Box& box, std::span<const JointMatrix> pose,
                            Method method) {
  const MorphWeight morph{0, 0.75f};
  const Result<reference::SkinnedMesh> skinned = reference::skin(mesh, pose, method, {&morph, 1});
  if (!skinned) return skinned.error();
  print(std::string(methodName(method)).c_str(),
        hashOf(std::as_bytes(std::span(skinned->positions))) ^
            hashOf(std::as_bytes(std::span(skinned->normals))) ^
            hashOf(std::as_bytes(std::span(skinned->tangents))));
  double bounds = 0;
  for (const reference::VertexBounds& vertex : skinned->bounds) {
    bounds += vertex.position + vertex.normal + vertex.tangent;
  }
  std::printf("bounds %.17g\n", bounds);
  for (const reference::Double3& position : skinned->positions) {
    if (!holds(box, position)) return wrong("skinnedBounds does not hold every vertex");
  }

  const std::vector<SkinnedVertex> stored = quantize(*skinned, box);
  const auto attribute = [](const void* data, VertexFormat format) {
    return SkinnedAttribute{data, vertexCount, sizeof(SkinnedVertex), format};
  };
  const SkinnedView view{attribute(stored[0].position, VertexFormat::snorm16x4),
                         attribute(stored[0].normal, VertexFormat::snorm8x4),
                         attribute(stored[0].tangent, VertexFormat::snorm16x4), box};
  const Result<Comparison> comparison = compareWithReference(*skinned, view);
  if (!comparison) return comparison.error();
  std::printf("compared %llu, %llu clamped, worst %.9g %.9g %.9g\n",
              static_cast<unsigned long long>(comparison->compared),
              static_cast<unsigned long long>(comparison->clamped), comparison->worstPosition,
              comparison->worstNormal, comparison->worstTangent);
  const std::array<double, 3> first =
      decodePosition(VertexFormat::snorm16x4, stored[0].position, box);
  std::printf("first vertex %.9g %.9g %.9g\n", first[0], first[1], first[2]);
  if (comparison->compared != vertexCount || comparison->clamped != 0)
    return wrong("not every vertex was compared");
  if (!comparison->passed()) return wrong("what was stored is outside its bounds");
  return {};
}

Result<void> run() {
  printSizes();
  printGlm();
  Model model;
  const MeshView mesh = model.view();
  for (const MeshReport::Finding& finding : validate(mesh, jointCount).findings)
    std::printf("%s: %llu\n", meshProblemName(finding.problem),
                static_cast<unsigned long long>(finding.count));

  const Result<PackedMesh> packed = pack(mesh, jointCount);
  if (!packed) return packed.error();
  print("packed", hashOf(packed->bytes()));
  const Result<PackedMesh> loaded = PackedMesh::fromBytes(packed->bytes());
  if (!loaded) return loaded.error();
  const Result<JointBounds> bounds = jointBounds(mesh, jointCount);
  if (!bounds) return bounds.error();

  const std::vector<JointMatrix> pose = makePose();
  for (const Method method : allMethods) {
    Box box = skinnedBounds(*bounds, pose, method);
    printBox(box);
    if (!std::isfinite(box.min[0])) box = {{-8, -8, -8}, {8, 8, 8}};  // nothing is proven
    if (Result<void> done = planBatch(loaded->info(), box); !done) return done;
    if (Result<void> done = skinAndCompare(mesh, box, pose, method); !done) return done;
  }
  return {};
}

}  // namespace

int main() {
  const Result<void> done = run();
  if (done) return 0;
  std::printf("%s: %s\n", std::string(errorCodeName(done.error().code)).c_str(),
              done.error().message.c_str());
  return 1;
}
