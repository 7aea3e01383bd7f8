#include "kit/bench/throughput.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstring>
#include <limits>
#include <span>
#include <thread>
#include <utility>

#include "dermis/cpu.h"
#include "kit/bench/clip_crowd.h"
#include "kit/bench/plain_batches.h"
#include "kit/in_parallel.h"
#include "kit/timed_batches.h"

namespace dermis::samples {
namespace {

using Section = ThroughputSection;

/// Comparison methods are slow, so a round skins fewer instances with them, by this factor.
constexpr std::uint32_t comparisonShare = 10;
/// Instances per job of the CPU.
constexpr std::uint32_t instancesOfJob = 16;

// -- Skinning on a device.

struct Case {
  std::string name;
  Section section = Section::methods;
  Method method = Method::dualQuaternion;
  OutputLayout layout = {};
  std::uint32_t instances = 0;
  std::size_t place = 0;  ///< index among the cases
};

OutputLayout layoutOf(VertexFormat positions, VertexFormat normals) {
  OutputLayout layout;
  layout.positions = positions;
  layout.normals = normals;
  return layout;
}

std::string methodRow(Method method, std::string_view formats) {
  return "gpu/" + std::string(methodName(method)) + "/" + std::string(formats);
}

std::vector<Case> formatCases() {
  using enum VertexFormat;
  std::vector<Case> cases;
  const auto add = [&cases](std::string_view name, const OutputLayout& layout) {
    cases.push_back({methodRow(Method::dualQuaternion, name), Section::formats,
                     Method::dualQuaternion, layout, 0, 0});
  };
  add("float32x3+octahedral16x2", layoutOf(float32x3, octahedral16x2));
  add("float16x4+octahedral16x2", layoutOf(float16x4, octahedral16x2));
  add("snorm16x4+snorm8x4", layoutOf(snorm16x4, snorm8x4));
  add("float16x3+octahedral8x2", layoutOf(float16x3, octahedral8x2));
  OutputLayout bounds;
  bounds.bounds = true;
  add("float32x3/bounds", bounds);
  OutputLayout kept;
  kept.motion = true;
  add("float32x3/previous_positions", kept);
  return cases;
}

std::vector<Case> gpuCases(std::uint32_t instances) {
  std::vector<Case> cases;
  for (const Method method : allMethods) {
    const std::uint32_t share = isForComparison(method) ? comparisonShare : 1;
    cases.push_back({methodRow(method, "float32x3"), Section::methods, method, OutputLayout(),
                     std::max(instances / share, 1u), 0});
  }
  for (Case& format : formatCases()) {
    format.instances = instances;
    cases.push_back(std::move(format));
  }
  for (std::uint32_t count = 1; count < instances; count *= 10) {
    cases.push_back({methodRow(Method::dualQuaternion, "float32x3") + "/" + std::to_string(count) +
                         (count == 1 ? "_instance" : "_instances"),
                     Section::instances, Method::dualQuaternion, OutputLayout(), count, 0});
  }
  for (std::size_t place = 0; place < cases.size(); ++place) cases[place].place = place;
  return cases;
}

/// The box around the output of the plain kernels.
Box boxOf(std::span<const std::byte> output) {
  constexpr std::size_t stride = 24;
  Box box{{HUGE_VALF, HUGE_VALF, HUGE_VALF}, {-HUGE_VALF, -HUGE_VALF, -HUGE_VALF}};
  for (std::size_t place = 0; place + stride <= output.size(); place += stride) {
    std::array<float, 3> position;
    std::memcpy(position.data(), output.data() + place, sizeof(position));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      box.min[axis] = std::min(box.min[axis], position[axis]);
      box.max[axis] = std::max(box.max[axis], position[axis]);
    }
  }
  // Every side must have a length above 0.
  for (std::size_t axis = 0; axis < 3; ++axis) {
    box.min[axis] -= 1e-3f;
    box.max[axis] += 1e-3f;
  }
  return box;
}

// -- Checks that the plain kernels skin the same as Dermis.

/// The greatest difference between the floats of two outputs; NaN counts as infinite. With
/// `ofPositions`, ignores normals: the plain linear kernel transforms them by the blended matrix,
/// which is not correct in general.
double greatestDifference(std::span<const std::byte> plain, std::span<const std::byte> dermis,
                          bool ofPositions) {
  constexpr std::size_t stride = 24, positionSize = 12;
  double greatest = 0;
  for (std::size_t place = 0; place + 4 <= std::min(plain.size(), dermis.size()); place += 4) {
    if (ofPositions && place % stride >= positionSize) continue;
    float a, b;
    std::memcpy(&a, plain.data() + place, 4);
    std::memcpy(&b, dermis.data() + place, 4);
    const double difference = std::abs(static_cast<double>(a) - static_cast<double>(b));
    if (!(difference <= greatest)) greatest = std::isnan(difference) ? HUGE_VAL : difference;
  }
  return greatest;
}

double largestCoordinate(const Box& box) {
  double largest = 1;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    largest = std::max({largest, std::abs(static_cast<double>(box.min[axis])),
                        std::abs(static_cast<double>(box.max[axis]))});
  }
  return largest;
}

