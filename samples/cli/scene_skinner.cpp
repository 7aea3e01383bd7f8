#include "scene_skinner.h"

#include <cstddef>
#include <cstring>
#include <memory>
#include <tuple>
#include <utility>

#include "dermis/verify.h"
#include "kit/batch_runner.h"

namespace dermis::cli {
namespace {

/// Adds to the first three of every `components` values.
void addDisplacements(std::vector<float>& values, std::size_t components,
                      std::span<const std::uint32_t> vertices, std::span<const float> displacements,
                      float weight) {
  if (values.empty()) return;
  for (std::size_t i = 0; i < displacements.size(); ++i) {
    const std::size_t vertex = vertices.empty() ? i / 3 : vertices[i / 3];
    values[vertex * components + i % 3] += weight * displacements[i];
  }
}

template <typename Vector>
std::vector<float> toFloats(const std::vector<Vector>& vectors) {
  std::vector<float> floats;
  floats.reserve(vectors.size() * std::tuple_size_v<Vector>);
  for (const Vector& vector : vectors) {
    for (const double value : vector) floats.push_back(static_cast<float>(value));
  }
  return floats;
}

SkinnedPart fromTarget(samples::SkinnedVertices&& vertices) {
  SkinnedPart part{std::move(vertices.positions), std::move(vertices.normals), {}};
  const std::vector<std::byte>& tangents =
      vertices.streams[static_cast<std::size_t>(Stream::tangents)];
  part.tangents.resize(tangents.size() / sizeof(float));
  if (!tangents.empty()) std::memcpy(part.tangents.data(), tangents.data(), tangents.size());
  return part;
}

}  // namespace

SkinnedPart bindPose(const ScenePart& part, std::span<const MorphWeight> morphs) {
  SkinnedPart skinned{part.primitive->positions, part.primitive->normals, part.primitive->tangents};
  for (const MorphWeight& morph : morphs) {
    const gltf::MorphTarget& target = part.primitive->morphTargets[morph.target];
    addDisplacements(skinned.positions, 3, target.vertices, target.positions, morph.weight);
    addDisplacements(skinned.normals, 3, target.vertices, target.normals, morph.weight);
    addDisplacements(skinned.tangents, 4, target.vertices, target.tangents, morph.weight);
  }
  return skinned;
}

std::vector<samples::SkinRequest> skinRequests(const Scene& scene, const ScenePose& pose) {
  std::vector<samples::SkinRequest> requests;
  for (std::size_t index = 0; index < scene.parts.size(); ++index) {
    const ScenePart& part = scene.parts[index];
    if (part.mesh == nullptr) continue;
    samples::SkinRequest& request = requests.emplace_back();
    request.mesh = &part.mesh->packed();
    request.pose = pose.pose(part);
    request.morphs = pose.morphs[index];
  }
  return requests;
}

SkinParts referenceSkinner(const Scene& scene, Method method) {
  return [&scene, method](const ScenePose& pose) -> Result<std::vector<SkinnedPart>> {
    std::vector<SkinnedPart> all;
    for (std::size_t index = 0; index < scene.parts.size(); ++index) {
      const ScenePart& part = scene.parts[index];
      if (part.mesh == nullptr) {
        all.push_back(bindPose(part, pose.morphs[index]));
        continue;
      }
      const Result<reference::SkinnedMesh> skinned =
          reference::skin(part.mesh->view(), pose.pose(part), method, pose.morphs[index]);
      if (!skinned) return skinned.error();
      all.push_back(
          {toFloats(skinned->positions), toFloats(skinned->normals), toFloats(skinned->tangents)});
    }
    return all;
  };
}

SkinParts targetSkinner(const Scene& scene, Method method, bool tangents,
                        samples::BatchTarget& target) {
  samples::RunOptions options;
  options.countUntouched = false;
  if (tangents) options.output.tangents = VertexFormat::float32x4;
  options.tuning = target.divisions().front().tuning;
  const std::shared_ptr<samples::BatchRunner> runner = target.runner(options);
  return [&scene, method, runner](const ScenePose& pose) -> Result<std::vector<SkinnedPart>> {
    std::vector<samples::SkinRequest> requests = skinRequests(scene, pose);
    for (samples::SkinRequest& request : requests) request.method = method;
    Result<samples::BatchResult> result = runner->run(requests);
    if (!result) return result.error();
    std::vector<SkinnedPart> all;
    std::size_t next = 0;
    for (std::size_t index = 0; index < scene.parts.size(); ++index) {
      const ScenePart& part = scene.parts[index];
      all.push_back(part.mesh != nullptr ? fromTarget(std::move(result->instances[next++]))
                                         : bindPose(part, pose.morphs[index]));
    }
    return all;
  };
}

}  // namespace dermis::cli
