#include "dermis/plan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <string>
#include <unordered_map>

#include "abi.h"

namespace dermis {
namespace {

constexpr std::uint64_t unitBytes = 16;
constexpr std::uint32_t storageBufferUsage = 0x20;   // VK_BUFFER_USAGE_STORAGE_BUFFER_BIT
constexpr std::uint32_t transferTargetUsage = 0x02;  // VK_BUFFER_USAGE_TRANSFER_DST_BIT
constexpr std::uint32_t attributeBytes = 12;         // three floats
constexpr std::uint32_t notUsed = 0xffffffffu;

std::uint64_t alignDown(std::uint64_t value, std::uint64_t alignment) {
  return value - value % alignment;
}

/// The longest run of output bytes that one group writes: what two neighbouring output ranges
/// share.
std::uint64_t outputWindowOverlap(const DeviceLimits& limits) {
  return limits.maxStorageBufferRange / 16;
}

/// One mesh with one output layout, in one dispatch; the instances follow in the instance table.
struct GroupKey {
  std::uint64_t mesh = 0;  ///< bytes into the mesh buffer
  std::uint32_t window = 0;
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  std::uint32_t positionStride = 0;
  std::uint32_t normalStride = 0;
  Method method = Method::linear;

  friend bool operator==(const GroupKey&, const GroupKey&) = default;
};

struct GroupKeyHash {
  std::size_t operator()(const GroupKey& key) const {
    std::uint64_t hash = key.mesh;
    for (const std::uint64_t part :
         {std::uint64_t{key.window} << 32 | key.firstVertex,
          std::uint64_t{key.vertexEnd} << 8 | static_cast<std::uint64_t>(key.method),
          std::uint64_t{key.positionStride} << 32 | key.normalStride}) {
      hash = (std::rotl(hash, 29) ^ part) * 0x9e3779b97f4a7c15u;
    }
    return static_cast<std::size_t>(hash ^ (hash >> 32));
  }
};

struct Group {
  GroupKey key;
  std::uint32_t maxInfluences = 0;
  std::uint32_t instances = 0;
  std::uint32_t firstInstance = 0;
  std::uint32_t filled = 0;
};

/// A piece of a job: the whole instance, or a run of its vertices where it is too long for one
/// output range.
struct Piece {
  std::uint32_t group;
  std::uint32_t job;
};

/// Kernels are specialised for so many influences a vertex; 0 is any number.
constexpr std::array<std::uint8_t, 4> influenceClasses{1, 2, 4, 0};

std::uint8_t influenceClass(std::uint32_t maxInfluences) {
  for (const std::uint8_t influences : influenceClasses) {
    if (maxInfluences <= influences) return influences;
  }
  return 0;
}

Error invalid(std::string message) {
  return {ErrorCode::invalidArgument, std::move(message)};
}

std::string jobName(std::size_t index) {
  return "job " + std::to_string(index);
}

/// Whether `count` elements of `stride` bytes from `offset` on end inside `size` bytes.
bool isInside(const OutputAttribute& attribute, std::uint32_t count, std::uint64_t size) {
  const std::uint64_t length = std::uint64_t{count - 1} * attribute.stride + attributeBytes;
  return attribute.offset <= size && length <= size - attribute.offset;
}

Result<void> checkAttribute(const OutputAttribute& attribute, const char* name,
                            std::uint32_t vertexCount, std::uint64_t outputSize,
                            std::size_t index) {
  if (attribute.offset % 4 != 0 || attribute.stride % 4 != 0 || attribute.stride < attributeBytes) {
    return invalid(jobName(index) + ": the offset " + std::to_string(attribute.offset) +
                   " and stride " + std::to_string(attribute.stride) + " of its " + name +
                   " must be multiples of 4, the stride at least 12");
  }
  if (!isInside(attribute, vertexCount, outputSize)) {
    return invalid(jobName(index) + ": its " + name + " end outside the output buffer of " +
                   std::to_string(outputSize) + " bytes");
  }
  return {};
}

Result<void> checkJob(const Batch& batch, const Job& job, std::size_t index) {
  if (job.mesh == nullptr) return invalid(jobName(index) + " has no mesh");
  if (job.meshOffset % packedMeshAlignment != 0 || job.meshOffset > batch.meshesSize ||
      job.mesh->bytes().size() > batch.meshesSize - job.meshOffset) {
    return invalid(jobName(index) + ": a packed mesh of " +
                   std::to_string(job.mesh->bytes().size()) + " bytes cannot stand at byte " +
                   std::to_string(job.meshOffset) + " of a mesh buffer of " +
                   std::to_string(batch.meshesSize));
  }
  if (job.palette >= batch.palettes.size()) {
    return invalid(jobName(index) + ": there is no palette " + std::to_string(job.palette) +
                   " among " + std::to_string(batch.palettes.size()));
  }
  if (batch.palettes[job.palette].jointCount < job.mesh->requiredJoints()) {
    return invalid(jobName(index) + ": its mesh needs a palette of " +
                   std::to_string(job.mesh->requiredJoints()) + " joints, palette " +
                   std::to_string(job.palette) + " has " +
                   std::to_string(batch.palettes[job.palette].jointCount));
  }
  if (methodName(job.method) == "unknown")
    return invalid(jobName(index) + ": its method is not one of Method");
  if (job.normals.stride != 0 && !job.mesh->hasNormals()) {
    return invalid(jobName(index) + " wants normals, its mesh has none");
  }
  const std::uint32_t vertices = job.mesh->vertexCount();
  if (Result<void> good =
          checkAttribute(job.positions, "positions", vertices, batch.outputSize, index);
      !good) {
    return good;
  }
  if (job.normals.stride == 0) return {};
  return checkAttribute(job.normals, "normals", vertices, batch.outputSize, index);
}

Result<void> checkPalette(const Batch& batch, const Palette& palette, std::size_t index) {
  const std::string name = "palette " + std::to_string(index);
  if (palette.jointCount == 0 || palette.jointCount > maxPaletteJoints) {
    return invalid(name + " has " + std::to_string(palette.jointCount) +
                   " joints, it may have 1 to " + std::to_string(maxPaletteJoints));
  }
  if (palette.matrixOffset % unitBytes != 0 || palette.matrixOffset > batch.matricesSize ||
      std::uint64_t{palette.jointCount} * sizeof(JointMatrix) >
          batch.matricesSize - palette.matrixOffset) {
    return invalid(name + ": " + std::to_string(palette.jointCount) +
                   " matrices cannot stand at byte " + std::to_string(palette.matrixOffset) +
                   " of a matrices buffer of " + std::to_string(batch.matricesSize));
  }
  return {};
}

Result<void> checkTuning(const Tuning& tuning) {
  if (!std::has_single_bit(tuning.workgroupSize) || tuning.workgroupSize < 8 ||
      tuning.workgroupSize > 128) {
    return invalid("tuning: a workgroup has a power of two of invocations from 8 to 128, not " +
                   std::to_string(tuning.workgroupSize));
  }
  if (tuning.instancesPerInvocation < 1 || tuning.instancesPerInvocation > 16) {
    return invalid("tuning: an invocation skins 1 to 16 instances, not " +
                   std::to_string(tuning.instancesPerInvocation));
  }
  return {};
}

std::uint64_t divideUp(std::uint64_t value, std::uint64_t divisor) {
  return (value + divisor - 1) / divisor;
}

}  // namespace

std::uint64_t outputWindowStep(const DeviceLimits& limits) {
  return alignDown(limits.maxStorageBufferRange - outputWindowOverlap(limits),
                   std::max<std::uint64_t>(limits.minStorageBufferOffsetAlignment, unitBytes));
}

std::uint64_t Variant::key() const {
  return static_cast<std::uint64_t>(kernel) | static_cast<std::uint64_t>(method) << 4 |
         static_cast<std::uint64_t>(normals) << 12 | static_cast<std::uint64_t>(influences) << 16 |
         static_cast<std::uint64_t>(instancesPerInvocation) << 24 |
         static_cast<std::uint64_t>(workgroupSize) << 32;
}

std::vector<Variant> everyVariant(const Tuning& tuning) {
  const auto workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  std::vector<Variant> variants{
      {Kernel::palette, Method::dualQuaternion, false, 0, 1, workgroupSize}};
  for (const Method method : allMethods) {
    for (const bool normals : {false, true}) {
      for (const std::uint8_t influences : influenceClasses) {
        variants.push_back({Kernel::skin, method, normals, influences,
                            static_cast<std::uint8_t>(tuning.instancesPerInvocation),
                            workgroupSize});
      }
    }
  }
  return variants;
}

struct Plan::State {
  std::vector<Dispatch> dispatches;
  std::vector<Variant> variants;
  std::vector<std::uint32_t> tables;  ///< palette records, group records, instance records
  std::vector<std::uint32_t>
      paletteUnits;  ///< where each palette stands in the palettes buffer, or notUsed
  std::uint64_t palettesSize = 0;
  std::uint64_t meshesSize = 0, matricesSize = 0, outputSize = 0;
  std::uint32_t alignment = 256;
  std::uint32_t instanceCount = 0;
  std::uint64_t vertexCount = 0;

