// The box of a skinned mesh from its pose alone (docs/bounds.md).

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory_resource>
#include <numbers>
#include <span>
#include <vector>

#include "bounds/extent.h"
#include "bounds/joint_regions.h"
#include "dermis/mesh.h"
#include "strict_floating_point.h"

namespace dermis::bounds {
namespace {

/// The polar decomposition of a joint's 3×3 matrix: C = R S.
struct Parts {
  math::Mat3 scaleShear;        ///< exactly 1 where the joint is rigid but for rounding
  math::Vec4 real{0, 0, 0, 1};  ///< the unit quaternion of R: x y z w
  double largest = 1;           ///< no singular value of C is larger
  bool rigid = true;
  /// Rounding decides R, and a kernel's R may differ: the rank is 1, or C is so near to a singular
  /// mirror that rounding decides the sign of its determinant. C = 0 is not ambiguous: its R is 1
  /// by definition.
  bool ambiguous = false;
};

/// The largest sum of a row's absolute values of MᵀM − 1: no singular value is further from 1.
double deviationFromRotation(const math::Mat3& m) {
  const double xx = std::abs(math::dot(m[0], m[0]) - 1), yy = std::abs(math::dot(m[1], m[1]) - 1),
               zz = std::abs(math::dot(m[2], m[2]) - 1);
  const double xy = std::abs(math::dot(m[0], m[1])), xz = std::abs(math::dot(m[0], m[2])),
               yz = std::abs(math::dot(m[1], m[2]));
  return std::max({xx + xy + xz, xy + yy + yz, xz + yz + zz});
}

/// R ← ½ R (3 − RᵀR), which squares the deviation. Björck and Bowie 1971, "An iterative algorithm
/// for computing the best estimate of an orthogonal matrix". The deviation must be below ½.
math::Mat3 orthonormalized(math::Mat3 m, double deviation) {
  for (int step = 0; step < 6 && deviation > 1e-12; ++step) {
    m = 1.5 * m - 0.5 * (m * (math::transpose(m) * m));
    deviation *= deviation;
  }
  return m;
}

/// The rotation R that makes trace(Rᵀ C) largest: the polar rotation where det C ≥ 0 and the rank
/// is at least 2. Horn 1987, "Closed-form solution of absolute orientation using unit quaternions":
/// the eigenvector of the largest eigenvalue of a symmetric 4×4 matrix, here by cyclic Jacobi.
math::Vec4 nearestRotation(const math::Mat3& c) {
  const auto at = [&](int row, int column) { return c[column][row]; };
  double a[4][4] = {{at(0, 0) - at(1, 1) - at(2, 2), at(0, 1) + at(1, 0), at(0, 2) + at(2, 0),
                     at(2, 1) - at(1, 2)},
                    {at(0, 1) + at(1, 0), at(1, 1) - at(0, 0) - at(2, 2), at(1, 2) + at(2, 1),
                     at(0, 2) - at(2, 0)},
                    {at(0, 2) + at(2, 0), at(1, 2) + at(2, 1), at(2, 2) - at(0, 0) - at(1, 1),
                     at(1, 0) - at(0, 1)},
                    {at(2, 1) - at(1, 2), at(0, 2) - at(2, 0), at(1, 0) - at(0, 1),
                     at(0, 0) + at(1, 1) + at(2, 2)}};
  double v[4][4] = {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}, {0, 0, 0, 1}};
  for (int sweep = 0; sweep < 12; ++sweep) {
    bool turned = false;
    for (int p = 0; p < 3; ++p) {
      for (int q = p + 1; q < 4; ++q) {
        if (std::abs(a[p][q]) <= 1e-17 * (std::abs(a[p][p]) + std::abs(a[q][q]))) continue;
        turned = true;
        const double theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
        const double tangent =
            std::copysign(1.0, theta) / (std::abs(theta) + std::sqrt(1 + theta * theta));
        const double cosine = 1 / std::sqrt(1 + tangent * tangent), sine = tangent * cosine;
        for (int k = 0; k < 4; ++k) {
          const double x = a[k][p], y = a[k][q];
          a[k][p] = cosine * x - sine * y;
          a[k][q] = sine * x + cosine * y;
        }
        for (int k = 0; k < 4; ++k) {
          const double x = a[p][k], y = a[q][k];
          a[p][k] = cosine * x - sine * y;
          a[q][k] = sine * x + cosine * y;
          const double s = v[k][p], t = v[k][q];
          v[k][p] = cosine * s - sine * t;
          v[k][q] = sine * s + cosine * t;
        }
      }
    }
    if (!turned) break;
  }
  int best = 0;
  for (int i = 1; i < 4; ++i) {
    if (a[i][i] > a[best][best]) best = i;
  }
  return math::normalize({v[0][best], v[1][best], v[2][best], v[3][best]});
}

enum class Sense { upright, mirrored, ambiguous };

/// Which way round a matrix is; `size` is what it was divided by. The reference and the kernels
/// draw the line between flat and mirrored at 16 and 24 roundings of float32 and call a matrix of
/// rank 1 where σ₂ ≤ 1e-5 σ₁; within twice that, one may decide this way and another that way.
/// Kernels take a mirror for flat if flushed denormals could make it one.
Sense senseOf(const math::Mat3& m, double size) {
  double cofactors = 0, squares = 0, uncancelled = 0;
  for (int i = 0; i < 3; ++i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const math::Vec3 cofactor = math::cross(m[j], m[k]);
    cofactors += math::dot(cofactor, cofactor);
    squares += math::dot(m[i], m[i]);
    uncancelled += std::abs(m[0][i]) * (std::abs(m[1][j] * m[2][k]) + std::abs(m[1][k] * m[2][j]));
  }
  // Cofactors, squared, sum to σ₁²σ₂² + σ₁²σ₃² + σ₂²σ₃².
  if (cofactors <= 1e-9 * squares * squares) return Sense::ambiguous;
  const double determinant = math::determinant(m), rounding = 0x1p-24 * uncancelled;
  if (determinant >= -8 * rounding) return Sense::upright;
  const double flushing = 0x1p-98 * std::max(1.0, 1 / size);
  return determinant <= -64 * rounding - flushing ? Sense::mirrored : Sense::ambiguous;
}

/// By the rules of the reference: the polar decomposition, R being that of −C where C mirrors. The
/// matrix must be finite.
Parts partsOf(const math::Mat3& matrix) {
  Parts parts;
  const double determinant = math::determinant(matrix);
  const double deviation = deviationFromRotation(matrix);
  if (determinant > 0 && deviation <= 1e-5) {
    parts.real = math::quaternionOf(orthonormalized(matrix, deviation));
    parts.largest = 1 + 1e-5;
    return parts;
  }

  parts.rigid = false;
  const double squares = math::dot(matrix[0], matrix[0]) + math::dot(matrix[1], matrix[1]) +
                         math::dot(matrix[2], matrix[2]);
  parts.largest = std::sqrt(squares);  // ‖C‖, at most √3 too much
  parts.scaleShear = matrix;
  if (squares == 0) return parts;

  const double size = std::sqrt(squares / 3);
  const math::Mat3 unit = matrix / size;
  const Sense sense = senseOf(unit, size);
  // Entries below 2^-126 may be flushed to 0; `reference::PolarParts` has the same line.
  parts.ambiguous = sense == Sense::ambiguous || size < 0x1p-98;
  if (parts.ambiguous) return parts;
  const math::Mat3 upright = sense == Sense::mirrored ? -unit : unit;
  const double unitDeviation = deviationFromRotation(upright);
  parts.real = unitDeviation < 0.25 ? math::quaternionOf(orthonormalized(upright, unitDeviation))
                                    : nearestRotation(upright);
  parts.scaleShear = math::transpose(math::rotationOf(parts.real)) * matrix;
  return parts;
}

/// Those of R, for poses whose scale the kernels ignore. R is as ambiguous as C makes it.
Parts partsOfRotation(const Parts& parts) {
  Parts rotation;
  rotation.real = parts.real;
  rotation.largest = 1 + 1e-5;
  rotation.ambiguous = parts.ambiguous;
  return rotation;
}

}  // namespace
}  // namespace dermis::bounds

