// What several tasks need: the poses of figures, and what rigs drive.
#include <algorithm>
#include <cstddef>
#include <span>

#include "clips/bank.h"
#include "clips/sample.h"
#include "cpu/clip_plan.h"
#include "cpu/task.h"
#include "cpu/thread_memory.h"
#include "rig/blob.h"

namespace dermis::cpu {

void FigureTask::finish() {
  ClipScratch& scratch = threadMemory().clips;
  work.finish([&] { scratch.prepare(*plan); },
              [&] { dispatchSampling(*plan, layers, scratch, matrices); });
}

void RigTask::finish() {
  RigScratch& scratch = threadMemory().rigs;
  const auto evaluate = [&] {
    for (std::size_t i = 0; i < count; ++i) {
      const RigPose& pose = poses[i];
      FigureTask* const figure = figures[i];
      if (figure != nullptr) {
        figure->finish();
        const PackedClips& bank = *figure->plan->bank;
        const std::span given = pose.weights.first(rig->givenWeights());
        if (!given.empty()) {
          const auto node = ClipBank(bank).morphedNode(rig->weightsOf());
          sampleWeights(bank, figure->layers, *node, given);
        }
      }
      std::ranges::copy(pose.written, pose.driven.data() - pose.written.size());
    }
    dispatchRigs(*rig, std::span(poses).first(count), scratch);
  };
  const auto prepare = [&] {
    scratch.prepare(*rig);
    for (const FigureTask* figure : std::span(figures).first(count)) {
      if (figure != nullptr) threadMemory().clips.prepare(*figure->plan);
    }
  };
  work.finish(prepare, evaluate);
}

void RigScratch::prepare(const PackedRig& rig) {
  const RigHeader header = RigBlob(rig).header;
  const std::size_t count = maxRigExamples + std::size_t{header.givenWeights} +
                            header.drivenWeights + std::size_t{4} * header.mostInputs;
  if (numbers.size() < count) numbers.resize(count);
}

void evaluatePlainly(const PackedRig& rig, std::span<const RigPose> poses, RigScratch& scratch) {
  for (const RigPose& pose : poses) {
    evaluateRigIn(numbersOf(scratch.numbers.data()), rig, pose.written, pose.givenWeights,
                  pose.driven, pose.weights);
  }
}

}  // namespace dermis::cpu
