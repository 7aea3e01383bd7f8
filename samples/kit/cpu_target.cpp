// Batches on the CPU.

#include <algorithm>
#include <map>
#include <mutex>

#include "dermis/cpu.h"
#include "kit/batch_runner.h"

namespace dermis::samples {
namespace {

constexpr std::array cpuMethods{Method::linear, Method::dualQuaternion, Method::blended,
                                Method::centerOfRotation, Method::bulgeControlled};

class CpuRunner : public BatchRunner {
 public:
  explicit CpuRunner(const RunOptions& options) : BatchRunner(options) {}

 private:
  Result<BatchResult> skin() override;
  std::span<const std::byte> outputBytes(std::size_t stream) const override {
    return outputs_[stream];
  }
  void makeOutputs();
  Result<void> makeMeshes();
  cpu::Instance instanceOf(const Job& job);
  std::vector<cpu::Job> cutUp(std::span<const cpu::Instance> instances) const;

  std::array<std::vector<std::byte>, streamCount> outputs_;
  /// By offset in the layout. Made once, as long as batches have the same meshes.
  std::map<std::uint64_t, cpu::Mesh> meshes_;
  std::map<const PackedMesh*, std::uint64_t> made_;
};

void CpuRunner::makeOutputs() {
  for (std::size_t stream = 0; stream < streamCount; ++stream) {
    const auto size =
        static_cast<std::size_t>(layout_.oneOutput && stream > 0 ? 0 : layout_.outputs[stream]);
    if (outputs_[stream].size() != size) outputs_[stream].assign(size, options_.poison);
  }
}

Result<void> CpuRunner::makeMeshes() {
  if (made_ == layout_.meshOffsets) return {};
  made_.clear();
  meshes_.clear();
  for (const auto& [packed, offset] : layout_.meshOffsets) {
    Result<cpu::Mesh> mesh = cpu::Mesh::create(*packed);
    if (!mesh) return mesh.error();
    meshes_.emplace(offset, std::move(*mesh));
  }
  made_ = layout_.meshOffsets;
  return {};
}

/// The offset of each attribute is added to its address here, so that instances of one job may have
/// different offsets.
cpu::Instance CpuRunner::instanceOf(const Job& job) {
  const auto memory = [&](std::size_t stream) -> void* {
    const OutputAttribute& attribute = job.places.attributes[stream];
    if (attribute.format == VertexFormat::none) return nullptr;
    return outputs_[outputOf(stream)].data() + attribute.offset;
  };
  cpu::Instance instance;
  instance.pose = layout_.poses[job.pose];
  instance.promise = layout_.poseDescriptions[job.pose].promise;
  instance.output = {{memory(0), memory(1), memory(2), memory(3)}};
  instance.box = job.box;
  instance.morphs = job.morphs;
  instance.restartsMotion = job.restartsMotion;
  instance.settles = job.settles;
  return instance;
}

/// A job has a range of vertices of some instances with the same mesh and method (`Tuning`).
std::vector<cpu::Job> CpuRunner::cutUp(std::span<const cpu::Instance> instances) const {
  std::vector<cpu::Job> jobs;
  for (std::size_t first = 0; first < instances.size();) {
    const Job& like = layout_.jobs[first];
    std::size_t end = first + 1;
    while (end < instances.size() && end - first < options_.tuning.instancesPerInvocation &&
           layout_.jobs[end].meshOffset == like.meshOffset &&
           layout_.jobs[end].method == like.method)
      ++end;
    cpu::Job job;
    job.mesh = &meshes_.at(like.meshOffset);
    job.method = like.method;
    job.places = like.places;
    for (OutputAttribute& attribute : job.places.attributes) attribute.offset = 0;
    job.instances = instances.subspan(first, end - first);
    for (std::uint32_t vertex = 0; vertex < like.mesh.vertexCount;
         vertex += options_.tuning.workgroupSize) {
      job.firstVertex = vertex;
      job.vertexEnd = vertex + options_.tuning.workgroupSize;
      jobs.push_back(job);
    }
    first = end;
  }
  return jobs;
}

Result<BatchResult> CpuRunner::skin() {
  static std::mutex instructionsMutex;  // they are chosen for the whole process
  const std::lock_guard lock(instructionsMutex);
  if (Result<void> chosen = cpu::setTarget(options_.instructions); !chosen) return chosen.error();
  if (Result<void> made = makeMeshes(); !made) return made.error();
  makeOutputs();
  std::vector<std::vector<MorphWeight>> morphs;
  std::vector<cpu::Instance> instances;
  for (Job& job : layout_.jobs) {
    // cpu::skin expects morph weights in the order of their morph targets.
    std::vector<MorphWeight>& own = morphs.emplace_back(job.morphs.begin(), job.morphs.end());
    std::ranges::sort(own, {}, &MorphWeight::target);
    job.morphs = own;
    instances.push_back(instanceOf(job));
  }
  BatchResult result;
  result.instances.resize(instances.size());
  const std::vector<cpu::Job> jobs = cutUp(instances);
  for (const cpu::Job& job : jobs) {
    std::vector<cpu::Instance> own(job.instances.begin(), job.instances.end());
    std::vector<InstanceResult> found(own.size());
    const auto first = static_cast<std::size_t>(job.instances.data() - instances.data());
    for (std::size_t i = 0; i < own.size(); ++i) {
      const Job& from = layout_.jobs[first + i];
      if (from.bounds || isSnormPosition(from.places[Stream::positions].format))
        own[i].result = &found[i];
    }
    cpu::Job part = job;
    part.instances = own;
    if (Result<void> done = cpu::skin(part); !done) return done.error();
    for (std::size_t i = 0; i < own.size(); ++i)
      cpu::addResult(result.instances[first + i].result, found[i]);
  }
  return result;
}

}  // namespace

std::string CpuTarget::name() const {
  const std::string best(cpu::targetNames().front());
  return "cpu (" + (instructions_.empty() ? best : instructions_) + ")";
}
DeviceLimits CpuTarget::limits() const {
  DeviceLimits limits;
  limits.maxStorageBuffersPerStage = storageBuffersWanted;
  return limits;
}
std::span<const Method> CpuTarget::methods() const {
  return cpuMethods;
}
std::vector<Division> CpuTarget::divisions() const {
  std::vector<Division> all;
  for (const std::string_view instructions : cpu::targetNames()) {
    for (const Tuning& tuning : {Tuning{1u << 31, 32}, Tuning{61, 3}}) {
      const bool isWhole = tuning.workgroupSize > 61;
      all.push_back(
          {std::string(instructions) + (isWhole ? ", whole instances" : ", 61 vertices a job"),
           tuning, std::string(instructions)});
    }
  }
  return all;
}
std::unique_ptr<BatchRunner> CpuTarget::runner(const RunOptions& options) {
  RunOptions own = options;
  if (own.instructions.empty()) own.instructions = instructions_;
  return std::make_unique<CpuRunner>(own);
}
Result<std::vector<std::vector<JointMatrix>>> CpuTarget::samplePoses(
    const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays) {
  std::vector<std::vector<JointMatrix>> poses;
  for (const std::vector<ClipLayer>& layers : plays) {
    for (std::uint32_t skin = 0; skin < bank.skinCount(); ++skin) {
      std::vector<JointMatrix>& pose = poses.emplace_back(bank.jointCount(skin));
      if (Result<void> sampled = samplePose(bank, layers, skin, pose); !sampled)
        return sampled.error();
    }
  }
  return poses;
}
Result<std::vector<std::vector<float>>> CpuTarget::sampleWeights(
    const PackedClips& bank, std::span<const std::vector<ClipLayer>> plays, std::uint32_t node) {
  std::vector<std::vector<float>> all;
  for (const std::vector<ClipLayer>& layers : plays) {
    std::vector<float>& weights = all.emplace_back(bank.weightCount(node));
    if (Result<void> sampled = dermis::sampleWeights(bank, layers, node, weights); !sampled)
      return sampled.error();
  }
  return all;
}
Result<std::vector<DrivenPose>> CpuTarget::drivePoses(const PackedRig& rig,
                                                      std::span<const RigInput> inputs) {
  std::vector<DrivenPose> poses;
  for (const RigInput& input : inputs) {
    DrivenPose& pose = poses.emplace_back();
    pose.joints.resize(rig.drivenJoints());
    pose.weights.resize(std::size_t{rig.givenWeights()} + rig.drivenWeights());
    if (Result<void> done =
            evaluateRig(rig, input.written, input.givenWeights, pose.joints, pose.weights);
        !done)
      return done.error();
  }
  return poses;
}

}  // namespace dermis::samples