namespace dermis {
namespace {

using bounds::AffineMap;
using bounds::Chord;
using bounds::JointRegion;
using bounds::JointRegions;
using bounds::Parts;
using bounds::Range;

/// What is not known of a joint of a region.
struct Uncertainty {
  const JointRegion* region = nullptr;
  std::uint32_t joint = 0;  ///< index into the pose
  /// |v − map p| is at most what the region says, with this instead of its `slack`.
  double slack = 0;
  double angle = 0, stretch = 0;  ///< how far R and S may be from those of `parts`
};

/// A joint in the pose: v = C p, and for dual quaternions C = R S.
struct Posed {
  AffineMap map;
  Parts parts;
  const Uncertainty* uncertainty = nullptr;  ///< null: the matrix is exactly known
  /// The two smallest |q · q'| with joints that share vertices of more than `maxTrioInfluences`
  /// influences.
  double leastCosines[2] = {1, 1};
  double partnerDistance = 0;  ///< largest |t − t'| of a joint that shares vertices, and the most
  std::uint32_t influences = 0;  ///< influences of such a vertex; only where a joint is ambiguous
  /// Vertices of which this joint is the pivot may have influences in opposite hemispheres.
  bool split = false;
};
static_assert(sizeof(Posed) <= 256, "`skinnedBounds` needs 32 KiB of stack");

/// How far v may be from map p, for the points of an extent.
double errorOf(const Posed& joint, const Extent& extent) {
  if (joint.uncertainty == nullptr) return 0;
  const JointRegion& region = *joint.uncertainty->region;
  return region.shift + region.turn * bounds::reachOf(bounds::imageOf(region.bind, extent)) +
         joint.uncertainty->slack * bounds::reachOf(bounds::rangeOf(extent));
}

/// How far t may be from that of the map.
double offsetError(const Posed& joint) {
  if (joint.uncertainty == nullptr) return 0;
  const JointRegion& region = *joint.uncertainty->region;
  return region.shift + region.turn * math::length(region.bind.offset);
}

AffineMap affineOf(const JointMatrix& matrix) {
  AffineMap map;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column) {
      map.linear[column][row] = static_cast<double>(matrix.m[row][column]);
    }
    map.offset[row] = static_cast<double>(matrix.m[row][3]);
  }
  return map;
}