  // Scratch of `plan`, kept for its memory.
  std::vector<Group> groups;
  std::vector<Piece> pieces;
  std::vector<std::uint32_t> order;
  std::unordered_map<GroupKey, std::uint32_t, GroupKeyHash> groupOf;

  void clear();
  Result<void> build(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning);

 private:
  Result<void> gatherPieces(const Batch& batch, const DeviceLimits& limits);
  void addPiece(const Job& job, std::uint32_t jobIndex, GroupKey key);
  Result<void> placePalettes(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning);
  Result<void> placeGroups(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning);
  void writeInstances(const Batch& batch, const DeviceLimits& limits, std::uint32_t firstRecord);
  Result<void> addDispatch(const Variant& variant, std::uint64_t workgroups,
                           const DispatchConstants& constants, const DeviceLimits& limits);
};

void Plan::State::clear() {
  dispatches.clear();
  variants.clear();
  tables.clear();
  paletteUnits.clear();
  palettesSize = meshesSize = matricesSize = outputSize = 0;
  instanceCount = 0;
  vertexCount = 0;
  groups.clear();
  pieces.clear();
  groupOf.clear();
}

void Plan::State::addPiece(const Job& job, std::uint32_t jobIndex, GroupKey key) {
  // Neighbouring jobs mostly belong together: look there before asking the map.
  std::uint32_t group = pieces.empty() ? notUsed : pieces.back().group;
  if (group == notUsed || !(groups[group].key == key)) {
    const auto [entry, isNew] = groupOf.try_emplace(key, static_cast<std::uint32_t>(groups.size()));
    group = entry->second;
    if (isNew) groups.push_back({key, job.mesh->maxInfluences(), 0, 0, 0});
  }
  ++groups[group].instances;
  pieces.push_back({group, jobIndex});
}

Result<void> Plan::State::gatherPieces(const Batch& batch, const DeviceLimits& limits) {
  const std::uint64_t step = outputWindowStep(limits);
  const std::uint64_t longest = batch.outputSize <= limits.maxStorageBufferRange
                                    ? batch.outputSize
                                    : outputWindowOverlap(limits);
  const bool oneWindow = batch.outputSize <= limits.maxStorageBufferRange;

  for (std::size_t index = 0; index < batch.jobs.size(); ++index) {
    const Job& job = batch.jobs[index];
    if (Result<void> good = checkJob(batch, job, index); !good) return good;
    const std::uint32_t vertices = job.mesh->vertexCount();
    GroupKey key{job.meshOffset,     0,         0, vertices, job.positions.stride,
                 job.normals.stride, job.method};
    ++instanceCount;
    vertexCount += vertices;
    if (oneWindow) {
      addPiece(job, static_cast<std::uint32_t>(index), key);
      continue;
    }
    // The bytes from vertex a to vertex b lie between the lower beginning and the higher end of its
    // attributes.
    const bool normals = job.normals.stride != 0;
    const auto begin = [&](std::uint64_t vertex) {
      const std::uint64_t positions = job.positions.offset + vertex * job.positions.stride;
      return normals ? std::min(positions, job.normals.offset + vertex * job.normals.stride)
                     : positions;
    };
    const auto end = [&](std::uint64_t vertex) {
      const std::uint64_t positions =
          job.positions.offset + vertex * job.positions.stride + attributeBytes;
      return normals ? std::max(positions,
                                job.normals.offset + vertex * job.normals.stride + attributeBytes)
                     : positions;
    };
    for (std::uint32_t vertex = 0; vertex < vertices;) {
      if (end(vertex) - begin(vertex) > longest) {
        return Error{
            ErrorCode::limitExceeded,
            jobName(index) + ": the positions and normals of one vertex lie " +
                std::to_string(end(vertex) - begin(vertex)) +
                " bytes apart, in an output larger than one storage buffer range at most " +
                std::to_string(longest) + " are possible on this device"};
      }
      // The largest run that fits: the span of a run grows with its length, so halve the interval.
      std::uint32_t low = vertex + 1, high = vertices;
      while (low < high) {
        const std::uint32_t middle = low + (high - low + 1) / 2;
        if (end(middle - 1) - begin(vertex) <= longest) {
          low = middle;
        } else {
          high = middle - 1;
        }
      }
      key.firstVertex = vertex;
      key.vertexEnd = low;
      key.window = static_cast<std::uint32_t>(begin(vertex) / step);
      addPiece(job, static_cast<std::uint32_t>(index), key);
      vertex = low;
    }
  }
  return {};
}

Result<void> Plan::State::addDispatch(const Variant& variant, std::uint64_t workgroups,
                                      const DispatchConstants& constants,
                                      const DeviceLimits& limits) {
  if (workgroups >
      std::min<std::uint64_t>(std::uint64_t{limits.maxWorkgroupCountX} * limits.maxWorkgroupCountY,
                              std::numeric_limits<std::uint32_t>::max())) {
    return Error{ErrorCode::limitExceeded,
                 "the batch needs " + std::to_string(workgroups) +
                     " workgroups in one dispatch, more than the device can count; split it"};
  }
  Dispatch dispatch;
  dispatch.variant = variant;
  dispatch.constants = constants;
  dispatch.constants.workgroupCount = static_cast<std::uint32_t>(workgroups);
  dispatch.groupCountY =
      static_cast<std::uint32_t>(divideUp(workgroups, limits.maxWorkgroupCountX));
  dispatch.groupCountX = static_cast<std::uint32_t>(divideUp(workgroups, dispatch.groupCountY));
  dispatches.push_back(dispatch);
  if (std::find(variants.begin(), variants.end(), variant) == variants.end())
    variants.push_back(variant);
  return {};
}

Result<void> Plan::State::placePalettes(const Batch& batch, const DeviceLimits& limits,
                                        const Tuning& tuning) {
  for (std::size_t index = 0; index < batch.palettes.size(); ++index) {
    if (Result<void> good = checkPalette(batch, batch.palettes[index], index); !good) return good;
  }
  paletteUnits.assign(batch.palettes.size(), notUsed);
  for (const Job& job : batch.jobs) {
    if (job.method != Method::linear) paletteUnits[job.palette] = 0;
  }
  std::uint64_t units = 0;
  std::uint32_t records = 0;
  for (std::size_t index = 0; index < batch.palettes.size(); ++index) {
    if (paletteUnits[index] == notUsed) continue;
    const Palette& palette = batch.palettes[index];
    paletteUnits[index] = static_cast<std::uint32_t>(units);
    tables.insert(tables.end(), {static_cast<std::uint32_t>(palette.matrixOffset / unitBytes),
                                 static_cast<std::uint32_t>(units), palette.jointCount,
                                 palette.mayScale ? 1u : 0u});
    units += 1 + std::uint64_t{palette.jointCount} * (palette.mayScale ? 4 : 2);
    ++records;
  }
  palettesSize = units * unitBytes;
  if (palettesSize > limits.maxStorageBufferRange ||
      batch.matricesSize > limits.maxStorageBufferRange ||
      batch.meshesSize > limits.maxStorageBufferRange) {
    return Error{
        ErrorCode::limitExceeded,
        "meshes, matrices or palettes of " +
            std::to_string(std::max({palettesSize, batch.matricesSize, batch.meshesSize})) +
            " bytes are more than a storage buffer range of " +
            std::to_string(limits.maxStorageBufferRange) + " bytes; split the batch"};
  }
  if (records == 0) return {};
  Variant variant;
  variant.kernel = Kernel::palette;
  variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
  return addDispatch(variant, records, {0, records, 0, 0}, limits);
}

Result<void> Plan::State::placeGroups(const Batch& batch, const DeviceLimits& limits,
                                      const Tuning& tuning) {
  const auto variantOrder = [&](std::uint32_t index) {
    const GroupKey& key = groups[index].key;
    return std::array<std::uint32_t, 3>{key.window, static_cast<std::uint32_t>(key.method),
                                        key.normalStride != 0 ? 1u : 0u};
  };
  order.resize(groups.size());
  for (std::uint32_t index = 0; index < order.size(); ++index) order[index] = index;
  std::stable_sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return variantOrder(a) < variantOrder(b);
  });

  const std::size_t groupRecords = tables.size();
  tables.resize(groupRecords + groups.size() * abi::GROUP_WORDS, 0u);
  const auto instanceRecords = static_cast<std::uint32_t>(tables.size());
  const bool afterPalettes = !dispatches.empty();

  std::uint32_t firstInstance = 0;
  for (std::size_t begin = 0; begin < order.size();) {
    std::size_t end = begin;
    std::uint64_t workgroups = 0;
    std::uint32_t maxInfluences = 0;
    for (; end < order.size() && variantOrder(order[end]) == variantOrder(order[begin]); ++end) {
      Group& group = groups[order[end]];
      group.firstInstance = firstInstance;
      firstInstance += group.instances;
      maxInfluences = std::max(maxInfluences, group.maxInfluences);
      const std::uint64_t vertexGroups =
          divideUp(group.key.vertexEnd - group.key.firstVertex, tuning.workgroupSize);
      workgroups += vertexGroups * divideUp(group.instances, tuning.instancesPerInvocation);
      std::uint32_t* record = &tables[groupRecords + end * abi::GROUP_WORDS];
      record[abi::GROUP_WORKGROUP_END] =
          static_cast<std::uint32_t>(std::min<std::uint64_t>(workgroups, notUsed));
      record[abi::GROUP_MESH] = static_cast<std::uint32_t>(group.key.mesh / 4);
      record[abi::GROUP_FIRST_VERTEX] = group.key.firstVertex;
      record[abi::GROUP_VERTEX_END] = group.key.vertexEnd;
      record[abi::GROUP_VERTEX_GROUPS] = static_cast<std::uint32_t>(vertexGroups);
      record[abi::GROUP_FIRST_INSTANCE] = group.firstInstance;
      record[abi::GROUP_INSTANCE_COUNT] = group.instances;
      record[abi::GROUP_POSITION_STRIDE] = group.key.positionStride / 4;
      record[abi::GROUP_NORMAL_STRIDE] = group.key.normalStride / 4;
    }
    const GroupKey& key = groups[order[begin]].key;
    Variant variant;
    variant.method = key.method;
    variant.normals = key.normalStride != 0;
    variant.influences = influenceClass(maxInfluences);
    variant.instancesPerInvocation = static_cast<std::uint8_t>(tuning.instancesPerInvocation);
    variant.workgroupSize = static_cast<std::uint16_t>(tuning.workgroupSize);
    const DispatchConstants constants{
        static_cast<std::uint32_t>(groupRecords + begin * abi::GROUP_WORDS),
        static_cast<std::uint32_t>(end - begin), 0, instanceRecords};
    if (Result<void> good = addDispatch(variant, workgroups, constants, limits); !good) return good;
    dispatches.back().outputWindow = key.window;
    dispatches.back().outputOffset = key.window * outputWindowStep(limits);
    dispatches.back().afterPalettes = afterPalettes && key.method != Method::linear;
    begin = end;
  }
  writeInstances(batch, limits, instanceRecords);
  return {};
}

