#include "scene_view.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

#include "dermis/verify.h"
#include "kit/text.h"
#include "vulkan_helpers.h"

namespace dermis::viewer {
namespace {

namespace render = samples::render;

/// Software Vulkan is too slow for the defaults of the renderer.
bool isSoftware(const samples::Device& device) {
  return device.info().type == "CPU";
}

bool haveSamePose(const Shot& a, const Shot& b) {
  return a.clip == b.clip && a.time == b.time && a.methods == b.methods && a.views == b.views;
}

void write(const samples::MappedBuffer& buffer, std::span<const float> values, float factor) {
  std::span<std::byte> bytes = buffer.bytes();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float value = values[i] * factor;
    std::memcpy(&bytes[i * sizeof(float)], &value, sizeof(float));
  }
}

}  // namespace

std::vector<Joint> jointsOf(const cli::Scene& scene) {
  const gltf::Model& model = *scene.model;
  std::vector<std::uint32_t> place(model.nodes.size(), noIndex);
  std::vector<Joint> joints;
  for (const cli::ScenePart& part : scene.parts) {
    for (const std::uint32_t node : model.skins[part.source.skin].joints) {
      if (place[node] != noIndex) continue;
      place[node] = static_cast<std::uint32_t>(joints.size());
      std::string name = samples::shortName(model.nodes[node].name);
      if (name.empty()) name = "node " + std::to_string(node);
      joints.push_back({std::move(name), node, noIndex});
    }
  }
  for (Joint& joint : joints) {
    std::uint32_t above = model.nodes[joint.node].parent;
    while (above != noIndex && place[above] == noIndex) above = model.nodes[above].parent;
    if (above != noIndex) joint.parent = place[above];
  }
  return joints;
}

std::vector<glm::vec3> jointPositions(const cli::Scene& scene, const std::vector<Joint>& joints,
                                      std::uint32_t clip, double time) {
  const std::vector<Transform> globals = gltf::nodeGlobals(*scene.model, clip, time);
  std::vector<glm::vec3> positions;
  for (const Joint& joint : joints) {
    const Transform& global = globals[joint.node];
    positions.emplace_back(global[0][3], global[1][3], global[2][3]);
  }
  return positions;
}

Result<std::vector<float>> jointWeights(const cli::Scene& scene, const cli::ScenePart& part,
                                        std::uint32_t node) {
  std::vector<float> weights(part.primitive->vertexCount, 0.0f);
  if (part.mesh == nullptr) return weights;
  // Linear blending moves a vertex by the weight of the joint if that joint alone is moved by 1.
  const std::vector<std::uint32_t>& joints = scene.model->skins[part.source.skin].joints;
  std::vector<JointMatrix> pose(joints.size());
  const auto rest = reference::skin(part.mesh->view(), pose, Method::linear);
  if (!rest) return rest.error();
  for (std::size_t index = 0; index < joints.size(); ++index) {
    if (joints[index] == node) pose[index].m[0][3] = 1;
  }
  const auto moved = reference::skin(part.mesh->view(), pose, Method::linear);
  if (!moved) return moved.error();
  for (std::size_t vertex = 0; vertex < weights.size(); ++vertex) {
    weights[vertex] = static_cast<float>(moved->positions[vertex][0] - rest->positions[vertex][0]);
  }
  return weights;
}