bool isFinite(const JointMatrix& matrix) {
  return std::ranges::all_of(matrix.m, [](const auto& row) {
    return std::ranges::all_of(row, [](float value) { return std::isfinite(value); });
  });
}

/// The rotation between two joints: the cosine of half its angle, not negative, and the axis,
/// towards the first, times the sine.
struct Turn {
  double cosine;
  math::Vec3 axis;
};

Turn turnBetween(const Posed& first, const Posed& second) {
  const math::Vec4 &a = first.parts.real, &b = second.parts.real;
  const double cosine = math::dot(a, b);
  const math::Vec3 u = a.xyz(), v = b.xyz();
  const math::Vec3 axis = b.w * u - a.w * v - math::cross(u, v);  // of a b*
  return cosine < 0 ? Turn{-cosine, -axis} : Turn{cosine, axis};
}

/// Below this cosine rounding decides the sign.
constexpr double ambiguousCosine = 2e-5;

/// Whether sums and products of a region's numbers stay finite.
bool isBounded(const JointRegion& region) {
  double sum = region.shift + region.turn + region.slack + region.spread + region.most;
  for (const AffineMap* map : {&region.map, &region.bind}) {
    for (int axis = 0; axis < 3; ++axis) sum += math::length(map->linear[axis]);
    sum += math::length(map->offset);
  }
  return sum < 1e75;
}

