#include "core_plan_simulation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <map>
#include <set>
#include <stdexcept>
#include <utility>

#include "abi.h"
#include "plan/variant.h"
#include "plan/work.h"
#include "plan_commands.h"
#include "random_rig.h"

namespace dermis::test {
namespace {

constexpr std::size_t previousStream = static_cast<std::size_t>(Stream::previousPositions);

std::uint64_t divideUp(std::uint64_t value, std::uint64_t divisor) {
  return (value + divisor - 1) / divisor;
}

bool isMorphed(const Job& job) {
  return !activeMorphs(job.morphs).empty();
}

/// A palette, and whether as logarithms.
using PaletteInForm = std::pair<std::uint32_t, bool>;

bool wantsLogarithms(Method method) {
  return method == Method::logMatrix;
}

class Simulation {
 public:
  Simulation(const OwnedBatch& batch, const DeviceLimits& limits, const Tuning& tuning,
             const Plan& plan)
      : batch_(batch), limits_(limits), tuning_(tuning), plan_(plan), tables_(tablesOf(plan)) {
    sizes_ = batch.batch().outputSizes;
    for (std::uint32_t index = 0; index < batch.jobs.size(); ++index) {
      begins_.push_back({batch.jobs[index].places[Stream::positions].offset, index});
      written_.emplace_back(batch.jobs[index].mesh.vertexCount, std::uint8_t{0});
      if (wantsResult(batch.jobs[index])) ++resultCount_;
    }
    std::sort(begins_.begin(), begins_.end());
  }

  void run() {
    ASSERT_NO_FATAL_FAILURE(checkResults());
    std::vector<Variant> used;
    for (const PlannedDispatch& dispatch : dispatchesOf(plan_)) {
      ASSERT_NO_FATAL_FAILURE(checkDispatch(dispatch));
      if (std::find(used.begin(), used.end(), dispatch.variant) == used.end())
        used.push_back(dispatch.variant);
      if (dispatch.variant.kernel == Kernel::palette) {
        ASSERT_FALSE(dispatch.isAfterBarrier);
        ASSERT_NO_FATAL_FAILURE(runPalettes(dispatch));
      } else if (dispatch.variant.kernel == Kernel::clear) {
        ASSERT_FALSE(dispatch.isAfterBarrier);
        ASSERT_NO_FATAL_FAILURE(runClear(dispatch));
      } else {
        ASSERT_NO_FATAL_FAILURE(runSkin(dispatch));
      }
    }
    ASSERT_NO_FATAL_FAILURE(checkAllWritten());
    ASSERT_NO_FATAL_FAILURE(checkPalettes());
    ASSERT_EQ(cleared_.size(), resultCount_);
    ASSERT_NO_FATAL_FAILURE(checkStatuses());
    ASSERT_TRUE(std::ranges::equal(variantsOf(plan_.pipelines()), used));
  }

 private:
  std::uint32_t word(std::uint64_t index) const { return tables_.at(index); }
  template <typename Record>
  Record at(std::uint64_t index) const {
    static_cast<void>(word(index + sizeof(Record) / 4 - 1));  // it lies in the tables
    return abi::load<Record>(tables_, index);
  }
  abi::GroupRecord groupAt(std::uint64_t index) const { return at<abi::GroupRecord>(index); }
  abi::InstanceRecord instanceAt(std::uint64_t index) const {
    return at<abi::InstanceRecord>(index);
  }

  void checkResults() {
    std::uint64_t next = 0;
    for (std::uint32_t index = 0; index < batch_.jobs.size(); ++index) {
      const bool wanted = wantsResult(batch_.jobs[index]);
      ASSERT_EQ(plan_.resultOffset(index), wanted ? std::optional(next) : std::nullopt) << index;
      if (wanted) next += sizeof(InstanceResult);
    }
    ASSERT_EQ(plan_.buffer(BufferRole::results).size, next);
    ASSERT_EQ(plan_.resultOffset(static_cast<std::uint32_t>(batch_.jobs.size())), std::nullopt);
  }

  void checkAllWritten() {
    std::uint64_t vertices = 0;
    for (std::size_t index = 0; index < batch_.jobs.size(); ++index) {
      const Job& job = batch_.jobs[index];
      const ByStream<OutputAttribute>& attributes = job.places.attributes;
      std::uint8_t expected = 0;
      for (std::size_t stream = 0; stream < streamCount; ++stream) {
        if (attributes[stream].format == VertexFormat::none) continue;
        if (!job.settles || stream == previousStream)
          expected = static_cast<std::uint8_t>(expected | 1u << stream);
      }
      const auto isExpected = [&](std::uint8_t streams) { return streams == expected; };
      ASSERT_TRUE(std::all_of(written_[index].begin(), written_[index].end(), isExpected))
          << "job " << index << " lacks something";
      vertices += job.mesh.vertexCount;
    }
    ASSERT_EQ(plan_.vertexCount(), vertices);
    ASSERT_EQ(plan_.instanceCount(), batch_.jobs.size());
  }

