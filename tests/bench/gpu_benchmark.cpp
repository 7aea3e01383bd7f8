// Which way to read and to store, which workgroup size and how many instances an invocation are
// fastest on a GPU, beside a kernel that only copies. Results of all ways must be the same to the
// bit; the program ends with 1 where they are not.
//
//   dermis_gpu_benchmark FILE.json [SECONDS [INSTANCES [COMMIT]]]
//
// DERMIS_DEVICE in the environment names another Vulkan device than the best.

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "bench_scene.h"
#include "kit/bench/crowd.h"
#include "kit/bench/plain_batches.h"
#include "kit/device.h"
#include "kit/timed_batches.h"

namespace dermis::bench {
namespace {

using Json = nlohmann::ordered_json;

[[noreturn]] void stop(const Error& error) {
  std::fprintf(stderr, "dermis_gpu_benchmark: error: %s\n", error.message.c_str());
  std::exit(5);
}

template <typename T>
T must(Result<T> result) {
  if (!result) stop(result.error());
  return std::move(*result);
}

constexpr std::uint32_t figureVertices = 10'000;

/// A context for each way to read and to store.
struct Way {
  const char* reads;
  const char* stores;
  vulkan::Context context;
};

std::vector<Way> waysOn(const samples::Device& device) {
  struct Choice {
    const char* reads;
    const char* stores;
    bool texels, staged;
  };
  std::vector<Way> ways;
  for (const Choice& choice :
       {Choice{"storage", "words", false, false}, Choice{"storage", "staged", false, true},
        Choice{"texels", "wide", true, false}}) {
    vulkan::DeviceDescription description = device.description();
    description.texelBuffers = choice.texels;
    description.stagedStores = choice.staged;
    vulkan::Context context = must(vulkan::Context::create(description));
    if (context.limits().texelBuffers != choice.texels) continue;  // too few of them
    ways.push_back({choice.reads, choice.stores, std::move(context)});
  }
  return ways;
}

struct Row {
  std::string section, name;
  Way* way = nullptr;  ///< none: the kernel that copies
  Tuning tuning;
  std::uint32_t instances = 0;
  std::uint32_t bytes = 24;  ///< written a vertex
  double bestSeconds = 1e30;
  std::function<double()> run;

  double rate() const {  ///< million vertices a second
    return static_cast<double>(instances) * figureVertices / bestSeconds / 1e6;
  }
};

struct Layout {
  const char* name;
  samples::OutputLayout output;
  Method method = Method::dualQuaternion;
};

std::vector<Layout> layouts() {
  using enum VertexFormat;
  const auto of = [](const char* name, VertexFormat positions, VertexFormat normals) {
    Layout layout{name, {}};
    layout.output.positions = positions;
    layout.output.normals = normals;
    return layout;
  };
  // The largest first: it decides how much memory there is for all.
  std::vector<Layout> all{of("float32x3, float32x3, previous positions", float32x3, float32x3),
                          of("float32x3, float32x3", float32x3, float32x3),
                          of("float32x3", float32x3, none),
                          of("float32x3, octahedral16x2", float32x3, octahedral16x2),
                          of("float16x4, octahedral16x2", float16x4, octahedral16x2),
                          of("float16x3, octahedral8x2", float16x3, octahedral8x2),
                          of("float32x4, float32x4", float32x4, float32x4),
                          of("float32x3, float32x3, linear", float32x3, float32x3),
                          of("float32x3, float32x3, bounds", float32x3, float32x3),
                          of("float32x3, float32x3, planar", float32x3, float32x3)};
  all.front().output.motion = true;
  all[7].method = Method::linear;
  all[8].output.bounds = true;
  all[9].output.arrangement = samples::Arrangement::planar;
  return all;
}

Layout usualLayout() {
  return layouts()[1];
}

class Measurement {
 public:
  Measurement(samples::OpenDevice& open, std::uint32_t instances)
      : device_(*open.device),
        crowd_(must(samples::longFigure(figureVertices, instances))),
        ways_(waysOn(device_)),
        plain_(must(samples::PlainBatches::create(open, crowd_))) {
    Row copy;
    copy.section = "copy";
    copy.name = "24 bytes a vertex";
    copy.instances = instances;
    copy.run = [this] { return must(plain_->skin(samples::PlainKernel::copy)); };
    rows_.push_back(copy);
  }

  /// Every tuning, every way.
  void search(double seconds) {
    for (Way& way : ways_) {
      samples::TimedBatches& batches = addBatches(way);
      for (const std::uint32_t workgroupSize : {32u, 64u, 128u}) {
        for (const std::uint32_t each : {1u, 2u, 4u, 8u, 16u, 24u})
          add("tuning", usualLayout(), way, batches, {workgroupSize, each, 0}, instances());
      }
    }
    runAll(seconds);
    best_ = *std::ranges::max_element(
        rows_, {}, [](const Row& row) { return row.section == "tuning" ? row.rate() : 0.0; });
  }