/// What `skinnedBounds` was asked for.
struct Blend {
  Method method;
  /// Joints as the palette kernel decomposes them, which is rounded as dual quaternions are. False
  /// for `Method::linear`.
  bool decomposed;
  bool mayScale;  ///< if false, decomposed joints are R instead of C
};

class PoseBounds {
 public:
  /// `regions`: null if a pose is exactly known.
  PoseBounds(const JointBoundsData& bounds, const Blend& blend, const JointRegions* regions,
             std::pmr::memory_resource* memory)
      : bounds_(bounds),
        regions_(regions),
        method_(blend.method),
        exactJoints_(!blend.decomposed),
        ignoresScale_(blend.decomposed && !blend.mayScale),
        joints_(memory) {}

  Box of(std::span<const JointMatrix> palette) {
    if (!pose(palette)) return bounds::boxOf(bounds::everything());
    if (method_ == Method::dualQuaternion) findSplitJoints();
    addAmbiguousJoints();
    addJoints();
    for (const JointBoundsData::Pair& pair : bounds_.pairs) {
      if (method_ == Method::linear) {
        addLinearPair(pair);
      } else {
        addDualQuaternionPair(pair);
      }
    }
    if (!box_.empty()) box_ = box_.grownBy(rounding());
    addUnweighted();
    const bool ordered = box_.empty() || (box_.min.x <= box_.max.x && box_.min.y <= box_.max.y &&
                                          box_.min.z <= box_.max.z);
    return bounds::boxOf(ordered ? box_ : bounds::everything());
  }

 private:
  /// False if a joint that moves vertices is not finite, or is not in the pose, and if the mesh is
  /// so large that float32 cannot hold the sums of an extent: from here on no number is NaN.
  bool pose(std::span<const JointMatrix> palette) {
    joints_.reserve(bounds_.joints.size());
    if (regions_ != nullptr) uncertainties_.reserve(bounds_.joints.size());
    for (const JointBoundsData::Joint& used : bounds_.joints) {
      Posed& joint = joints_.emplace_back();
      if (regions_ != nullptr) {
        if (!poseRegion(joint, used.joint)) return false;
        continue;
      }
      if (used.joint >= palette.size() || !isFinite(palette[used.joint])) return false;
      joint.map = affineOf(palette[used.joint]);
      if (method_ == Method::dualQuaternion || ignoresScale_) {
        joint.parts = bounds::partsOf(joint.map.linear);
        if (ignoresScale_) {
          joint.parts = bounds::partsOfRotation(joint.parts);
          joint.map.linear = math::rotationOf(joint.parts.real);
        }
        anyAmbiguous_ |= joint.parts.ambiguous;
        largest_ = std::max(largest_, joint.parts.largest);
      } else {
        const math::Mat3& c = joint.map.linear;
        largest_ = std::max(largest_, std::sqrt(math::dot(c[0], c[0]) + math::dot(c[1], c[1]) +
                                                math::dot(c[2], c[2])));
      }
      furthest_ = std::max(furthest_, math::length(joint.map.offset));
    }
    for (const JointBoundsData::Joint& used : bounds_.joints) {
      if (!used.alone.empty()) bind_.add(bounds::rangeOf(used.alone));
    }
    for (const JointBoundsData::Pair& pair : bounds_.pairs) bind_.add(bounds::rangeOf(pair.extent));
    return bind_.empty() || bounds::reachOf(bind_) <= 1e38;
  }

  /// False if the joint is outside the pose, or its numbers are too large.
  bool poseRegion(Posed& joint, std::uint32_t index) {
    if (index >= regions_->joints.size() || !isBounded(regions_->joints[index])) return false;
    const JointRegion& region = regions_->joints[index];
    Uncertainty& uncertainty = uncertainties_.emplace_back();
    uncertainty.region = &region;
    uncertainty.joint = index;
    uncertainty.slack = region.slack;
    joint.uncertainty = &uncertainty;
    joint.map = region.map;
    largest_ = std::max({largest_, region.most, 1 + 1e-5});
    furthest_ = std::max(furthest_, math::length(joint.map.offset) + offsetError(joint));
    if (method_ == Method::dualQuaternion || ignoresScale_) decompose(joint, uncertainty);
    anyAmbiguous_ |= joint.parts.ambiguous;
    return true;
  }

