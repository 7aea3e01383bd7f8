#include "drawn_scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <utility>

#include "dermis/vulkan/context.h"
#include "kit/device.h"
#include "kit/render/draw.h"
#include "scene_skinner.h"

namespace dermis::cli {
namespace {

using samples::MappedBuffer;
using samples::render::Draw;

void include(std::optional<Box>& all, const Box& box) {
  if (!all) all = box;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    all->min[axis] = std::min(all->min[axis], box.min[axis]);
    all->max[axis] = std::max(all->max[axis], box.max[axis]);
  }
}

/// The box around all finite positions. If there are none, its sides are reversed.
Box boxOf(std::span<const float> positions) {
  constexpr float infinity = std::numeric_limits<float>::infinity();
  Box box{{infinity, infinity, infinity}, {-infinity, -infinity, -infinity}};
  for (std::size_t i = 0; i < positions.size(); ++i) {
    if (!std::isfinite(positions[i])) continue;
    box.min[i % 3] = std::min(box.min[i % 3], positions[i]);
    box.max[i % 3] = std::max(box.max[i % 3], positions[i]);
  }
  return box;
}

constexpr std::uint32_t bytesPerVector = 3 * sizeof(float);

}  // namespace

Result<DrawnScene> DrawnScene::create(samples::OpenDevice& device,
                                      samples::render::Renderer& renderer, const Scene& scene,
                                      std::uint32_t figures, Method method) {
  const std::vector<Method> methods(figures, method);
  return create(device, renderer, scene, methods);
}

Result<DrawnScene> DrawnScene::create(samples::OpenDevice& device,
                                      samples::render::Renderer& renderer, const Scene& scene,
                                      std::span<const Method> methods) {
  DrawnScene drawn;
  drawn.device_ = &device;
  drawn.scene_ = &scene;
  if (Result<void> made = drawn.makeSystem(static_cast<std::uint32_t>(methods.size())); !made)
    return made.error();
  if (Result<void> added = drawn.addSharedParts(renderer); !added) return added.error();
  for (const Method method : methods) {
    if (Result<void> added = drawn.addFigure(method); !added) return added.error();
  }
  return drawn;
}

Result<void> DrawnScene::makeSystem(std::uint32_t figures) {
  vulkan::SceneRecorderDescription description;
  description.scene.framesInFlight = 1;
  description.tuning = device_->context.tuning();
  std::uint64_t joints = 0, outputs = 0, meshes = 0;
  std::uint32_t instances = 0;
  for (std::uint32_t skin = 0; skin < scene_->model->skins.size(); ++skin)
    joints += jointCount(*scene_, skin);
  for (const ScenePart& part : scene_->parts) {
    if (part.mesh == nullptr) continue;
    // The offset of each attribute is a multiple of its stride.
    outputs += (std::uint64_t{part.primitive->vertexCount} + 2) * 2 * bytesPerVector;
    meshes += part.mesh->packed().bytes().size() + packedMeshAlignment;
    ++instances;
  }
  const std::uint64_t all = joints * figures;
  for (const auto& [each, what] :
       {std::pair{joints, "joints"}, {std::uint64_t{instances}, "meshes"}}) {
    if (std::in_range<std::uint32_t>(each * figures)) continue;
    return Error{ErrorCode::limitExceeded,
                 fmt::format("{} figures of {} {} each exceed the maximum of {}", figures, each,
                             what, std::numeric_limits<std::uint32_t>::max())};
  }
  description.scene.meshCapacity = {std::max<std::uint64_t>(meshes, 4096)};
  description.scene.jointCapacity = {std::max<std::uint64_t>(all, 1)};
  description.scene.outputCapacity = {std::max<std::uint64_t>(outputs * figures, 4096)};
  description.scene.instanceCapacity = {std::max(instances * figures, 1u)};
  description.scene.boundsCapacity = description.scene.instanceCapacity;
  Result<vulkan::SceneRecorder> recorder =
      vulkan::SceneRecorder::create(device_->context, description);
  if (!recorder) return recorder.error();
  recorder_.emplace(std::move(*recorder));
  return {};
}

