#include <algorithm>
#include <cmath>
#include <string>

#include "dermis/verify.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

using reference::Double3;
using reference::Double4;
using reference::SkinnedMesh;
using reference::VertexBounds;

/// As inaccurate as Vulkan permits: 4 u for `inversesqrt`, 10 u for a division, and their own
/// roundings.
constexpr double unitTolerance = 1.5e-6;
/// The least value that binary16 rounds to infinity: half a step above its largest finite number,
/// 65504.
constexpr double halfOverflow = 65520;

bool isHalf(VertexFormat format) {
  return format == VertexFormat::float16x3 || format == VertexFormat::float16x4;
}

bool isOctahedral(VertexFormat format) {
  return format == VertexFormat::octahedral16x2 || format == VertexFormat::octahedral8x2;
}

bool hasFourComponents(VertexFormat format) {
  return format == VertexFormat::float32x4 || format == VertexFormat::float16x4 ||
         format == VertexFormat::snorm16x4 || format == VertexFormat::snorm8x4;
}

const void* elementOf(const SkinnedAttribute& attribute, std::size_t vertex) {
  return static_cast<const unsigned char*>(attribute.data) + vertex * attribute.stride;
}

/// Whether the fourth component, if there is one, is as documented.
bool isFilledWith(double value, const SkinnedAttribute& attribute, std::size_t vertex) {
  return !hasFourComponents(attribute.format) ||
         decodeTangent(attribute.format, elementOf(attribute, vertex))[3] == value;
}

Double3 direction(const Double4& tangent) {
  return {tangent[0], tangent[1], tangent[2]};
}

double distance(const Double3& a, const Double3& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

double length(const Double3& a) {
  return std::hypot(a[0], a[1], a[2]);
}

bool isFinite(const Double3& a) {
  return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(a[2]);
}

/// error ÷ bound; a bound of 0 allows no error.
double share(double error, double bound) {
  if (error == 0) return 0;
  return bound > 0 ? error / bound : HUGE_VAL;
}

/// Compares the position in the buffer with the expected one.
struct PositionCheck {
  double error = 0;
  double share = 0;
  bool finite = true;
  bool clamped = false;
};

/// Clears infinite components that are correct because float16 overflows. `bound` is that of the
/// float32 position.
bool dropOverflow(Double3& actual, Double3& expected, double bound) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (std::isfinite(actual[axis])) continue;
    const bool overflows = std::abs(expected[axis]) + bound >= halfOverflow;
    const bool sameSign = std::signbit(actual[axis]) == std::signbit(expected[axis]);
    if (!std::isinf(actual[axis]) || !overflows || !sameSign) return false;
    actual[axis] = expected[axis] = 0;
  }
  return true;
}

/// Whether float16 may overflow at a position of which only the size is known. No result is much
/// further away than `scale`: blending divides by |b_q|, which is rarely less than a half.
bool mayOverflow(VertexFormat format, const VertexBounds& bounds) {
  return isHalf(format) && 8 * bounds.scale >= halfOverflow;
}

PositionCheck checkPosition(Double3 expected, const SkinnedView& view, std::size_t vertex,
                            double bound) {
  const VertexFormat format = view.positions.format;
  Double3 actual = decodePosition(format, elementOf(view.positions, vertex), view.box);
  PositionCheck check;
  if (isHalf(format)) check.finite = dropOverflow(actual, expected, bound);
  check.finite &= isFinite(actual);
  if (!check.finite) return check;
  Double3 reach{};  // maximum size of the float32 components
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (isSnormPosition(format)) {
      const double inside = std::clamp(expected[axis], static_cast<double>(view.box.min[axis]),
                                       static_cast<double>(view.box.max[axis]));
      check.clamped |= inside != expected[axis];
      expected[axis] = inside;
    }
    reach[axis] = std::abs(expected[axis]) + bound;
  }
  check.error = distance(actual, expected);
  check.share = share(check.error, bound + positionFormatBound(format, reach, view.box));
  return check;
}

