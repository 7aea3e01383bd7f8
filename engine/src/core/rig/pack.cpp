// Packs rigs: checks the drivers, orders them, and computes what they read.
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "affine.h"
#include "linear_algebra.h"
#include "pack/check.h"
#include "rig/blob.h"
#include "rig/chain.h"
#include "rig/solve.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

using math::Vec3;
using math::Vec4;
using Matrix = Affine<double>;

Error badRig(const std::string& what) {
  return {ErrorCode::invalidArgument, "packRig: " + what};
}

template <std::size_t size>
bool areFinite(const std::array<float, size>& numbers) {
  return std::ranges::all_of(numbers, [](float number) { return std::isfinite(number); });
}
bool isFinite(const JointMatrix& matrix) {
  for (const auto& row : matrix.m) {
    if (!std::ranges::all_of(row, [](float number) { return std::isfinite(number); })) return false;
  }
  return true;
}

Matrix matrixFrom(const JointMatrix& joint) {
  Matrix matrix;
  for (std::size_t row = 0; row < 3; ++row) std::ranges::copy(joint.m[row], matrix[row].begin());
  return matrix;
}

Vec3 rowOf(const Matrix& m, std::size_t row) {
  return {m[row][0], m[row][1], m[row][2]};
}

/// The orthonormal columns that follow from those of a matrix by the method of Gram and Schmidt.
std::array<Vec3, 3> orthonormalColumns(const Matrix& m) {
  const auto column = [&](std::size_t i) { return Vec3(m[0][i], m[1][i], m[2][i]); };
  const Vec3 x = column(0) / math::length(column(0));
  const Vec3 rest = column(1) - math::dot(x, column(1)) * x;
  const Vec3 y = rest / math::length(rest);
  return {x, y, math::cross(x, y)};
}

/// Whether it is a rotation, uniform scale and translation.
bool keepsAngles(const Matrix& m) {
  const auto product = [&](std::size_t i, std::size_t j) {
    return m[0][i] * m[0][j] + m[1][i] * m[1][j] + m[2][i] * m[2][j];
  };
  const double square = product(0, 0), limit = 1e-6 * square;
  return std::abs(product(1, 1) - square) <= limit && std::abs(product(2, 2) - square) <= limit &&
         std::abs(product(0, 1)) <= limit && std::abs(product(0, 2)) <= limit &&
         std::abs(product(1, 2)) <= limit;
}

template <std::size_t rows>
void put(float (&numbers)[rows][4], const Matrix& matrix, bool hasShift) {
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t column = 0; column < 4; ++column) {
      const bool isZero = column == 3 && !hasShift;
      numbers[row][column] = isZero ? 0.0f : static_cast<float>(matrix[row][column]);
    }
  }
}
void put(float (&numbers)[4], const Vec3& vector, double fourth = 0) {
  for (std::size_t i = 0; i < 3; ++i) numbers[i] = static_cast<float>(vector[i]);
  numbers[3] = static_cast<float>(fourth);
}

Vec4 unitOf(const std::array<float, 4>& q) {
  return math::normalize({double{q[0]}, double{q[1]}, double{q[2]}, double{q[3]}});
}

/// A driver of the view, and what it reads and drives.
struct Driver {
  std::uint32_t kind = 0;
  std::size_t number = 0;  ///< among those of its kind
  std::vector<std::uint32_t> reads, drives, readsWeights;
  std::uint32_t firstWeight = 0, weightCount = 0;  ///< that it drives

  std::string title() const {
    constexpr const char* names[] = {"twist", "corrective", "chain", "linear driver"};
    return std::string(names[kind]) + " " + std::to_string(number);
  }
};

class RigPacker {
 public:
  explicit RigPacker(const RigView& rig) : rig_(rig) {}

