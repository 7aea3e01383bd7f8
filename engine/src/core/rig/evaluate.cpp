// Computes what a rig drives, for one pose.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <span>
#include <string>
#include <vector>

#include "dermis/rig.h"
#include "rig/blob.h"
#include "strict_floating_point.h"

namespace dermis {
namespace rigs {
namespace {

float squareRoot(float square) {
  return std::sqrt(square);
}
float floorOf(float number) {
  return std::floor(number);
}
float select(bool condition, float a, float b) {
  return condition ? a : b;
}
float powerOfTwo(float exponent) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(static_cast<int>(exponent) + 127) << 23);
}

#include "rig/evaluate_inl.h"

struct PoseMemory {
  std::span<const JointMatrix> written;
  std::span<JointMatrix> driven;
  std::span<float> weights;

  Transform<float> joint(std::size_t number) const {
    return transformFrom<float>(
        (number < written.size() ? written[number] : driven[number - written.size()]).m);
  }
  void setDriven(std::size_t number, const Transform<float>& t) {
    const Linear<float>& m = t.linear;
    driven[number] = {{{m.r0.x, m.r0.y, m.r0.z, t.shift.x},
                       {m.r1.x, m.r1.y, m.r1.z, t.shift.y},
                       {m.r2.x, m.r2.y, m.r2.z, t.shift.z}}};
  }
  float weight(std::size_t number) const { return weights[number]; }
  void setWeight(std::size_t number, float value) { weights[number] = value; }
};

}  // namespace
}  // namespace rigs

namespace {

Result<void> checkSize(std::size_t size, std::size_t expected, const char* what) {
  if (size == expected) return {};
  return Error{ErrorCode::invalidArgument, "evaluateRig: there are " + std::to_string(size) + " " +
                                               what + ", but the rig has " +
                                               std::to_string(expected)};
}

}  // namespace

void evaluateRigIn(float* scratch, const PackedRig& rig, std::span<const JointMatrix> written,
                   std::span<const float> givenWeights, std::span<JointMatrix> driven,
                   std::span<float> weights) {
  const RigBlob blob(rig);
  if (weights.data() != givenWeights.data()) std::ranges::copy(givenWeights, weights.begin());
  std::array<float, maxRigExamples> basis{};
  const std::span rotations(reinterpret_cast<rigs::Quat<float>*>(scratch), blob.header.mostInputs);
  rigs::PoseMemory memory{written, driven, weights};
  rigs::evaluateDrivers<float>(blob, rotations, std::span<float>(basis), memory);
}

Result<void> evaluateRig(const PackedRig& rig, std::span<const JointMatrix> written,
                         std::span<const float> givenWeights, std::span<JointMatrix> driven,
                         std::span<float> weights) {
  const RigHeader header = RigBlob(rig).header;
  Result<void> good = checkSize(written.size(), header.writtenJoints, "written joints");
  if (good) good = checkSize(givenWeights.size(), header.givenWeights, "given weights");
  if (good) good = checkSize(driven.size(), header.drivenJoints, "driven joints");
  if (good)
    good = checkSize(weights.size(), std::size_t{header.givenWeights} + header.drivenWeights,
                     "weights in all");
  if (!good) return good;
  // Most correctives read one joint, which needs no memory.
  std::array<float, 4> one{};
  std::vector<float> many(header.mostInputs > 1 ? header.mostInputs * std::size_t{4} : 0);
  evaluateRigIn(many.empty() ? one.data() : many.data(), rig, written, givenWeights, driven,
                weights);
  return {};
}

}  // namespace dermis