  /// From which number of instances on an invocation should skin several: `Tuning::minWorkgroups`.
  void measureSmallDispatches(double seconds) {
    for (const std::uint32_t count : {1u, 3u, 10u, 30u, 100u}) {
      if (count > instances()) continue;
      samples::TimedBatches& batches = addBatches(*best_.way);
      for (const std::uint32_t each : {1u, 2u, 4u, 8u}) {
        if (each <= count)
          add("small", usualLayout(), *best_.way, batches, {best_.tuning.workgroupSize, each, 0},
              count);
      }
    }
    runAll(seconds);
  }

  /// The layouts, every way, in the best tuning of that way.
  void measureLayouts(double seconds) {
    for (Way& way : ways_) {
      samples::TimedBatches& batches = addBatches(way);
      const Tuning tuning = bestOf(way).tuning;
      for (const Layout& layout : layouts())
        add("layouts", layout, way, batches, tuning, instances());
    }
    runAll(seconds);
  }

  const Row& best() const { return best_; }
  const std::vector<Row>& rows() const { return rows_; }
  bool areSame() const { return areSame_; }

 private:
  std::uint32_t instances() const { return crowd_.instanceCount(); }

  const Row& bestOf(const Way& way) const {
    return *std::ranges::max_element(rows_, {}, [&](const Row& row) {
      return row.section == "tuning" && row.way == &way ? row.rate() : 0.0;
    });
  }

  samples::TimedBatches& addBatches(Way& way) {
    batches_.push_back(std::make_unique<samples::TimedBatches>(
        must(samples::TimedBatches::create(device_, way.context))));
    return *batches_.back();
  }

  void add(const char* section, const Layout& layout, Way& way, samples::TimedBatches& batches,
           const Tuning& tuning, std::uint32_t count) {
    const std::vector<samples::SkinRequest> requests = crowd_.requests(layout.method, count);
    const Result<void> added = batches.add(requests, layout.output, tuning);
    if (!added) stop(added.error());
    Row row;
    row.section = section;
    row.name = layout.name;
    row.way = &way;
    row.tuning = tuning;
    row.instances = count;
    row.bytes = formatSize(layout.output.positions) * (!layout.output.motion ? 1 : 2) +
                formatSize(layout.output.normals);
    compare(layout, row, must(batches.output()));
    const std::size_t number = numbers_[&batches]++;
    row.run = [&batches, number] { return must(batches.skin(number)); };
    rows_.push_back(std::move(row));
  }

  /// With what the first way wrote.
  void compare(const Layout& layout, const Row& row, const std::vector<std::byte>& output) {
    // In the first frame kept positions are what stood there before.
    if (layout.output.motion) return;
    const std::size_t size = std::size_t{row.instances} * figureVertices * row.bytes;
    const std::size_t hash = std::hash<std::string_view>()(
        {reinterpret_cast<const char*>(output.data()), std::min(size, output.size())});
    const auto [first, isNew] =
        hashes_.try_emplace(row.name + ", " + std::to_string(row.instances), hash);
    if (first->second == hash) return;
    std::fprintf(stderr, "dermis_gpu_benchmark: error: %s: not the same bits in every way\n",
                 layout.name);
    areSame_ = false;
  }

  /// In turn, so that what else the machine does hits all alike; at least three times.
  void runAll(double seconds) {
    const auto begin = std::chrono::steady_clock::now();
    const auto elapsed = [&] {
      return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    };
    for (int round = 0; round < 3 || elapsed() < seconds; ++round) {
      for (std::size_t number = firstOfSection_; number < rows_.size(); ++number)
        rows_[number].bestSeconds = std::min(rows_[number].bestSeconds, rows_[number].run());
    }
    batches_.clear();
    numbers_.clear();
    for (Row& row : rows_) row.run = nullptr;
    firstOfSection_ = rows_.size();
  }

