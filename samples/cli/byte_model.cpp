#include "byte_model.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <unordered_map>

#include "abi.h"
#include "dermis/layout.h"
#include "dermis/plan.h"
#include "kernel_instructions.h"

namespace dermis::cli {
namespace {

constexpr double sector = 32;  // bytes that a cache transfers together
constexpr std::uint32_t influences = 4, instancesEach = 4;

// SPIR-V 1.3, section 3.32.
constexpr std::uint32_t opTypeFloat = 22, opTypeVector = 23, opLoopMerge = 246, opLabel = 248,
                        opFNegate = 127, opFAdd = 129, opFSub = 131, opFMul = 133, opFDiv = 136,
                        opFRem = 140, opFMod = 141, opVectorTimesScalar = 142;

bool isArithmetic(std::uint32_t opcode) {
  return opcode == opFNegate || opcode == opFAdd || opcode == opFSub || opcode == opFMul ||
         opcode == opFDiv || opcode == opFRem || opcode == opFMod ||
         opcode == opVectorTimesScalar || opcode == opExtInst;
}

struct Instruction {
  std::uint32_t opcode = 0;
  std::span<const std::uint32_t> operands;
};

std::vector<Instruction> instructionsOf(std::span<const std::uint32_t> words) {
  constexpr std::size_t headerWords = 5;
  std::vector<Instruction> all;
  for (std::size_t place = headerWords; place < words.size();) {
    const std::size_t length = words[place] >> 16;
    if (length == 0 || length > words.size() - place) return {};
    all.push_back({words[place] & 0xffffu, words.subspan(place + 1, length - 1)});
    place += length;
  }
  return all;
}

/// Counts the operations of a kernel with all functions inlined into `main`. It has a loop over
/// instances; on CPU devices it is in another, over runs of instances. Code outside them runs once
/// per vertex and invocation. What is in further loops counts once: none is over influences. An
/// `fma` counts once.
double countOperations(std::span<const std::uint32_t> words, std::size_t instanceLoops) {
  const std::vector<Instruction> instructions = instructionsOf(words);
  std::unordered_map<std::uint32_t, double> floats;  // of types
  for (const auto& [opcode, operands] : instructions) {
    if (opcode == opTypeFloat) floats[operands[0]] = 1;
    if (opcode == opTypeVector && floats.contains(operands[1]))
      floats[operands[0]] = static_cast<double>(operands[2]) * floats[operands[1]];
  }
  double operations = 0;
  std::vector<std::uint32_t> loops;
  bool isInFunction = false;
  for (const auto& [opcode, operands] : instructions) {
    if (opcode == opFunction) isInFunction = true;
    if (opcode == opLabel) {
      while (!loops.empty() && std::ranges::find(loops, operands[0]) != loops.end())
        loops.pop_back();
    }
    if (opcode == opLoopMerge) loops.push_back(operands[0]);
    if (!isInFunction || !isArithmetic(opcode)) continue;
    const auto type = floats.find(operands[0]);
    if (type == floats.end()) continue;
    operations += type->second / (loops.size() < instanceLoops ? instancesEach : 1);
  }
  return operations;
}

struct Layout {
  const char* name;
  VertexFormat positions, normals;
};

/// Bytes of the sectors that a subgroup's stores touch, per vertex. If each store writes some bytes
/// of every record, it touches all sectors of all records.
double storedBytes(const Layout& layout, const vulkan::PipelineDescription& pipeline,
                   double stride) {
  const std::uint32_t recordBytes = pipeline.constants[abi::CONSTANT_RECORD];
  if (pipeline.module.ends_with("_staged")) {
    // 16 or 8 bytes at a time, or through workgroup memory.
    const double unit = recordBytes % 16 == 0 ? 16 : recordBytes % 8 == 0 ? 8 : stride;
    return stride / unit * std::min(stride, sector);
  }
  if (recordBytes != 0 && recordBytes != abi::RECORD_IN_PAIRS)
    return std::max(recordBytes / 16.0, 1.0) * std::min(stride, sector);
  double stores = 0;
  const std::uint32_t wide = pipeline.constants[abi::CONSTANT_WIDE];
  const std::array formats{layout.positions, layout.normals};
  for (std::size_t stream = 0; stream < formats.size(); ++stream)
    stores += (wide >> stream & 1) != 0 ? 1 : formatSize(formats[stream]) / 4.0;
  return stores * std::min(stride, sector);
}

std::optional<ByteModel> modelOf(const Layout& layout, Method method, const char* way,
                                 const DeviceLimits& limits) {
  PipelineNeeds needs;
  needs.method = method;
  needs.layout.positions = layout.positions;
  needs.layout.normals = layout.normals;
  needs.promise = JointPromise::scaleIgnored;
  needs.mesh = MeshInfo();
  needs.mesh->minInfluences = needs.mesh->maxInfluences = influences;
  Tuning tuning;
  tuning.instancesPerInvocation = instancesEach;
  const Result<std::vector<PipelineId>> all = pipelines(needs, limits, tuning);
  if (!all) return std::nullopt;
  const Result<vulkan::PipelineDescription> pipeline = vulkan::pipelineDescription(all->back());
  if (!pipeline) return std::nullopt;
  const std::vector<std::uint32_t> spirv = specializedSpirv(*pipeline);
  if (spirv.empty()) return std::nullopt;
  ByteModel model;
  model.name = fmt::format("{}, {}, {}", methodName(method), layout.name, way);
  model.written = formatSize(layout.positions) + formatSize(layout.normals);
  model.stored = storedBytes(layout, *pipeline, model.written);
  // Positions and normals have 16 bytes each, an influence has 8.
  model.meshRead =
      (16.0 + (layout.normals == VertexFormat::none ? 0 : 16) + 8 * influences) / instancesEach;
  model.paletteRead = influences * (method == Method::linear ? 48 : 32);
  model.operations = countOperations(spirv, pipeline->texelBuffers != 0 ? 2 : 1);
  return model;
}

}  // namespace

std::vector<GpuSpeed> gpuSpeeds() {
  return {{"0.5 TB/s", 0.5, 2, 15, 15},
          {"3.35 TB/s", 3.35, 5.5, 30, 33},
          {"4.8 TB/s", 4.8, 5.5, 30, 33}};
}

ByteBound boundOf(const ByteModel& model, const GpuSpeed& gpu) {
  const std::array<ByteBound, 5> bounds{{{gpu.memory * 1e12 / model.written, "memory"},
                                         {gpu.cache * 1e12 / model.stored, "stores"},
                                         {gpu.cache * 1e12 / model.meshRead, "mesh"},
                                         {gpu.firstLevel * 1e12 / model.paletteRead, "palette"},
                                         {gpu.operations * 1e12 / model.operations, "arithmetic"}}};
  return *std::ranges::min_element(bounds, {}, &ByteBound::verticesPerSecond);
}

std::optional<std::vector<ByteModel>> byteModels() {
  using enum VertexFormat;
  DeviceLimits words;
  words.maxStorageBuffersPerStage = storageBuffersWanted;
  DeviceLimits staged = words;
  staged.stagedStores = true;
  DeviceLimits wide = words;
  wide.texelBuffers = true;
  std::vector<ByteModel> models;
  for (const Method method : {Method::dualQuaternion, Method::linear}) {
    for (const Layout& layout : {Layout{"float32x3 + float32x3", float32x3, float32x3},
                                 {"float32x3 + octahedral16x2", float32x3, octahedral16x2},
                                 {"float16x4 + octahedral16x2", float16x4, octahedral16x2},
                                 {"float16x3 + octahedral8x2", float16x3, octahedral8x2},
                                 {"float32x3", float32x3, none}}) {
      for (const auto& [way, limits] :
           {std::pair{"words", &words}, {"staged", &staged}, {"wide", &wide}}) {
        std::optional<ByteModel> model = modelOf(layout, method, way, *limits);
        if (!model) return std::nullopt;
        models.push_back(std::move(*model));
      }
    }
  }
  return models;
}

bool printByteModels() {
  const std::optional<std::vector<ByteModel>> models = byteModels();
  if (!models) return false;
  fmt::print(
      "A vertex of an instance: four influences, rigid joints, {} instances per invocation\n",
      instancesEach);
  for (const GpuSpeed& gpu : gpuSpeeds()) {
    fmt::print("{}: L2 {} TB/s, L1 {} TB/s, {} x 10^12 float32 operations per second (assumed)\n",
               gpu.name, gpu.cache, gpu.firstLevel, gpu.operations);
  }
  fmt::print("\n{:<52} {:>8} {:>8} {:>6} {:>8} {:>7}", "method, formats, stores", "written",
             "stored", "mesh", "palette", "ops");
  for (const GpuSpeed& gpu : gpuSpeeds()) fmt::print(" {:>21}", gpu.name);
  fmt::print("\n{:<52} {:>8} {:>8} {:>6} {:>8} {:>7}", "", "bytes", "bytes", "bytes", "bytes", "");
  for (std::size_t gpu = 0; gpu < gpuSpeeds().size(); ++gpu)
    fmt::print(" {:>21}", "10^9 vertices/s");
  fmt::print("\n");
  for (const ByteModel& model : *models) {
    fmt::print("{:<52} {:>8} {:>8} {:>6} {:>8} {:>7.0f}", model.name, model.written, model.stored,
               model.meshRead, model.paletteRead, model.operations);
    for (const GpuSpeed& gpu : gpuSpeeds()) {
      const ByteBound bound = boundOf(model, gpu);
      fmt::print(" {:>10.1f} {:<10}", bound.verticesPerSecond / 1e9, bound.by);
    }
    fmt::print("\n");
  }
  return true;
}

}  // namespace dermis::cli
