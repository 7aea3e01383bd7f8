#include "comparison.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "dermis/cpu.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "kernel_instructions.h"
#include "kit/bench/pipeline_statistics.h"
#include "kit/timed_batches.h"
#include "scene_skinner.h"

namespace dermis::cli {
namespace {

/// Enough for a run to take milliseconds on the CPU, or to keep a whole GPU busy.
constexpr std::uint64_t verticesOnCpu = 1'500'000;
constexpr std::uint64_t verticesOnGpu = 8'000'000;
/// For small meshes with many joints: limits the joint matrices and palettes of all methods.
constexpr std::uint64_t mostPaletteBytes = std::uint64_t{1} << 26;
constexpr std::uint64_t mostComparedInstances = 20'000;
/// Limit for all instances together, even if the number of instances was given.
constexpr std::uint64_t mostVertices = 100'000'000;

/// Whether a kernel treats a joint as rigid (docs/accuracy.md).
bool isRigid(const JointMatrix& joint) {
  const auto at = [&joint](int row, int column) {
    return static_cast<double>(joint.m[row][column]);
  };
  double farthest = 0;
  for (int i = 0; i < 3; ++i) {
    double rowSum = 0;
    for (int j = 0; j < 3; ++j) {
      double product = i == j ? -1 : 0;
      for (int row = 0; row < 3; ++row) product += at(row, i) * at(row, j);
      rowSum += std::abs(product);
    }
    farthest = std::max(farthest, rowSum);
  }
  const double determinant = at(0, 0) * (at(1, 1) * at(2, 2) - at(1, 2) * at(2, 1)) -
                             at(0, 1) * (at(1, 0) * at(2, 2) - at(1, 2) * at(2, 0)) +
                             at(0, 2) * (at(1, 0) * at(2, 1) - at(1, 1) * at(2, 0));
  return determinant > 0 && farthest <= 8e-6;
}

/// The requests for one instance: its parts.
std::vector<samples::SkinRequest> requestsOf(const Scene& scene, const ScenePose& pose) {
  std::vector<samples::SkinRequest> requests = skinRequests(scene, pose);
  for (samples::SkinRequest& request : requests)
    if (std::ranges::all_of(request.pose, isRigid)) request.promise = JointPromise::scaleIgnored;
  return requests;
}

Result<std::uint32_t> chooseInstances(const MethodComparison& comparison,
                                      std::span<const samples::SkinRequest> instance,
                                      const ComparisonOptions& options, bool isCpu) {
  if (options.instances) {
    if (comparison.vertices > mostVertices / *options.instances) {
      return Error{
          ErrorCode::invalidArgument,
          fmt::format("--instances {}: {} × {} vertices exceed the maximum of {}",
                      *options.instances, *options.instances, comparison.vertices, mostVertices)};
    }
    return *options.instances;
  }
  const std::uint64_t wanted = (isCpu ? verticesOnCpu : verticesOnGpu) / comparison.vertices;
  // The joint matrices, and a palette of the largest size for each method except `linear`.
  std::uint64_t bytes = 0;
  for (const samples::SkinRequest& part : instance)
    bytes += part.pose.size() * (48 + 80 * (allMethods.size() - 1));
  return static_cast<std::uint32_t>(std::clamp<std::uint64_t>(
      std::min(wanted, mostPaletteBytes / bytes), 1, mostComparedInstances));
}

double medianOf(std::vector<double> values) {
  std::ranges::sort(values);
  const std::size_t middle = values.size() / 2;
  return values.size() % 2 == 1 ? values[middle] : (values[middle - 1] + values[middle]) / 2;
}

/// The skin kernel that does most of a plan's work.
Result<vulkan::PipelineDescription> mainPipeline(const Plan& plan) {
  Result<vulkan::PipelineDescription> main =
      Error{ErrorCode::invalidArgument, "the plan skins nothing"};
  std::uint32_t most = 0;
  for (const Command& command : plan.commands()) {
    const auto* dispatch = std::get_if<DispatchCommand>(&command);
    if (dispatch == nullptr || dispatch->workgroupCount < most) continue;
    Result<vulkan::PipelineDescription> pipeline = vulkan::pipelineDescription(dispatch->pipeline);
    if (!pipeline || !pipeline->module.starts_with("skin")) continue;
    most = dispatch->workgroupCount;
    main = std::move(pipeline);
  }
  return main;
}

std::uint32_t bytesPerJoint(Method method, bool scales) {
  if (method == Method::linear) return 48;
  return (method == Method::logMatrix ? 48u : 32u) + (scales ? 32u : 0u);
}

struct Differences {
  double largest = 0, squares = 0;
  std::uint64_t count = 0;
};

bool isFinite(const reference::Double3& point) {
  return std::isfinite(point[0]) && std::isfinite(point[1]) && std::isfinite(point[2]);
}

class MethodComparer {
 public:
  MethodComparer(const Scene& scene, const ScenePose& pose, const ComparisonOptions& options,
                 const std::function<void()>& step)
      : scene_(scene),
        pose_(pose),
        options_(options),
        step_(step),
        instance_(requestsOf(scene, pose)) {
    for (const Method method : allMethods) {
      if (allows(scene, method)) comparison_.methods.emplace_back().method = method;
    }
    for (const samples::SkinRequest& request : instance_) {
      comparison_.vertices += request.mesh->vertexCount();
      comparison_.scales = comparison_.scales || request.promise == JointPromise::scaling;
    }
    for (const std::vector<JointMatrix>& palette : pose.poses)
      comparison_.joints += static_cast<std::uint32_t>(palette.size());
    for (ComparedMethod& compared : comparison_.methods)
      compared.bytesPerJoint = bytesPerJoint(compared.method, comparison_.scales);
  }

