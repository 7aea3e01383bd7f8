#include "scene_view.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

namespace dermis::viewer {
namespace {

namespace render = samples::render;

constexpr std::uint32_t posesOfAClip = 16;

double durationOf(const gltf::Model& model, std::uint32_t clip) {
  return clip < model.clips.size() ? model.clips[clip].duration : 0;
}

/// Software Vulkan is too slow for more.
render::FilterTaps tapsOf(const samples::Device& device) {
  if (device.info().type != "CPU") return {};
  return {10, 16, 2};
}

VkCommandBuffer begin(samples::Device& device) {
  const VkCommandBuffer commandBuffer = device.allocateCommandBuffer();
  VkCommandBufferBeginInfo info{};
  info.sType = VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO;
  device.functions().BeginCommandBuffer(commandBuffer, &info);
  return commandBuffer;
}

VkRect2D areaOf(std::uint32_t view, std::uint32_t views, std::uint32_t width,
                std::uint32_t height) {
  const std::uint32_t left = width * view / views, right = width * (view + 1) / views;
  return {{static_cast<std::int32_t>(left), 0}, {right - left, height}};
}

void write(const samples::MappedBuffer& buffer, std::span<const float> values, float factor) {
  std::span<std::byte> bytes = buffer.bytes();
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float value = values[i] * factor;
    std::memcpy(&bytes[i * sizeof(float)], &value, sizeof(float));
  }
}

}  // namespace

bool Shot::operator==(const Shot& other) const {
  return clip == other.clip && time == other.time && methods[0] == other.methods[0] &&
         views == other.views && (views == 1 || methods[1] == other.methods[1]) &&
         camera == other.camera && coloring == other.coloring &&
         (coloring != Coloring::weights || joint == other.joint) &&
         pixels.width == other.pixels.width && pixels.height == other.pixels.height;
}

Result<std::unique_ptr<SceneView>> SceneView::create(samples::OpenDevice& device,
                                                     cli::Scene scene) {
  if (scene.parts.empty()) return Error{ErrorCode::invalidData, "its scene has no skinned mesh"};
  std::unique_ptr<SceneView> view(new SceneView(device, std::move(scene)));
  if (Result<void> done = view->prepare(); !done) return done.error();
  return view;
}

Result<void> SceneView::prepare() {
  joints_ = jointsOf(scene_);
  Result<render::Renderer> renderer =
      render::Renderer::create(*device_->device, tapsOf(*device_->device));
  if (!renderer) return renderer.error();
  renderer_.emplace(std::move(*renderer));
  Result<cli::DrawnScene> drawn =
      cli::DrawnScene::create(*device_, *renderer_, scene_, 2, methods_[0]);
  if (!drawn) return drawn.error();
  drawn_.emplace(std::move(*drawn));
  for (samples::Timestamps* timestamps : {&skinning_, &drawing_}) {
    Result<samples::Timestamps> made = samples::Timestamps::create(*device_->device);
    if (!made) return made.error();
    *timestamps = std::move(*made);
  }
  return makeValues();
}