Result<void> compare(std::span<const std::byte> plain, std::span<const std::byte> dermis,
                     const Box& box, Method method) {
  const double difference = greatestDifference(plain, dermis, method == Method::linear);
  const double allowed = 1e-4 * largestCoordinate(box);
  if (difference <= allowed) return {};
  return Error{ErrorCode::invalidData,
               std::string(methodName(method)) +
                   ": the outputs of the plain kernel and of Dermis differ by " +
                   std::to_string(difference) + ", more than the allowed " +
                   std::to_string(allowed) + ", so their times cannot be compared"};
}

// -- On the CPU.

/// Alignment of output buffers as in engines.
struct alignas(64) CacheLine {
  std::byte bytes[64];
};

struct CpuCase {
  const char* name = "";  ///< what follows the method and the number of threads
  Method method = Method::dualQuaternion;
  VertexLayout layout = {.normals = VertexFormat::float32x3};
  bool scales = false;
  /// The instances are divided by it, so that all cases need about the same memory.
  std::uint32_t share = 1;
};

std::vector<CpuCase> cpuCases() {
  using enum VertexFormat;
  const VertexLayout tangents{.normals = float32x3, .tangents = float32x4};
  const VertexLayout compact{.positions = float16x4, .normals = octahedral16x2};
  return {{},
          {.method = Method::linear},
          {.name = "/tangents", .layout = tangents, .share = 2},
          {.name = "/float16x4+octahedral16x2", .layout = compact},
          {.name = "/scales", .scales = true}};
}

std::string cpuRow(Method method, std::uint32_t threads, std::string_view what) {
  return "cpu/" + std::string(methodName(method)) + "/" + std::to_string(threads) +
         std::string(what);
}

class CpuCrowd {
 public:
  static Result<CpuCrowd> create(const Crowd& crowd) {
    Result<cpu::Mesh> mesh = cpu::Mesh::create(*crowd.mesh);
    if (!mesh) return mesh.error();
    return CpuCrowd(crowd, std::move(*mesh));
  }
  std::uint32_t instancesOf(const CpuCase& one) const {
    return std::max(crowd_->instanceCount() / one.share, 1u);
  }