  Result<std::vector<std::uint32_t>> run() {
    Result<void> good = checkJoints();
    if (good) good = collect();
    if (good) good = assign();
    if (good) good = order();
    if (!good) return good.error();
    RigHeader header{};
    header.magic = rigMagic;
    header.version = rigVersion;
    header.writtenJoints = rig_.writtenJoints;
    header.drivenJoints = static_cast<std::uint32_t>(rig_.joints.size()) - rig_.writtenJoints;
    header.givenWeights = rig_.givenWeights;
    header.drivenWeights = rig_.drivenWeights;
    header.weightsOf = rig_.weightsOf;
    reserve(sizeof(header) / 4);
    header.drivers = reserve(drivers_.size() * abi::RIG_DRIVER_WORDS);
    header.driverCount = static_cast<std::uint32_t>(drivers_.size());
    for (std::size_t place = 0; place < order_.size(); ++place) {
      const Result<RigDriver> driver = write(drivers_[order_[place]]);
      if (!driver) return driver.error();
      put(header.drivers + place * abi::RIG_DRIVER_WORDS, *driver);
      if (words_.size() > 0x3fffffff)
        return Error{ErrorCode::limitExceeded, "packRig: the rig needs more than 4 GiB"};
    }
    header.isRigid = isRigid_ ? 1 : 0;
    header.residual = static_cast<float>(residual_);
    for (const CorrectiveDriver& corrective : rig_.correctives) {
      header.mostInputs =
          std::max(header.mostInputs, static_cast<std::uint32_t>(corrective.inputs.size()));
    }
    put(0, header);
    finishStored(words_);
    return std::move(words_);
  }

 private:
  std::uint32_t reserve(std::size_t words) {
    const auto offset = static_cast<std::uint32_t>(words_.size());
    words_.resize(words_.size() + words);
    return offset;
  }
  template <typename Record>
  void put(std::size_t offset, const Record& record) {
    std::memcpy(&words_[offset], &record, sizeof(record));
  }
  template <typename Record>
  void append(const Record& record) {
    put(reserve(sizeof(record) / 4), record);
  }

  Result<void> checkJoints() const {
    const std::size_t count = rig_.joints.size();
    if (count > maxPoseJoints) {
      return Error{ErrorCode::limitExceeded, "packRig: there are " + std::to_string(count) +
                                                 " joints; the maximum is " +
                                                 std::to_string(maxPoseJoints)};
    }
    if (rig_.writtenJoints == 0 || rig_.writtenJoints > count) {
      return badRig("of " + std::to_string(count) + " joints " +
                    std::to_string(rig_.writtenJoints) + " are written");
    }
    // A number of weights that no driver drives is refused later; this bounds what is made.
    if (rig_.drivenWeights > 0xffffffffu - rig_.givenWeights)
      return badRig("there are too many weights");
    for (std::size_t joint = 0; joint < count; ++joint) {
      const RigJoint& record = rig_.joints[joint];
      if (!isFinite(record.bind)) {
        return badRig("the bind matrix of joint " + std::to_string(joint) +
                      " has a number that is not finite");
      }
      if (record.parent != abi::RIG_NO_JOINT && record.parent >= count) {
        return badRig("joint " + std::to_string(record.parent) + ", the parent of joint " +
                      std::to_string(joint) + ", does not exist");
      }
    }
    std::vector<bool> hasRoot(count);  // it is not part of a cycle, nor below one
    for (std::uint32_t joint = 0; joint < count; ++joint) {
      std::size_t steps = 0;
      for (std::uint32_t above = joint; above != abi::RIG_NO_JOINT && !hasRoot[above];
           above = rig_.joints[above].parent) {
        if (++steps > count) {
          return badRig("joint " + std::to_string(joint) +
                        " is part of, or below, a cycle of parents");
        }
      }
      for (std::uint32_t above = joint; above != abi::RIG_NO_JOINT && !hasRoot[above];
           above = rig_.joints[above].parent)
        hasRoot[above] = true;
    }
    return {};
  }

  /// The joints that a sensor of a joint reads.
  void readsRotation(Driver& driver, std::uint32_t joint) const {
    driver.reads.push_back(joint);
    if (joint < rig_.joints.size() && rig_.joints[joint].parent != abi::RIG_NO_JOINT)
      driver.reads.push_back(rig_.joints[joint].parent);
  }
  void drivesRelative(Driver& driver, std::uint32_t joint) const {
    driver.drives.push_back(joint);
    if (joint < rig_.joints.size() && rig_.joints[joint].parent != abi::RIG_NO_JOINT)
      driver.reads.push_back(rig_.joints[joint].parent);
  }