Result<void> DrawnScene::addSharedParts(samples::render::Renderer& renderer) {
  appearances_.emplace(*device_->device, renderer, *scene_->model);
  std::map<const PreparedMesh*, MeshHandle> meshes;
  for (const ScenePart& part : scene_->parts) {
    SharedPart& shared = shared_.emplace_back();
    const Result<samples::render::Surface> surface = appearances_->surface(*part.primitive);
    if (!surface) return surface.error();
    shared.surface = *surface;
    const Result<const samples::render::Geometry*> geometry =
        appearances_->geometry(*part.primitive);
    if (!geometry) return geometry.error();
    shared.geometry = *geometry;
    if (part.mesh == nullptr) continue;
    if (!meshes.contains(part.mesh.get())) {
      Result<MeshHandle> mesh = recorder_->scene().addMesh(part.mesh->packed());
      if (!mesh) return mesh.error();
      meshes.emplace(part.mesh.get(), *mesh);
    }
    shared.mesh = meshes.at(part.mesh.get());
  }
  return {};
}

InstanceDescription DrawnScene::instanceOf(const Figure& figure, std::size_t part,
                                           Method method) const {
  InstanceDescription description;
  description.mesh = *shared_[part].mesh;
  description.pose = figure.poses[scene_->parts[part].source.skin];
  description.method = method;
  description.layout.normals =
      scene_->parts[part].primitive->normals.empty() ? VertexFormat::none : VertexFormat::float32x3;
  description.bounds = true;
  return description;
}

Result<void> DrawnScene::prepare(const Figure& figure, Method method) {
  for (std::size_t part = 0; part < shared_.size(); ++part) {
    if (!shared_[part].mesh) continue;
    if (Result<void> done = recorder_->prepare(instanceOf(figure, part, method)); !done)
      return done;
  }
  return {};
}

Result<void> DrawnScene::addFigure(Method method) {
  Figure figure;
  figure.parts.resize(shared_.size());
  figure.poses.resize(scene_->model->skins.size());
  std::vector<bool> isUsed(figure.poses.size());
  for (std::size_t index = 0; index < shared_.size(); ++index) {
    const std::uint32_t skin = scene_->parts[index].source.skin;
    if (!shared_[index].mesh || isUsed[skin]) continue;
    Result<PoseHandle> palette = recorder_->scene().addPose(jointCount(*scene_, skin));
    if (!palette) return palette.error();
    figure.poses[skin] = *palette;
    isUsed[skin] = true;
  }
  if (Result<void> done = prepare(figure, method); !done) return done;
  if (Result<void> added = addInstances(figure, method); !added) return added;
  figures_.push_back(std::move(figure));
  return {};
}

Result<void> DrawnScene::addInstances(Figure& figure, Method method) {
  for (std::size_t index = 0; index < shared_.size(); ++index) {
    if (!shared_[index].mesh) continue;
    Result<InstanceHandle> instance =
        recorder_->scene().addInstance(instanceOf(figure, index, method));
    if (!instance) return instance.error();
    figure.parts[index].instance = *instance;
  }
  return {};
}

Result<void> DrawnScene::setMethod(std::uint32_t index, Method method) {
  Figure& figure = figures_[index];
  if (Result<void> done = prepare(figure, method); !done) return done;
  for (FigurePart& part : figure.parts) {
    if (!part.instance) continue;
    if (Result<void> removed = recorder_->scene().removeInstance(*part.instance); !removed)
      return removed;
    part.instance.reset();
  }
  // The memory of the old instances must be free before there is space for the new ones.
  if (Result<void> begun = beginFrame(); !begun) return begun;
  return addInstances(figure, method);
}

Result<void> DrawnScene::beginFrame() {
  ++frame_;
  return recorder_->scene().beginFrame(frame_, frame_ - 1);
}