  void checkDispatch(const PlannedDispatch& dispatch) {
    const std::uint64_t groups = std::uint64_t{dispatch.groupCountX} * dispatch.groupCountY;
    ASSERT_GE(dispatch.groupCountX, 1u);
    ASSERT_LE(dispatch.groupCountX, limits_.maxWorkgroupCountX);
    ASSERT_LE(dispatch.groupCountY, limits_.maxWorkgroupCountY);
    ASSERT_GE(groups, dispatch.workgroupCount);
    // Hardly any workgroup is started in vain.
    ASSERT_LT(groups, std::uint64_t{dispatch.workgroupCount} + dispatch.groupCountY);
    ASSERT_EQ(dispatch.variant.workgroupSize, tuning_.workgroupSize);
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      if (dispatch.variant.kernel != Kernel::skin) break;
      const BufferPart part = dispatch.outputPart(stream);
      ASSERT_EQ(part.offset % outputWindowStep(limits_), 0u);
      ASSERT_EQ(part.offset % limits_.minStorageBufferOffsetAlignment, 0u);
      ASSERT_LE(part.size, limits_.maxStorageBufferRange);
      if (sizes_[stream] <= limits_.maxStorageBufferRange &&
          writesStream(dispatch.variant, stream)) {
        ASSERT_EQ(part.offset, 0u);
      }
    }
  }

  void runClear(const PlannedDispatch& dispatch) {
    const abi::ClearPush push = dispatch.clearPush();
    ASSERT_EQ(push.workgroupCount, dispatch.workgroupCount);
    ASSERT_EQ(push.workgroupCount, divideUp(push.resultCount, tuning_.workgroupSize));
    for (std::uint32_t number = 0; number < push.resultCount; ++number) {
      const std::uint32_t result = word(push.results + number);
      ASSERT_LT(result, resultCount_);
      ASSERT_TRUE(cleared_.insert(result).second) << "cleared twice";
    }
  }

  void runPalettes(const PlannedDispatch& dispatch) {
    const abi::PalettePush push = dispatch.palettePush();
    const bool logarithms = wantsLogarithms(dispatch.variant.method);
    ASSERT_TRUE(logarithms || dispatch.variant.method == Method::dualQuaternion);
    ASSERT_TRUE(
        paletteDispatches_.insert({logarithms, dispatch.variant.scales, dispatch.variant.rigid})
            .second)
        << "one dispatch for all palettes of a form";
    ASSERT_EQ(push.workgroupCount, dispatch.workgroupCount);
    for (std::uint32_t number = 0; number < push.workgroupCount; ++number) {
      const auto record = at<abi::PaletteRecord>(push.palettes + number * abi::PALETTE_WORDS);
      const std::uint64_t status = std::uint64_t{record.place} * 16;
      // No two palettes of a batch begin at the same matrix.
      const auto matrices = std::uint64_t{record.matrices} * 16;
      const auto found = std::find_if(
          batch_.poses.begin(), batch_.poses.end(),
          [&](const PoseDescription& palette) { return palette.matrixOffset == matrices; });
      ASSERT_NE(found, batch_.poses.end());
      const PoseDescription& palette = *found;
      const PaletteInForm form{static_cast<std::uint32_t>(found - batch_.poses.begin()),
                               logarithms};
      ASSERT_TRUE(statuses_.emplace(form, status).second) << "twice in a form";
      ASSERT_EQ(record.jointCount, palette.jointCount);
      ASSERT_EQ(dispatch.variant.scales, palette.promise == JointPromise::scaling);
      ASSERT_EQ(dispatch.variant.rigid, palette.promise == JointPromise::rigid);
      // A joint: 8 floats of a dual quaternion, 12 of a logarithm, 8 of scale and shear.
      paletteEnds_[status] =
          status + 16 +
          std::uint64_t{palette.jointCount} *
              ((logarithms ? 48u : 32u) + (palette.promise == JointPromise::scaling ? 32u : 0u));
    }
  }

  /// Those that are read, and no others, one behind the other.
  void checkPalettes() {
    std::set<PaletteInForm> wanted;
    for (const Job& job : batch_.jobs) {
      if (job.method == Method::linear) continue;
      wanted.insert({job.pose, wantsLogarithms(job.method)});
    }
    ASSERT_EQ(statuses_.size(), wanted.size());
    for (const PaletteInForm& form : wanted) ASSERT_TRUE(statuses_.contains(form));
    std::uint64_t end = 0;
    for (const auto& [status, paletteEnd] : paletteEnds_) {
      ASSERT_EQ(status, end) << "palettes overlap, or leave room";
      end = paletteEnd;
    }
    ASSERT_EQ(end, plan_.buffer(BufferRole::palettes).size);
  }