  Result<void> collect() {
    for (std::size_t i = 0; i < rig_.twists.size(); ++i) {
      Driver& driver = drivers_.emplace_back(Driver{abi::RIG_TWIST, i, {}, {}, {}});
      readsRotation(driver, rig_.twists[i].source);
      drivesRelative(driver, rig_.twists[i].joint);
    }
    for (std::size_t i = 0; i < rig_.correctives.size(); ++i) {
      const CorrectiveDriver& corrective = rig_.correctives[i];
      Driver& driver = drivers_.emplace_back(Driver{abi::RIG_CORRECTIVE, i, {}, {}, {}});
      for (const std::uint32_t joint : corrective.inputs) readsRotation(driver, joint);
      for (const std::uint32_t joint : corrective.joints) drivesRelative(driver, joint);
      driver.firstWeight = corrective.firstWeight;
      driver.weightCount = corrective.weightCount;
    }
    for (std::size_t i = 0; i < rig_.chains.size(); ++i) {
      const ChainDriver& chain = rig_.chains[i];
      Driver& driver = drivers_.emplace_back(Driver{abi::RIG_CHAIN, i, {}, {}, {}});
      if (Result<RestCurve> curve =
              RestCurve::create(rig_.joints, chain, "packRig: " + driver.title() + ": ");
          !curve)
        return curve.error();
      driver.reads.assign(chain.joints.begin(), chain.joints.end());
      for (std::uint32_t joint = 0; joint + 1 < chain.segments; ++joint) {
        driver.drives.push_back(chain.firstDriven + joint);
        if (chain.firstDriven > maxPoseJoints) break;  // it is refused
      }
    }
    for (std::size_t i = 0; i < rig_.linears.size(); ++i) {
      const LinearDriver& linear = rig_.linears[i];
      Driver& driver = drivers_.emplace_back(Driver{abi::RIG_LINEAR, i, {}, {}, {}});
      drivesRelative(driver, linear.joint);
      driver.readsWeights.assign(linear.weights.begin(), linear.weights.end());
    }
    return {};
  }

  /// Who drives each driven joint and weight.
  Result<void> assign() {
    constexpr std::size_t none = ~std::size_t{0};
    const std::size_t written = rig_.writtenJoints;
    jointDrivers_.assign(rig_.joints.size() - written, none);
    std::uint64_t driven = 0;
    for (const Driver& driver : drivers_) driven += driver.weightCount;
    if (driven < rig_.drivenWeights) {
      return badRig("of " + std::to_string(rig_.drivenWeights) + " driven weights drivers drive " +
                    std::to_string(driven));
    }
    for (std::size_t i = 0; i < drivers_.size(); ++i) {
      const Driver& driver = drivers_[i];
      for (const std::uint32_t joint : driver.reads) {
        if (joint >= rig_.joints.size()) {
          return badRig(driver.title() + ": joint " + std::to_string(joint) + " does not exist");
        }
      }
      for (const std::uint32_t joint : driver.drives) {
        if (joint >= rig_.joints.size())
          return badRig(driver.title() + ": joint " + std::to_string(joint) + " does not exist");
        if (joint < written) {
          return badRig(driver.title() + " drives joint " + std::to_string(joint) +
                        ", which is written");
        }
        if (std::exchange(jointDrivers_[joint - written], i) != none)
          return badRig("two drivers drive joint " + std::to_string(joint));
      }
      const std::uint64_t first = driver.firstWeight, count = driver.weightCount;
      const std::uint64_t end = std::uint64_t{rig_.givenWeights} + rig_.drivenWeights;
      if (count != 0 && (first < rig_.givenWeights || first + count > end)) {
        return badRig(driver.title() + " drives weights " + std::to_string(first) + " to " +
                      std::to_string(first + count - 1) + ", but driven ones are " +
                      std::to_string(rig_.givenWeights) + " to " + std::to_string(end - 1));
      }
      if (count != 0) weightRanges_.push_back({first, first + count, i});
      for (const std::uint32_t weight : driver.readsWeights) {
        if (weight >= end)
          return badRig(driver.title() + ": weight " + std::to_string(weight) + " does not exist");
      }
    }
    std::ranges::sort(weightRanges_, {}, &WeightRange::first);
    std::uint64_t next = rig_.givenWeights;
    for (const WeightRange& range : weightRanges_) {
      if (range.first != next) {
        return badRig("weight " + std::to_string(std::min(range.first, next)) +
                      (range.first < next ? " has two drivers" : " has no driver"));
      }
      next = range.end;
    }
    if (const auto lost = std::ranges::find(jointDrivers_, none); lost != jointDrivers_.end()) {
      const auto joint = static_cast<std::size_t>(lost - jointDrivers_.begin()) + written;
      return badRig("joint " + std::to_string(joint) + " is not written, and no driver drives it");
    }
    return {};
  }

