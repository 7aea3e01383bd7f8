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

/// Factors of a cubic Hermite spline: of its points, and of its tangents there.
struct HermiteFactors {
  double first, second, firstTangent, secondTangent;
};
HermiteFactors hermiteAt(double share);
/// Their derivatives.
HermiteFactors hermiteSlopeAt(double share);

/// Cubic Hermite splines between the joints of a chain. The parameter is the length along the
/// straight lines between them.
class RestCurve {
 public:
  /// Fails with `invalidArgument` and a message that begins with `subject` if the joints are too
  /// few, do not exist, or do not make a curve, or there are fewer than two segments.
  static Result<RestCurve> create(std::span<const RigJoint> joints, const ChainDriver& chain,
                                  const std::string& subject);

  double length() const { return ends_.back(); }
  double lengthOf(std::size_t piece) const { return ends_[piece] - beginOf(piece); }
  CurvePlace at(double parameter) const;
  double parameterOf(const CurvePlace& place) const {
    return beginOf(place.piece) + place.share * lengthOf(place.piece);
  }
  math::Vec3 origin(std::size_t joint) const { return origins_[joint]; }
  math::Vec3 direction(std::size_t joint) const { return directions_[joint]; }  ///< of the curve
  math::Vec3 point(const CurvePlace& place) const {
    return combined(place, hermiteAt(place.share));
  }
  /// The derivative by `CurvePlace::share`.
  math::Vec3 slope(const CurvePlace& place) const {
    return combined(place, hermiteSlopeAt(place.share));
  }
  /// The parameter of the point of the curve that is nearest.
  double nearest(const math::Vec3& position) const;

 private:
  double beginOf(std::size_t piece) const { return piece == 0 ? 0 : ends_[piece - 1]; }
  math::Vec3 combined(const CurvePlace& place, const HermiteFactors& factors) const;
  double squareTo(const math::Vec3& position, const CurvePlace& place) const;

  std::vector<math::Vec3> origins_, directions_;
  std::vector<double> ends_;  ///< parameters of the pieces' ends
};

}  // namespace dermis