  /// R and S of all matrices of a region. If it does not say what R is, it is near that of the
  /// center: ‖R − R'‖ ≤ 2 ‖C − C'‖ / (σ₃ + σ'₃), with Frobenius norms; Li 1995, "New perturbation
  /// bounds for the unitary polar factor". All matrices are far from those whose R is a matter of
  /// rounding if their smallest singular value is at least 1/40 of the largest.
  void decompose(Posed& joint, Uncertainty& uncertainty) const {
    const JointRegion& region = *uncertainty.region;
    Parts& parts = joint.parts;
    const double tiny = std::max(0.05 * region.most, 0x1p-80);
    const double scale = std::max(region.most - 1, 1 - region.least);  // ‖S − 1‖
    const bool isUpright = region.least >= tiny;
    // σ₁ σ₂ σ₃ ≤ σ₁² σ₃
    const double smallest =
        std::abs(math::determinant(joint.map.linear)) / (region.most * region.most);
    const bool isNear = smallest >= tiny && 2 * region.spread < smallest;
    if (isUpright &&
        (!isNear || (region.angle < std::numbers::pi && (!ignoresScale_ || scale < 1e-3)))) {
      const double middle = 0.5 * (region.least + region.most);
      parts.real = region.rotation;
      parts.scaleShear = middle * math::Mat3{};
      parts.rigid = false;
      uncertainty.angle = std::min(region.angle, std::numbers::pi);
      uncertainty.stretch = region.most - middle;
      if (ignoresScale_) uncertainty.slack += scale;  // R p = C p + R (1 − S) p
    } else if (isNear) {
      parts = bounds::partsOf(joint.map.linear);
      const double turn =
          2 * std::sqrt(3) * region.spread / (2 * smallest - region.spread);  // ‖R − R'‖
      uncertainty.angle = 2 * std::asin(std::min(1.0, turn / std::sqrt(8)));
      uncertainty.stretch = region.spread + turn * region.most;
      if (isUpright)
        uncertainty.stretch = std::min(uncertainty.stretch, region.most - region.least);
      if (ignoresScale_) {
        const math::Mat3 stretch = parts.scaleShear - math::Mat3{};
        uncertainty.slack +=
            uncertainty.stretch +
            turn * std::sqrt(math::dot(stretch[0], stretch[0]) + math::dot(stretch[1], stretch[1]) +
                             math::dot(stretch[2], stretch[2]));
        joint.map.linear = math::rotationOf(parts.real);
      }
    } else {
      parts.ambiguous = true;
    }
    if (!ignoresScale_) return;
    parts = bounds::partsOfRotation(parts);
    uncertainty.stretch = 0;
  }

  /// How far the quaternion between two joints may be from that of the centers.
  double turnError(const Posed& first, const Posed& second) const {
    if (regions_ == nullptr) return 0;
    const Uncertainty &a = *first.uncertainty, &b = *second.uncertainty;
    return 0.5 * std::min(a.angle + b.angle, regions_->angle(a.joint, b.joint));
  }

  /// Finds the joints whose vertices may have influences in opposite hemispheres: by trios or, if a
  /// vertex has too many influences for those, by angles. The angles may name joints that have no
  /// such vertices.
  void findSplitJoints() {
    for (const auto& [a, b, c] : bounds_.trios) {
      splitIfTorn(joints_[a], joints_[b], joints_[c]);
    }
    for (const JointBoundsData::Pair& pair : bounds_.pairs) {
      if (pair.influences <= JointBoundsData::maxTrioInfluences) continue;
      Posed &first = joints_[pair.first], &second = joints_[pair.second];
      const double cosine = std::max(
          0.0, std::abs(math::dot(first.parts.real, second.parts.real)) - turnError(first, second));
      for (Posed* joint : {&first, &second}) {
        auto& [least, next] = joint->leastCosines;
        next = std::min(next, std::max(least, cosine));
        least = std::min(least, cosine);
      }
    }
    for (Posed& joint : joints_) {
      const auto& [least, next] = joint.leastCosines;
      joint.split |= least * least + next * next <= 1 + 1e-4;
    }
  }