  std::size_t driverOfWeight(std::uint32_t weight) const {
    const auto range = std::ranges::upper_bound(weightRanges_, weight, {}, &WeightRange::first);
    return std::prev(range)->driver;
  }

  /// Drivers after those that they read, and as many of one kind as possible after each other.
  Result<void> order() {
    std::vector<std::size_t> waitsFor(drivers_.size());
    std::vector<std::vector<std::size_t>> readers(drivers_.size());
    for (std::size_t i = 0; i < drivers_.size(); ++i) {
      std::vector<std::size_t> before;
      for (const std::uint32_t joint : drivers_[i].reads) {
        if (joint >= rig_.writtenJoints)
          before.push_back(jointDrivers_[joint - rig_.writtenJoints]);
      }
      for (const std::uint32_t weight : drivers_[i].readsWeights) {
        if (weight >= rig_.givenWeights) before.push_back(driverOfWeight(weight));
      }
      waitsFor[i] = before.size();
      for (const std::size_t other : before) readers[other].push_back(i);
    }
    std::array<std::vector<std::size_t>, 4> ready;  // by kind
    const auto add = [&](std::size_t i) { ready[drivers_[i].kind].push_back(i); };
    for (std::size_t i = drivers_.size(); i-- > 0;) {
      if (waitsFor[i] == 0) add(i);
    }
    const auto isEmpty = [&] {
      return std::ranges::all_of(ready, &std::vector<std::size_t>::empty);
    };
    for (std::size_t kind = 0; !isEmpty(); kind = (kind + 1) % ready.size()) {
      while (!ready[kind].empty()) {
        const std::size_t next = ready[kind].back();
        ready[kind].pop_back();
        order_.push_back(next);
        for (const std::size_t reader : readers[next]) {
          if (--waitsFor[reader] == 0) add(reader);
        }
      }
    }
    if (order_.size() == drivers_.size()) return {};
    const auto stuck = std::ranges::find_if(waitsFor, [](std::size_t count) { return count != 0; });
    return badRig(drivers_[static_cast<std::size_t>(stuck - waitsFor.begin())].title() +
                  " is part of, or reads, a cycle of drivers");
  }

  Result<RigDriver> write(const Driver& driver) {
    switch (driver.kind) {
      case abi::RIG_TWIST:
        return writeTwist(rig_.twists[driver.number], driver.title());
      case abi::RIG_CORRECTIVE:
        return writeCorrective(rig_.correctives[driver.number], driver.title());
      case abi::RIG_CHAIN:
        return writeChain(rig_.chains[driver.number], driver.title());
      default:
        return writeLinear(rig_.linears[driver.number], driver.title());
    }
  }

  std::uint32_t placeOf(std::uint32_t joint) const { return joint - rig_.writtenJoints; }

  Result<Matrix> invertBind(std::uint32_t joint, const std::string& title) const {
    if (const std::optional<Matrix> inverse = inverseOf(matrixFrom(rig_.joints[joint].bind)))
      return Matrix(*inverse);
    return badRig(title + ": the bind matrix of joint " + std::to_string(joint) +
                  " has no inverse");
  }

