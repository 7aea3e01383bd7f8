// Compiles the everyday kernels on the best device, which may be one without hardware, and prints
// what its driver tells about each, a line a kernel: layout, stores, kernel, then NAME=VALUE,
// separated by tabs.
//
//   dermis_compiler_table [ISA_FOLDER]     also writes the machine code of each kernel there

#include <fmt/format.h>

#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>

#include "dermis/plan.h"
#include "dermis/vulkan/context.h"
#include "kit/bench/pipeline_statistics.h"
#include "kit/device.h"
#include "kit/program.h"

namespace {

using namespace dermis;

struct Row {
  const char* name;
  VertexLayout layout;
  bool bounds = false;
};

std::vector<Row> rows() {
  using enum VertexFormat;
  const VertexLayout plain{.positions = float32x3, .normals = float32x3};
  VertexLayout planar = plain, motion = plain, all = plain;
  planar.planar = true;
  motion.motion = true;
  all.tangents = float32x4;
  all.motion = true;
  return {{"float32x3 x2", plain},
          {"float32x3 x2, tangents",
           {.positions = float32x3, .normals = float32x3, .tangents = float32x4}},
          {"float32x3, octahedral16x2", {.positions = float32x3, .normals = octahedral16x2}},
          {"float16x4, octahedral16x2", {.positions = float16x4, .normals = octahedral16x2}},
          {"planar float32x3 x2", planar},
          {"motion, float32x3 x2", motion},
          {"bounds, float32x3 x2", plain, true},
          {"motion, bounds, float32x3 x2, tangents", all, true}};
}

std::string fileNameOf(std::string name) {
  for (char& c : name) {
    if (c == ' ' || c == ',' || c == '/') c = '_';
  }
  return name + ".s";
}

}  // namespace

int main(int argc, char** argv) {
  const std::filesystem::path folder = argc > 1 ? argv[1] : "";
  const auto device = samples::must(samples::Device::create({}));
  const auto statistics = samples::PipelineStatistics::create(*device);
  if (statistics == nullptr) {
    fmt::print(stderr, "dermis_compiler_table: {} tells nothing about kernels\n",
               device->info().name);
    return 1;
  }
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  bool good = true;
  std::set<PipelineId> seen;
  for (const bool staged : {false, true}) {
    limits.stagedStores = staged;
    for (const Row& row : rows()) {
      for (const Method method : allMethods) {
        if (isForComparison(method)) continue;
        const PipelineNeeds needs{.method = method,
                                  .layout = row.layout,
                                  .bounds = row.bounds,
                                  .culledOnGpu = true,
                                  .figures = true,
                                  .morphsOnGpu = true,
                                  .rigs = true};
        for (const PipelineId id : samples::must(pipelines(needs, limits, Tuning{}))) {
          if (!seen.insert(id).second) continue;
          const auto pipeline = samples::must(vulkan::pipelineDescription(id));
          const std::string name =
              fmt::format("{}\t{}\t{}", row.name, staged ? "staged" : "words", pipeline.name);
          const auto kernel = statistics->compile(pipeline, !folder.empty());
          if (!kernel) {
            fmt::print("{}\tFAILED\n", name);
            good = false;
            continue;
          }
          fmt::print("{}\tsubgroup={}", name, kernel->subgroupSize);
          for (const auto& [what, value] : kernel->statistics) fmt::print("\t{}={}", what, value);
          fmt::print("\n");
          if (!folder.empty())
            std::ofstream(folder /
                          fileNameOf(pipeline.module + " " + row.name + " " + pipeline.name))
                << kernel->assembly;
        }
      }
    }
  }
  // Without destructors: Mesa 22.3.6 crashes when it destroys a device without hardware.
  std::fflush(stdout);
  std::_Exit(good ? 0 : 1);
}