  Result<MethodComparison> compare(const ComparisonTimer& timer) {
    if (Result<void> done = compareShapes(); !done) return done.error();
    if (Result<void> done = compareOnModel(); !done) return done.error();
    const bool isTimed = timer.isCpu || timer.device != nullptr;
    if (Result<void> done = compareRigs(isTimed); !done) return done.error();
    if (Result<void> done = compareCurved(isTimed); !done) return done.error();
    if (timer.isCpu) {
      if (Result<void> done = timeOnCpu(); !done) return done.error();
    }
    if (Result<void> done = timer.device != nullptr ? time(*timer.device) : planOnly(); !done)
      return done.error();
    return std::move(comparison_);
  }

 private:
  Result<void> compareShapes() {
    for (ComparedMethod& compared : comparison_.methods) {
      const Result<TubeComparison> tube = compareTube(compared.method, options_.shares);
      if (!tube) return tube.error();
      compared.tube = *tube;
      step_();
    }
    return {};
  }

  /// The vertices of all parts, one part after the other.
  Result<std::vector<reference::Double3>> skinModel(Method method) const {
    std::vector<reference::Double3> positions;
    for (std::size_t index = 0; index < scene_.parts.size(); ++index) {
      const ScenePart& part = scene_.parts[index];
      if (part.mesh == nullptr) continue;
      const Result<reference::SkinnedMesh> skinned =
          reference::skin(part.mesh->view(), pose_.pose(part), method, pose_.morphs[index]);
      if (!skinned) return skinned.error();
      positions.insert(positions.end(), skinned->positions.begin(), skinned->positions.end());
    }
    return positions;
  }

  static double sizeOf(const std::vector<reference::Double3>& positions) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    reference::Double3 low{infinity, infinity, infinity}, high{-infinity, -infinity, -infinity};
    for (const reference::Double3& position : positions) {
      if (!isFinite(position)) continue;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        low[axis] = std::min(low[axis], position[axis]);
        high[axis] = std::max(high[axis], position[axis]);
      }
    }
    return std::hypot(high[0] - low[0], high[1] - low[1], high[2] - low[2]);
  }