Result<PositionErrors> positionErrors(const cli::Scene& scene, const cli::ScenePose& pose,
                                      Method method,
                                      std::span<const std::vector<float>> positions) {
  PositionErrors result;
  for (std::size_t index = 0; index < scene.parts.size(); ++index) {
    const cli::ScenePart& part = scene.parts[index];
    std::vector<float>& errors = result.errors.emplace_back(part.primitive->vertexCount, 0.0f);
    if (part.mesh == nullptr || positions[index].empty()) continue;
    const Result<reference::SkinnedMesh> expected =
        reference::skin(part.mesh->view(), pose.pose(part), method, pose.morphs[index]);
    if (!expected) return expected.error();
    for (std::size_t vertex = 0; vertex < errors.size(); ++vertex) {
      const reference::VertexBounds& bounds = expected->bounds[vertex];
      if (bounds.onlyFinite || bounds.outOfRange || bounds.undefined) continue;
      // A value that is not finite counts as the largest possible error.
      constexpr double most = static_cast<double>(std::numeric_limits<float>::max());
      const reference::Double3& right = expected->positions[vertex];
      const float* skinned = &positions[index][3 * vertex];
      const double apart =
          std::hypot(right[0] - skinned[0], right[1] - skinned[1], right[2] - skinned[2]);
      const double error = apart < most ? apart : most;
      errors[vertex] = static_cast<float>(error);
      result.greatest = std::max(result.greatest, error);
      if (bounds.position > 0) {
        result.greatestPartOfBound = std::max(result.greatestPartOfBound, error / bounds.position);
      }
    }
  }
  return result;
}

Result<std::unique_ptr<SceneView>> SceneView::create(samples::OpenDevice& device,
                                                     cli::Scene scene) {
  if (scene.parts.empty()) return Error{ErrorCode::invalidData, "its scene has no skinned mesh"};
  std::unique_ptr<SceneView> view(new SceneView(device, std::move(scene)));
  if (Result<void> done = view->prepare(); !done) return done.error();
  return view;
}