  struct Sensor {
    RigSensor record;
    Matrix local;     ///< the bind matrix relative to the parent, in its own orthonormal columns
    bool isMirrored;  ///< the parent is, in bind pose
  };
  Result<Sensor> sensorOf(std::uint32_t joint, const std::string& title) const {
    Sensor sensor{};
    sensor.record.joint = joint;
    sensor.record.parent = rig_.joints[joint].parent;
    const Matrix bind = matrixFrom(rig_.joints[joint].bind);
    if (const Result<Matrix> inverse = invertBind(joint, title); !inverse) return inverse.error();
    Matrix above{{{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, 0}}};
    if (sensor.record.parent != abi::RIG_NO_JOINT) {
      const Result<Matrix> inverse = invertBind(sensor.record.parent, title);
      if (!inverse) return inverse.error();
      above = *inverse;
    }
    const std::array<Vec3, 3> axes = orthonormalColumns(multiply(above, bind));
    Matrix back{};
    for (std::size_t row = 0; row < 3; ++row)
      back[row] = {axes[row].x, axes[row].y, axes[row].z, 0};
    const Matrix left = multiply(back, above);
    dermis::put(sensor.record.left, left, false);
    dermis::put(sensor.record.right, bind, false);
    sensor.local = multiply(left, bind);
    sensor.isMirrored =
        math::dot(rowOf(above, 0), math::cross(rowOf(above, 1), rowOf(above, 2))) < 0;
    return sensor;
  }

  Result<RigDriver> writeTwist(const TwistDriver& view, const std::string& title) {
    const Vec3 axis(double{view.axis[0]}, double{view.axis[1]}, double{view.axis[2]});
    if (!areFinite(view.axis) || !(math::length(axis) > 0))
      return badRig(title + ": the axis has no direction");
    if (!(std::abs(view.share) <= 1)) return badRig(title + ": the share is not from -1 to 1");
    const Result<Sensor> sensor = sensorOf(view.source, title);
    if (!sensor) return sensor.error();
    RigTwist twist{};
    twist.sensor = sensor->record;
    twist.driven = placeOf(view.joint);
    twist.parent = rig_.joints[view.joint].parent;
    twist.share = view.share;
    const auto unitAlong = [&](const Matrix& m) {
      const Vec3 v(math::dot(rowOf(m, 0), axis), math::dot(rowOf(m, 1), axis),
                   math::dot(rowOf(m, 2), axis));
      return v / math::length(v);
    };
    dermis::put(twist.axis, unitAlong(sensor->local));
    const Vec3 direction = unitAlong(matrixFrom(rig_.joints[view.source].bind));
    // Seen in a mirror, a rotation has the other sense.
    dermis::put(twist.direction, sensor->isMirrored ? -direction : direction);
    const auto& own = rig_.joints[view.joint].bind.m;
    dermis::put(twist.origin, {double{own[0][3]}, double{own[1][3]}, double{own[2][3]}});
    const auto data = static_cast<std::uint32_t>(words_.size());
    append(twist);
    return RigDriver{abi::RIG_TWIST, data, 0, 0};
  }

  Result<RigDriver> writeCorrective(const CorrectiveDriver& view, const std::string& title);
  Result<void> checkCorrective(const CorrectiveDriver& view, const std::string& title) const;
  Result<RigDriver> writeChain(const ChainDriver& chain, const std::string& title);
  Result<RigDriver> writeLinear(const LinearDriver& linear, const std::string& title);

  struct WeightRange {
    std::uint64_t first, end;
    std::size_t driver;
  };

  const RigView& rig_;
  std::vector<Driver> drivers_;
  std::vector<std::size_t> jointDrivers_;
  std::vector<WeightRange> weightRanges_;
  std::vector<std::size_t> order_;
  std::vector<std::uint32_t> words_;
  bool isRigid_ = true;
  double residual_ = 0;
};