Result<void> SceneView::makeValues() {
  for (const cli::ScenePart& part : scene_.parts) {
    PartValues& values = values_.emplace_back();
    for (samples::MappedBuffer& buffer : values.figures) {
      Result<samples::MappedBuffer> made = samples::MappedBuffer::create(
          *device_->device, std::max<std::uint64_t>(part.primitive->vertexCount, 1) * sizeof(float),
          VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
      if (!made) return made.error();
      buffer = std::move(*made);
    }
  }
  clearValues();
  return {};
}

std::uint64_t SceneView::vertexCount() const {
  std::uint64_t count = 0;
  for (const cli::ScenePart& part : scene_.parts) count += part.primitive->vertexCount;
  return count;
}

Result<void> SceneView::skin(std::uint32_t clip, double time) {
  if (Result<void> begun = drawn_->beginFrame(); !begun) return begun;
  if (Result<void> posed = drawn_->setPose(0, cli::scenePose(scene_, clip, time)); !posed)
    return posed;
  posed_.reset();
  const VkCommandBuffer commandBuffer = begin(*device_->device);
  Result<void> done = drawn_->recordSkinning(commandBuffer);
  device_->device->functions().EndCommandBuffer(commandBuffer);
  if (done) done = device_->device->submitAndWait(commandBuffer);
  device_->device->freeCommandBuffer(commandBuffer);
  return done;
}

Result<Box> SceneView::extent(std::uint32_t clip) {
  if (const auto found = extents_.find(clip); found != extents_.end()) return found->second;
  const double duration = durationOf(*scene_.model, clip);
  const std::uint32_t count = duration > 0 ? posesOfAClip : 1;
  std::vector<Box> boxes;
  for (std::uint32_t index = 0; index < count; ++index) {
    if (Result<void> done = skin(clip, duration * index / count); !done) return done.error();
    if (Result<void> begun = drawn_->beginFrame(); !begun) return begun.error();
    const Result<std::optional<Box>> box = drawn_->bounds(0);
    if (!box) return box.error();
    if (*box) boxes.push_back(**box);
  }
  if (boxes.empty())
    return Error{ErrorCode::invalidData, "there is nothing to draw: no vertex is finite"};
  return extents_[clip] = render::unite(boxes);
}

Box SceneView::withGround(const Box& extent) {
  Box ground = extent;
  for (const std::size_t axis : {0u, 2u}) {
    ground.min[axis] -= 4 * render::radiusOf(extent);
    ground.max[axis] += 4 * render::radiusOf(extent);
  }
  return ground;
}

void SceneView::clearValues() {
  weightsOf_.reset();
  for (const PartValues& part : values_) {
    for (const samples::MappedBuffer& buffer : part.figures)
      std::ranges::fill(buffer.bytes(), std::byte{0});
  }
}

void SceneView::writeWeights(std::uint32_t joint) {
  if (weightsOf_ == joint || joint >= joints_.size()) return;
  for (std::size_t index = 0; index < values_.size(); ++index) {
    const std::vector<float> weights =
        jointWeights(scene_, scene_.parts[index], joints_[joint].node);
    for (const samples::MappedBuffer& buffer : values_[index].figures) write(buffer, weights, 1);
  }
  weightsOf_ = joint;
}

void SceneView::setErrors(CheckResult result) {
  errors_ = std::move(result);
  writeErrors();
}

/// The color scale ends at the greatest error of all parts shown.
void SceneView::writeErrors() {
  clearValues();
  if (!errors_) return;
  const CheckResult& result = *errors_;
  double greatest = 0;
  for (const FigureError& figure : result.figures) greatest = std::max(greatest, figure.greatest);
  const float factor = greatest > 0 ? static_cast<float>(1 / greatest) : 0;
  for (std::size_t figure = 0; figure < result.figures.size() && figure < 2; ++figure) {
    for (std::size_t part = 0; part < values_.size(); ++part)
      write(values_[part].figures[figure], result.figures[figure].errors[part], factor);
  }
}

/// Returns whether there is something to skin.
Result<bool> SceneView::pose(const Shot& shot) {
  bool isNew = !posed_ || posed_->clip != shot.clip || posed_->time != shot.time ||
               posed_->views < shot.views;
  for (std::uint32_t figure = 0; figure < shot.views; ++figure) {
    if (methods_[figure] == shot.methods[figure]) continue;
    if (!cli::allows(scene_, shot.methods[figure])) {
      return Error{ErrorCode::invalidArgument,
                   std::string(methodName(shot.methods[figure])) +
                       " needs centers of rotation, but this model has none"};
    }
    if (Result<void> set = drawn_->setMethod(figure, shot.methods[figure]); !set)
      return set.error();
    methods_[figure] = shot.methods[figure];
    isNew = true;
  }
  if (Result<void> begun = drawn_->beginFrame(); !begun) return begun.error();
  if (!isNew) return false;
  pose_ = cli::scenePose(scene_, shot.clip, shot.time);
  for (std::uint32_t figure = 0; figure < shot.views; ++figure) {
    if (Result<void> posed = drawn_->setPose(figure, pose_); !posed) return posed.error();
  }
  return true;
}

Result<void> SceneView::recordSkinning(VkCommandBuffer commandBuffer, const Shot& shot) {
  const Result<bool> isNew = pose(shot);
  posed_.reset();
  if (!isNew) return isNew.error();
  hasSkinned_ = *isNew;
  if (hasSkinned_) skinning_.recordBegin(commandBuffer);
  if (Result<void> done = drawn_->recordSkinning(commandBuffer); !done) return done;
  if (hasSkinned_) skinning_.recordEnd(commandBuffer);
  return {};
}

Result<render::RenderFrame*> SceneView::frameOf(const Shot& shot, const Quality& quality,
                                                bool isStill) {
  const auto scaled = [&](std::uint32_t side) {
    return std::max(
        static_cast<std::uint32_t>(std::lround(static_cast<float>(side) * quality.scale)), 1u);
  };
  PictureSlot& slot = slots_[isStill ? 1 : 0];
  render::FrameDescription description;
  description.width = scaled(shot.pixels.width);
  description.height = scaled(shot.pixels.height);
  description.views = 2;
  description.shadows = quality.shadows;
  shown_ = &slot;
  if (slot.frame && slot.width == description.width && slot.height == description.height &&
      slot.skyLights == quality.shadows.skyLights) {
    return &*slot.frame;
  }
  slot.frame.reset();
  Result<render::RenderFrame> made = renderer_->createFrame(description);
  if (!made) return made.error();
  slot.frame.emplace(std::move(*made));
  slot.width = description.width;
  slot.height = description.height;
  slot.skyLights = quality.shadows.skyLights;
  return &*slot.frame;
}

Result<void> SceneView::record(VkCommandBuffer commandBuffer, const Shot& shot,
                               const Quality& quality, bool isStill, bool copiesPositions) {
  const Result<Box> extent = this->extent(shot.clip);
  if (!extent) return extent.error();
  const Result<render::RenderFrame*> frame = frameOf(shot, quality, isStill);
  if (!frame) return frame.error();
  if (shot.coloring == Coloring::weights) writeWeights(shot.joint);
  if (shot.coloring == Coloring::error && weightsOf_) writeErrors();
  if (Result<void> done = recordSkinning(commandBuffer, shot); !done) return done;
  drawing_.recordBegin(commandBuffer);
  if (Result<void> done = draw(commandBuffer, shot, **frame, *extent); !done) return done;
  drawing_.recordEnd(commandBuffer);
  if (copiesPositions) {
    if (Result<void> done = copyPositions(commandBuffer, shot.views); !done) return done;
  }
  posed_ = shot;
  return {};
}

Result<void> SceneView::addDraws(std::uint32_t figure, Coloring coloring,
                                 std::vector<render::Draw>& draws) const {
  if (Result<void> done = drawn_->addDraws(figure, JointMatrix(), draws); !done) return done;
  if (coloring == Coloring::surface) return {};
  for (std::size_t part = 0; part < draws.size(); ++part) {
    draws[part].values = {values_[part].figures[figure].handle(), 0, sizeof(float),
                          VertexFormat::none};
  }
  return {};
}

Result<void> SceneView::draw(VkCommandBuffer commandBuffer, const Shot& shot,
                             render::RenderFrame& frame, const Box& extent) {
  const std::uint32_t width = frame.target().width(), height = frame.target().height();
  const float radius = render::radiusOf(extent);
  std::array<std::vector<render::Draw>, 2> draws;
  std::vector<render::View> views(shot.views);
  for (std::uint32_t index = 0; index < shot.views; ++index) {
    if (Result<void> done = addDraws(index, shot.coloring, draws[index]); !done) return done;
    render::View& view = views[index];
    view.area = areaOf(index, shot.views, width, height);
    view.draws = draws[index];
    view.casters = extent;
    view.groundHeight = extent.min[1] - 1e-3f * radius;
    view.groundRadius = 5 * radius;
    view.camera =
        shot.camera.camera(withGround(extent), static_cast<float>(view.area.extent.width) /
                                                   static_cast<float>(view.area.extent.height));
  }
  return renderer_->record(commandBuffer, frame, views);
}

Result<void> SceneView::copyPositions(VkCommandBuffer commandBuffer, std::uint32_t figures) {
  std::uint64_t size = 0;
  std::vector<std::pair<VkBuffer, VkBufferCopy>> copies;
  for (std::uint32_t figure = 0; figure < 2; ++figure) {
    copied_[figure].clear();
    if (figure >= figures) continue;
    std::vector<render::Draw> draws;
    if (Result<void> done = addDraws(figure, Coloring::surface, draws); !done) return done;
    for (std::size_t part = 0; part < draws.size(); ++part) {
      CopiedPart& copied = copied_[figure].emplace_back();
      const std::uint32_t count = scene_.parts[part].primitive->vertexCount;
      if (scene_.parts[part].mesh == nullptr || count == 0) continue;
      const render::VertexStream& stream = draws[part].positions;
      copied = {size, stream.stride};
      const VkDeviceSize bytes = std::uint64_t{stream.stride} * (count - 1) + 3 * sizeof(float);
      copies.push_back({stream.buffer, {stream.offset, size, bytes}});
      size += bytes;
    }
  }
  if (positions_.bytes().size() < size) {
    Result<samples::MappedBuffer> made = samples::MappedBuffer::create(
        *device_->device, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
    if (!made) return made.error();
    positions_ = std::move(*made);
  }
  const samples::VulkanFunctions& functions = device_->device->functions();
  for (const auto& [buffer, copy] : copies)
    functions.CmdCopyBuffer(commandBuffer, buffer, positions_.handle(), 1, &copy);
  VkMemoryBarrier barrier{};
  barrier.sType = VK_STRUCTURE_TYPE_MEMORY_BARRIER;
  barrier.srcAccessMask = VK_ACCESS_TRANSFER_WRITE_BIT;
  barrier.dstAccessMask = VK_ACCESS_HOST_READ_BIT;
  functions.CmdPipelineBarrier(commandBuffer, VK_PIPELINE_STAGE_TRANSFER_BIT,
                               VK_PIPELINE_STAGE_HOST_BIT, 0, 1, &barrier, 0, nullptr, 0, nullptr);
  return {};
}

CheckRequest SceneView::skinned() const {
  CheckRequest request;
  request.clip = posed_->clip;
  request.time = posed_->time;
  request.pose = pose_;
  for (std::uint32_t figure = 0; figure < posed_->views; ++figure) {
    SkinnedFigure& skinned = request.figures.emplace_back();
    skinned.method = methods_[figure];
    for (std::size_t part = 0; part < copied_[figure].size(); ++part) {
      std::vector<float>& positions = skinned.positions.emplace_back();
      const CopiedPart& copied = copied_[figure][part];
      if (copied.stride == 0) continue;
      const std::uint32_t count = scene_.parts[part].primitive->vertexCount;
      positions.resize(std::size_t{3} * count);
      for (std::uint32_t vertex = 0; vertex < count; ++vertex) {
        std::memcpy(&positions[std::size_t{3} * vertex],
                    &positions_.bytes()[copied.offset + std::uint64_t{copied.stride} * vertex],
                    3 * sizeof(float));
      }
    }
  }
  return request;
}

Result<void> SceneView::finish() {
  if (drawing_.has()) {
    const Result<double> seconds = drawing_.seconds();
    if (!seconds) return seconds.error();
    times_.drawingSeconds = *seconds;
  }
  if (!hasSkinned_) return {};
  const vulkan::FrameStatistics& last = drawn_->statistics().lastFrame;
  times_.planSeconds = last.planSeconds + last.recordSeconds;
  if (!skinning_.has()) return {};
  const Result<double> seconds = skinning_.seconds();
  if (!seconds) return seconds.error();
  times_.skinningSeconds = *seconds;
  return {};
}

const render::RenderTarget* SceneView::picture() const {
  return shown_ != nullptr && shown_->frame ? &shown_->frame->target() : nullptr;
}

}  // namespace dermis::viewer