/// Error ÷ bound of a unit or zero direction. `bound` is negative if only the length is known.
double directionShare(Double3 expected, const Double3& actual, VertexFormat format, double bound,
                      double formatBound, bool mayBeZero) {
  if (!isFinite(expected) || !std::isfinite(bound)) return HUGE_VAL;
  const bool isZero = length(expected) == 0;
  if (isOctahedral(format) && isZero) expected = {0, 0, 1};
  if (bound < 0) {
    if (mayBeZero && length(actual) == 0) return 0;
    const double expectedLength = length(expected) == 0 && !mayBeZero ? 0 : 1;
    return std::abs(length(actual) - expectedLength) / (unitTolerance + formatBound);
  }
  return share(distance(actual, expected), bound + formatBound);
}

struct Checker {
  const SkinnedMesh& expected;
  const SkinnedView& actual;
  bool withNormals, withTangents;
  Comparison result;

  void fail(std::size_t vertex) {
    if (result.failures == 0) result.firstFailure = static_cast<std::uint32_t>(vertex);
    ++result.failures;
  }

  static void record(double share, std::size_t vertex, double& worst, std::uint32_t& worstVertex) {
    if (share <= worst) return;
    worst = share;
    worstVertex = static_cast<std::uint32_t>(vertex);
  }

  Double3 normalAt(std::size_t vertex) const {
    if (!withNormals) return {};
    return decodeNormal(actual.normals.format, elementOf(actual.normals, vertex));
  }

  Double4 tangentAt(std::size_t vertex) const {
    if (!withTangents) return {};
    return decodeTangent(actual.tangents.format, elementOf(actual.tangents, vertex));
  }

  bool checkNormal(std::size_t vertex) {
    const VertexBounds& bounds = expected.bounds[vertex];
    const VertexFormat format = actual.normals.format;
    const double bound = bounds.normal;
    const double share = directionShare(expected.normals[vertex], normalAt(vertex), format, bound,
                                        normalFormatBound(format), bounds.normalMayVanish);
    if (bound < 0) ++result.onlyUnitNormals;
    record(share, vertex, result.worstNormal, result.worstNormalVertex);
    return share <= 1 && isFilledWith(0, actual.normals, vertex);
  }

  bool checkTangent(std::size_t vertex) {
    const VertexBounds& bounds = expected.bounds[vertex];
    const VertexFormat format = actual.tangents.format;
    const Double4 tangent = tangentAt(vertex);
    const double bound = bounds.tangent;
    double share = directionShare(direction(expected.tangents[vertex]), direction(tangent), format,
                                  bound, tangentFormatBound(format), bounds.tangentMayVanish);
    if (bound < 0) ++result.onlyUnitTangents;
    const double handedness = expected.tangents[vertex][3];
    const bool opposite = bounds.eitherHandedness && tangent[3] == -handedness;
    if (tangent[3] != handedness && !opposite) {
      const double tolerance = bound < 0 ? unitTolerance : bound;
      share = std::max(share, 2 / (tolerance + tangentFormatBound(format)));
    }
    record(share, vertex, result.worstTangent, result.worstTangentVertex);
    return share <= 1;
  }