Result<void> RigPacker::checkCorrective(const CorrectiveDriver& view,
                                        const std::string& title) const {
  const std::size_t inputs = view.inputs.size();
  if (inputs == 0) return badRig(title + " has no input");
  const std::size_t examples = view.examples.size() / inputs;
  if (examples == 0 || examples * inputs != view.examples.size()) {
    return badRig(title + " has " + std::to_string(view.examples.size()) +
                  " rotations for examples of " + std::to_string(inputs) + " inputs");
  }
  if (examples > maxRigExamples) {
    return Error{ErrorCode::limitExceeded,
                 "packRig: " + title + " has " + std::to_string(examples) +
                     " examples; the maximum is " + std::to_string(maxRigExamples)};
  }
  if (!(view.radius >= 0) || !std::isfinite(view.radius))
    return badRig(title + ": the radius is negative or not finite");
  if (view.radius > 0 &&
      !std::isnormal(static_cast<float>(-0.5 / (double{view.radius} * view.radius))))
    return badRig(title + ": the radius is too small or too large for float32");
  if (view.weights.size() != std::uint64_t{examples} * view.weightCount ||
      view.offsets.size() != examples * view.joints.size()) {
    return badRig(title + " has " + std::to_string(view.weights.size()) + " weights and " +
                  std::to_string(view.offsets.size()) + " offsets for " + std::to_string(examples) +
                  " examples of " + std::to_string(view.weightCount) + " weights and " +
                  std::to_string(view.joints.size()) + " joints");
  }
  if (view.weightCount == 0 && view.joints.empty()) return badRig(title + " drives nothing");
  const auto isRotation = [](const std::array<float, 4>& q) {
    return areFinite(q) && std::ranges::any_of(q, [](float number) { return number != 0; });
  };
  if (!std::ranges::all_of(view.examples, isRotation))
    return badRig(title + ": a rotation of an example is 0 or not finite");
  if (!std::ranges::all_of(view.weights, [](float weight) { return std::isfinite(weight); }))
    return badRig(title + ": a weight of an example is not finite");
  for (const JointOffset& offset : view.offsets) {
    if (!areFinite(offset.translation) || !areFinite(offset.scale) || !isRotation(offset.rotation))
      return badRig(title + ": an offset of an example is not finite, or its rotation is 0");
  }
  return {};
}

/// The function of the distance between two examples.
double basisBetween(std::span<const Vec4> a, std::span<const Vec4> b, double radius) {
  double square = 0;
  for (std::size_t input = 0; input < a.size(); ++input) {
    const Vec4 p = a[input], q = b[input];
    const Vec3 between = p.w * q.xyz() - q.w * p.xyz() - math::cross(p.xyz(), q.xyz());
    square += 4 * math::dot(between, between);
  }
  return radius == 0 ? std::sqrt(square) : std::exp(-square / (2 * radius * radius));
}