  /// Whether no choice of signs brings three quaternions into one hemisphere, all of them.
  void splitIfTorn(Posed& a, Posed& b, Posed& c) const {
    const double ab = math::dot(a.parts.real, b.parts.real);
    const double bc = math::dot(b.parts.real, c.parts.real);
    const double ca = math::dot(c.parts.real, a.parts.real);
    const double least = std::min({std::abs(ab) - turnError(a, b), std::abs(bc) - turnError(b, c),
                                   std::abs(ca) - turnError(c, a)});
    if (ab * bc * ca > 0 && least > ambiguousCosine) return;
    a.split = b.split = c.split = true;
  }

  /// All vertices of a joint whose rotation is a matter of rounding: |v' − t| ≤ k max |v − t| for
  /// any rotation.
  void addAmbiguousJoints() {
    if (!anyAmbiguous_) return;
    for (const JointBoundsData::Pair& pair : bounds_.pairs) {
      Posed &first = joints_[pair.first], &second = joints_[pair.second];
      const double distance = math::length(first.map.offset - second.map.offset) +
                              offsetError(first) + offsetError(second);
      for (Posed* joint : {&first, &second}) {
        joint->partnerDistance = std::max(joint->partnerDistance, distance);
        joint->influences = std::max(joint->influences, pair.influences);
      }
    }
    const double reach = largest_ * bounds::reachOf(bind_);
    for (const Posed& joint : joints_) {
      if (!joint.parts.ambiguous) continue;
      // A vertex of this joint alone is at C p, or at R p if scale is ignored.
      if (joint.influences == 0 && !ignoresScale_) continue;
      const std::uint32_t influences = std::max(joint.influences, 1u);
      box_.add(Range{joint.map.offset, joint.map.offset}.grownBy(
          offsetError(joint) + influences * (reach + joint.partnerDistance)));
      amplification_ = std::max(amplification_, 0.5 * influences);
    }
  }

  void addJoints() {
    for (std::size_t index = 0; index < joints_.size(); ++index) {
      const Extent& alone = bounds_.joints[index].alone;
      const Posed& joint = joints_[index];
      if (!alone.empty())
        box_.add(bounds::imageOf(joint.map, alone).grownBy(errorOf(joint, alone)));
    }
  }

  /// The range of the fraction of the way from the second joint's point to the first's at which
  /// vertices may be.
  struct Share {
    double least, greatest;
  };
  static Share shareOf(const JointBoundsData::Pair& pair, double cosine) {
    const auto share = [&](double a, double b) { return (a + cosine) / (a + b + 2 * cosine); };
    return {share(static_cast<double>(pair.firstOverSecond[0]),
                  static_cast<double>(pair.secondOverFirst[1])),
            share(static_cast<double>(pair.firstOverSecond[1]),
                  static_cast<double>(pair.secondOverFirst[0]))};
  }

  void addLinearPair(const JointBoundsData::Pair& pair) {
    if (joints_[pair.first].parts.ambiguous || joints_[pair.second].parts.ambiguous) return;
    const AffineMap &second = joints_[pair.second].map,
                    difference = joints_[pair.first].map - second;
    const Share share = shareOf(pair, 1);
    const double firstError = errorOf(joints_[pair.first], pair.extent);
    const double secondError = errorOf(joints_[pair.second], pair.extent);
    for (const double part : {share.least, share.greatest}) {
      box_.add(bounds::imageOf(second + part * difference, pair.extent)
                   .grownBy(part * firstError + (1 - part) * secondError));
    }
  }