  /// What a plan says of a status is true of one that is written.
  void checkStatuses() {
    for (std::uint32_t palette = 0; palette < batch_.poses.size(); ++palette) {
      const std::optional<std::uint64_t> status = plan_.statusOffset(palette);
      const auto dual = statuses_.find({palette, false}),
                 logarithm = statuses_.find({palette, true});
      if (!status) {
        ASSERT_TRUE(dual == statuses_.end() && logarithm == statuses_.end()) << palette;
      } else {
        ASSERT_TRUE((dual != statuses_.end() && dual->second == status) ||
                    (logarithm != statuses_.end() && logarithm->second == status))
            << palette;
      }
    }
  }

  void runSkin(const PlannedDispatch& dispatch) {
    const abi::SkinPush push = dispatch.skinPush();
    ASSERT_EQ(push.workgroupCount, dispatch.workgroupCount);
    ASSERT_EQ(dispatch.variant.instancesPerInvocation, tuning_.instancesPerInvocation);
    ASSERT_EQ(push.verticesPerInvocation, verticesWanted(push));
    for (std::uint32_t number = 0; number < push.workgroupCount; ++number) {
      // The first group whose end lies behind the workgroup's number.
      std::uint32_t index = 0, begin = 0, end = 0;
      for (;; ++index) {
        ASSERT_LT(index, push.groupCount) << "workgroup " << number << " has no group";
        begin = end;
        end = groupAt(std::uint64_t{push.groups} + index * abi::GROUP_WORDS).workgroupEnd;
        ASSERT_GT(end, begin) << "an empty group";
        if (number < end) break;
      }
      ASSERT_NO_FATAL_FAILURE(
          runWorkgroup(dispatch, push.groups + index * abi::GROUP_WORDS, number - begin));
    }
  }

  /// By the rule of `Tuning::verticesPerInvocation`.
  std::uint32_t verticesWanted(const abi::SkinPush& push) const {
    if (!limits_.texelBuffers) return 1;
    std::uint32_t vertices = tuning_.verticesPerInvocation;
    const auto isRight = [&] {
      std::uint64_t workgroups = 0, instances = 0;
      for (std::uint32_t index = 0; index < push.groupCount; ++index) {
        const auto group = groupAt(push.groups + index * abi::GROUP_WORDS);
        instances += group.instanceCount;
        workgroups += divideUp(group.vertexEnd - group.firstVertex,
                               std::uint64_t{tuning_.workgroupSize} * vertices);
      }
      return workgroups >= 32 && instances * vertices <= std::uint64_t{push.groupCount} *
                                                             tuning_.instancesPerInvocation;
    };
    while (vertices > 1 && !isRight()) vertices /= 2;
    return vertices;
  }

  /// By the rule of `Tuning::minWorkgroups`.
  std::uint32_t instancesWanted(const abi::SkinPush& push) const {
    std::uint32_t instances = tuning_.instancesPerInvocation;
    const auto workgroups = [&] {
      std::uint64_t count = 0;
      for (std::uint32_t index = 0; index < push.groupCount; ++index) {
        const auto group = groupAt(std::uint64_t{push.groups} + index * abi::GROUP_WORDS);
        count += std::uint64_t{group.vertexGroups} * divideUp(group.instanceCount, instances);
      }
      return count;
    };
    while (instances > 1 && workgroups() < tuning_.minWorkgroups) instances = (instances + 1) / 2;
    return instances;
  }

  /// The kernel steps from the first two records to all others where the group says so.
  void checkSpacing(const PlannedDispatch& dispatch, std::uint32_t group) {
    const std::uint32_t count = groupAt(group).instanceCount;
    const auto word = [&](std::uint32_t instance, std::uint32_t index) {
      const std::uint64_t record = std::uint64_t{dispatch.skinPush().instances} +
                                   (groupAt(group).firstInstance + instance) * abi::INSTANCE_WORDS;
      return tables_.at(record + index);
    };
    bool isEven = count > 1;
    for (std::uint32_t instance = 2; instance < count; ++instance) {
      for (std::uint32_t index = 0; index < abi::INSTANCE_WORDS; ++index) {
        const std::uint32_t step = word(1, index) - word(0, index);
        isEven = isEven && word(instance, index) == word(0, index) + instance * step;
      }
    }
    // The kernel reads the box of snorm16 positions from the first extension only.
    const VertexFormat positions = dispatch.variant.positions;
    if (positions == VertexFormat::snorm16x3 || positions == VertexFormat::snorm16x4) {
      constexpr std::uint32_t box = offsetof(abi::ExtensionRecord, centerX) / 4;
      constexpr std::uint32_t extension = offsetof(abi::InstanceRecord, extension) / 4;
      for (std::uint32_t instance = 1; instance < count; ++instance) {
        for (std::uint32_t index = box; index < box + 6; ++index) {
          isEven = isEven && tables_.at(word(instance, extension) + index) ==
                                 tables_.at(word(0, extension) + index);
        }
      }
    }
    ASSERT_EQ((groupAt(group).instancesEach & abi::EVENLY_SPACED) != 0, isEven);
  }

