// The poses of the instances that are skinned together, in the form that the vertices of a section
// read.
#pragma once

#include <cstring>
#include <span>
#include <vector>

#include "cpu/pose_inl.h"
#include "cpu/task.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Maximum number of instances skinned at a time: one for each 128 bits of a vector.
inline constexpr std::size_t mostInstances = HWY_MAX_BYTES >= 64 ? 4 : HWY_MAX_BYTES >= 32 ? 2 : 1;

/// A vector has a block of 128 bits for each of several instances, or holds eight vertices of a
/// *lone* one.
template <class D>
inline constexpr std::size_t blocksOf = hn::MaxLanes(D()) / 4;

inline float* floatsOf(std::vector<CacheLine>& memory, std::size_t count) {
  const std::size_t lines = (count + std::size(CacheLine().v) - 1) / std::size(CacheLine().v);
  if (memory.size() < lines) {
    memory.reserve(lines);  // exact size, no geometric growth
    memory.resize(lines);
  }
  return numbersOf(memory.data());
}

inline bool needsRows(Method method) {
  return method == Method::linear || method == Method::blended || needsCentersOfRotation(method);
}

inline std::span<const std::uint32_t> jointsOf(const MeshData& mesh, const Section& section) {
  return std::span(mesh.joints).subspan(section.firstJoint, section.jointCount());
}
inline std::span<const Pair> pairsOf(const MeshData& mesh, const Section& section) {
  return std::span(mesh.pairs).subspan(section.firstPair, section.pairCount());
}

inline const JointMatrix stillMatrix;

/// Instances that are skinned together, and their converted poses.
struct Group {
  std::size_t count = 0;
  const TaskInstance* instances[mostInstances] = {};
  bool scales = false;
  /// For each joint, the real parts of all instances; the dual parts follow. The same for its
  /// scale/shear parts.
  DualQuaternionArray<float> joints{nullptr, mostInstances * 4};
  DualQuaternionArray<float> parts = joints;

  void assign(Scratch& scratch, std::size_t jointCount) {
    // Joints are converted in whole vectors, so the last one may write beyond the last joint.
    joints.dual = parts.dual = (jointCount + blockVertices) * joints.stride;
    joints.first = floatsOf(scratch.dualQuaternions, joints.dual * 2);
    parts.first = floatsOf(scratch.scaleShears, joints.dual * 2);
  }
  DualQuaternionArray<float> jointsOf(std::size_t instance) const {
    return {joints.first + instance * 4, joints.stride, joints.dual};
  }
  DualQuaternionArray<float> partsOf(std::size_t instance) const {
    return {parts.first + instance * 4, parts.stride, parts.dual};
  }
};

template <class T>
inline DualQuaternionArray<const T> readOnly(const DualQuaternionArray<T>& array) {
  return {array.first, array.stride, array.dual};
}

/// Entries of four floats. Those of all instances are side by side: entry `number` begins at
/// `number` / 8 × `stride`. Entries of a lone instance of eight lanes have the next quads of the
/// same joint or pair beside them.
struct Palette {
  const float* pairs[2] = {};      ///< dual quaternions: real and dual part
  const float* partPairs[2] = {};  ///< scale/shear parts of pairs: the joint's minus the pivot's
  const float* parts[2] = {};      ///< scale/shear parts of joints
  const float* rows[3] = {};       ///< of the matrices of joints
  bool scales = false;
  bool isModerate = false;  ///< result of `areModerate`, for directions
};

/// Writes the rows of R S | t of a decomposed joint, `apart` floats apart.
inline void writeRows(const float* q, const float* low, const float* high,
                      const JointMatrix& matrix, float* to, std::size_t apart) {
  const float x = q[0], y = q[1], z = q[2], w = q[3];
  const float r[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                         {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                         {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
  for (std::size_t row = 0; row < 3; ++row) {
    float* const out = to + row * apart;
    if (low == nullptr) {
      std::memcpy(out, r[row], sizeof(r[row]));
    } else {
      const float a = r[row][0], b = r[row][1], c = r[row][2];
      out[0] = low[0] * a + low[3] * b + high[0] * c;
      out[1] = low[3] * a + low[1] * b + high[1] * c;
      out[2] = high[0] * a + high[1] * b + low[2] * c;
    }
    out[3] = matrix.m[row][3];
  }
}

/// The palette of `blocksOf<D>` instances of a group from `first` on, or of the one at `first`.
template <bool isLone, class D>
inline HWY_ATTR Palette makePalette(D, const MeshData& mesh, const Section& section, Method method,
                                    const Group& group, std::size_t first, Scratch& scratch) {
  constexpr std::size_t instances = isLone ? 1 : blocksOf<D>;
  using Lanes = std::conditional_t<isLone, Four, D>;
  const Lanes d;
  const std::span<const std::uint32_t> joints = jointsOf(mesh, section);
  const std::span<const Pair> pairs = pairsOf(mesh, section);
  // Floats from an entry to the next, and from the first quad of an entry to the second.
  const std::size_t stride = isLone ? 8 : instances * 4;
  const auto second = [&](std::size_t count) { return isLone ? 4 : count * stride; };
  Palette palette;
  palette.scales = group.scales;
  if (method != Method::linear) {
    float* const to = floatsOf(scratch.pairs, pairs.size() * 8 * instances);
    const std::size_t dual = second(pairs.size());
    convertPairs(d, pairs, readOnly(group.jointsOf(first)), {to, stride, dual});
    palette.pairs[0] = to;
    palette.pairs[1] = to + dual;
  }
  if (palette.scales) {
    float* const differences =
        floatsOf(scratch.scalePairs, (pairs.size() + joints.size()) * 8 * instances);
    const std::size_t dual = second(pairs.size());
    subtractPivots(d, pairs, readOnly(group.partsOf(first)), {differences, stride, dual});
    palette.partPairs[0] = differences;
    palette.partPairs[1] = differences + dual;
    float* const parts = differences + pairs.size() * 8 * instances;
    for (std::size_t joint = 0; joint < joints.size(); ++joint) {
      const float* const from = group.partsOf(first).first + joint * group.parts.stride;
      hn::Store(hn::LoadU(d, from), d, parts + joint * stride);
      hn::Store(hn::LoadU(d, from + group.parts.dual), d,
                parts + second(joints.size()) + joint * stride);
    }
    palette.parts[0] = parts;
    palette.parts[1] = parts + second(joints.size());
  }
  if (!needsRows(method)) return palette;
  float* const rows = floatsOf(scratch.rows, joints.size() * 16 * instances);
  const std::size_t apart = isLone ? 4 : joints.size() * stride;
  for (std::size_t i = 0; i < instances; ++i) {
    const TaskInstance& instance = *group.instances[first + i];
    const DualQuaternionArray<float> own = group.jointsOf(first + i),
                                     parts = group.partsOf(first + i);
    for (std::size_t joint = 0; joint < joints.size(); ++joint) {
      const JointMatrix& matrix =
          joints[joint] == stillJoint ? stillMatrix : instance.pose[joints[joint]];
      float* const to = rows + (isLone ? joint * 16 : joint * stride + i * 4);
      if (method == Method::linear) {
        for (std::size_t row = 0; row < 3; ++row)
          std::memcpy(to + row * apart, matrix.m[row], sizeof(matrix.m[row]));
      } else {
        const float* const low = parts.first + joint * parts.stride;
        writeRows(own.first + joint * own.stride, palette.scales ? low : nullptr, low + parts.dual,
                  matrix, to, apart);
      }
    }
  }
  for (std::size_t row = 0; row < 3; ++row) palette.rows[row] = rows + row * apart;
  return palette;
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
