#include "kit/batch_runner.h"

#include <algorithm>
#include <cstring>
#include <exception>
#include <mutex>
#include <optional>
#include <utility>

#include "kit/in_parallel.h"

namespace dermis::samples {
namespace {

/// Places the attributes of one instance after those that are in the outputs already.
class OutputPlacer {
 public:
  OutputPlacer(const OutputLayout& output, ByStream<std::uint64_t>& sizes)
      : output_(output), sizes_(sizes) {}

  void place(std::uint64_t vertices, ByStream<OutputAttribute>& attributes) {
    const auto isTogether = [&](std::size_t stream) {
      const auto which = static_cast<Stream>(stream);
      return output_.arrangement == Arrangement::interleaved ||
             (output_.arrangement == Arrangement::directionsTogether &&
              (which == Stream::normals || which == Stream::tangents));
    };
    std::uint32_t vertexSize = output_.gap;
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      if (isTogether(stream)) vertexSize += formatSize(attributes[stream].format);
    }
    std::uint64_t first = 0;
    std::uint32_t inVertex = 0;
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      OutputAttribute& attribute = attributes[stream];
      const std::uint32_t size = formatSize(attribute.format);
      if (size == 0) continue;
      std::uint64_t& end = sizes_[output_.arrangement == Arrangement::separate ? stream : 0];
      if (isTogether(stream)) {
        if (inVertex == 0) {
          first = end + output_.before;
          // Kernels that store 8 bytes at a time need instances at multiples of 8 bytes.
          end = (first + vertices * vertexSize + 7) / 8 * 8;
        }
        attribute.offset = first + inVertex;
        attribute.stride = vertexSize;
        inVertex += size;
      } else {
        attribute.offset = end;
        attribute.stride = size + output_.gap;
        end = (end + vertices * attribute.stride + 3) / 4 * 4;
      }
    }
  }

 private:
  const OutputLayout& output_;
  ByStream<std::uint64_t>& sizes_;
};

std::uint32_t addPose(BatchLayout& layout, std::span<const JointMatrix> pose,
                      JointPromise promise) {
  PoseDescription palette;
  palette.jointCount = static_cast<std::uint32_t>(pose.size());
  palette.matrixOffset = layout.posesSize;
  palette.promise = promise;
  layout.posesSize += pose.size_bytes();
  layout.poseDescriptions.push_back(palette);
  layout.poses.push_back(pose);
  return static_cast<std::uint32_t>(layout.poses.size() - 1);
}

}  // namespace

BatchLayout layOutBatch(std::span<const SkinRequest> requests, const OutputLayout& output) {
  BatchLayout layout;
  layout.oneOutput = output.arrangement != Arrangement::separate;
  OutputPlacer placer(output, layout.outputs);
  for (const SkinRequest& request : requests) {
    const auto [entry, isNew] = layout.meshOffsets.try_emplace(request.mesh, layout.meshesSize);
    if (isNew) layout.meshesSize += request.mesh->bytes().size();

    Job job;
    job.mesh = request.mesh->info();
    job.meshOffset = entry->second;
    job.pose = addPose(layout, request.pose, request.promise);
    job.method = request.method;
    job.morphs = request.morphs;
    job.box = request.box;
    job.bounds = output.bounds;
    job.restartsMotion = request.restartsMotion;
    job.settles = request.settles;
    job.places[Stream::positions].format = output.positions;
    if (job.mesh.hasNormals) job.places[Stream::normals].format = output.normals;
    if (job.mesh.hasTangents) job.places[Stream::tangents].format = output.tangents;
    if (output.motion) job.places[Stream::previousPositions].format = output.positions;
    placer.place(job.mesh.vertexCount, job.places.attributes);
    layout.jobs.push_back(job);
  }
  if (layout.oneOutput) layout.outputs.fill(layout.outputs[Stream::positions]);
  return layout;
}

namespace {

constexpr std::array<const char*, streamCount> outputNames{
    "the positions' buffer", "the normals' buffer", "the tangents' buffer",
    "the previous positions' buffer"};

/// A tightly packed copy of one attribute of one instance.
std::vector<std::byte> copyAttribute(std::span<const std::byte> output,
                                     const OutputAttribute& attribute, std::uint32_t vertices) {
  const std::size_t size = formatSize(attribute.format);
  std::vector<std::byte> copy(size * vertices);
  for (std::size_t vertex = 0; size != 0 && vertex < vertices; ++vertex) {
    std::memcpy(copy.data() + vertex * size,
                output.data() + attribute.offset + vertex * attribute.stride, size);
  }
  return copy;
}

/// The first three floats of every element.
std::vector<float> floatsOf(const std::vector<std::byte>& bytes, VertexFormat format) {
  std::vector<float> floats;
  if (format != VertexFormat::float32x3 && format != VertexFormat::float32x4) return floats;
  const std::size_t size = formatSize(format);
  floats.resize(bytes.size() / size * 3);
  for (std::size_t element = 0; element * size < bytes.size(); ++element)
    std::memcpy(floats.data() + element * 3, bytes.data() + element * size, 12);
  return floats;
}

}  // namespace

SkinnedAttribute SkinnedVertices::attribute(Stream stream) const {
  const auto index = static_cast<std::size_t>(stream);
  const std::uint32_t size = formatSize(formats[index]);
  if (size == 0) return {};
  return {streams[index].data(), static_cast<std::uint32_t>(streams[index].size() / size), size,
          formats[index]};
}