  void checkVertex(std::size_t vertex) {
    const VertexBounds& bounds = expected.bounds[vertex];
    if (bounds.undefined) {
      ++result.exempt.skipped;
      return;
    }
    const bool arbitrary = bounds.onlyFinite;
    const double bound = bounds.position;
    if (!isFinite(expected.positions[vertex]) || !(arbitrary || std::isfinite(bound))) {
      fail(vertex);  // the reference is at fault
      return;
    }
    if (bounds.outOfRange) {
      ++result.exempt.outOfRange;
      return;
    }
    const PositionCheck position = checkPosition(expected.positions[vertex], actual, vertex, bound);
    result.clamped += position.clamped ? 1 : 0;
    const Double4 tangent = tangentAt(vertex);
    const bool overflow = arbitrary && mayOverflow(actual.positions.format, bounds);
    if (!(position.finite || overflow) || !isFinite(normalAt(vertex)) ||
        !isFinite(direction(tangent)) || !std::isfinite(tangent[3])) {
      fail(vertex);
      return;
    }
    if (arbitrary) {
      ++result.exempt.onlyFinite;
      return;
    }
    ++result.compared;
    result.largestPositionError = std::max(result.largestPositionError, position.error);
    record(position.share, vertex, result.worstPosition, result.worstPositionVertex);
    bool good = position.share <= 1 && isFilledWith(1, actual.positions, vertex);
    if (withNormals) good &= checkNormal(vertex);
    if (withTangents) good &= checkTangent(vertex);
    if (!good) fail(vertex);
  }
};

/// Describes what is wrong with an attribute to compare; empty if nothing is.
std::string complaint(const char* name, const SkinnedAttribute& attribute,
                      bool (*allows)(VertexFormat), std::size_t count) {
  if (attribute.data == nullptr) return std::string("the skinned ") + name + " have no data";
  if (!allows(attribute.format)) {
    return std::string("the skinned ") + name + " cannot be stored as " +
           std::string(formatName(attribute.format));
  }
  if (attribute.count != count) {
    return "there are " + std::to_string(attribute.count) + " skinned " + name + " for " +
           std::to_string(count) + " vertices of the reference";
  }
  if (attribute.stride < formatSize(attribute.format)) {
    return std::string("the stride of the skinned ") + name + " is " +
           std::to_string(attribute.stride) + " bytes, but an element has " +
           std::to_string(formatSize(attribute.format));
  }
  return {};
}

bool isUpright(const Box& box) {
  for (int axis = 0; axis < 3; ++axis) {
    if (!std::isfinite(box.min[axis]) || !std::isfinite(box.max[axis])) return false;
    if (box.min[axis] > box.max[axis]) return false;
  }
  return true;
}

}  // namespace

Exemptions exemptionsOf(const SkinnedMesh& expected) {
  Exemptions exemptions;
  for (const VertexBounds& bounds : expected.bounds) {
    if (bounds.undefined) {
      ++exemptions.skipped;
    } else if (bounds.outOfRange) {
      ++exemptions.outOfRange;
    } else if (bounds.onlyFinite) {
      ++exemptions.onlyFinite;
    }
  }
  return exemptions;
}

Result<Comparison> compareWithReference(const SkinnedMesh& expected, const SkinnedView& actual,
                                        const Exemptions& exemptions) {
  const std::size_t count = expected.positions.size();
  const bool withNormals = actual.normals.data != nullptr && !expected.normals.empty();
  const bool withTangents = actual.tangents.data != nullptr && !expected.tangents.empty();
  std::string wrong = complaint("positions", actual.positions, isPositionFormat, count);
  if (wrong.empty() && withNormals) {
    wrong = complaint("normals", actual.normals, isNormalFormat, count);
  }
  if (wrong.empty() && withTangents) {
    wrong = complaint("tangents", actual.tangents, isTangentFormat, count);
  }
  if (wrong.empty() && isSnormPosition(actual.positions.format) && !isUpright(actual.box)) {
    wrong = "the box of the skinned positions is not finite, or its minimum is above its maximum";
  }
  if (wrong.empty() && expected.bounds.size() != count) {
    wrong = "the reference has " + std::to_string(expected.bounds.size()) + " bounds for " +
            std::to_string(count) + " vertices";
  }
  if (!wrong.empty()) return Error{ErrorCode::invalidArgument, wrong};

  Checker checker{expected, actual, withNormals, withTangents, {}};
  checker.result.expectedExempt = exemptions;
  for (std::size_t vertex = 0; vertex < count; ++vertex) checker.checkVertex(vertex);
  return checker.result;
}

}  // namespace dermis