Result<RigDriver> RigPacker::writeCorrective(const CorrectiveDriver& view,
                                             const std::string& title) {
  if (Result<void> good = checkCorrective(view, title); !good) return good.error();
  const std::size_t inputs = view.inputs.size(), examples = view.examples.size() / inputs;
  RigCorrective record{};
  record.inputCount = static_cast<std::uint32_t>(inputs);
  record.exampleCount = static_cast<std::uint32_t>(examples);
  record.firstWeight = view.firstWeight;
  record.weightCount = view.weightCount;
  record.jointCount = static_cast<std::uint32_t>(view.joints.size());
  const double radius = double{view.radius};
  record.factor = radius == 0 ? 0 : static_cast<float>(-0.5 / (radius * radius));
  const auto data = static_cast<std::uint32_t>(words_.size());
  append(record);
  for (const std::uint32_t joint : view.inputs) {
    const Result<Sensor> sensor = sensorOf(joint, title);
    if (!sensor) return sensor.error();
    append(sensor->record);
  }
  std::vector<Vec4> rotations;
  for (const std::array<float, 4>& rotation : view.examples) {
    const Vec4& q = rotations.emplace_back(unitOf(rotation));
    const std::array<float, 4> numbers{static_cast<float>(q.x), static_cast<float>(q.y),
                                       static_cast<float>(q.z), static_cast<float>(q.w)};
    append(numbers);
  }
  std::vector<double> matrix(examples * examples);
  const auto exampleAt = [&](std::size_t example) {
    return std::span<const Vec4>(rotations).subspan(example * inputs, inputs);
  };
  for (std::size_t row = 0; row < examples; ++row) {
    for (std::size_t column = 0; column < examples; ++column)
      matrix[row * examples + column] = basisBetween(exampleAt(row), exampleAt(column), radius);
  }
  const SymmetricSolver solver(matrix, examples);
  const auto areSimilar = [&] {
    return badRig(title + ": two examples are the same, or too near each other for its radius");
  };
  if (solver.isSingular()) return areSimilar();
  // The coefficients for the values of one number in all examples; empty if they miss them.
  const auto coefficientsFor = [&](const std::vector<double>& values, double largest) {
    std::vector<float> coefficients;
    for (const double value : solver.solve(values))
      coefficients.push_back(static_cast<float>(value));
    for (std::size_t row = 0; row < examples; ++row) {
      double sum = -values[row];
      for (std::size_t column = 0; column < examples; ++column)
        sum += matrix[row * examples + column] * double{coefficients[column]};
      residual_ = std::max(residual_, std::abs(sum));
      if (!(std::abs(sum) <= 1e-5 * largest)) return std::vector<float>();
    }
    return coefficients;
  };

  std::vector<double> values(examples);
  double largest = 0;
  for (const float weight : view.weights) largest = std::max(largest, std::abs(double{weight}));
  std::vector<std::vector<float>> columns;
  for (std::size_t weight = 0; weight < view.weightCount; ++weight) {
    for (std::size_t example = 0; example < examples; ++example)
      values[example] = double{view.weights[example * view.weightCount + weight]};
    columns.push_back(coefficientsFor(values, largest));
    if (columns.back().empty()) return areSimilar();
  }
  for (std::size_t first = 0; first < columns.size(); first += 4) {
    for (std::size_t example = 0; example < examples; ++example) {
      std::array<float, 4> four{};
      for (std::size_t i = 0; i < 4 && first + i < columns.size(); ++i)
        four[i] = columns[first + i][example];
      append(four);
    }
  }

  for (std::size_t joint = 0; joint < view.joints.size(); ++joint) {
    const std::uint32_t driven = view.joints[joint];
    const Matrix bind = matrixFrom(rig_.joints[driven].bind);
    const Result<Matrix> inverse = invertBind(driven, title);
    if (!inverse) return inverse.error();
    RigOffsetJoint offsetJoint{};
    offsetJoint.driven = placeOf(driven);
    offsetJoint.parent = rig_.joints[driven].parent;
    dermis::put(offsetJoint.bind, bind, true);
    dermis::put(offsetJoint.inverse, *inverse, true);
    append(offsetJoint);
    isRigid_ = isRigid_ && keepsAngles(bind);
    std::array<std::array<double, maxRigExamples>, 10> numbers{};
    double longest = 0;
    for (std::size_t example = 0; example < examples; ++example) {
      const JointOffset& offset = view.offsets[example * view.joints.size() + joint];
      Vec4 q = unitOf(offset.rotation);
      if (q.w < 0) q = {-q.x, -q.y, -q.z, -q.w};
      for (std::size_t i = 0; i < 3; ++i) {
        numbers[i][example] = double{offset.translation[i]};
        numbers[7 + i][example] = double{offset.scale[i]} - 1;
        longest = std::max(longest, std::abs(numbers[i][example]));
        isRigid_ = isRigid_ && offset.scale[i] == 1;
      }
      numbers[3][example] = q.x;
      numbers[4][example] = q.y;
      numbers[5][example] = q.z;
      numbers[6][example] = q.w - 1;
    }
    std::array<std::vector<float>, 10> found;
    for (std::size_t i = 0; i < found.size(); ++i) {
      std::ranges::copy_n(numbers[i].begin(), static_cast<std::ptrdiff_t>(examples),
                          values.begin());
      found[i] = coefficientsFor(values, i < 3 ? longest : 1);
      if (found[i].empty()) return areSimilar();
    }
    for (std::size_t example = 0; example < examples; ++example) {
      RigOffset offset{};
      for (std::size_t i = 0; i < 3; ++i) {
        offset.translation[i] = found[i][example];
        offset.scale[i] = found[7 + i][example];
      }
      for (std::size_t i = 0; i < 4; ++i) offset.rotation[i] = found[3 + i][example];
      append(offset);
    }
  }
  return RigDriver{abi::RIG_CORRECTIVE, data, 0, 0};
}