  Result<void> compareOnModel() {
    const Result<std::vector<reference::Double3>> base = skinModel(Method::dualQuaternion);
    if (!base) return base.error();
    const double size = sizeOf(*base);
    for (ComparedMethod& compared : comparison_.methods) {
      const Result<std::vector<reference::Double3>> skinned = skinModel(compared.method);
      if (!skinned) return skinned.error();
      Differences differences;
      for (std::size_t vertex = 0; vertex < base->size(); ++vertex) {
        const reference::Double3 &a = (*base)[vertex], &b = (*skinned)[vertex];
        if (!isFinite(a) || !isFinite(b)) continue;
        const double distance = std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
        differences.largest = std::max(differences.largest, distance);
        differences.squares += distance * distance;
        ++differences.count;
      }
      step_();
      if (differences.count == 0 || !(size > 0)) continue;
      compared.largestDifference = differences.largest / size;
      compared.rootMeanSquareDifference =
          std::sqrt(differences.squares / static_cast<double>(differences.count)) / size;
    }
    return {};
  }

  /// The median time of a call, over the repetitions.
  template <typename Run>
  Result<double> secondsOf(const Run& run) const {
    using Timer = std::chrono::steady_clock;
    std::vector<double> seconds;
    for (std::uint32_t repetition = 0; repetition < options_.repetitions; ++repetition) {
      const auto begin = Timer::now();
      if (Result<void> done = run(); !done) return done.error();
      seconds.push_back(std::chrono::duration<double>(Timer::now() - begin).count());
    }
    return medianOf(std::move(seconds));
  }

  /// Skins copies of the tube in bind pose with dual quaternions.
  Result<double> secondsPerVertex(const PackedMesh& packed, std::span<const JointMatrix> pose) {
    constexpr std::size_t copies = 16;
    const Result<cpu::Mesh> mesh = cpu::Mesh::create(packed);
    if (!mesh) return mesh.error();
    const Result<VertexPlaces> places = placeVertices(VertexLayout{}, packed.vertexCount());
    if (!places) return places.error();
    std::vector<std::byte> output(static_cast<std::size_t>(places->size) * copies);
    std::vector<cpu::Instance> instances(copies);
    for (std::size_t i = 0; i < copies; ++i) {
      instances[i].pose = pose;
      instances[i].promise = JointPromise::scaleIgnored;
      instances[i].output.fill(output.data() + places->size * i);
    }
    cpu::Job job;
    job.mesh = &*mesh;
    job.places = *places;
    job.instances = instances;
    job.method = Method::dualQuaternion;
    const Result<double> seconds = secondsOf([&] { return cpu::skin(job); });
    if (!seconds) return seconds;
    return *seconds / static_cast<double>(copies * packed.vertexCount());
  }

  /// Evaluates a rig. Given weights are 0.
  Result<double> secondsPerPose(const PackedRig& rig, std::span<const JointMatrix> written) const {
    constexpr int poses = 1000;
    std::vector<JointMatrix> driven(rig.drivenJoints());
    const std::vector<float> given(rig.givenWeights());
    std::vector<float> weights(given.size() + rig.drivenWeights());
    const Result<double> seconds = secondsOf([&]() -> Result<void> {
      for (int i = 0; i < poses; ++i) {
        if (Result<void> done = evaluateRig(rig, written, given, driven, weights); !done)
          return done;
      }
      return {};
    });
    if (!seconds) return seconds;
    return *seconds / poses;
  }

  Result<void> compareRigs(bool isTimed) {
    ComparedRigs& rigs = comparison_.rigs;
    for (const auto& [skin, rig] : scene_.rigs) {
      rigs.drivenJoints += rig.packed.drivenJoints();
      rigs.drivenWeights += rig.packed.drivenWeights();
      if (!isTimed || pose_.poses[skin].empty()) continue;
      const Result<double> seconds = secondsPerPose(
          rig.packed, std::span(pose_.poses[skin]).first(rig.packed.writtenJoints()));
      if (!seconds) return seconds.error();
      rigs.secondsPerPose = rigs.secondsPerPose.value_or(0) + *seconds;
    }
    return {};
  }