  /// All invocations of a group skin about as many instances.
  void checkShare(const PlannedDispatch& dispatch, std::uint32_t group) {
    const std::uint32_t count = groupAt(group).instanceCount;
    const std::uint64_t shares = divideUp(count, instancesWanted(dispatch.skinPush()));
    ASSERT_EQ(groupAt(group).instancesEach & ~abi::EVENLY_SPACED, divideUp(count, shares));
  }

  void runWorkgroup(const PlannedDispatch& dispatch, std::uint32_t group, std::uint32_t local) {
    if (local == 0) {
      ASSERT_NO_FATAL_FAILURE(checkSpacing(dispatch, group));
      ASSERT_NO_FATAL_FAILURE(checkShare(dispatch, group));
    }
    const std::uint32_t vertexGroups = groupAt(group).vertexGroups;
    const std::uint32_t firstVertex = groupAt(group).firstVertex;
    const std::uint32_t vertexEnd = groupAt(group).vertexEnd;
    const std::uint32_t instancesEach = groupAt(group).instancesEach & ~abi::EVENLY_SPACED;
    const std::uint32_t firstInstance = local / vertexGroups * instancesEach;
    const std::uint32_t instanceCount = groupAt(group).instanceCount;
    ASSERT_LT(firstInstance, instanceCount) << "an idle workgroup";
    const std::uint32_t size =
        dispatch.variant.workgroupSize * dispatch.skinPush().verticesPerInvocation;
    const std::uint32_t firstRun = local % vertexGroups * size;
    ASSERT_LT(firstVertex + firstRun, vertexEnd) << "an idle workgroup";
    const std::uint32_t runEnd = std::min(firstRun + size, vertexEnd - firstVertex);
    for (std::uint32_t instance = firstInstance;
         instance < std::min(firstInstance + instancesEach, instanceCount); ++instance) {
      const std::uint64_t record = std::uint64_t{dispatch.skinPush().instances} +
                                   (groupAt(group).firstInstance + instance) * abi::INSTANCE_WORDS;
      std::uint32_t job = 0;
      ASSERT_NO_FATAL_FAILURE(findJob(dispatch, record, firstVertex, job));
      ASSERT_NO_FATAL_FAILURE(checkVariant(dispatch, batch_.jobs[job]));
      ASSERT_NO_FATAL_FAILURE(checkRecord(group, record, job));
      ASSERT_NO_FATAL_FAILURE(checkExtension(record, job));
      for (std::size_t stream = 0; stream < streamCount; ++stream) {
        ASSERT_NO_FATAL_FAILURE(
            writeStream(dispatch, group, record, job, stream, {firstVertex, firstRun, runEnd}));
      }
    }
  }

  /// The job whose positions the record points at.
  void findJob(const PlannedDispatch& dispatch, std::uint64_t record, std::uint32_t firstVertex,
               std::uint32_t& index) {
    const std::uint64_t place = dispatch.outputPart(0).offset + instanceAt(record).positions;
    const auto behind =
        std::upper_bound(begins_.begin(), begins_.end(), std::pair{place, ~std::uint32_t{0}});
    ASSERT_NE(behind, begins_.begin()) << "a write that no job asked for";
    index = std::prev(behind)->second;
    const OutputAttribute& positions = batch_.jobs[index].places[Stream::positions];
    ASSERT_EQ(place, positions.offset + std::uint64_t{firstVertex} * positions.stride);
  }

  void checkVariant(const PlannedDispatch& dispatch, const Job& job) {
    const Variant& variant = dispatch.variant;
    ASSERT_EQ(variant.method, job.method);
    ASSERT_EQ(variant.positions, job.places[Stream::positions].format);
    ASSERT_EQ(variant.normals, job.places[Stream::normals].format);
    ASSERT_EQ(variant.tangents, job.places[Stream::tangents].format);
    ASSERT_EQ(variant.motion, job.places.hasMotion());
    ASSERT_EQ(variant.bounds, job.bounds);
    ASSERT_EQ(variant.morphs, isMorphed(job));
    ASSERT_TRUE(variant.influences == 0 || variant.influences >= job.mesh.maxInfluences);
    ASSERT_TRUE(!variant.fullInfluences || (variant.influences == job.mesh.maxInfluences &&
                                            variant.influences == job.mesh.minInfluences));
    ASSERT_TRUE(variant.scales || !mayScale(job));
    const std::vector<Variant> foreseen = *everyVariant(job, limits_, tuning_);
    ASSERT_NE(std::find(foreseen.begin(), foreseen.end(), variant), foreseen.end());
    const ByStream<OutputAttribute>& attributes = job.places.attributes;
    for (std::size_t stream = 0; stream < streamCount; ++stream) {
      const bool isWanted = attributes[stream].format != VertexFormat::none;
      if (variant.wide[stream]) {
        ASSERT_TRUE(variant.texels && isWanted);
        ASSERT_EQ(attributes[stream].offset % formatSize(attributes[stream].format), 0u);
      }
    }
    // It waits for what it reads or adds to; where there are previous positions, the kernel is one
    // that may see results.
    const bool reads = job.method != Method::linear || wantsResult(job);
    const bool maySee = reads || job.places.hasMotion();
    const bool anyBefore = !paletteDispatches_.empty() || !cleared_.empty();
    ASSERT_TRUE(dispatch.isAfterBarrier || !(maySee && anyBefore));
    ASSERT_TRUE(anyBefore || !reads);
  }