  void addDualQuaternionPair(const JointBoundsData::Pair& pair) {
    const Posed &first = joints_[pair.first], &second = joints_[pair.second];
    if (first.parts.ambiguous || second.parts.ambiguous) return;
    const Turn turn = turnBetween(first, second);
    const AffineMap difference = first.map - second.map;
    const double stretch = stretchBetween(first, second, pair.extent);

    // In a region the cosine may be this small, or as much larger.
    const double error = turnError(first, second);
    const double cosine = std::max(0.0, turn.cosine - error);
    const double bulging = 1 / (static_cast<double>(pair.minSum) + 2 * cosine);
    const Bulge bulge = bulgeOf(first, second, turn, cosine, pair.extent);
    const AffineMap bulged = bulging * bulge.map;
    amplification_ = std::max(amplification_, 2 * bulging);

    Range range;
    const double firstError = errorOf(first, pair.extent);
    const double secondError = errorOf(second, pair.extent);
    const Share share = shareOf(pair, cosine), other = shareOf(pair, turn.cosine + error);
    for (const double part :
         {std::min(share.least, other.least), std::max(share.greatest, other.greatest)}) {
      const AffineMap chord = second.map + part * difference;
      const double chordError = part * firstError + (1 - part) * secondError;
      range.add(bounds::imageOf(chord, pair.extent).grownBy(chordError));
      range.add(bounds::imageOf(chord + bulged, pair.extent).grownBy(chordError));
      if (turn.cosine - error < ambiguousCosine)
        range.add(bounds::imageOf(chord - bulged, pair.extent).grownBy(chordError));
    }
    // |q − q'| = √(2 − 2 q · q')
    const double stretching = bulging * std::sqrt(std::max(0.0, 2 - 2 * cosine));
    box_.add(range.grownBy(stretching * stretch + bulging * bulge.error));

    if (pair.influences > 2 && (first.split || second.split)) {
      const double radius = ballFactor(pair, cosine) * (bulge.chord + 2 * stretch);
      for (const Posed* pivot : {&first, &second}) {
        if (!pivot->split) continue;
        box_.add(bounds::imageOf(pivot->map, pair.extent)
                     .grownBy(radius + errorOf(*pivot, pair.extent)));
      }
    }
  }

  /// D = (v − v') × vec (q q'*) is within `error` of `map`, and |v − v'| is at most `chord`.
  struct Bulge {
    AffineMap map;
    double error = 0, chord = 0;
  };
  Bulge bulgeOf(const Posed& first, const Posed& second, const Turn& turn, double cosine,
                const Extent& extent) const {
    const AffineMap difference = first.map - second.map;
    const double distance = bounds::reachOf(bounds::imageOf(difference, extent));
    const AffineMap map = bounds::cross(difference, turn.axis);
    if (regions_ == nullptr) return {map, 0, distance};
    const Uncertainty &a = *first.uncertainty, &b = *second.uncertainty;
    Chord chord = regions_->chord(a.joint, b.joint, extent);
    if (ignoresScale_) {
      chord.error += (a.slack + b.slack) * bounds::reachOf(bounds::rangeOf(extent));
      chord.length = distance + chord.error;
    }
    const double sine = std::sqrt(std::max(0.0, 1 - cosine * cosine));
    const double error = chord.error * sine + distance * 0.5 * (a.angle + b.angle);
    if (error < chord.length * sine) return {map, error, chord.length};
    return {0.0 * map, chord.length * sine, chord.length};
  }

  /// The largest |S p − S' p| of a pair's vertices: how differently two joints scale them.
  static double stretchBetween(const Posed& first, const Posed& second, const Extent& extent) {
    const double error =
        first.uncertainty == nullptr ? 0 : first.uncertainty->stretch + second.uncertainty->stretch;
    if (first.parts.rigid && second.parts.rigid && error == 0) return 0;
    const AffineMap difference{first.parts.scaleShear - second.parts.scaleShear, {}};
    const double most = bounds::reachOf(bounds::imageOf(difference, extent));
    return error == 0 ? most : most + error * bounds::reachOf(bounds::rangeOf(extent));
  }

