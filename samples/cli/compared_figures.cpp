#include "compared_figures.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <utility>

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "dermis/vulkan/context.h"
#include "kit/device.h"

namespace dermis::cli {
namespace {

using samples::MappedBuffer;
using samples::render::Draw;

double diagonalOf(const Box& box) {
  double squares = 0;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double side = static_cast<double>(box.max[axis]) - static_cast<double>(box.min[axis]);
    squares += side * side;
  }
  return std::sqrt(squares);
}

}  // namespace

Result<ComparedFigures> ComparedFigures::create(samples::OpenDevice& device,
                                                samples::render::Renderer& renderer,
                                                const Scene& scene, const ScenePose& pose,
                                                std::span<const Method> methods) {
  std::vector<Method> all(methods.begin(), methods.end());
  all.push_back(Method::dualQuaternion);
  Result<DrawnScene> drawn = DrawnScene::create(device, renderer, scene, all);
  if (!drawn) return drawn.error();
  ComparedFigures figures(device, scene, std::move(*drawn));
  if (Result<void> done = figures.skin(pose); !done) return done.error();
  if (Result<void> done = figures.readBack(); !done) return done.error();
  if (Result<void> done = figures.findBox(); !done) return done.error();
  figures.compareAll();
  return figures;
}

Result<void> ComparedFigures::skin(const ScenePose& pose) {
  if (Result<void> begun = drawn_.beginFrame(); !begun) return begun;
  for (std::uint32_t figure = 0; figure < drawn_.figureCount(); ++figure) {
    if (Result<void> posed = drawn_.setPose(figure, pose); !posed) return posed;
  }
  return device_->device->run(
      [this](VkCommandBuffer commandBuffer) { return drawn_.recordSkinning(commandBuffer); });
}

Result<void> ComparedFigures::readBack() {
  std::vector<std::vector<Draw>> draws(drawn_.figureCount());
  std::vector<VkBufferCopy> copies;
  VkBuffer output = VK_NULL_HANDLE;
  std::uint64_t size = 0;
  for (std::uint32_t figure = 0; figure < drawn_.figureCount(); ++figure) {
    if (Result<void> added = drawn_.addDraws(figure, {}, draws[figure]); !added) return added;
    for (std::size_t part = 0; part < scene_->parts.size(); ++part) {
      const samples::render::VertexStream& stream = draws[figure][part].positions;
      if (scene_->parts[part].mesh == nullptr) continue;
      const std::uint64_t bytes =
          (scene_->parts[part].primitive->vertexCount - std::uint64_t{1}) * stream.stride +
          3 * sizeof(float);
      output = stream.buffer;
      copies.push_back({stream.offset, size, bytes});
      size += bytes;
    }
  }
  Result<MappedBuffer> buffer =
      MappedBuffer::create(*device_->device, size, VK_BUFFER_USAGE_TRANSFER_DST_BIT, true);
  if (!buffer) return buffer.error();
  const Result<void> copied = device_->device->run([&](VkCommandBuffer commandBuffer) {
    if (copies.empty()) return Result<void>();
    const samples::Device& device = *device_->device;
    device_->context.recordBarrier(commandBuffer, Use::dermis, Use::copyRead);
    device.functions().CmdCopyBuffer(commandBuffer, output, buffer->handle(),
                                     static_cast<std::uint32_t>(copies.size()), copies.data());
    device_->context.recordBarrier(commandBuffer, Use::copyWrite, Use::hostRead);
    return Result<void>();
  });
  if (!copied) return copied;
  auto copy = copies.begin();
  for (std::uint32_t figure = 0; figure < drawn_.figureCount(); ++figure) {
    Positions& positions = positions_.emplace_back(scene_->parts.size());
    for (std::size_t part = 0; part < scene_->parts.size(); ++part) {
      if (scene_->parts[part].mesh == nullptr) continue;
      const std::uint32_t vertexCount = scene_->parts[part].primitive->vertexCount;
      positions[part].resize(std::size_t{vertexCount} * 3);
      const std::byte* source = buffer->bytes().data() + (copy++)->dstOffset;
      for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
        std::memcpy(&positions[part][std::size_t{vertex} * 3],
                    source + std::size_t{vertex} * draws[figure][part].positions.stride,
                    3 * sizeof(float));
      }
    }
  }
  return {};
}

Result<void> ComparedFigures::findBox() {
  if (Result<void> begun = drawn_.beginFrame(); !begun) return begun;
  const std::uint32_t count = drawn_.figureCount();
  const Result<std::optional<Box>> base = drawn_.bounds(count - 1);
  if (!base) return base.error();
  if (!*base) return Error{ErrorCode::invalidData, "there is nothing to draw: no vertex is finite"};
  size_ = std::max(diagonalOf(**base), 1e-30);
  box_ = **base;
  floor_ = box_.min[1];
  const auto beyond = static_cast<float>(0.15 * size_);
  for (std::uint32_t figure = 0; figure + 1 < count; ++figure) {
    const Result<std::optional<Box>> box = drawn_.bounds(figure);
    if (!box) return box.error();
    if (!*box) continue;
    if ((*box)->min[1] > (*base)->min[1] - beyond / 10) floor_ = std::min(floor_, (*box)->min[1]);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const float low = (*base)->min[axis], high = (*base)->max[axis];
      box_.min[axis] = std::min(box_.min[axis], std::max((*box)->min[axis], low - beyond));
      box_.max[axis] = std::max(box_.max[axis], std::min((*box)->max[axis], high + beyond));
    }
  }
  box_.min[1] = floor_;  // Nothing below the floor is visible.
  return {};
}