  bool mayScale(const Job& job) const {
    return batch_.poses[job.pose].promise == JointPromise::scaling;
  }

  std::uint64_t paletteBytes(Method method, std::uint32_t palette) const {
    return method == Method::linear ? batch_.poses[palette].matrixOffset
                                    : statuses_.at({palette, wantsLogarithms(method)});
  }

  void checkRecord(std::uint32_t group, std::uint64_t record, std::uint32_t index) {
    const Job& job = batch_.jobs[index];
    ASSERT_EQ(std::uint64_t{groupAt(group).mesh} * 4, job.meshOffset);
    ASSERT_EQ(instanceAt(record).joints & abi::INSTANCE_JOINTS, batch_.poses[job.pose].jointCount);
    ASSERT_EQ(std::uint64_t{instanceAt(record).palette} * 16, paletteBytes(job.method, job.pose));
    ASSERT_EQ(instanceAt(record).joints & ~abi::INSTANCE_JOINTS,
              (job.restartsMotion ? abi::INSTANCE_RESTARTS : 0u) |
                  (job.settles ? abi::INSTANCE_SETTLES : 0u));
  }

  void checkMorphs(std::uint64_t first, std::uint32_t count, std::span<const MorphWeight> morphs) {
    const std::vector<MorphWeight> expected = activeMorphs(morphs);
    ASSERT_EQ(count, expected.size());
    for (std::size_t i = 0; i < expected.size(); ++i) {
      const auto morph = at<abi::ActiveMorph>(first + i * abi::ACTIVE_MORPH_WORDS);
      ASSERT_EQ(morph.target, expected[i].target);
      ASSERT_EQ(morph.weight, expected[i].weight);
    }
  }

  void checkExtension(std::uint64_t record, std::uint32_t index) {
    const Job& job = batch_.jobs[index];
    const std::uint64_t place = instanceAt(record).extension;
    if (!wantsResult(job) && !isMorphed(job)) {
      ASSERT_EQ(place, 0u) << "what the instance does not need costs words";
      return;
    }
    ASSERT_GT(place, record);
    ASSERT_EQ(place % 4, 0u);
    const auto extension = at<abi::ExtensionRecord>(place);
    ASSERT_NO_FATAL_FAILURE(checkMorphs(extension.morphs, extension.morphCount, job.morphs));
    if (wantsResult(job)) {
      ASSERT_EQ(extension.result * sizeof(InstanceResult), plan_.resultOffset(index));
    }
    if (job.places[Stream::positions].format != VertexFormat::snorm16x3 &&
        job.places[Stream::positions].format != VertexFormat::snorm16x4)
      return;
    const std::array<float, 3> center{extension.centerX, extension.centerY, extension.centerZ};
    const std::array<float, 3> inverse{extension.inverseX, extension.inverseY, extension.inverseZ};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double low = static_cast<double>(job.box.min[axis]);
      const double high = static_cast<double>(job.box.max[axis]);
      ASSERT_EQ(center[axis], static_cast<float>((low + high) / 2));
      ASSERT_EQ(inverse[axis], static_cast<float>(2 / (high - low)));
    }
  }

  struct Run {
    std::uint32_t firstVertex;  ///< of the group
    std::uint32_t begin, end;   ///< the workgroup's vertices, from there
  };