void Plan::State::writeInstances(const Batch& batch, const DeviceLimits& limits,
                                 std::uint32_t firstRecord) {
  const std::uint64_t step = outputWindowStep(limits);
  tables.resize(firstRecord + pieces.size() * abi::INSTANCE_WORDS);
  for (const Piece& piece : pieces) {
    Group& group = groups[piece.group];
    const Job& job = batch.jobs[piece.job];
    const Palette& palette = batch.palettes[job.palette];
    const std::uint64_t windowBegin = group.key.window * step;
    const auto wordOffset = [&](const OutputAttribute& attribute) {
      const std::uint64_t offset =
          attribute.offset + std::uint64_t{group.key.firstVertex} * attribute.stride;
      return static_cast<std::uint32_t>((offset - windowBegin) / 4);
    };
    std::uint32_t* record =
        &tables[firstRecord +
                std::size_t{group.firstInstance + group.filled++} * abi::INSTANCE_WORDS];
    record[abi::INSTANCE_PALETTE] =
        job.method == Method::linear ? static_cast<std::uint32_t>(palette.matrixOffset / unitBytes)
                                     : paletteUnits[job.palette];
    record[abi::INSTANCE_JOINTS] = palette.jointCount;
    record[abi::INSTANCE_POSITIONS] = wordOffset(job.positions);
    record[abi::INSTANCE_NORMALS] = job.normals.stride != 0 ? wordOffset(job.normals) : 0u;
  }
}