SkinnedView SkinnedVertices::view() const {
  return {attribute(Stream::positions), attribute(Stream::normals), attribute(Stream::tangents),
          box};
}

void BatchRunner::readOutputs(BatchResult& result) const {
  for (std::size_t index = 0; index < layout_.jobs.size(); ++index) {
    const Job& job = layout_.jobs[index];
    SkinnedVertices& skinned = result.instances[index];
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const OutputAttribute attribute = job.places.attributes[stream];
      skinned.formats[stream] = attribute.format;
      skinned.streams[stream] =
          copyAttribute(outputBytes(outputOf(stream)), attribute, job.mesh.vertexCount);
    }
    skinned.positions = floatsOf(skinned.streams[0], skinned.formats[0]);
    skinned.normals = floatsOf(skinned.streams[1], skinned.formats[1]);
    skinned.box = job.box;
  }
}

void BatchRunner::countChangedBytes(BatchResult& result) const {
  std::array<std::vector<bool>, streamCount> written;
  for (std::size_t buffer = 0; buffer < streamCount; ++buffer)
    written[buffer].resize(outputBytes(buffer).size());
  for (const Job& job : layout_.jobs) {
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const OutputAttribute attribute = job.places.attributes[stream];
      std::vector<bool>& marks = written[outputOf(stream)];
      for (std::uint64_t vertex = 0; vertex < job.mesh.vertexCount; ++vertex) {
        for (std::uint64_t byte = 0; byte < formatSize(attribute.format); ++byte)
          marks[static_cast<std::size_t>(attribute.offset + vertex * attribute.stride + byte)] =
              true;
      }
    }
  }
  for (std::size_t buffer = 0; buffer < streamCount; ++buffer) {
    const std::span<const std::byte> bytes = outputBytes(buffer);
    for (std::size_t byte = 0; byte < bytes.size(); ++byte) {
      if (written[buffer][byte] || bytes[byte] == options_.poison) continue;
      if (result.untouchedBytesChanged++ == 0)
        result.firstChanged = "byte " + std::to_string(byte) + " of " + outputNames[buffer];
    }
  }
}

Result<BatchResult> BatchRunner::run(std::span<const SkinRequest> requests) {
  layout_ = layOutBatch(requests, options_.output);
  Result<BatchResult> result = skin();
  if (!result) return result;
  readOutputs(*result);
  if (options_.countUntouched) countChangedBytes(*result);
  return result;
}

namespace {

/// Hands out the tasks of one call, and collects their results.
class Tasks {
 public:
  Tasks(const TargetPool::Work& work, std::size_t workers)
      : work_(work), workers_(workers), next_(work.pinnedTasks), end_(work.tasks) {
    for (std::size_t worker = 0; worker < workers; ++worker) nextPinned_.push_back(worker);
  }

  /// The next task of a worker: first its pinned tasks, then any.
  std::optional<std::size_t> take(std::size_t worker) {
    const std::lock_guard lock(mutex_);
    std::size_t& pinned = nextPinned_[worker];
    const bool isPinned = pinned < work_.pinnedTasks;
    const std::size_t index = isPinned ? pinned : next_;
    if (index >= end_) return {};
    (isPinned ? pinned : next_) += isPinned ? workers_ : 1;
    return index;
  }
  void end(std::size_t index, Result<void> result) {
    const std::lock_guard lock(mutex_);
    if (result) return work_.done();
    if (index >= end_) return;
    end_ = index;
    result_ = std::move(result);
  }
  void end(std::exception_ptr exception) {
    const std::lock_guard lock(mutex_);
    exception_ = std::move(exception);
    end_ = 0;
  }
  Result<void> result() const {
    if (exception_) std::rethrow_exception(exception_);
    return result_;
  }

 private:
  const TargetPool::Work& work_;
  std::size_t workers_;
  std::mutex mutex_;
  std::vector<std::size_t> nextPinned_;  ///< by worker
  std::size_t next_;
  std::size_t end_;  ///< the lowest index that failed, or the number of tasks
  Result<void> result_;
  std::exception_ptr exception_;
};

}  // namespace

TargetPool::TargetPool(std::shared_ptr<BatchTarget> first, MakeTarget makeTarget,
                       std::size_t threads)
    : targets_{std::move(first)}, makeTarget_(std::move(makeTarget)), threads_(threads) {}

void TargetPool::makeTargets(std::size_t count) {
  while (targets_.size() < std::min(threads_, count)) {
    Result<std::shared_ptr<BatchTarget>> made = makeTarget_();
    if (made) {
      targets_.push_back(std::move(*made));
    } else {
      threads_ = targets_.size();
    }
  }
}

Result<void> TargetPool::run(const Work& work, const Task& task) {
  makeTargets(work.tasks);
  Tasks tasks(work, targets_.size());
  const auto serve = [&](std::size_t worker) {
    try {
      while (const std::optional<std::size_t> index = tasks.take(worker))
        tasks.end(*index, task(*index, *targets_[worker]));
    } catch (...) {
      tasks.end(std::current_exception());
    }
  };
  {
    JoiningThreads others;
    for (std::size_t worker = 1; worker < targets_.size(); ++worker) others.start(serve, worker);
    serve(0);
  }
  return tasks.result();
}

}  // namespace dermis::samples