Result<void> DrawnScene::setPose(std::uint32_t index, const ScenePose& pose) {
  Figure& figure = figures_[index];
  std::vector<bool> isWritten(figure.poses.size());
  for (std::size_t i = 0; i < scene_->parts.size(); ++i) {
    const ScenePart& part = scene_->parts[i];
    FigurePart& posed = figure.parts[i];
    if (!posed.instance) {
      if (Result<void> placed = placeFixed(part, pose.morphs[i], posed.fixed); !placed)
        return placed;
      continue;
    }
    const std::vector<JointMatrix>& palette = pose.pose(part);
    posed.isMirrored = samples::render::isMirrored(palette);
    if (!isWritten[part.source.skin]) {
      isWritten[part.source.skin] = true;
      Result<std::span<JointMatrix>> place =
          recorder_->scene().writePose(figure.poses[part.source.skin]);
      if (!place) return place.error();
      std::ranges::copy(palette, place->begin());
    }
    if (part.primitive->morphTargets.empty()) continue;
    if (Result<void> set =
            recorder_->scene().change({.instance = *posed.instance, .morphs = pose.morphs[i]});
        !set)
      return set;
  }
  return {};
}

Result<void> DrawnScene::placeFixed(const ScenePart& part, std::span<const MorphWeight> morphs,
                                    FixedPart& fixed) const {
  const SkinnedPart posed = bindPose(part, morphs);
  const std::size_t positions = posed.positions.size() * sizeof(float);
  const std::size_t normals = posed.normals.size() * sizeof(float);
  if (fixed.vertices.handle() == VK_NULL_HANDLE) {
    Result<MappedBuffer> made = MappedBuffer::create(*device_->device, positions + normals,
                                                     VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
    if (!made) return made.error();
    fixed.vertices = std::move(*made);
  }
  std::memcpy(fixed.vertices.bytes().data(), posed.positions.data(), positions);
  if (normals != 0)
    std::memcpy(fixed.vertices.bytes().data() + positions, posed.normals.data(), normals);
  fixed.box = boxOf(posed.positions);
  return {};
}

Result<void> DrawnScene::recordSkinning(VkCommandBuffer commandBuffer) {
  device_->context.recordBarrier(commandBuffer, Use::vertexInput | Use::copyRead, Use::dermis);
  if (Result<void> done = recorder_->record(commandBuffer); !done) return done;
  device_->context.recordBarrier(commandBuffer, Use::dermis, Use::vertexInput | Use::copyRead);
  return {};
}

Result<void> DrawnScene::addDraws(std::uint32_t figure, const JointMatrix& transform,
                                  std::vector<Draw>& draws) const {
  for (std::size_t index = 0; index < shared_.size(); ++index) {
    const FigurePart& part = figures_[figure].parts[index];
    Draw& draw = draws.emplace_back();
    draw.geometry = shared_[index].geometry;
    draw.surface = shared_[index].surface;
    draw.transform = transform;
    draw.isMirrored = part.isMirrored;
    if (part.instance) {
      const Result<InstanceOutput> output = recorder_->scene().output(*part.instance);
      if (!output) return output.error();
      const auto stream = [&](const OutputAttribute& attribute) -> samples::render::VertexStream {
        return {recorder_->outputBuffer(), attribute.offset, attribute.stride, attribute.format};
      };
      draw.positions = stream(output->places[Stream::positions]);
      if (output->places[Stream::normals].format != VertexFormat::none)
        draw.normals = stream(output->places[Stream::normals]);
      continue;
    }
    const gltf::Primitive& primitive = *scene_->parts[index].primitive;
    const VkBuffer buffer = part.fixed.vertices.handle();
    draw.positions = {buffer, 0, bytesPerVector, VertexFormat::float32x3};
    if (!primitive.normals.empty()) {
      draw.normals = {buffer, std::uint64_t{bytesPerVector} * primitive.vertexCount, bytesPerVector,
                      VertexFormat::float32x3};
    }
  }
  return {};
}

Result<std::optional<Box>> DrawnScene::bounds(std::uint32_t figure) const {
  std::optional<Box> all;
  for (const FigurePart& part : figures_[figure].parts) {
    if (!part.instance) {
      if (part.fixed.box.min[0] <= part.fixed.box.max[0]) include(all, part.fixed.box);
      continue;
    }
    const Result<std::optional<Box>> box = recorder_->scene().bounds(*part.instance);
    if (!box) return box.error();
    if (*box) include(all, **box);
  }
  return all;
}

}  // namespace dermis::cli
