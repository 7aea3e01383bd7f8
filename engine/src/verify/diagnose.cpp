#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include <glm/geometric.hpp>

#include "core/text.h"
#include "dermis/verify.h"
#include "strict_floating_point.h"
#include "verify/bind_vertex.h"
#include "verify/pose_hypotheses.h"
#include "verify/pose_probe.h"

namespace dermis {
namespace {

using diagnosis::Hypothesis;
using diagnosis::Pose;
using diagnosis::PoseProbe;
using diagnosis::PoseScore;
using diagnosis::PoseSkeleton;

/// Poses are equal if no vertex differs by more, in sizes of the posed mesh.
constexpr double sameVertex = 0.01;
/// A measure of a pose. Above `suspicious` it is suspicious. Sound poses may be, too: a rig may
/// stretch, and its joints may move apart. They have no finding, because no mistake explains them.
/// A mistake does if undoing it leaves at most `explained` of the measure. The numbers are from the
/// sound poses of tests/unit/diagnose_models_test.cpp.
struct Measure {
  double PoseScore::*value;
  double suspicious;
  double explained;
};
constexpr std::array<Measure, 4> measures{{{&PoseScore::stretch, 0.3, 0.35},
                                           {&PoseScore::loose, 0.1, 0.35},
                                           {&PoseScore::bend, 0.55, 0.6},
                                           {&PoseScore::misfit, 0.6, 0.5}}};
/// More stretch than that is wrong even if no mistake explains it.
constexpr double tornStretch = 0.5;

bool isSuspicious(const PoseScore& score) {
  return std::ranges::any_of(measures, [&score](const Measure& measure) {
    return score.*measure.value > measure.suspicious;
  });
}

/// Whether a pose with the second score is right, if that with the first one is wrong.
bool explains(const PoseScore& wrong, const PoseScore& right) {
  bool better = false;
  for (const auto& [value, suspicious, explained] : measures) {
    const double before = wrong.*value, after = right.*value;
    if (!(after <= std::max(before, suspicious))) return false;
    better = better || (before > suspicious && after <= explained * before);
  }
  return better;
}

double costOf(const PoseScore& score) {
  return score.stretch + score.loose + score.apart + score.bend + score.misfit / 2;
}

/// The largest distance between vertices of the two poses, in sizes of the first one.
double differenceOf(const PoseProbe& probe, const std::vector<glm::dvec3>& expected,
                    const Pose& pose) {
  const std::vector<glm::dvec3> positions = probe.skin(pose);
  double largest = 0;
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const double difference = glm::distance(expected[i], positions[i]);
    // NaN counts as infinite.
    largest = difference <= largest ? largest : difference;
    if (!std::isfinite(largest)) return std::numeric_limits<double>::infinity();
  }
  return largest / std::max(diagnosis::sizeOf(expected), 1e-30);
}

/// The mistake that turns the right pose into this one.
const Hypothesis* findMaker(const PoseProbe& probe, const std::vector<Hypothesis>& hypotheses,
                            const Pose& right, const Pose& pose) {
  const std::vector<glm::dvec3> positions = probe.skin(pose);
  const Hypothesis* best = nullptr;
  double least = sameVertex;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (!hypothesis.make) continue;
    const std::optional<Pose> made = hypothesis.make(right);
    if (!made) continue;
    const double difference = differenceOf(probe, positions, *made);
    // Of equal ones the first counts.
    if (difference < least - 1e-4) {
      least = difference;
      best = &hypothesis;
    }
  }
  return best;
}

/// Whether the local transforms may be wrong by this mistake, too.
bool isInLocals(PoseMistake mistake) {
  return mistake == PoseMistake::units || mistake == PoseMistake::axes ||
         mistake == PoseMistake::quaternionOrder;
}

/// The weights of the later set are larger; or no joint has a translation.
constexpr double withOtherEvidence = 0.5;

struct Mended {
  PoseMistake mistake = PoseMistake::unknown;
  std::string message;
  PoseScore score;
  double cost = std::numeric_limits<double>::infinity();