  void writeStream(const PlannedDispatch& dispatch, std::uint32_t group, std::uint64_t record,
                   std::uint32_t index, std::size_t stream, const Run& run) {
    const Job& job = batch_.jobs[index];
    const OutputAttribute attribute = job.places.attributes[stream];
    if (attribute.format == VertexFormat::none) return;
    const std::uint64_t window = dispatch.outputPart(stream).offset;
    ASSERT_LE(window, sizes_[stream]);
    const std::uint64_t range = std::min(limits_.maxStorageBufferRange, sizes_[stream] - window);
    const abi::GroupRecord layout = groupAt(group);
    const abi::InstanceRecord places = instanceAt(record);
    const std::uint32_t stride = std::array{layout.positionStride, layout.normalStride,
                                            layout.tangentStride, layout.previousStride}[stream];
    const std::uint32_t begin = std::array{places.positions, places.normals, places.tangents,
                                           places.previousPositions}[stream];
    for (std::uint32_t i = run.begin; i < run.end; ++i) {
      const std::uint64_t place = begin + std::uint64_t{i} * stride;
      const std::uint32_t vertex = run.firstVertex + i;
      ASSERT_EQ(window + place, attribute.offset + std::uint64_t{vertex} * attribute.stride)
          << "job " << index << ", stream " << stream << ", vertex " << vertex;
      ASSERT_LE(place + formatSize(attribute.format), range) << "outside the output range";
      if (dispatch.variant.wide[stream]) {
        ASSERT_EQ(place % formatSize(attribute.format), 0u);
      }
      // The kernel knows from formats where in a word an attribute begins.
      std::uint32_t before = 0;
      for (std::size_t other = 0; other < stream && stream != previousStream; ++other)
        before += formatSize(job.places.attributes[other].format);
      ASSERT_EQ(place % 4, before % 4);
      if (job.settles && stream != previousStream) continue;  // positions are read
      std::uint8_t& streams = written_[index].at(vertex);
      ASSERT_EQ(streams & 1u << stream, 0u) << "a vertex is skinned twice";
      streams = static_cast<std::uint8_t>(streams | 1u << stream);
    }
  }

  const OwnedBatch& batch_;
  const DeviceLimits& limits_;
  const Tuning& tuning_;
  const Plan& plan_;
  std::vector<std::uint32_t> tables_;
  std::array<std::uint64_t, streamCount> sizes_{};
  std::vector<std::pair<std::uint64_t, std::uint32_t>> begins_;  ///< of positions, and the job
  std::vector<std::vector<std::uint8_t>> written_;      ///< by job and vertex: a bit a stream
  std::map<PaletteInForm, std::uint64_t> statuses_;     ///< bytes into the palettes
  std::map<std::uint64_t, std::uint64_t> paletteEnds_;  ///< by where they begin
  std::set<std::array<bool, 3>> paletteDispatches_;     ///< logarithms, scales, rigid
  std::set<std::uint32_t> cleared_;
  std::uint64_t resultCount_ = 0;
};

}  // namespace

PackedMesh meshOf(std::uint32_t vertices, std::uint32_t influences, std::uint32_t joints,
                  MeshParts parts) {
  OwnedMesh mesh;
  mesh.influencesPerVertex = influences;
  mesh.positions.assign(std::size_t{vertices} * 3, 1.0f);
  if (parts.centers) mesh.centersOfRotation.assign(std::size_t{vertices} * 3, 0.5f);
  if (parts.normals) mesh.normals.assign(std::size_t{vertices} * 3, 1.0f);
  for (std::uint32_t vertex = 0; vertex < vertices; ++vertex) {
    for (std::uint32_t slot = 0; slot < influences; ++slot) {
      mesh.joints.push_back(joints - 1 - slot % joints);
      mesh.weights.push_back(1.0f / static_cast<float>(influences));
    }
  }
  MeshView view = mesh.view();
  const std::vector<float> tangents(std::size_t{vertices} * 4, 1.0f);
  if (parts.tangents) view.tangents = attributeView(tangents.data(), vertices, 4);
  const std::vector<MorphTargetView> targets(parts.morphTargets);
  view.morphTargets = targets;
  Result<PackedMesh> packed = pack(view, joints);
  EXPECT_TRUE(packed.ok());
  return std::move(*packed);
}

PackedMesh meshOf(std::uint32_t vertices, std::uint32_t influences, std::uint32_t joints,
                  bool normals) {
  return meshOf(vertices, influences, joints, MeshParts{normals, false, 0, true});
}

OwnedBatch::OwnedBatch(PackedMesh mesh, std::uint32_t joints) {
  addMesh(std::move(mesh));
  addPose(joints, JointPromise::scaleIgnored);
}

void OwnedBatch::addMesh(PackedMesh mesh) {
  meshOffsets.push_back(meshesSize);
  meshesSize += mesh.bytes().size();
  meshes.push_back(std::move(mesh));
}

void OwnedBatch::addPose(std::uint32_t joints, JointPromise promise) {
  poses.push_back({joints, posesSize, promise});
  posesSize += std::uint64_t{joints} * 48;
}

Job OwnedBatch::jobOf(std::uint32_t mesh, std::uint32_t palette, Method method) const {
  Job job;
  job.mesh = meshes[mesh].info();
  job.meshOffset = meshOffsets[mesh];
  job.pose = palette;
  job.method = method;
  job.places[Stream::positions].format = VertexFormat::float32x3;
  return job;
}

Job& OwnedBatch::addJob(std::uint32_t mesh, std::uint32_t palette, Method method, bool normals,
                        std::uint32_t stride) {
  Job job = jobOf(mesh, palette, method);
  if (normals && stride % 8 == 0) outputSize += outputSize % 8;
  job.places[Stream::positions] = {outputSize, stride, VertexFormat::float32x3};
  if (normals) job.places[Stream::normals] = {outputSize + 12, stride, VertexFormat::float32x3};
  outputSize += std::uint64_t{job.mesh.vertexCount} * stride;
  jobs.push_back(job);
  return jobs.back();
}