  Result<void> compareCurved(bool isTimed) {
    const Result<CurvedTube> tube = makeCurvedTube();
    if (!tube) return tube.error();
    CurvedComparison& curved = comparison_.curved;
    curved.tube = tube->shape;
    if (!isTimed) return {};
    std::vector<JointMatrix> pose(3);
    const Result<double> perPose = secondsPerPose(tube->rig, pose);
    if (!perPose) return perPose.error();
    pose.resize(3 + tube->rig.drivenJoints());
    const Result<double> perVertex = secondsPerVertex(tube->mesh, pose);
    if (!perVertex) return perVertex.error();
    const Result<double> straight = secondsPerVertex(tube->straight, std::span(pose).first(2));
    if (!straight) return straight.error();
    curved.secondsPerPose = *perPose;
    curved.secondsPerVertex = *perVertex;
    curved.secondsPerStraight = *straight;
    return {};
  }

  std::vector<samples::SkinRequest> allRequests(Method method, std::uint32_t instances) const {
    std::vector<samples::SkinRequest> requests;
    for (std::uint32_t instance = 0; instance < instances; ++instance)
      requests.insert(requests.end(), instance_.begin(), instance_.end());
    for (samples::SkinRequest& request : requests) request.method = method;
    return requests;
  }

  Result<void> time(samples::OpenDevice& open) {
    const Result<std::uint32_t> instances =
        chooseInstances(comparison_, instance_, options_, open.device->info().type == "CPU");
    if (!instances) return instances.error();
    comparison_.instances = *instances;
    comparison_.repetitions = options_.repetitions;
    Result<samples::TimedBatches> batches =
        samples::TimedBatches::create(*open.device, open.context);
    if (!batches) return batches.error();
    comparison_.clock = batches->hasTimestamps() ? Clock::timestamps : Clock::submission;
    std::vector<vulkan::PipelineDescription> pipelines;
    for (const ComparedMethod& compared : comparison_.methods) {
      const Result<void> added =
          batches->add(allRequests(compared.method, *instances), {}, open.context.tuning());
      if (!added) return added.error();
      Result<vulkan::PipelineDescription> main = mainPipeline(batches->plan(pipelines.size()));
      if (!main) return main.error();
      pipelines.push_back(std::move(*main));
      step_();
    }
    if (Result<void> timed = repeat([&](std::size_t method) { return batches->skin(method); });
        !timed)
      return timed;
    countInstructions(pipelines, samples::PipelineStatistics::create(*open.device).get());
    return {};
  }

  /// `run` returns the time of a method, or less than 0 if it is not timed.
  template <typename Run>
  Result<void> repeat(const Run& run) {
    // Methods take turns, so that other load on the machine affects all of them equally.
    std::vector<std::vector<double>> seconds(comparison_.methods.size());
    for (std::uint32_t repetition = 0; repetition < options_.repetitions; ++repetition) {
      for (std::size_t method = 0; method < seconds.size(); ++method) {
        const Result<double> taken = run(method);
        if (!taken) return taken.error();
        if (*taken >= 0) seconds[method].push_back(*taken);
      }
      step_();
    }
    for (std::size_t method = 0; method < seconds.size(); ++method) {
      if (!seconds[method].empty()) comparison_.methods[method].seconds = medianOf(seconds[method]);
    }
    const double linear = *comparison_.methods.front().seconds;
    for (ComparedMethod& compared : comparison_.methods) {
      if (linear > 0 && compared.seconds) compared.time = *compared.seconds / linear;
    }
    return {};
  }