  double ballFactor(const JointBoundsData::Pair& pair, double cosine) {
    const double others = pair.influences - 1;
    const double factor = 1 / (1 / others + std::max(0.0, cosine - ambiguousCosine));
    amplification_ = std::max(amplification_, factor);
    return factor;
  }

  /// They are copied, so they need no allowance for `rounding`.
  void addUnweighted() {
    const Range unweighted = bounds::rangeOf(bounds_.unweighted);
    if (unweighted.empty()) return;
    box_.add(unweighted.grownBy(contract() * bounds::reachOf(unweighted)));
  }

  /// By how much a float32 position may be off, over its scale: `positionBound`.
  double contract() const { return (exactJoints_ ? 6 : 24) * 0x1p-24; }

  /// What float32 may add: the more where quaternions all but cancel, and as the square of that, as
  /// `positionBound` does, where they do so by more than a quarter. 1e-5 is for joints that are not
  /// decomposed although they are not quite rigid: the kernels leave up to 4.3e-6 of stretch out,
  /// `partsOf` up to 5e-6.
  double rounding() const {
    const double reach = bind_.empty() ? 0 : largest_ * bounds::reachOf(bind_);
    const double exactly = contract() * (furthest_ + reach);
    const double amplified = std::max(amplification_, amplification_ * amplification_ / 16);
    return exactJoints_ ? exactly : amplified * (exactly + 1e-5 * reach);
  }

  const JointBoundsData& bounds_;
  const JointRegions* regions_;
  Method method_;
  bool exactJoints_, ignoresScale_;
  std::pmr::vector<Posed> joints_;
  std::vector<Uncertainty> uncertainties_;  ///< of regions
  Range box_, bind_;
  double furthest_ = 0;  ///< the largest |t|
  double largest_ = 1;   ///< no singular value is larger
  double amplification_ = 1;
  bool anyAmbiguous_ = false;
};

Box boundsBy(const JointBoundsData& bounds, std::span<const JointMatrix> palette,
             const JointRegions* regions, const Blend& blend) {
  // Room for the joints of nearly all rigs; what does not fit comes from the heap.
  alignas(Posed) std::array<std::byte, 128 * sizeof(Posed)> room;
  std::pmr::monotonic_buffer_resource memory(room.data(), room.size());
  return PoseBounds(bounds, blend, regions, &memory).of(palette);
}

Box boundsOf(const JointBounds& jointBounds, std::span<const JointMatrix> palette,
             const JointRegions* regions, Method method, JointPromise promise) {
  const bool mayScale = promise == JointPromise::scaling;
  const JointBoundsData& bounds = JointBoundsData::of(jointBounds);
  switch (method) {
    case Method::linear:
      return boundsBy(bounds, palette, regions, {Method::linear, false, mayScale});
    case Method::dualQuaternion:
      return boundsBy(bounds, palette, regions, {Method::dualQuaternion, true, mayScale});
    case Method::blended: {
      // Each position lies between one of linear blending and one of dual quaternions.
      bounds::Range range =
          bounds::rangeOf(boundsBy(bounds, palette, regions, {Method::linear, true, mayScale}));
      range.add(bounds::rangeOf(
          boundsBy(bounds, palette, regions, {Method::dualQuaternion, true, mayScale})));
      return bounds::boxOf(range);
    }
    default:
      return bounds::boxOf(bounds::everything());
  }
}

}  // namespace

Box skinnedBounds(const JointBounds& jointBounds, std::span<const JointMatrix> palette,
                  Method method, JointPromise promise) {
  return boundsOf(jointBounds, palette, nullptr, method, promise);
}

Box bounds::skinnedBounds(const JointBounds& jointBounds, const JointRegions& regions,
                          Method method, JointPromise promise) {
  return boundsOf(jointBounds, {}, &regions, method, promise);
}

}  // namespace dermis
