// The curve of a chain in bind pose.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "dermis/result.h"
#include "dermis/rig.h"
#include "linear_algebra.h"

namespace dermis {

/// Where a parameter is on a curve: a piece, and the share of it.
struct CurvePlace {
  std::size_t piece = 0;
  double share = 0;
};

/// Cubic Hermite splines between the joints of a chain. The parameter is the length along the
/// straight lines between them.
class RestCurve {
 public:
  /// Fails with `invalidArgument` and a message that begins with `subject` if the joints are too
  /// few, do not exist, or do not make a curve, or there are fewer than two segments.
  static Result<RestCurve> create(std::span<const RigJoint> joints, const ChainDriver& chain,
                                  const std::string& subject);

  double length() const { return ends_.back(); }
  std::size_t pieceCount() const { return ends_.size(); }
  CurvePlace at(double parameter) const;
  double parameterOf(const CurvePlace& place) const {
    return beginOf(place.piece) + place.share * lengthOf(place.piece);
  }
  math::Vec3 origin(std::size_t joint) const { return origins_[joint]; }
  /// Of the curve of a piece at its joint: that of a unit of `CurvePlace::share`.
  math::Vec3 tangent(std::size_t joint, std::size_t piece) const {
    return lengthOf(piece) * directions_[joint];
  }
  math::Vec3 point(const CurvePlace& place) const;
  /// The parameter of the point of the curve that is nearest.
  double nearest(const math::Vec3& position) const;

 private:
  double beginOf(std::size_t piece) const { return piece == 0 ? 0 : ends_[piece - 1]; }
  double lengthOf(std::size_t piece) const { return ends_[piece] - beginOf(piece); }
  double squareTo(const math::Vec3& position, const CurvePlace& place) const;

  std::vector<math::Vec3> origins_, directions_;
  std::vector<double> ends_;  ///< parameters of the pieces' ends
};

/// Of a cubic Hermite spline: the factors of its first point, the first tangent, and the second
/// tangent. That of the second point is 1 - the first one.
struct HermiteFactors {
  double first, firstTangent, secondTangent;
};
HermiteFactors hermiteAt(double share);
/// Their derivatives. That of the second point is -the first one.
HermiteFactors hermiteSlopeAt(double share);

}  // namespace dermis
