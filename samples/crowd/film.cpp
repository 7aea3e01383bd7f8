#include "film.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include <glm/trigonometric.hpp>

#include "coarse_triangles.h"
#include "dermis/vulkan/scope.h"
#include "frames.h"
#include "kit/barrier.h"
#include "kit/exit_status.h"
#include "kit/render/winding.h"

using namespace dermis;

namespace crowd {
namespace {

namespace render = samples::render;

/// Height of a figure in units of the flight plan.
constexpr double figureHeight = 1.75;

/// Direction of the sun in degrees. It does not move with the camera.
constexpr float sunAzimuth = 205, sunElevation = 38;

/// Cells of the grids for coarser triangles, as fractions of the character's longest side.
constexpr std::array coarseCells{0.009, 0.016, 0.03};

/// A box around the whole crowd in all frames, so that shadows do not crawl.
Box boxOf(const FlightPlan& plan, double height) {
  const auto side = static_cast<float>(plan.crowdRadius + plan.unit);
  return {{-side, 0, -side}, {side, static_cast<float>(1.3 * height), side}};
}

/// Each shadow map needs another draw of everything in view, so larger crowds get fewer sky maps.
/// The maps are large, since the figures in a picture are small.
render::ShadowSizes shadowSizes(std::uint64_t triangles) {
  render::ShadowSizes sizes;
  sizes.keyMap = 4096;
  sizes.skyMap = 2048;
  sizes.skyLights = static_cast<std::uint32_t>(
      std::clamp(2e8 / static_cast<double>(std::max<std::uint64_t>(triangles, 1)), 8.0, 24.0));
  return sizes;
}

render::LightingStyle styleAt(const render::Camera& camera) {
  render::LightingStyle style;
  const float cameraAzimuth = glm::degrees(std::atan2(camera.towardsEye.x, camera.towardsEye.z));
  style.keyAzimuth = sunAzimuth - cameraAzimuth;
  style.keyElevation = sunElevation;
  style.haze = 0.55f;
  style.horizonColor = {0.64f, 0.605f, 0.55f};
  style.zenithColor = {0.26f, 0.33f, 0.42f};
  return style;
}

}  // namespace

Result<std::unique_ptr<Film>> Film::create(samples::OpenDevice& device, const Character& character,
                                           const Stroll& stroll, const FilmOptions& options,
                                           std::unique_ptr<samples::PictureWriter> writer) {
  Result<render::Renderer> renderer = render::Renderer::create(*device.device);
  if (!renderer) return renderer.error();
  std::unique_ptr<Film> film(
      new Film(device, character, stroll, options, std::move(writer), std::move(*renderer)));
  if (Result<void> prepared = film->prepareParts(); !prepared) return prepared.error();
  if (Result<void> made = film->makeFrames(); !made) return made.error();
  if (Result<void> made = film->makeProgress(); !made) return made.error();
  film->loadFont();
  return film;
}

Result<void> Film::prepareParts() {
  for (const Part& part : character_->parts()) {
    const Result<render::Surface> surface = appearances_.surface(*part.source);
    if (!surface) return surface.error();
    const Result<const render::Geometry*> geometry = appearances_.geometry(*part.source);
    if (!geometry) return geometry.error();
    parts_.push_back({*geometry, {}, *surface});
  }
  for (const double cell : coarseCells) {
    const std::vector<std::vector<std::uint32_t>> triangles =
        coarseTriangles(character_->parts(), cell);
    for (std::size_t part = 0; part < parts_.size(); ++part) {
      Result<render::Geometry> geometry =
          appearances_.geometry(*character_->parts()[part].source, triangles[part]);
      if (!geometry) return geometry.error();
      parts_[part].coarse.push_back(std::move(*geometry));
    }
  }
  isMirrored_ = samples::isMirrored(character_->pose({}, 0));
  for (const std::string& note : appearances_.notes()) samples::reportNote(note);
  return {};
}

Result<void> Film::makeFrames() {
  std::uint64_t triangles = 0;
  for (const Part& part : character_->parts()) triangles += part.source->triangles.size() / 3;
  render::FrameDescription description;
  description.width = options_.width;
  description.height = options_.height;
  description.shadows = shadowSizes(triangles * stroll_->count());
  for (std::uint32_t index = 0; index < options_.framesInFlight; ++index) {
    Result<render::RenderFrame> frame = renderer_.createFrame(description);
    if (!frame) return frame.error();
    frames_.push_back(std::move(*frame));
  }
  return {};
}

/// Progress counts pictures. If there is only one, it counts the passes of that picture, beginning
/// with the skinning.
Result<void> Film::makeProgress() {
  std::uint32_t steps = options_.frames;
  if (options_.frames == 1) {
    steps = 1 + render::Renderer::passCount(frames_.front(), 1);
    Result<render::PassCounter> passes = render::PassCounter::create(*device_->device, steps);
    if (!passes) return passes.error();
    passes_.emplace(std::move(*passes));
  }
  progress_.emplace("rendering", steps);
  return {};
}

void Film::loadFont() {
  Result<render::Font> font = render::Font::load();
  if (font) {
    panel_.emplace(std::move(*font));
  } else {
    samples::reportNote(font.error().message + "; the film has no statistics");
  }
}

render::View Film::viewAt(std::uint64_t frame) const {
  const FlightPlan& plan = stroll_->flight().plan();
  const Eye eye = stroll_->eye(frame);
  render::View view;
  view.area.extent = {options_.width, options_.height};
  view.camera = stroll_->flight().camera(eye);
  view.casters = boxOf(plan, figureHeight * plan.unit);
  // The haze begins half a radius in front of this distance.
  view.camera.distance = 0.5f * render::radiusOf(view.casters) + static_cast<float>(5 * plan.unit);
  view.style = styleAt(view.camera);
  // Slightly below the soles, because flat soles would otherwise coincide with the ground.
  view.groundHeight = static_cast<float>(-0.004 * plan.unit);
  view.groundRadius = static_cast<float>(3 * plan.crowdRadius);
  return view;
}

/// Near figures are drawn first, so that hidden ones are not shaded.
std::vector<Film::Seen> Film::nearestFirst(const Crowd& crowd, std::uint64_t frame) const {
  const Eye eye = stroll_->eye(frame);
  std::vector<Seen> seen;
  for (std::uint32_t index = 0; index < crowd.figures().size(); ++index) {
    const CrowdFigure& figure = crowd.figures()[index];
    if (!figure.isThere() || !figure.now.isInView) continue;
    const JointMatrix place = stroll_->place(index, frame);
    seen.push_back({std::hypot(static_cast<double>(place.m[0][3]) - eye.place[0], eye.place[1],
                               static_cast<double>(place.m[2][3]) - eye.place[2]),
                    index});
  }
  std::ranges::sort(seen, {},
                    [](const Seen& each) { return std::pair(each.distance, each.figure); });
  return seen;
}

/// The coarsest geometry whose error is at most `error` everywhere.
const render::Geometry* Film::geometryFor(const DrawnPart& part, double error) const {
  const render::Geometry* chosen = part.geometry;
  for (std::size_t level = 0; level < part.coarse.size(); ++level) {
    if (coarseCells[level] * figureHeight * stroll_->flight().plan().unit / 2 <= error)
      chosen = &part.coarse[level];
  }
  return chosen;
}

Result<Film::Draws> Film::drawsOf(const Crowd& crowd, std::uint64_t frame) const {
  Draws draws;
  const Eye eye = stroll_->eye(frame);
  const std::vector<Seen> seen = nearestFirst(crowd, frame);
  for (std::uint32_t index = 0; index < parts_.size(); ++index) {
    const DrawnPart& part = parts_[index];
    for (const auto& [distance, figure] : seen) {
      const Result<InstanceOutput> output =
          crowd.system().output(crowd.figures()[figure].instances[index]);
      if (!output) return output.error();
      if (output->size == 0) continue;
      const auto stream = [&](const OutputAttribute& attribute) -> render::VertexStream {
        return {crowd.system().onDevice()->outputBuffer(), attribute.offset, attribute.stride,
                attribute.format};
      };
      render::Draw draw;
      draw.positions = stream(output->positions);
      if (output->normals.format != VertexFormat::none) draw.normals = stream(output->normals);
      draw.surface = part.surface;
      const std::array<float, 3> tint = wardrobe_.tint(figure, index);
      for (std::size_t i = 0; i < 3; ++i) draw.surface.baseColor[i] *= tint[i];
      draw.transform = stroll_->place(figure, frame);
      draw.isMirrored = isMirrored_;
      const double pixel = stroll_->flight().pixelSize(eye, distance);
      draw.geometry = geometryFor(part, 0.7 * pixel);
      draws.picture.push_back(draw);
      draw.geometry = geometryFor(part, 2 * pixel);
      draws.shadows.push_back(draw);
    }
  }
  return draws;
}

Result<void> Film::record(const Crowd& crowd, std::uint64_t frame, VkCommandBuffer commandBuffer) {
  const Result<Draws> draws = drawsOf(crowd, frame);
  if (!draws) return draws.error();
  render::View view = viewAt(frame);
  view.draws = draws->picture;
  view.shadowDraws = draws->shadows;
  const samples::Device& device = *device_->device;
  render::RenderFrame& target = frames_[frame % frames_.size()];
  const auto afterPass = [&] {
    if (passes_) passes_->record(commandBuffer);
  };
  afterPass();
  recordBarrier(device, commandBuffer, vulkan::outputScope(vulkan::Consumer::vertexInput));
  if (Result<void> drawn = renderer_.record(commandBuffer, target, {&view, 1}, afterPass); !drawn)
    return drawn;
  // The next frame overwrites the vertices that this frame draws.
  recordBarrier(device, commandBuffer, vulkan::inputScope(vulkan::PreviousUse::vertexInput));
  target.target().recordReadBack(device, commandBuffer);
  recorded_ = frame;
  return {};
}

Result<void> Film::watch(VkFence submission) {
  if (!passes_) return {};
  return passes_->wait(submission, [&] { progress_->step(); });
}

PanelNumbers Film::numbersOf(const CrowdReport& report, std::uint64_t frame) const {
  const CrowdReport::Frame& numbers = report.frame(frame);
  const std::optional<std::uint32_t> skinned = report.skinnedBy(numbers);
  PanelNumbers panel;
  panel.device = device_->device->info().name;
  panel.figures = numbers.figures;
  panel.verticesOfFigure = character_->vertexCount();
  panel.instances = numbers.instances;
  panel.outOfView = numbers.outOfView;
  if (skinned) {
    panel.skinned = *skinned;
    panel.notDue = numbers.displayed - std::min(numbers.displayed, *skinned);
  }
  if (!report.title().culledOnGpu) panel.vertices = numbers.cpu.skinnedVertices;
  panel.dispatches = numbers.cpu.dispatches;
  panel.cpuSeconds = numbers.cpu.planSeconds + numbers.cpu.recordSeconds;
  if (numbers.gpu) panel.gpuSeconds = numbers.gpu->seconds;
  return panel;
}

Result<void> Film::writeUpTo(std::uint64_t completedFrame, const CrowdReport& report) {
  while (written_ < std::min(completedFrame, recorded_)) {
    ++written_;
    render::Picture picture{options_.width, options_.height,
                            frames_[written_ % frames_.size()].target().pixels()};
    if (panel_) panel_->draw(picture, numbersOf(report, written_));
    if (Result<void> done = writer_->write(picture); !done) return done;
    if (!passes_) progress_->step();
  }
  return {};
}

Result<void> Film::finish() {
  progress_.reset();
  return writer_->finish();
}

}  // namespace crowd