  /// Each thread skins the same number of instances. Returns seconds.
  Result<double> skin(const CpuCase& one, std::uint32_t threads) {
    const Result<VertexPlaces> places = placeVertices(one.layout, crowd_->vertexCount());
    if (!places) return places.error();
    const std::uint32_t count = instancesOf(one);
    const auto lines = static_cast<std::size_t>(places->size * count / sizeof(CacheLine) + 1);
    if (output_.size() < lines) output_.resize(lines);
    std::vector<Result<void>> done(threads);
    const auto begin = std::chrono::steady_clock::now();
    {
      JoiningThreads workers;
      for (std::uint32_t thread = 0; thread < threads; ++thread) {
        const auto first = static_cast<std::uint32_t>(std::uint64_t{count} * thread / threads);
        const auto end = static_cast<std::uint32_t>(std::uint64_t{count} * (thread + 1) / threads);
        const auto work = [this, &done, &one, &places, thread, first, end] {
          done[thread] = skinSome(one, *places, first, end);
        };
        if (thread + 1 < threads) {
          workers.start(work);
        } else {
          work();
        }
      }
    }
    for (const Result<void>& part : done) {
      if (!part) return part.error();
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

 private:
  CpuCrowd(const Crowd& crowd, cpu::Mesh mesh)
      : crowd_(&crowd), mesh_(std::make_unique<cpu::Mesh>(std::move(mesh))) {
    for (const std::vector<JointMatrix>& pose : crowd.poses) {
      std::vector<JointMatrix>& scaled = scaledPoses_.emplace_back(pose);
      for (JointMatrix& joint : scaled) {
        for (auto& row : joint.m) row[0] *= 1.25f;
      }
    }
  }

  Result<void> skinSome(const CpuCase& one, const VertexPlaces& places, std::uint32_t first,
                        std::uint32_t end) {
    std::array<cpu::Instance, instancesOfJob> instances;
    cpu::Job job;
    job.mesh = mesh_.get();
    job.method = one.method;
    job.places = places;
    for (std::uint32_t begin = first; begin < end; begin += instancesOfJob) {
      const std::uint32_t count = std::min(instancesOfJob, end - begin);
      for (std::uint32_t i = 0; i < count; ++i) {
        instances[i].pose = (one.scales ? scaledPoses_ : crowd_->poses)[begin + i];
        instances[i].promise = one.scales ? JointPromise::scaling : JointPromise::scaleIgnored;
        instances[i].output.fill(reinterpret_cast<std::byte*>(output_.data()) +
                                 places.size * (begin + i));
      }
      job.instances = std::span(instances).first(count);
      if (Result<void> skinned = cpu::skin(job); !skinned) return skinned;
    }
    return {};
  }

  const Crowd* crowd_;
  std::unique_ptr<cpu::Mesh> mesh_;
  std::vector<std::vector<JointMatrix>> scaledPoses_;
  std::vector<CacheLine> output_;
};

/// Powers of two, and the number of hardware threads.
std::vector<std::uint32_t> threadCounts() {
  const std::uint32_t most = std::max(std::thread::hardware_concurrency(), 1u);
  std::vector<std::uint32_t> counts;
  for (std::uint32_t count = 1; count < most; count *= 2) counts.push_back(count);
  counts.push_back(most);
  return counts;
}

// -- All rows.

class Rows : public Throughput {
 public:
  Result<void> make(OpenDevice* open, const Crowd& crowd, const std::function<void()>& step) {
    vertexCount_ = crowd.vertexCount();
    if (open != nullptr) {
      if (Result<void> made = makePlain(*open, crowd, step); !made) return made;
      if (Result<void> made = makeGpu(*open, crowd, step); !made) return made;
      if (Result<void> made = makeGpuClips(*open, crowd, step); !made) return made;
    }
    if (Result<void> made = makeCpu(crowd, step); !made) return made;
    if (Result<void> made = makeCpuClips(crowd, step); !made) return made;
    std::vector<std::size_t> order(rows_.size());
    for (std::size_t index = 0; index < order.size(); ++index) order[index] = index;
    std::ranges::stable_sort(order, {}, [this](std::size_t index) {
      return std::pair(rows_[index].section, places_[index]);
    });
    std::vector<ThroughputRow> rows;
    std::vector<std::function<Result<double>()>> runs;
    for (const std::size_t index : order) {
      rows.push_back(std::move(rows_[index]));
      runs.push_back(std::move(runs_[index]));
    }
    rows_ = std::move(rows);
    runs_ = std::move(runs);
    return {};
  }

  Result<void> runRound() override {
    for (std::size_t index = 0; index < rows_.size(); ++index) {
      const Result<double> seconds = runs_[index]();
      if (!seconds) return seconds.error();
      ThroughputRow& row = rows_[index];
      if (row.bestSeconds != 0 && row.bestSeconds <= *seconds) continue;
      row.bestSeconds = *seconds;
      row.millionVerticesPerSecond =
          static_cast<double>(vertexCount_) * row.instances / *seconds * 1e-6;
    }
    return {};
  }

 private:
  void add(std::string name, Section section, std::uint32_t instances,
           std::function<Result<double>()> run, std::size_t place = 0) {
    rows_.push_back({std::move(name), section, instances, 0, 0});
    places_.push_back(place);
    runs_.push_back(std::move(run));
  }

  Result<void> makePlain(OpenDevice& open, const Crowd& crowd, const std::function<void()>& step) {
    Result<std::unique_ptr<PlainBatches>> plain = PlainBatches::create(open, crowd);
    if (!plain) return plain.error();
    plain_ = std::move(*plain);
    for (const auto& [kernel, name] : {std::pair{PlainKernel::dualQuaternion, "dual_quaternion"},
                                       {PlainKernel::linear, "linear"},
                                       {PlainKernel::copy, ""}}) {
      const bool copies = kernel == PlainKernel::copy;
      add(copies ? "gpu/copy" : "gpu/plain/" + std::string(name), Section::baselines,
          crowd.instanceCount(), [this, kernel = kernel] { return plain_->skin(kernel); });
      step();
    }
    return {};
  }

  Result<void> makeGpu(OpenDevice& open, const Crowd& crowd, const std::function<void()>& step) {
    Result<TimedBatches> batches = TimedBatches::create(*open.device, open.context);
    if (!batches) return batches.error();
    batches_ = std::make_unique<TimedBatches>(std::move(*batches));
    std::vector<Case> cases = gpuCases(crowd.instanceCount());
    const bool isRigid = crowd.isRigid();
    const Result<std::vector<std::byte>> plainOutput = plain_->output();
    if (!plainOutput) return plainOutput.error();
    const Box box = boxOf(*plainOutput);
    // The first one determines the size of the output.
    std::ranges::stable_sort(cases, std::greater<>(), [](const Case& one) {
      return std::pair(one.layout.motion, one.instances);
    });
    for (const Case& one : cases) {
      std::vector<SkinRequest> requests = crowd.requests(one.method, one.instances);
      for (SkinRequest& request : requests) request.box = box;
      Result<void> added = batches_->add(requests, one.layout, open.context.tuning());
      step();
      // This build lacks some methods.
      if (!added && added.error().code == ErrorCode::missingFeature) continue;
      if (!added) return added;
      const std::size_t number = batchCount_++;
      if (isRigid && one.section == Section::methods &&
          (one.method == Method::dualQuaternion || one.method == Method::linear)) {
        const PlainKernel kernel =
            one.method == Method::linear ? PlainKernel::linear : PlainKernel::dualQuaternion;
        if (const Result<double> skinned = plain_->skin(kernel); !skinned) return skinned.error();
        const Result<std::vector<std::byte>> expected = plain_->output();
        if (!expected) return expected.error();
        const Result<std::vector<std::byte>> output = batches_->output();
        if (!output) return output.error();
        if (Result<void> same = compare(*expected, *output, box, one.method); !same) return same;
      }
      add(
          one.name, one.section, one.instances, [this, number] { return batches_->skin(number); },
          one.place);
    }
    return {};
  }

  Result<void> makeGpuClips(OpenDevice& open, const Crowd& crowd,
                            const std::function<void()>& step) {
    if (!crowd.clips) return {};
    Result<std::unique_ptr<ClipCrowd>> made = ClipCrowd::onDevice(open, crowd);
    if (!made) return made.error();
    gpuClips_ = std::move(*made);
    constexpr std::size_t last = std::numeric_limits<std::size_t>::max();
    return addClips(*gpuClips_, methodRow(Method::dualQuaternion, "float32x3/clips"),
                    Section::formats, crowd, 1, step, last);
  }

  Result<void> makeCpuClips(const Crowd& crowd, const std::function<void()>& step) {
    if (!crowd.clips) return {};
    Result<std::unique_ptr<ClipCrowd>> made = ClipCrowd::onCpu(crowd);
    if (!made) return made.error();
    cpuClips_ = std::move(*made);
    for (const std::uint32_t threads : threadCounts()) {
      if (Result<void> added =
              addClips(*cpuClips_, cpuRow(Method::dualQuaternion, threads, "/clips"), Section::cpu,
                       crowd, threads, step);
          !added)
        return added;
    }
    return {};
  }

  /// Compares the second frame. The first also uploads meshes and clips, which is not timed.
  Result<void> addClips(ClipCrowd& clips, std::string name, Section section, const Crowd& crowd,
                        std::uint32_t threads, const std::function<void()>& step,
                        std::size_t place = 0) {
    for (int frame = 0; frame < 2; ++frame) {
      if (const Result<double> skinned = clips.skin(threads); !skinned) return skinned.error();
    }
    if (Result<void> same = clips.check(); !same) return same;
    add(
        std::move(name), section, crowd.instanceCount(),
        [&clips, threads] { return clips.skin(threads); }, place);
    step();
    return {};
  }

  Result<void> makeCpu(const Crowd& crowd, const std::function<void()>& step) {
    Result<CpuCrowd> made = CpuCrowd::create(crowd);
    if (!made) return made.error();
    cpu_ = std::make_unique<CpuCrowd>(std::move(*made));
    for (const CpuCase& one : cpuCases()) {
      for (const std::uint32_t threads : threadCounts()) {
        add(cpuRow(one.method, threads, one.name), Section::cpu, cpu_->instancesOf(one),
            [this, one, threads] { return cpu_->skin(one, threads); });
        if (const Result<double> first = cpu_->skin(one, threads); !first) return first.error();
        step();
      }
    }
    return {};
  }

  std::uint32_t vertexCount_ = 0;
  std::vector<std::size_t> places_;  ///< of rows, within their sections
  std::unique_ptr<PlainBatches> plain_;
  std::unique_ptr<TimedBatches> batches_;
  std::size_t batchCount_ = 0;
  std::unique_ptr<CpuCrowd> cpu_;
  std::unique_ptr<ClipCrowd> gpuClips_, cpuClips_;
  std::vector<std::function<Result<double>()>> runs_;
};

}  // namespace

Result<std::unique_ptr<Throughput>> Throughput::create(OpenDevice* open, const Crowd& crowd,
                                                       const std::function<void()>& step) {
  auto rows = std::make_unique<Rows>();
  if (Result<void> made = rows->make(open, crowd, step); !made) return made.error();
  return std::unique_ptr<Throughput>(std::move(rows));
}

std::size_t Throughput::rowCount(const OpenDevice* open, const Crowd& crowd) {
  const std::size_t clips = crowd.clips ? 1 : 0;
  const std::size_t gpu =
      open == nullptr ? 0 : plainKernelCount + gpuCases(crowd.instanceCount()).size() + clips;
  return gpu + (cpuCases().size() + clips) * threadCounts().size();
}

}  // namespace dermis::samples