  samples::Device& device_;
  samples::Crowd crowd_;
  std::vector<Way> ways_;
  std::unique_ptr<samples::PlainBatches> plain_;
  std::vector<std::unique_ptr<samples::TimedBatches>> batches_;
  std::map<samples::TimedBatches*, std::size_t> numbers_;  ///< of batches in each
  std::map<std::string, std::size_t> hashes_;
  std::vector<Row> rows_;
  std::size_t firstOfSection_ = 0;
  Row best_;
  bool areSame_ = true;
};

std::uint64_t workgroupsOf(const Row& row) {
  const auto divideUp = [](std::uint64_t a, std::uint64_t b) { return (a + b - 1) / b; };
  return divideUp(figureVertices, row.tuning.workgroupSize) *
         divideUp(row.instances, row.tuning.instancesPerInvocation);
}

void printRow(const Row& row, double copyRate) {
  const double gigabytes = row.rate() * row.bytes / 1e3;
  if (row.way == nullptr) {
    std::printf("%-8s %-40s %8s %7s %4s %5s %9u %10s %12.1f %8.1f %7.2f\n", row.section.c_str(),
                row.name.c_str(), "-", "-", "-", "-", row.instances, "-", row.rate(), gigabytes,
                1.0);
    return;
  }
  std::printf("%-8s %-40s %8s %7s %4u %5u %9u %10llu %12.1f %8.1f %7.2f\n", row.section.c_str(),
              row.name.c_str(), row.way->reads, row.way->stores, row.tuning.workgroupSize,
              row.tuning.instancesPerInvocation, row.instances,
              static_cast<unsigned long long>(workgroupsOf(row)), row.rate(), gigabytes,
              row.rate() / copyRate);
}

Json jsonOf(const Row& row) {
  Json json;
  json["section"] = row.section;
  json["name"] = row.name;
  if (row.way != nullptr) {
    json["reads"] = row.way->reads;
    json["stores"] = row.way->stores;
    json["workgroup_size"] = row.tuning.workgroupSize;
    json["instances_per_invocation"] = row.tuning.instancesPerInvocation;
    json["workgroups"] = workgroupsOf(row);
  }
  json["instances"] = row.instances;
  json["bytes_written_a_vertex"] = row.bytes;
  json["best_seconds"] = row.bestSeconds;
  json["million_vertices_per_second"] = row.rate();
  return json;
}

double numberOr(int argc, char** argv, int index, double fallback) {
  if (index < argc) std::from_chars(argv[index], argv[index] + std::strlen(argv[index]), fallback);
  return fallback;
}

int measure(int argc, char** argv, samples::OpenDevice& open) {
  const double seconds = numberOr(argc, argv, 2, 60);
  const auto instances =
      static_cast<std::uint32_t>(std::clamp(numberOr(argc, argv, 3, 1000), 1.0, 1e5));
  const std::string device = open.device->info().name, type = open.device->info().type,
                    driver = samples::driverVersion(*open.device), commit = argc > 4 ? argv[4] : "";
  std::printf("device  %s (%s)\ndriver  %s\ncommit  %s\n", device.c_str(), type.c_str(),
              driver.c_str(), commit.c_str());
  std::printf(
      "model   %u vertices of 60 joints, four influences per vertex; best of all rounds\n\n",
      figureVertices);
  std::printf("%-8s %-40s %8s %7s %4s %5s %9s %10s %12s %8s %7s\n", "", "", "reads", "stores",
              "size", "each", "instances", "workgroups", "M vertices/s", "GB/s", "x copy");
  std::fflush(stdout);
  Measurement measurement(open, instances);
  measurement.search(seconds * 0.5);
  measurement.measureSmallDispatches(seconds * 0.2);
  measurement.measureLayouts(seconds * 0.3);

  const double copyRate = measurement.rows().front().rate();
  Json json;
  json["device"] = device;
  json["type"] = type;
  json["driver"] = driver;
  json["commit"] = commit;
  json["vertices"] = figureVertices;
  json["rows"] = Json::array();
  for (const Row& row : measurement.rows()) {
    printRow(row, copyRate);
    json["rows"].push_back(jsonOf(row));
  }
  const Row& best = measurement.best();
  std::printf(
      "\nbest    %s reads, %s stores, workgroups of %u, %u instances an invocation: %.2f of the "
      "copy\n",
      best.way->reads, best.way->stores, best.tuning.workgroupSize,
      best.tuning.instancesPerInvocation, best.rate() / copyRate);
  const Tuning used = open.context.tuning();
  std::printf("now     %s reads, %s stores, workgroups of %u, %u instances an invocation\n",
              open.context.limits().texelBuffers ? "texels" : "storage",
              open.context.limits().stagedStores && !open.context.limits().texelBuffers ? "staged"
              : open.context.limits().texelBuffers                                      ? "wide"
                                                                                        : "words",
              used.workgroupSize, used.instancesPerInvocation);
  json["best"] = jsonOf(best);
  std::ofstream file(argv[1]);
  file << json.dump(2, ' ', false, Json::error_handler_t::replace) << "\n";
  if (!file.flush()) {
    std::fprintf(stderr, "dermis_gpu_benchmark: error: cannot write %s\n", argv[1]);
    return 5;
  }
  return measurement.areSame() ? 0 : 1;
}

}  // namespace
}  // namespace dermis::bench

int main(int argc, char** argv) {
  if (argc < 2) {
    std::fprintf(stderr, "usage: dermis_gpu_benchmark FILE.json [SECONDS [INSTANCES [COMMIT]]]\n");
    return 2;
  }
  auto* open = dermis::bench::benchDevice();
  if (open == nullptr) return 4;
  return dermis::bench::measure(argc, argv, *open);
}