Job& OwnedBatch::place(Job job, Arrangement arrangement, std::uint32_t gap) {
  hasSeparateOutputs = hasSeparateOutputs || arrangement == Arrangement::separate;
  ByStream<OutputAttribute>& attributes = job.places.attributes;
  const std::uint64_t vertices = job.mesh.vertexCount;
  std::uint32_t inVertex = 0;
  std::uint32_t vertexSize = gap;
  for (const OutputAttribute& attribute : attributes) vertexSize += formatSize(attribute.format);
  // Positions and normals may stand in pairs.
  if (arrangement == Arrangement::interleaved) outputSize += (8 - outputSize % 8) % 8;
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    const std::uint32_t size = formatSize(attributes[stream].format);
    if (size == 0) continue;
    if (arrangement == Arrangement::interleaved) {
      attributes[stream].offset = outputSize + inVertex;
      attributes[stream].stride = vertexSize;
      inVertex += size;
    } else {
      std::uint64_t& end = endOf(stream);
      attributes[stream].offset = end;
      attributes[stream].stride = size + gap;
      end += vertices * (size + gap);
      end += (4 - end % 4) % 4;
    }
  }
  if (arrangement == Arrangement::interleaved) outputSize += vertices * vertexSize;
  jobs.push_back(job);
  return jobs.back();
}

std::span<const MorphWeight> OwnedBatch::keep(std::vector<MorphWeight> morphs) {
  return morphLists_.emplace_back(std::move(morphs));
}

Batch OwnedBatch::batch() const {
  return {poses,
          jobs,
          meshesSize,
          posesSize,
          hasSeparateOutputs ? separateSizes : ByStream<std::uint64_t>::all(outputSize),
          !hasSeparateOutputs};
}

OwnedBatch batchOfFiveMeshes() {
  OwnedBatch batch;
  batch.addMesh(meshOf(1, 1, 3, true));
  batch.addMesh(meshOf(63, 2, 5, false));
  batch.addMesh(meshOf(64, 4, 5, MeshParts{true, true, 3}));
  batch.addMesh(meshOf(65, 8, 5, MeshParts{true, true, 9}));
  batch.addMesh(meshOf(1234, 3, 5, MeshParts{true, false, 5}));
  for (const std::uint32_t joints : {5u, 9u, 300u, 7u})
    batch.addPose(joints, static_cast<JointPromise>(joints % 3));
  return batch;
}

OwnedBatch randomBatch(std::uint32_t seed, std::uint32_t jobs) {
  std::mt19937 engine(seed);
  OwnedBatch batch = batchOfFiveMeshes();
  // The same mesh may stand twice in the mesh buffer.
  batch.meshesSize += 16;
  batch.addMesh(meshOf(64, 4, 5, true));
  for (std::uint32_t index = 0; index < jobs; ++index) {
    batch.outputSize += engine() % 5 * 4;
    const auto mesh = static_cast<std::uint32_t>(engine() % batch.meshes.size());
    const bool normals = batch.meshes[mesh].info().hasNormals && engine() % 3 != 0;
    const std::uint32_t stride = (normals ? 24 : 12) + static_cast<std::uint32_t>(engine() % 3) * 4;
    const auto palette = static_cast<std::uint32_t>(engine() % 4);
    const Method method =
        engine() % 2 == 0 ? Method::linear : allMethods[1 + engine() % (allMethods.size() - 1)];
    Job& job = batch.addJob(mesh, palette, method, normals, stride);
    if (!normals || engine() % 2 == 0) continue;
    // Planar: first all positions, then all normals with a stride of their own.
    const std::uint32_t vertices = job.mesh.vertexCount;
    job.places[Stream::positions].stride = 12 + static_cast<std::uint32_t>(engine() % 2) * 4;
    job.places[Stream::normals].offset =
        job.places[Stream::positions].offset +
        std::uint64_t{vertices} * job.places[Stream::positions].stride;
    job.places[Stream::normals].stride = 12 + static_cast<std::uint32_t>(engine() % 3) * 4;
    batch.outputSize = job.places[Stream::normals].offset +
                       std::uint64_t{vertices} * job.places[Stream::normals].stride;
  }
  return batch;
}