Result<void> SceneView::prepare() {
  samples::Device& device = *device_->device;
  joints_ = jointsOf(scene_);
  const render::FilterTaps taps =
      isSoftware(device) ? render::FilterTaps{10, 16, 2} : render::FilterTaps{};
  Result<void> done = keep(render::Renderer::create(device, taps), renderer_);
  if (done)
    done = keep(cli::DrawnScene::create(*device_, *renderer_, scene_, 2, methods_[0]), drawn_);
  if (done) done = keep(samples::Timestamps::create(device), skinning_);
  if (done) done = keep(samples::Timestamps::create(device), drawing_);
  if (!done) return done;
  for (FigureBuffers& figure : values_) {
    for (const cli::ScenePart& part : scene_.parts) {
      const std::uint64_t count = std::max<std::uint64_t>(part.primitive->vertexCount, 1);
      Result<samples::MappedBuffer> made = samples::MappedBuffer::create(
          device, count * sizeof(float), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
      if (!made) return made.error();
      std::ranges::fill(made->bytes(), std::byte{0});
      figure.push_back(std::move(*made));
    }
  }
  return {};
}

std::uint64_t SceneView::vertexCount() const {
  std::uint64_t count = 0;
  for (const cli::ScenePart& part : scene_.parts) count += part.primitive->vertexCount;
  return count;
}

double SceneView::duration(std::uint32_t clip) const {
  return clip < scene_.model->clips.size() ? scene_.model->clips[clip].duration : 0;
}

Result<Box> SceneView::extent(std::uint32_t clip) {
  if (const auto found = extents_.find(clip); found != extents_.end()) return found->second;
  const std::uint32_t count = duration(clip) > 0 ? 16 : 1;  // poses
  std::vector<Box> boxes;
  for (std::uint32_t index = 0; index < count; ++index) {
    Shot shot;
    shot.clip = clip;
    shot.time = duration(clip) * index / count;
    shot.methods = methods_;
    if (Result<void> done = skin(shot); !done) return done.error();
    if (Result<void> begun = drawn_->beginFrame(); !begun) return begun.error();
    const Result<std::optional<Box>> box = drawn_->bounds(0);
    if (!box) return box.error();
    if (*box) boxes.push_back(**box);
  }
  if (boxes.empty())
    return Error{ErrorCode::invalidData, "there is nothing to draw: no vertex is finite"};
  return extents_[clip] = render::unite(boxes);
}

Result<void> SceneView::recordSkinning(VkCommandBuffer commandBuffer, const Shot& shot) {
  const bool isNew = !posed_ || !haveSamePose(*posed_, shot);
  posed_.reset();
  for (std::uint32_t figure = 0; figure < shot.views; ++figure) {
    if (std::exchange(methods_[figure], shot.methods[figure]) == shot.methods[figure]) continue;
    if (Result<void> set = drawn_->setMethod(figure, shot.methods[figure]); !set) return set;
  }
  if (Result<void> begun = drawn_->beginFrame(); !begun) return begun;
  if (isNew) {
    pose_ = cli::scenePose(scene_, shot.clip, shot.time);
    for (std::uint32_t figure = 0; figure < shot.views; ++figure) {
      if (Result<void> posed = drawn_->setPose(figure, pose_); !posed) return posed;
    }
    skinning_.recordBegin(commandBuffer);
  }
  if (Result<void> done = drawn_->recordSkinning(commandBuffer); !done) return done;
  posed_ = shot;
  if (!isNew) return {};
  skinning_.recordEnd(commandBuffer);
  hasSkinned_ = true;
  const vulkan::RecorderStatistics last = drawn_->statistics();
  times_.planSeconds = last.planSeconds + last.recordSeconds;
  return {};
}

/// Skins in a separate submission.
Result<void> SceneView::skin(const Shot& shot) {
  const VkCommandBuffer commandBuffer = beginCommands(*device_->device);
  return endCommands(*device_->device, commandBuffer, recordSkinning(commandBuffer, shot));
}

/// Writes what is shown as colors, unless it is there.
Result<void> SceneView::writeValues(const Shot& shot) {
  const bool isWritten = valued_ && valued_->coloring == shot.coloring &&
                         (shot.coloring == Coloring::weights ? valued_->joint == shot.joint
                                                             : haveSamePose(*valued_, shot));
  if (shot.coloring == Coloring::surface || isWritten) return {};
  valued_.reset();
  const Result<void> done =
      shot.coloring == Coloring::weights ? writeWeights(shot.joint) : writeErrors(shot);
  if (done) valued_ = shot;
  return done;
}

Result<void> SceneView::writeWeights(std::uint32_t joint) {
  for (std::size_t index = 0; index < scene_.parts.size() && joint < joints_.size(); ++index) {
    const Result<std::vector<float>> weights =
        jointWeights(scene_, scene_.parts[index], joints_[joint].node);
    if (!weights) return weights.error();
    for (const FigureBuffers& figure : values_) write(figure[index], *weights, 1);
  }
  return {};
}

/// The color scale ends at the greatest error of all parts shown.
Result<void> SceneView::writeErrors(const Shot& shot) {
  if (Result<void> done = skin(shot); !done) return done;
  errors_.clear();
  double greatest = 0;
  for (std::uint32_t figure = 0; figure < shot.views; ++figure) {
    const Result<std::vector<std::vector<float>>> positions = readPositions(figure);
    if (!positions) return positions.error();
    Result<PositionErrors> errors = positionErrors(scene_, pose_, shot.methods[figure], *positions);
    if (!errors) return errors.error();
    greatest = std::max(greatest, errors->greatest);
    errors_.push_back(std::move(*errors));
  }
  const float factor = greatest > 0 ? static_cast<float>(1 / greatest) : 0;
  for (std::size_t figure = 0; figure < errors_.size(); ++figure) {
    for (std::size_t part = 0; part < scene_.parts.size(); ++part)
      write(values_[figure][part], errors_[figure].errors[part], factor);
  }
  return {};
}

/// What the device has skinned, for `positionErrors`.
Result<std::vector<std::vector<float>>> SceneView::readPositions(std::uint32_t figure) {
  samples::Device& device = *device_->device;
  std::vector<render::Draw> draws;
  if (Result<void> done = drawn_->addDraws(figure, JointMatrix(), draws); !done)
    return done.error();
  std::vector<std::vector<float>> positions(draws.size());
  for (std::size_t part = 0; part < draws.size(); ++part) {
    const std::uint32_t count = scene_.parts[part].primitive->vertexCount;
    if (scene_.parts[part].mesh == nullptr || count == 0) continue;
    const render::VertexStream& stream = draws[part].positions;
    const VkBufferCopy copy{stream.offset, 0,
                            std::uint64_t{stream.stride} * (count - 1) + 3 * sizeof(float)};
    Result<samples::MappedBuffer> copied =
        samples::MappedBuffer::create(device, copy.size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
    if (!copied) return copied.error();
    const VkCommandBuffer commandBuffer = beginCommands(device);
    device.functions().CmdCopyBuffer(commandBuffer, stream.buffer, copied->handle(), 1, &copy);
    recordHostBarrier(device, commandBuffer);
    if (Result<void> done = endCommands(device, commandBuffer, {}); !done) return done.error();
    positions[part].resize(std::size_t{3} * count);
    for (std::size_t vertex = 0; vertex < count; ++vertex) {
      std::memcpy(&positions[part][3 * vertex], &copied->bytes()[stream.stride * vertex],
                  3 * sizeof(float));
    }
  }
  return positions;
}

Result<void> SceneView::fitFrame(std::uint32_t width, std::uint32_t height) {
  if (frame_ && frame_->target().width() == width && frame_->target().height() == height) return {};
  render::FrameDescription description;
  description.width = width;
  description.height = height;
  description.views = 2;
  if (isSoftware(*device_->device)) description.shadows = {1024, 256, 6};
  frame_.reset();
  return keep(renderer_->createFrame(description), frame_);
}

Result<const render::RenderTarget*> SceneView::record(VkCommandBuffer commandBuffer,
                                                      const Shot& shot) {
  const Result<Box> extent = this->extent(shot.clip);
  if (!extent) return extent.error();
  if (Result<void> done = fitFrame(shot.width, shot.height); !done) return done.error();
  if (Result<void> done = writeValues(shot); !done) return done.error();
  if (Result<void> done = recordSkinning(commandBuffer, shot); !done) return done.error();
  drawing_.recordBegin(commandBuffer);
  if (Result<void> done = draw(commandBuffer, shot, *extent); !done) return done.error();
  drawing_.recordEnd(commandBuffer);
  return picture();
}

Result<void> SceneView::draw(VkCommandBuffer commandBuffer, const Shot& shot, const Box& extent) {
  const float radius = render::radiusOf(extent);
  std::array<std::vector<render::Draw>, 2> draws;
  std::vector<render::View> views(shot.views);
  for (std::uint32_t index = 0; index < shot.views; ++index) {
    if (Result<void> done = drawn_->addDraws(index, JointMatrix(), draws[index]); !done)
      return done;
    for (std::size_t part = 0; part < draws[index].size(); ++part) {
      if (shot.coloring == Coloring::surface) continue;
      draws[index][part].values = {values_[index][part].handle(), 0, sizeof(float)};
    }
    render::View& view = views[index];
    const std::uint32_t left = shot.width * index / shot.views;
    const std::uint32_t right = shot.width * (index + 1) / shot.views;
    view.area = {{static_cast<std::int32_t>(left), 0}, {right - left, shot.height}};
    view.draws = draws[index];
    view.casters = extent;
    view.groundHeight = extent.min[1] - 1e-3f * radius;
    view.groundRadius = groundRadius * radius;
    view.camera = shot.camera.camera(
        extent, static_cast<float>(right - left) / static_cast<float>(shot.height));
  }
  return renderer_->record(commandBuffer, *frame_, views);
}

Result<void> SceneView::finish() {
  if (!drawing_.has()) return {};
  const Result<double> drawing = drawing_.seconds();
  if (!drawing) return drawing.error();
  times_.drawingSeconds = *drawing;
  if (!std::exchange(hasSkinned_, false)) return {};
  const Result<double> skinning = skinning_.seconds();
  if (!skinning) return skinning.error();
  times_.skinningSeconds = *skinning;
  return {};
}

}  // namespace dermis::viewer