Result<void> Plan::State::build(const Batch& batch, const DeviceLimits& limits,
                                const Tuning& tuning) {
  if (Result<void> good = checkTuning(tuning); !good) return good;
  meshesSize = batch.meshesSize;
  matricesSize = batch.matricesSize;
  outputSize = batch.outputSize;
  alignment = limits.minStorageBufferOffsetAlignment;
  if (batch.jobs.size() > notUsed / 2) return invalid("a batch of more than 2^31 jobs");
  if (Result<void> good = gatherPieces(batch, limits); !good) return good;
  if (Result<void> good = placePalettes(batch, limits, tuning); !good) return good;
  if (Result<void> good = placeGroups(batch, limits, tuning); !good) return good;
  if (tables.size() * 4 > limits.maxStorageBufferRange) {
    return Error{ErrorCode::limitExceeded,
                 "the tables of the batch are larger than a storage buffer range; split it"};
  }
  return {};
}

Plan::Plan() : state_(std::make_unique<State>()) {}
Plan::~Plan() = default;
Plan::Plan(Plan&&) noexcept = default;
Plan& Plan::operator=(Plan&&) noexcept = default;

std::span<const Dispatch> Plan::dispatches() const {
  return state_->dispatches;
}
std::span<const Variant> Plan::variants() const {
  return state_->variants;
}
std::uint32_t Plan::instanceCount() const {
  return state_->instanceCount;
}
std::uint64_t Plan::vertexCount() const {
  return state_->vertexCount;
}