Result<RigDriver> RigPacker::writeChain(const ChainDriver& chain, const std::string& title) {
  const Result<RestCurve> curve = RestCurve::create(rig_.joints, chain, "packRig: " + title + ": ");
  if (!curve) return curve.error();
  const std::size_t nodes = chain.joints.size();
  const std::uint32_t data = reserve(nodes * abi::RIG_NODE_WORDS);
  std::vector<RigNode> records(nodes);
  for (std::size_t i = 0; i < nodes; ++i) {
    records[i].joint = chain.joints[i];
    records[i].joints = data;
    dermis::put(records[i].origin, curve->origin(i));
    dermis::put(records[i].direction, curve->direction(i));
  }
  for (std::uint32_t end = 1; end < chain.segments; ++end) {
    const CurvePlace place = curve->at(curve->length() * end / chain.segments);
    const double length = curve->lengthOf(place.piece);
    const HermiteFactors at = hermiteAt(place.share), slope = hermiteSlopeAt(place.share);
    RigChainJoint joint{};
    joint.driven = placeOf(chain.firstDriven + end - 1);
    joint.share = static_cast<float>(place.share);
    joint.h = static_cast<float>(at.first);
    joint.a = static_cast<float>(at.firstTangent * length);
    joint.b = static_cast<float>(at.secondTangent * length);
    joint.g = static_cast<float>(slope.first);
    joint.c = static_cast<float>(slope.firstTangent * length);
    joint.d = static_cast<float>(slope.secondTangent * length);
    dermis::put(joint.point, curve->point(place));
    const Vec3 direction = curve->slope(place);
    if (!(math::length(direction) > 1e-6 * length))
      return badRig(title + ": the curve stands still between two joints");
    dermis::put(joint.direction, direction / math::length(direction));
    RigNode& node = records[place.piece];
    if (node.jointCount++ == 0) node.joints = static_cast<std::uint32_t>(words_.size());
    append(joint);
  }
  for (std::size_t i = 0; i < nodes; ++i) put(data + i * abi::RIG_NODE_WORDS, records[i]);
  return RigDriver{abi::RIG_CHAIN, data, static_cast<std::uint32_t>(nodes), 0};
}

Result<RigDriver> RigPacker::writeLinear(const LinearDriver& view, const std::string& title) {
  if (view.weights.size() != view.matrices.size()) {
    return badRig(title + " has " + std::to_string(view.weights.size()) + " weights, but " +
                  std::to_string(view.matrices.size()) + " matrices");
  }
  if (!std::ranges::all_of(view.matrices, isFinite))
    return badRig(title + ": a matrix has a number that is not finite");
  const auto data = static_cast<std::uint32_t>(words_.size());
  append(RigLinear{placeOf(view.joint), rig_.joints[view.joint].parent, {}});
  for (std::size_t i = 0; i < view.weights.size(); ++i) {
    RigTerm term{};
    term.weight = view.weights[i];
    dermis::put(term.matrix, matrixFrom(view.matrices[i]), true);
    append(term);
  }
  isRigid_ = isRigid_ && view.weights.empty();
  return RigDriver{abi::RIG_LINEAR, data, static_cast<std::uint32_t>(view.weights.size()), 0};
}

}  // namespace

Result<PackedRig> packRig(const RigView& rig) {
  Result<std::vector<std::uint32_t>> words = RigPacker(rig).run();
  if (!words) return words.error();
  if (!checkRig(*words))
    return badRig("a bind matrix, or what follows from it, is too large for float32");
  PackedRig packed;
  packed.words_ = std::move(*words);
  return packed;
}

}  // namespace dermis