  Result<void> timeOnCpu() {
    const Result<std::uint32_t> count = chooseInstances(comparison_, instance_, options_, true);
    if (!count) return count.error();
    comparison_.instances = *count;
    comparison_.repetitions = options_.repetitions;
    comparison_.clock = Clock::oneThread;
    VertexLayout layout;
    layout.normals = VertexFormat::float32x3;
    std::vector<cpu::Mesh> meshes;
    meshes.reserve(instance_.size());
    std::vector<cpu::Job> jobs;
    std::vector<std::vector<cpu::Instance>> instances;
    std::vector<std::vector<std::byte>> outputs;
    for (const samples::SkinRequest& part : instance_) {
      Result<cpu::Mesh> mesh = cpu::Mesh::create(*part.mesh);
      if (!mesh) return mesh.error();
      meshes.push_back(std::move(*mesh));
      VertexLayout own = layout;
      if (!part.mesh->info().hasNormals) own.normals = VertexFormat::none;
      const Result<VertexPlaces> places = placeVertices(own, part.mesh->vertexCount());
      if (!places) return places.error();
      std::vector<std::byte>& output = outputs.emplace_back(places->size * *count);
      std::vector<cpu::Instance>& all = instances.emplace_back(*count);
      for (std::uint32_t i = 0; i < *count; ++i) {
        all[i].pose = part.pose;
        all[i].promise = part.promise;
        all[i].morphs = part.morphs;
        all[i].output.fill(output.data() + places->size * i);
      }
      cpu::Job& job = jobs.emplace_back();
      job.mesh = &meshes.back();
      job.places = *places;
      job.instances = all;
    }
    return repeat([&](std::size_t number) -> Result<double> {
      const Method method = comparison_.methods[number].method;
      if (isForComparison(method)) return -1.0;
      using Timer = std::chrono::steady_clock;
      const auto begin = Timer::now();
      for (cpu::Job& job : jobs) {
        job.method = method;
        if (Result<void> done = cpu::skin(job); !done) return done.error();
      }
      return std::chrono::duration<double>(Timer::now() - begin).count();
    });
  }

  /// Plans for a device with enough storage buffers and no optional features.
  Result<void> planOnly() {
    DeviceLimits limits;
    limits.maxStorageBuffersPerStage = storageBuffersWanted;
    std::vector<vulkan::PipelineDescription> pipelines;
    for (const ComparedMethod& compared : comparison_.methods) {
      const std::vector<samples::SkinRequest> requests = allRequests(compared.method, 1);
      const samples::BatchLayout layout = samples::layOutBatch(requests, {});
      Plan plan;
      if (Result<void> planned = makePlan(layout.batch(), limits, {}, plan); !planned)
        return planned;
      Result<vulkan::PipelineDescription> main = mainPipeline(plan);
      if (!main) return main.error();
      pipelines.push_back(std::move(*main));
    }
    countInstructions(pipelines, nullptr);
    return {};
  }

  /// Counts from the driver, if it counts the instructions of every kernel.
  void countInstructions(const std::vector<vulkan::PipelineDescription>& pipelines,
                         const samples::PipelineStatistics* statistics) {
    std::vector<std::optional<std::uint64_t>> counts;
    if (statistics != nullptr) {
      for (const vulkan::PipelineDescription& pipeline : pipelines) {
        if (const auto kernel = statistics->compile(pipeline))
          counts.push_back(kernel->instructionCount());
        else
          counts.push_back(std::nullopt);
      }
    }
    comparison_.instructionSource = InstructionSource::driver;
    if (counts.empty() || std::ranges::any_of(counts, [](const auto& count) { return !count; })) {
      comparison_.instructionSource = InstructionSource::spirv;
      counts.clear();
      for (const vulkan::PipelineDescription& pipeline : pipelines)
        counts.push_back(spirvInstructionCount(pipeline));
    }
    for (std::size_t method = 0; method < counts.size(); ++method)
      comparison_.methods[method].instructions = counts[method];
  }

  const Scene& scene_;
  const ScenePose& pose_;
  const ComparisonOptions& options_;
  const std::function<void()>& step_;
  const std::vector<samples::SkinRequest> instance_;
  MethodComparison comparison_;
};

}  // namespace

std::size_t comparisonSteps(const ComparisonOptions& options, const ComparisonTimer& timer) {
  const bool isTimed = timer.device != nullptr || timer.isCpu;
  return allMethods.size() * (timer.device != nullptr ? 3 : 2) +
         (isTimed ? options.repetitions : 0);
}

Result<MethodComparison> compareMethods(const Scene& scene, const ScenePose& pose,
                                        const ComparisonTimer& timer,
                                        const ComparisonOptions& options,
                                        const std::function<void()>& step) {
  return MethodComparer(scene, pose, options, step).compare(timer);
}

}  // namespace dermis::cli