std::uint64_t Plan::statusOffset(std::uint32_t palette) const {
  if (palette >= state_->paletteUnits.size() || state_->paletteUnits[palette] == notUsed)
    return noStatus;
  return state_->paletteUnits[palette] * unitBytes;
}

BufferRequirement Plan::buffer(BufferRole role) const {
  const std::uint32_t alignment = state_->alignment;
  switch (role) {
    case BufferRole::meshes:
      return {state_->meshesSize, alignment, storageBufferUsage | transferTargetUsage, false, true};
    case BufferRole::matrices:
      return {state_->matricesSize, alignment, storageBufferUsage, true, true};
    case BufferRole::tables:
      return {state_->tables.size() * 4, alignment, storageBufferUsage, true, true};
    case BufferRole::palettes:
      return {state_->palettesSize, alignment, storageBufferUsage, true, false};
    case BufferRole::output:
      return {state_->outputSize, alignment, storageBufferUsage, false, false};
  }
  return {};
}

Result<void> plan(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning, Plan& out) {
  out.state_->clear();
  Result<void> built = out.state_->build(batch, limits, tuning);
  if (!built) out.state_->clear();
  return built;
}

Result<void> writeTables(const Plan& plan, std::span<std::byte> bytes) {
  const std::vector<std::uint32_t>& tables = plan.state_->tables;
  if (bytes.size() < tables.size() * 4) {
    return invalid("the tables of the plan need " + std::to_string(tables.size() * 4) +
                   " bytes, there are " + std::to_string(bytes.size()));
  }
  if (!tables.empty()) std::memcpy(bytes.data(), tables.data(), tables.size() * 4);
  return {};
}

}  // namespace dermis
