// Turns a batch into work, and the work into a plan.

#include <algorithm>

#include "plan/encode.h"

namespace dermis {

/// Reused for the next plan, for its memory.
class PlanMaker {
 public:
  Result<void> make(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning,
                    PlanData& plan);

 private:
  Result<void> placeJobs(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning,
                         Result<void>& placed);
  static Result<void> checkPoses(const Batch& batch);
  void markPalettes(const Job& job);
  void placePalettes(const Batch& batch);
  Result<void> checkSizes(const Batch& batch, const DeviceLimits& limits) const;
  void addPalettes(const Batch& batch);
  void addJobs(const Batch& batch);
  std::uint32_t paletteOf(const Batch& batch, Method method, std::uint32_t palette) const;
  const InstanceExtras* extrasOf(const Batch& batch, std::size_t index);

  std::array<std::vector<std::uint32_t>, paletteFormCount> paletteUnits_;
  std::uint64_t palettesSize_ = 0;
  std::vector<std::uint32_t> results_;  ///< each job's number among them, or notUsed
  std::uint32_t resultCount_ = 0;
  std::uint64_t vertexCount_ = 0;
  Work work_;
  Encoder encoder_;
  Groups groups_;
  std::vector<PlacedRun> runs_;
  std::vector<std::uint32_t> firstRuns_;  ///< of each job
  std::vector<InstanceExtras> extras_;    ///< of jobs that need any; the first `extrasUsed_`
  std::size_t extrasUsed_ = 0;
};

Result<void> PlanMaker::checkPoses(const Batch& batch) {
  for (std::size_t index = 0; index < batch.poses.size(); ++index) {
    if (Result<void> good = checkPose(batch, batch.poses[index], index); !good) return good;
  }
  return {};
}

/// Marks the form that a job reads.
void PlanMaker::markPalettes(const Job& job) {
  const PaletteForm form = paletteForm(job.method);
  if (form == PaletteForm::matrices) return;
  paletteUnits_[static_cast<std::size_t>(form)][job.pose] = 0;
}

/// Finds a place for each form that is marked.
void PlanMaker::placePalettes(const Batch& batch) {
  std::uint64_t end = 0;
  for (const PaletteForm form : {PaletteForm::dualQuaternions, PaletteForm::logarithms}) {
    std::vector<std::uint32_t>& units = paletteUnits_[static_cast<std::size_t>(form)];
    for (std::size_t index = 0; index < units.size(); ++index) {
      if (units[index] == notUsed) continue;
      units[index] = static_cast<std::uint32_t>(end);
      end += paletteSize(form, batch.poses[index].jointCount, batch.poses[index].promise);
    }
  }
  palettesSize_ = end * unitBytes;
}

Result<void> PlanMaker::checkSizes(const Batch& batch, const DeviceLimits& limits) const {
  for (const auto& [name, size] : {std::pair{"meshes", batch.meshesSize},
                                   {"poses", batch.posesSize},
                                   {"palettes", palettesSize_}}) {
    if (size > limits.maxStorageBufferRange) return tooLargeForRange(name, size, limits);
  }
  return {};
}

/// Checks all jobs and marks the palettes that they read. Returns the first error in a job.
/// `placed` receives the first error in a placement; errors in poses are reported before it.
Result<void> PlanMaker::placeJobs(const Batch& batch, const DeviceLimits& limits,
                                  const Tuning& tuning, Result<void>& placed) {
  for (std::vector<std::uint32_t>& units : paletteUnits_) units.assign(batch.poses.size(), notUsed);
  resultCount_ = 0;
  vertexCount_ = 0;
  results_.resize(batch.jobs.size());
  groups_.clear();
  runs_.clear();
  firstRuns_.clear();
  Placing placing;
  placing.windows = {batch.outputSizes, limits};
  for (std::size_t index = 0; index < batch.jobs.size(); ++index) {
    const Job& job = batch.jobs[index];
    const OutputStreams streams = outputStreams(job);
    placing.subject.index = index;
    if (Result<void> good = checkJob(batch, job, streams, placing.subject, limits); !good)
      return good;
    if (Result<void> good = checkRuns(job, streams, placing.subject); !good) return good;
    results_[index] = hasResult(job) ? resultCount_++ : notUsed;
    vertexCount_ += job.mesh.vertexCount;
    markPalettes(job);
    firstRuns_.push_back(static_cast<std::uint32_t>(runs_.size()));
    const PoseDescription& pose = batch.poses[job.pose];
    placing.jointCount = pose.jointCount;
    placing.mayScale = pose.promise == JointPromise::scaling;
    if (placed) placed = groups_.place(job, streams, placing, limits, tuning, runs_);
  }
  firstRuns_.push_back(static_cast<std::uint32_t>(runs_.size()));
  return {};
}

std::uint32_t PlanMaker::paletteOf(const Batch& batch, Method method, std::uint32_t palette) const {
  const PaletteForm form = paletteForm(method);
  if (form != PaletteForm::matrices) return paletteUnits_[static_cast<std::size_t>(form)][palette];
  return static_cast<std::uint32_t>(batch.poses[palette].matrixOffset / unitBytes);
}

/// Null if all its morph targets are inactive and it needs nothing else. `extras_` has room for
/// those of all jobs, so that none moves.
const InstanceExtras* PlanMaker::extrasOf(const Batch& batch, std::size_t index) {
  const Job& job = batch.jobs[index];
  InstanceExtras& extras = extras_[extrasUsed_];
  assignActive(job.morphs, extras.morphs);
  extras.result = results_[index];
  extras.hasBox = isSnormPosition(job.places[Stream::positions].format);
  extras.box = job.box;
  if (!extras.isNeeded()) return nullptr;
  ++extrasUsed_;
  return &extras;
}

void PlanMaker::addPalettes(const Batch& batch) {
  for (const PaletteForm form : {PaletteForm::dualQuaternions, PaletteForm::logarithms}) {
    const std::vector<std::uint32_t>& units = paletteUnits_[static_cast<std::size_t>(form)];
    for (std::size_t index = 0; index < units.size(); ++index) {
      if (units[index] == notUsed) continue;
      const PoseDescription& pose = batch.poses[index];
      work_.addPose({static_cast<std::uint32_t>(pose.matrixOffset / unitBytes)}, units[index],
                    pose.jointCount, form, pose.promise);
    }
  }
}

void PlanMaker::addJobs(const Batch& batch) {
  extrasUsed_ = 0;
  extras_.resize(std::max(extras_.size(), batch.jobs.size()));
  for (std::size_t index = 0; index < batch.jobs.size(); ++index) {
    const Job& job = batch.jobs[index];
    const std::uint32_t palette = paletteOf(batch, job.method, job.pose);
    const std::uint32_t flags = (job.restartsMotion ? abi::INSTANCE_RESTARTS : 0u) |
                                (job.settles ? abi::INSTANCE_SETTLES : 0u);
    const bool mayHaveExtras = !job.morphs.empty() || results_[index] != notUsed;
    const InstanceExtras* extras = mayHaveExtras ? extrasOf(batch, index) : nullptr;
    for (std::uint32_t run = firstRuns_[index]; run < firstRuns_[index + 1]; ++run) {
      Work::Instance& added = work_.add(runs_[run]);
      added.pose = job.pose;
      added.extras = extras;
      added.palette = palette;
      added.flags = flags;
    }
  }
}

Result<void> PlanMaker::make(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning,
                             PlanData& plan) {
  if (Result<void> good = checkLimits(limits); !good) return good;
  if (Result<void> good = checkTuning(tuning); !good) return good;
  if (batch.jobs.size() > notUsed / 2) return invalid("the batch has more than 2^31 jobs");
  Result<void> placed;
  if (Result<void> good = placeJobs(batch, limits, tuning, placed); !good) return good;
  if (Result<void> good = checkPoses(batch); !good) return good;
  placePalettes(batch);
  if (Result<void> good = checkSizes(batch, limits); !good) return good;
  if (!placed) return placed;

  PlanSizes sizes;
  sizes.meshes = batch.meshesSize;
  sizes.poses = batch.posesSize;
  sizes.palettes = palettesSize_;
  sizes.results = resultCount_;
  sizes.outputs = batch.outputSizes;
  work_.begin(groups_);
  addPalettes(batch);
  for (std::uint32_t result = 0; result < resultCount_; ++result)
    work_.clearedResults.push_back(result);
  addJobs(batch);
  work_.arrange();
  if (Result<void> good = encoder_.encode(work_, limits, tuning, sizes, plan); !good) return good;
  PlanBuffers buffers;
  for (std::size_t index = 0; index < bufferRoleCount; ++index) {
    const auto role = static_cast<BufferRole>(index);
    const std::uint64_t size = sizes.requirement(role, plan.tables.bytes().size(), limits).size;
    buffers[role] = {static_cast<std::uint32_t>(index), 0, size};
  }
  encoder_.listBatch(buffers);
  plan.paletteUnits = paletteUnits_;
  plan.results = results_;
  plan.instanceCount = static_cast<std::uint32_t>(batch.jobs.size());
  plan.vertexCount = vertexCount_;
  return {};
}

PlanData::PlanData() = default;
PlanData::~PlanData() = default;

Result<void> makePlan(const Batch& batch, const DeviceLimits& limits, const Tuning& tuning,
                      Plan& out) {
  PlanData& plan = PlanData::of(out);
  if (plan.maker == nullptr) plan.maker = std::make_unique<PlanMaker>();
  Result<void> made = plan.maker->make(batch, limits, tuning, plan);
  if (!made) plan.clear();
  return made;
}

}  // namespace dermis