namespace {

/// Some of the targets in random order, some of them with weight 0.
std::vector<MorphWeight> randomMorphs(std::mt19937& engine, std::uint32_t targets) {
  std::vector<MorphWeight> morphs;
  for (std::uint32_t target = 0; target < targets; ++target) {
    if (engine() % 2 == 0)
      morphs.push_back({target, static_cast<float>(engine() % 4) / 2.0f - 0.5f});
  }
  std::shuffle(morphs.begin(), morphs.end(), engine);
  return morphs;
}

VertexFormat anyFormat(std::mt19937& engine, bool (*isAllowed)(VertexFormat)) {
  for (;;) {
    const VertexFormat format = allVertexFormats[engine() % allVertexFormats.size()];
    if (isAllowed(format)) return format;
  }
}

/// Whether kernels can store a job's attributes.
bool isOfWords(const Job& job, Arrangement arrangement) {
  std::uint32_t length = 0, bits = 0;
  for (const OutputAttribute& attribute : job.places.attributes) {
    length += formatSize(attribute.format);
    bits |= formatSize(attribute.format);
  }
  const bool isMotionOfWords =
      !job.places.hasMotion() || formatSize(job.places[Stream::positions].format) % 4 == 0;
  return (arrangement == Arrangement::interleaved ? length : bits) % 4 == 0 && isMotionOfWords;
}

}  // namespace

OwnedBatch randomRichBatch(std::uint32_t seed, std::uint32_t jobs, bool separate) {
  std::mt19937 engine(seed);
  const auto below = [&](std::uint32_t count) {
    return static_cast<std::uint32_t>(engine()) % count;
  };
  OwnedBatch batch = batchOfFiveMeshes();
  for (std::uint32_t index = 0; index < jobs; ++index) {
    Job job = batch.jobOf(below(5), below(4), allMethods[below(allMethods.size())]);
    const Arrangement arrangement = separate        ? Arrangement::separate
                                    : below(2) == 0 ? Arrangement::planar
                                                    : Arrangement::interleaved;
    const bool hasMotion = below(2) != 0;
    do {
      job.places[Stream::positions].format = anyFormat(engine, isPositionFormat);
      const bool normals = job.mesh.hasNormals && below(3) != 0;
      job.places[Stream::normals].format =
          normals ? anyFormat(engine, isNormalFormat) : VertexFormat::none;
      const bool tangents = job.mesh.hasTangents && below(3) != 0;
      job.places[Stream::tangents].format =
          tangents ? anyFormat(engine, isTangentFormat) : VertexFormat::none;
      job.places[Stream::previousPositions].format =
          hasMotion ? job.places[Stream::positions].format : VertexFormat::none;
    } while (!isOfWords(job, arrangement));
    job.box = {{-1, -2, -3}, {4, 5, static_cast<float>(6 + below(9))}};
    job.bounds = below(3) == 0;
    job.restartsMotion = job.places.hasMotion() && below(4) == 0;
    job.settles = job.places.hasMotion() && below(4) == 0;
    if (below(2) == 0) job.morphs = batch.keep(randomMorphs(engine, job.mesh.morphTargetCount));
    batch.place(job, arrangement, below(3) * 4);
  }
  return batch;
}

DeviceLimits richLimits() {
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  return limits;
}

bool wantsResult(const Job& job) {
  return job.bounds || isSnormPosition(job.places[Stream::positions].format);
}

std::vector<MorphWeight> activeMorphs(std::span<const MorphWeight> morphs) {
  std::vector<MorphWeight> active;
  for (const MorphWeight& morph : morphs) {
    if (morph.weight != 0) active.push_back(morph);
  }
  std::sort(active.begin(), active.end(),
            [](const MorphWeight& a, const MorphWeight& b) { return a.target < b.target; });
  return active;
}

std::vector<std::uint32_t> tablesOf(const Plan& plan) {
  std::vector<std::uint32_t> words(plan.buffer(BufferRole::tables).size / 4);
  EXPECT_TRUE(writeTables(plan, std::as_writable_bytes(std::span(words))).ok());
  return words;
}

void expectEmpty(const Plan& plan) {
  EXPECT_TRUE(dispatchesOf(plan).empty());
  EXPECT_TRUE(plan.pipelines().empty());
  EXPECT_EQ(plan.instanceCount(), 0u);
  EXPECT_EQ(plan.vertexCount(), 0u);
  for (const BufferRole role : {BufferRole::tables, BufferRole::palettes, BufferRole::results})
    EXPECT_EQ(plan.buffer(role).size, 0u);
  EXPECT_EQ(plan.statusOffset(0), std::nullopt);
  EXPECT_EQ(plan.resultOffset(0), std::nullopt);
}

void expectPlanned(const OwnedBatch& batch, const DeviceLimits& limits, const Tuning& tuning,
                   Plan& out) {
  const Result<void> result = makePlan(batch.batch(), limits, tuning, out);
  ASSERT_TRUE(result.ok()) << result.error().message;
  Simulation(batch, limits, tuning, out).run();
}

Plan planned(const OwnedBatch& batch, const DeviceLimits& limits, const Tuning& tuning) {
  Plan out;
  expectPlanned(batch, limits, tuning, out);
  if (::testing::Test::HasFatalFailure()) throw std::runtime_error("the plan is wrong");
  return out;
}

}  // namespace dermis::test