  /// `doubt` is smaller if there is other evidence for the mistake.
  void offer(PoseMistake by, const std::string& text, const PoseScore& wrong, const PoseScore& with,
             double doubt = 1) {
    const double newCost = doubt * costOf(with);
    if (!explains(wrong, with) || !(newCost < cost - 1e-4)) return;
    cost = newCost;
    mistake = by;
    message = text;
    score = with;
  }
};

/// Of a sample of vertices. Exporters write the largest weights to the first set.
double sumOfWeights(const MeshView& mesh, std::size_t set) {
  const AttributeView& weights = mesh.influenceSets[set].weights;
  const std::size_t step = std::max<std::size_t>(1, mesh.vertexCount / 1000);
  double sum = 0;
  for (std::size_t vertex = 0; vertex < mesh.vertexCount; vertex += step) {
    for (std::uint32_t i = 0; i < weights.components; ++i)
      sum += reference::readComponent(weights, vertex, i);
  }
  return sum;
}

/// The mesh with the weights of set order[i] for the joints of set i.
std::vector<InfluenceSet> reorderedSets(const MeshView& mesh, std::span<const std::size_t> order) {
  std::vector<InfluenceSet> sets(mesh.influenceSets.begin(), mesh.influenceSets.end());
  for (std::size_t i = 0; i < sets.size(); ++i)
    sets[i].weights = mesh.influenceSets[order[i]].weights;
  return sets;
}

void offerWeightSets(const MeshView& mesh, const PoseInput& input, const PoseSkeleton& skeleton,
                     const Pose& pose, const PoseScore& wrong, Mended& mended) {
  const std::size_t count = mesh.influenceSets.size();
  for (std::size_t a = 0; a < count; ++a) {
    for (std::size_t b = a + 1; b < count; ++b) {
      if (!(sumOfWeights(mesh, a) < sumOfWeights(mesh, b))) continue;
      std::vector<std::size_t> order(count);
      for (std::size_t i = 0; i < count; ++i) order[i] = i == a ? b : i == b ? a : i;
      const std::vector<InfluenceSet> sets = reorderedSets(mesh, order);
      MeshView other = mesh;
      other.influenceSets = sets;
      if (!validate(other, static_cast<std::uint32_t>(pose.size())).packable()) continue;
      const PoseProbe probe(other, input.triangles);
      mended.offer(PoseMistake::weightSet,
                   "the weights of influence set " + std::to_string(b) +
                       " are read for the joints of set " + std::to_string(a) +
                       ": use influenceSets[" + std::to_string(a) + "].weights = WEIGHTS_" +
                       std::to_string(a) + " and influenceSets[" + std::to_string(b) +
                       "].weights = WEIGHTS_" + std::to_string(b),
                   wrong, probe.score(pose, skeleton.bind), withOtherEvidence);
    }
  }
}

Mended findMend(const MeshView& mesh, const PoseInput& input, const PoseSkeleton& skeleton,
                const PoseProbe& probe, const std::vector<Hypothesis>& hypotheses, const Pose& pose,
                const PoseScore& wrong, bool consistent) {
  Mended mended;
  for (const Hypothesis& hypothesis : hypotheses) {
    if (!hypothesis.undo || (consistent && !isInLocals(hypothesis.mistake))) continue;
    const std::optional<Pose> undone = hypothesis.undo(pose);
    if (!undone) continue;
    diagnosis::BindSkeleton bind = skeleton.bind;
    if (hypothesis.undoBind) bind.inverseBind = *hypothesis.undoBind(bind.inverseBind);
    mended.offer(hypothesis.mistake, hypothesis.message, wrong, probe.score(*undone, bind),
                 hypothesis.mistake == PoseMistake::transposed ? withOtherEvidence : 1);
  }
  offerWeightSets(mesh, input, skeleton, pose, wrong, mended);
  return mended;
}