/// The distance of each vertex; 0 if a position is not finite.
std::vector<double> ComparedFigures::distances(std::size_t method, std::size_t part) const {
  const std::vector<float>&a = positions_[method][part], &b = positions_.back()[part];
  std::vector<double> found(a.size() / 3);
  for (std::size_t vertex = 0; vertex < found.size(); ++vertex) {
    double squares = 0;
    for (std::size_t i = vertex * 3; i < vertex * 3 + 3; ++i) {
      const double along = static_cast<double>(a[i]) - static_cast<double>(b[i]);
      squares += along * along;
    }
    if (std::isfinite(squares)) found[vertex] = std::sqrt(squares);
  }
  return found;
}

void ComparedFigures::compareAll() {
  for (std::size_t method = 0; method + 1 < positions_.size(); ++method) {
    FigureDifference& difference = differences_.emplace_back();
    double squares = 0;
    std::size_t count = 0;
    for (std::size_t part = 0; part < scene_->parts.size(); ++part) {
      for (const double distance : distances(method, part)) {
        difference.largest = std::max(difference.largest, distance);
        squares += distance * distance;
        ++count;
      }
    }
    if (count != 0) difference.rootMeanSquare = std::sqrt(squares / static_cast<double>(count));
  }
}

Result<void> ComparedFigures::makeHeatMaps(double hottest) {
  heat_.clear();
  for (std::size_t method = 0; method < differences_.size(); ++method) {
    std::vector<MappedBuffer>& parts = heat_.emplace_back();
    for (std::size_t part = 0; part < scene_->parts.size(); ++part) {
      std::vector<float> values(scene_->parts[part].primitive->vertexCount);
      const std::vector<double> found = distances(method, part);
      std::ranges::transform(found, values.begin(), [hottest](double distance) {
        return static_cast<float>(std::min(distance / hottest, 1.0));
      });
      Result<MappedBuffer> buffer = MappedBuffer::create(
          *device_->device, values.size() * sizeof(float), VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);
      if (!buffer) return buffer.error();
      if (!values.empty())
        std::memcpy(buffer->bytes().data(), values.data(), values.size() * sizeof(float));
      parts.push_back(std::move(*buffer));
    }
  }
  return {};
}

Result<void> ComparedFigures::addDraws(std::size_t method, std::vector<Draw>& draws) const {
  return drawn_.addDraws(static_cast<std::uint32_t>(method), {}, draws);
}

Result<void> ComparedFigures::addHeatMap(std::size_t method, std::vector<Draw>& draws) const {
  const std::size_t first = draws.size();
  if (Result<void> added = addDraws(method, draws); !added) return added;
  for (std::size_t part = 0; part < heat_[method].size(); ++part) {
    Draw& draw = draws[first + part];
    draw.values = {heat_[method][part].handle(), 0, sizeof(float)};
    draw.surface.metallic = 0;
    draw.surface.roughness = 1;
  }
  return {};
}

namespace {

constexpr int planes = 65;  // odd: one is in the middle

glm::dvec3 at(std::span<const float> positions, std::uint32_t vertex) {
  const std::size_t first = std::size_t{vertex} * 3;
  return {positions[first], positions[first + 1], positions[first + 2]};
}

/// The areas of one section in bind pose and skinned, as vectors: the length is the area. Half the
/// sum of the cross products of its corners, which does not depend on the origin.
struct Areas {
  glm::dvec3 rest{0}, skinned{0};
};

class Plane {
 public:
  Plane(std::span<const float> rest, std::span<const float> skinned, double x)
      : rest_(rest), skinned_(skinned), x_(x) {}

  /// A segment of the section runs from the edge that goes down through the plane to the edge that
  /// goes up, so that all triangles have the same orientation.
  void cut(std::span<const std::uint32_t, 3> triangle, Areas& areas) const {
    std::array<glm::dvec3, 2> rest{}, skinned{};
    int crossed = 0;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const std::uint32_t a = triangle[corner], b = triangle[(corner + 1) % 3];
      if (isAbove(a) == isAbove(b)) continue;
      ++crossed;
      const std::size_t end = isAbove(a) ? 0 : 1;
      const double from = at(rest_, a).x, to = at(rest_, b).x;
      const double share = (x_ - from) / (to - from);
      rest[end] = glm::mix(at(rest_, a), at(rest_, b), share);
      skinned[end] = glm::mix(at(skinned_, a), at(skinned_, b), share);
    }
    if (crossed != 2) return;
    areas.rest += glm::cross(rest[0], rest[1]) / 2.0;
    areas.skinned += glm::cross(skinned[0], skinned[1]) / 2.0;
  }

 private:
  bool isAbove(std::uint32_t vertex) const { return at(rest_, vertex).x >= x_; }

  std::span<const float> rest_, skinned_;
  double x_;
};

}  // namespace

double leastSection(const gltf::Primitive& primitive, std::span<const float> positions,
                    const SectionRange& range) {
  double least = 1;
  const std::span<const std::uint32_t> indices(primitive.triangles);
  for (int index = 0; index < planes; ++index) {
    const Plane plane(primitive.positions, positions,
                      range.from + (range.to - range.from) * index / (planes - 1));
    Areas areas;
    for (std::size_t first = 0; first + 2 < indices.size(); first += 3)
      plane.cut(indices.subspan(first).first<3>(), areas);
    const double rest = glm::length(areas.rest);
    if (rest > 0) least = std::min(least, glm::length(areas.skinned) / rest);
  }
  return least;
}

}  // namespace dermis::cli