Result<void> checkInput(const MeshView& mesh, const PoseInput& input) {
  const std::size_t count = input.jointMatrices.size();
  if (count == 0 || count > maxPoseJoints) {
    return Error{ErrorCode::invalidArgument,
                 "PoseInput::jointMatrices has " + std::to_string(count) + " elements"};
  }
  if (const Result<void> accepted = validate(mesh, static_cast<std::uint32_t>(count)).accepted();
      !accepted) {
    return accepted;
  }
  const auto outside = std::ranges::find_if(
      input.triangles, [&mesh](std::uint32_t vertex) { return vertex >= mesh.vertexCount; });
  if (input.triangles.size() % 3 != 0 || outside != input.triangles.end()) {
    return Error{ErrorCode::invalidArgument,
                 "mesh " + inQuotes(mesh.name) +
                     ": PoseInput::triangles are not 3 vertices of the mesh for each triangle"};
  }
  return {};
}

}  // namespace

const char* poseMistakeName(PoseMistake mistake) {
  constexpr const char* names[] = {"none",
                                   "unknown",
                                   "transposed matrices",
                                   "column-major floats",
                                   "inverse bind matrix missing",
                                   "inverse bind matrix twice",
                                   "inverse bind matrix on the wrong side",
                                   "joints in the order of nodes",
                                   "joints sorted by name",
                                   "joints off by one",
                                   "root transform missing",
                                   "root transform twice",
                                   "units",
                                   "handedness or up axis",
                                   "quaternion order",
                                   "weights of another set"};
  static_assert(std::size(names) == std::size_t(PoseMistake::weightSet) + 1);
  return nameIn(names, mistake);
}

Result<Diagnosis> diagnose(const MeshView& mesh, const PoseInput& input) {
  if (const Result<void> valid = checkInput(mesh, input); !valid) return valid.error();
  const Result<PoseSkeleton> skeleton = diagnosis::skeletonOf(input);
  if (!skeleton) return skeleton.error();

  Diagnosis result;
  result.notTested = diagnosis::untested(input, mesh);
  Pose pose;
  for (const JointMatrix& matrix : input.jointMatrices) {
    pose.push_back(diagnosis::toAffine(matrix));
    if (diagnosis::isFinite(pose.back())) continue;
    result.mistake = PoseMistake::unknown;
    result.message = "joint " + std::to_string(pose.size() - 1) +
                     " has a matrix that is not finite: check what computes jointMatrices[" +
                     std::to_string(pose.size() - 1) + "]";
    return result;
  }
  const PoseProbe probe(mesh, input.triangles);
  const PoseScore score = probe.score(pose, skeleton->bind);
  result.stretch = result.mendedStretch = score.stretch;
  const std::vector<Hypothesis> hypotheses = diagnosis::hypothesesFor(*skeleton);
  bool consistent = false;
  if (skeleton->isComplete()) {
    const Pose right = rebuild(*skeleton, globalsOf(*skeleton, skeleton->locals));
    consistent = differenceOf(probe, probe.skin(pose), right) <= sameVertex;
    const Hypothesis* maker = consistent ? nullptr : findMaker(probe, hypotheses, right, pose);
    if (maker != nullptr) {
      result.mistake = maker->mistake;
      result.message = maker->message;
      result.mendedStretch = probe.score(right, skeleton->bind).stretch;
      return result;
    }
  }
  if (!isSuspicious(score)) return result;
  const Mended mended =
      findMend(mesh, input, *skeleton, probe, hypotheses, pose, score, consistent);
  if (mended.mistake == PoseMistake::unknown) {
    if (score.stretch <= tornStretch) return result;
    // Without a skeleton the lost translations cannot be found again, but that they are lost shows.
    const auto transposed =
        std::ranges::find(hypotheses, PoseMistake::transposed, &Hypothesis::mistake);
    if (transposed->undo(pose)) {
      result.mistake = transposed->mistake;
      result.message = transposed->message;
      return result;
    }
    result.mistake = mended.mistake;
    result.message =
        "the pose tears the mesh, but none of the tested mistakes explains it: pass what "
        "notTested names";
  } else {
    result.mistake = mended.mistake;
    result.message = mended.message;
    result.mendedStretch = mended.score.stretch;
  }
  return result;
}

}  // namespace dermis
