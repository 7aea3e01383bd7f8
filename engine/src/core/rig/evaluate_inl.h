// Computes what a rig drives, operation by operation, for one pose or for several at a time: a
// template over a number. docs/rigs.md has the formulas. It has no guard and includes nothing: it
// is included once for each instruction set, inside a namespace that defines for its numbers
//
//     N                         with + - * /, unary -, and a constructor from float
//     squareRoot, floorOf       of one
//     select(a < b, x, y)       x if it is true, otherwise y; also with >
//     powerOfTwo                of a whole number from -126 to 0
//
// `Memory` has the matrices and weights of these poses:
//
//     Transform<N> joint(number)              of all joints; those driven were set before
//     void setDriven(number, Transform<N>)    of driven joints
//     N weight(number), void setWeight(number, N)

template <typename N>
struct Vec {
  N x, y, z;
};
template <typename N>
struct Quat {
  N x, y, z, w;
};
/// Rows of a 3×3 matrix.
template <typename N>
struct Linear {
  Vec<N> r0, r1, r2;
};
/// `shift` is the fourth column.
template <typename N>
struct Transform {
  Linear<N> linear;
  Vec<N> shift;
};

template <typename N>
Vec<N> operator+(const Vec<N>& a, const Vec<N>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <typename N>
Vec<N> operator-(const Vec<N>& a, const Vec<N>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <typename N>
Vec<N> operator*(const Vec<N>& a, const N& b) {
  return {a.x * b, a.y * b, a.z * b};
}
template <typename N>
N dot(const Vec<N>& a, const Vec<N>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <typename N>
Vec<N> cross(const Vec<N>& a, const Vec<N>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// m v
template <typename N>
Vec<N> times(const Linear<N>& m, const Vec<N>& v) {
  return {dot(m.r0, v), dot(m.r1, v), dot(m.r2, v)};
}
/// A row times a matrix.
template <typename N>
Vec<N> rowTimes(const Vec<N>& row, const Linear<N>& m) {
  return m.r0 * row.x + m.r1 * row.y + m.r2 * row.z;
}
template <typename N>
Linear<N> times(const Linear<N>& a, const Linear<N>& b) {
  return {rowTimes(a.r0, b), rowTimes(a.r1, b), rowTimes(a.r2, b)};
}
template <typename N>
Transform<N> times(const Transform<N>& a, const Transform<N>& b) {
  return {times(a.linear, b.linear), times(a.linear, b.shift) + a.shift};
}
template <typename N>
Linear<N> transposed(const Linear<N>& m) {
  return {{m.r0.x, m.r1.x, m.r2.x}, {m.r0.y, m.r1.y, m.r2.y}, {m.r0.z, m.r1.z, m.r2.z}};
}

template <typename N>
Vec<N> vectorFrom(const float (&numbers)[4]) {
  return {N(numbers[0]), N(numbers[1]), N(numbers[2])};
}
template <typename N>
Linear<N> linearFrom(const float (&rows)[3][4]) {
  return {vectorFrom<N>(rows[0]), vectorFrom<N>(rows[1]), vectorFrom<N>(rows[2])};
}
template <typename N>
Transform<N> transformFrom(const float (&rows)[3][4]) {
  return {linearFrom<N>(rows), {N(rows[0][3]), N(rows[1][3]), N(rows[2][3])}};
}

/// v with length 1, or `other` if the square of its length is 0.
template <typename N>
Vec<N> unitOr(const Vec<N>& v, const Vec<N>& other) {
  const N square = dot(v, v);
  const auto isSome = square > N(0.0f);
  const N length = squareRoot(select(isSome, square, N(1.0f)));
  return {select(isSome, v.x / length, other.x), select(isSome, v.y / length, other.y),
          select(isSome, v.z / length, other.z)};
}
/// q with length 1, or the identity if the square of its length is at most `least`.
template <typename N>
Quat<N> unitOrIdentity(const Quat<N>& q, float least = 0) {
  const N square = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
  const auto isSome = square > N(least);
  const N length = squareRoot(select(isSome, square, N(1.0f)));
  return {select(isSome, q.x / length, N(0.0f)), select(isSome, q.y / length, N(0.0f)),
          select(isSome, q.z / length, N(0.0f)), select(isSome, q.w / length, N(1.0f))};
}

/// The orthonormal columns that follow from those of a matrix by the method of Gram and Schmidt, as
/// rows. The third is the cross product of the others.
template <typename N>
Linear<N> orthonormalColumns(const Linear<N>& m) {
  const Linear<N> columns = transposed(m);
  const N zero(0.0f), one(1.0f);
  const Vec<N> x = unitOr(columns.r0, {one, zero, zero});
  const Vec<N> y = unitOr(columns.r1 - x * dot(x, columns.r1), {zero, one, zero});
  return {x, y, cross(x, y)};
}

/// The unit quaternion of a rotation with these columns: from the largest of its components
/// (Shepperd 1978, "Quaternion from rotation matrix").
template <typename N>
Quat<N> quaternionOfColumns(const Linear<N>& c) {
  const N one(1.0f);
  const N a = c.r1.z - c.r2.y, b = c.r2.x - c.r0.z, d = c.r0.y - c.r1.x;
  const N e = c.r0.y + c.r1.x, f = c.r0.z + c.r2.x, g = c.r1.z + c.r2.y;
  const N w = one + c.r0.x + c.r1.y + c.r2.z;
  const N x = one + c.r0.x - c.r1.y - c.r2.z;
  const N y = one - c.r0.x + c.r1.y - c.r2.z;
  const N z = one - c.r0.x - c.r1.y + c.r2.z;
  Quat<N> q{a, b, d, w};
  N largest = w;
  const auto isX = x > largest;
  q = {select(isX, x, q.x), select(isX, e, q.y), select(isX, f, q.z), select(isX, a, q.w)};
  largest = select(isX, x, largest);
  const auto isY = y > largest;
  q = {select(isY, e, q.x), select(isY, y, q.y), select(isY, g, q.z), select(isY, b, q.w)};
  largest = select(isY, y, largest);
  const auto isZ = z > largest;
  q = {select(isZ, f, q.x), select(isZ, g, q.y), select(isZ, z, q.z), select(isZ, d, q.w)};
  return unitOrIdentity(q);
}

/// The rotation of a unit quaternion.
template <typename N>
Linear<N> rotationOf(const Quat<N>& q) {
  const N one(1.0f), two(2.0f);
  const N xx = q.x * q.x, yy = q.y * q.y, zz = q.z * q.z;
  const N xy = q.x * q.y, xz = q.x * q.z, yz = q.y * q.z;
  const N wx = q.w * q.x, wy = q.w * q.y, wz = q.w * q.z;
  return {{one - two * (yy + zz), two * (xy - wz), two * (xz + wy)},
          {two * (xy + wz), one - two * (xx + zz), two * (yz - wx)},
          {two * (xz - wy), two * (yz + wx), one - two * (xx + yy)}};
}

/// a b
template <typename N>
Quat<N> product(const Quat<N>& a, const Quat<N>& b) {
  return {
      a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y, a.w * b.y + a.y * b.w + a.z * b.x - a.x * b.z,
      a.w * b.z + a.z * b.w + a.x * b.y - a.y * b.x, a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z};
}

// Minimax polynomials, found by Remez' algorithm and rounded to float32. The errors, without that
// of the arithmetic, are the largest at 50,000 points; a test compares them.

/// For |x| <= 1, within 2.3e-8.
template <typename N>
N arcTangent(const N& x) {
  const N s = x * x;
  N p = N(0.00262224488f) * s - N(0.0151325371f);
  p = p * s + N(0.0411218628f);
  p = p * s - N(0.0736670643f);
  p = p * s + N(0.105739325f);
  p = p * s - N(0.141859755f);
  p = p * s + N(0.199903965f);
  p = p * s - N(0.333329856f);
  return x + x * s * p;
}
/// For |x| <= pi / 2, within 1.8e-8.
template <typename N>
N sine(const N& x) {
  const N s = x * x;
  N p = N(2.60005481e-06f) * s - N(0.000198066147f);
  p = p * s + N(0.00833301712f);
  p = p * s - N(0.166666567f);
  return x + x * s * p;
}
/// For |x| <= pi / 2, within 5.1e-9.
template <typename N>
N cosine(const N& x) {
  const N s = x * x;
  N p = N(2.47618864e-05f) - N(2.6077106e-07f) * s;
  p = p * s - N(0.00138884038f);
  p = p * s + N(0.0416666418f);
  p = p * s - N(0.5f);
  return N(1.0f) + s * p;
}
/// For x <= 0, within 4.4e-9 of the value; at least exp(-87). x = n ln 2 + r, where ln 2 is the sum
/// of two numbers of which n times the first is exact (Cody and Waite 1980).
template <typename N>
N exponential(const N& x) {
  const N least(-87.0f);
  const N clamped = select(x > least, x, least);
  const N n = floorOf(clamped * N(1.44269504f) + N(0.5f));
  const N r = (clamped - n * N(0.693359375f)) + n * N(0.000212194440f);
  N p = N(0.00138144672f) * r + N(0.00836878084f);
  p = p * r + N(0.0416683927f);
  p = p * r + N(0.166665196f);
  p = p * r + N(0.49999994f);
  return (N(1.0f) + (r + r * r * p)) * powerOfTwo(n);
}

/// The rotation of a joint relative to its parent and its bind pose.
template <typename N, typename Memory>
Quat<N> rotationAt(const RigSensor& sensor, const Memory& memory) {
  Linear<N> m = memory.joint(sensor.joint).linear;
  if (sensor.parent != abi::RIG_NO_JOINT) {
    // The inverse of the parent's matrix is the adjugate / the determinant.
    const Linear<N> parent = memory.joint(sensor.parent).linear;
    const Linear<N> adjugate = transposed(Linear<N>{
        cross(parent.r1, parent.r2), cross(parent.r2, parent.r0), cross(parent.r0, parent.r1)});
    const N determinant = dot(parent.r0, cross(parent.r1, parent.r2));
    const N zero(0.0f), one(1.0f);
    const N sign = select(determinant < zero, -one, one);
    m = times(adjugate, m);
    m = {m.r0 * sign, m.r1 * sign, m.r2 * sign};
  }
  m = times(times(linearFrom<N>(sensor.left), m), linearFrom<N>(sensor.right));
  return quaternionOfColumns(orthonormalColumns(m));
}

template <typename N, typename Memory>
void setRelative(std::uint32_t driven, std::uint32_t parent, const Transform<N>& matrix,
                 Memory& memory) {
  memory.setDriven(driven,
                   parent == abi::RIG_NO_JOINT ? matrix : times(memory.joint(parent), matrix));
}

template <typename N, typename Memory>
void evaluateTwist(const RigTwist& twist, Memory& memory) {
  const N zero(0.0f), one(1.0f);
  const Quat<N> q = rotationAt<N>(twist.sensor, memory);
  const Vec<N> axis = vectorFrom<N>(twist.axis);
  N s = axis.x * q.x + axis.y * q.y + axis.z * q.z;
  const auto isNegative = q.w < zero;
  s = select(isNegative, -s, s);
  const N w = select(isNegative, -q.w, q.w);
  const N sum = squareRoot(s * s + w * w) + w;
  const auto isSome = sum > zero;
  const N tangent = select(isSome, s / select(isSome, sum, one), zero);
  // Half of the angle is twice the arc whose tangent this is.
  const N half = N(twist.share) * (N(2.0f) * arcTangent(tangent));
  const Vec<N> turn = vectorFrom<N>(twist.direction) * sine(half);
  const Linear<N> rotation = rotationOf(Quat<N>{turn.x, turn.y, turn.z, cosine(half)});
  const Vec<N> origin = vectorFrom<N>(twist.origin);
  setRelative(twist.driven, twist.parent, Transform<N>{rotation, origin - times(rotation, origin)},
              memory);
}

/// The function of an example. `quaternions` are those of the example, `rotations` of the pose.
template <typename N>
N basisAt(const RigBlob& rig, std::size_t quaternions, std::span<const Quat<N>> rotations,
          float factor) {
  N square(0.0f);
  for (std::size_t input = 0; input < rotations.size(); ++input) {
    float numbers[4];
    rig.read(numbers, quaternions + 4 * input);
    const Quat<N> inverse{N(-numbers[0]), N(-numbers[1]), N(-numbers[2]), N(numbers[3])};
    const Quat<N> between = product(inverse, rotations[input]);
    square = square + (between.x * between.x + between.y * between.y + between.z * between.z);
  }
  square = square * N(4.0f);
  return factor == 0 ? squareRoot(square) : exponential(square * N(factor));
}

/// `rotations` and `basis` are scratch, for the inputs and examples.
template <typename N, typename Memory>
void evaluateCorrective(const RigBlob& rig, std::size_t data, std::span<Quat<N>> rotations,
                        std::span<N> basis, Memory& memory) {
  const auto record = rig.at<RigCorrective>(data);
  data += abi::RIG_CORRECTIVE_WORDS;
  rotations = rotations.first(record.inputCount);
  for (Quat<N>& rotation : rotations) {
    rotation = rotationAt<N>(rig.at<RigSensor>(data), memory);
    data += abi::RIG_SENSOR_WORDS;
  }
  basis = basis.first(record.exampleCount);
  for (N& value : basis) {
    value = basisAt<N>(rig, data, rotations, record.factor);
    data += 4 * rotations.size();
  }
  for (std::uint32_t first = 0; first < record.weightCount; first += 4) {
    N sums[4] = {N(0.0f), N(0.0f), N(0.0f), N(0.0f)};
    for (const N& value : basis) {
      float coefficients[4];
      rig.read(coefficients, data);
      data += 4;
      for (std::size_t i = 0; i < 4; ++i) sums[i] = sums[i] + value * N(coefficients[i]);
    }
    for (std::uint32_t i = 0; i < 4 && first + i < record.weightCount; ++i)
      memory.setWeight(record.firstWeight + first + i, sums[i]);
  }
  for (std::uint32_t i = 0; i < record.jointCount; ++i) {
    const auto joint = rig.at<RigOffsetJoint>(data);
    data += abi::RIG_OFFSET_JOINT_WORDS;
    const N zero(0.0f), one(1.0f);
    Vec<N> shift{zero, zero, zero}, scale{one, one, one};
    Quat<N> turn{zero, zero, zero, one};
    for (const N& value : basis) {
      const auto offset = rig.at<RigOffset>(data);
      data += abi::RIG_OFFSET_WORDS;
      shift = shift + vectorFrom<N>(offset.translation) * value;
      turn = {turn.x + value * N(offset.rotation[0]), turn.y + value * N(offset.rotation[1]),
              turn.z + value * N(offset.rotation[2]), turn.w + value * N(offset.rotation[3])};
      scale = scale + vectorFrom<N>(offset.scale) * value;
    }
    const Linear<N> rotation = rotationOf(unitOrIdentity(turn));
    const Linear<N> scaled{
        {rotation.r0.x * scale.x, rotation.r0.y * scale.y, rotation.r0.z * scale.z},
        {rotation.r1.x * scale.x, rotation.r1.y * scale.y, rotation.r1.z * scale.z},
        {rotation.r2.x * scale.x, rotation.r2.y * scale.y, rotation.r2.z * scale.z}};
    const Transform<N> inBindSpace =
        times(times(transformFrom<N>(joint.bind), Transform<N>{scaled, shift}),
              transformFrom<N>(joint.inverse));
    setRelative(joint.driven, joint.parent, inBindSpace, memory);
  }
}

/// A linear map as rotation × (what is on and above the diagonal, by rows).
template <typename N>
struct Frame {
  Quat<N> rotation;
  Vec<N> diagonal, above;  ///< `above`: row 0 columns 1 and 2, row 1 column 2
};

template <typename N>
Frame<N> frameOf(const Linear<N>& m) {
  const Linear<N> columns = transposed(m), axes = orthonormalColumns(m);
  return {quaternionOfColumns(axes),
          {dot(axes.r0, columns.r0), dot(axes.r1, columns.r1), dot(axes.r2, columns.r2)},
          {dot(axes.r0, columns.r1), dot(axes.r0, columns.r2), dot(axes.r1, columns.r2)}};
}

template <typename N>
Frame<N> mixed(const Frame<N>& a, const Frame<N>& b, const N& share) {
  const Quat<N>& p = a.rotation;
  const Quat<N>& q = b.rotation;
  const N rest = N(1.0f) - share;
  const N other = select(p.x * q.x + p.y * q.y + p.z * q.z + p.w * q.w < N(0.0f), -share, share);
  return {unitOrIdentity(Quat<N>{rest * p.x + other * q.x, rest * p.y + other * q.y,
                                 rest * p.z + other * q.z, rest * p.w + other * q.w}),
          a.diagonal * rest + b.diagonal * share, a.above * rest + b.above * share};
}

template <typename N>
Linear<N> linearOf(const Quat<N>& rotation, const Frame<N>& frame) {
  const Linear<N> r = rotationOf(rotation);
  const Vec<N>& d = frame.diagonal;
  const Vec<N>& u = frame.above;
  const auto row = [&](const Vec<N>& v) {
    return Vec<N>{v.x * d.x, v.x * u.x + v.y * d.y, v.x * u.y + v.y * u.z + v.z * d.z};
  };
  return {row(r.r0), row(r.r1), row(r.r2)};
}

/// The curve at a joint of the chain.
template <typename N>
struct CurveNode {
  Frame<N> frame;
  Vec<N> place, direction;
};

template <typename N>
CurveNode<N> nodeAt(const RigNode& node, const Transform<N>& matrix, const Frame<N>& frame) {
  const Vec<N> origin = vectorFrom<N>(node.origin), direction = vectorFrom<N>(node.direction);
  return {frame, times(matrix.linear, origin) + matrix.shift,
          times(linearOf(frame.rotation, frame), direction)};
}

template <typename N>
Transform<N> onCurve(const RigChainJoint& joint, const CurveNode<N>& begin,
                     const CurveNode<N>& end) {
  const N one(1.0f), h(joint.h);
  const Vec<N> place = begin.place * h + end.place * (one - h) + begin.direction * N(joint.a) +
                       end.direction * N(joint.b);
  const Vec<N> direction = (begin.place - end.place) * N(joint.g) + begin.direction * N(joint.c) +
                           end.direction * N(joint.d);
  const Frame<N> frame = mixed(begin.frame, end.frame, N(joint.share));
  // Then the shortest turn from the direction that this rotation gives to that of the curve.
  const Vec<N> from = times(rotationOf(frame.rotation), vectorFrom<N>(joint.direction));
  const Vec<N> to = unitOr(direction, from);
  const Vec<N> axis = cross(from, to);
  const Quat<N> swing = unitOrIdentity(Quat<N>{axis.x, axis.y, axis.z, one + dot(from, to)}, 1e-8f);
  const Linear<N> linear = linearOf(product(swing, frame.rotation), frame);
  return {linear, place - times(linear, vectorFrom<N>(joint.point))};
}

/// At its ends the curve has the frames of the joints there; at the others the mean of the frames
/// of the joint and of the one before it, so that a bend is the same on both sides.
template <typename N, typename Memory>
void evaluateChain(const RigBlob& rig, const RigDriver& driver, Memory& memory) {
  auto node = rig.at<RigNode>(driver.data);
  Transform<N> matrix = memory.joint(node.joint);
  Frame<N> frame = frameOf(matrix.linear);
  CurveNode<N> begin = nodeAt(node, matrix, frame);
  for (std::size_t i = 1; i < driver.count; ++i) {
    const auto next = rig.at<RigNode>(driver.data + i * abi::RIG_NODE_WORDS);
    matrix = memory.joint(next.joint);
    const Frame<N> own = frameOf(matrix.linear);
    const CurveNode<N> end =
        nodeAt(next, matrix, i + 1 == driver.count ? own : mixed(frame, own, N(0.5f)));
    for (std::size_t joint = 0; joint < node.jointCount; ++joint) {
      const auto record = rig.at<RigChainJoint>(node.joints + joint * abi::RIG_CHAIN_JOINT_WORDS);
      memory.setDriven(record.driven, onCurve(record, begin, end));
    }
    node = next;
    frame = own;
    begin = end;
  }
}

template <typename N, typename Memory>
void evaluateLinear(const RigBlob& rig, const RigDriver& driver, Memory& memory) {
  const auto linear = rig.at<RigLinear>(driver.data);
  const N zero(0.0f), one(1.0f);
  Transform<N> sum{{{one, zero, zero}, {zero, one, zero}, {zero, zero, one}}, {zero, zero, zero}};
  for (std::size_t i = 0; i < driver.count; ++i) {
    const auto term =
        rig.at<RigTerm>(driver.data + abi::RIG_LINEAR_WORDS + i * abi::RIG_TERM_WORDS);
    const N weight = memory.weight(term.weight);
    const Transform<N> matrix = transformFrom<N>(term.matrix);
    sum.linear = {sum.linear.r0 + matrix.linear.r0 * weight,
                  sum.linear.r1 + matrix.linear.r1 * weight,
                  sum.linear.r2 + matrix.linear.r2 * weight};
    sum.shift = sum.shift + matrix.shift * weight;
  }
  setRelative(linear.driven, linear.parent, sum, memory);
}

/// `rotations` and `basis` are scratch: for the inputs of any corrective, and for its examples.
template <typename N, typename Memory>
void evaluateDrivers(const RigBlob& rig, std::span<Quat<N>> rotations, std::span<N> basis,
                     Memory& memory) {
  for (std::size_t number = 0; number < rig.header.driverCount; ++number) {
    const RigDriver driver = rig.driver(number);
    switch (driver.kind) {
      case abi::RIG_TWIST:
        evaluateTwist<N>(rig.at<RigTwist>(driver.data), memory);
        break;
      case abi::RIG_CORRECTIVE:
        evaluateCorrective<N>(rig, driver.data, rotations, basis, memory);
        break;
      case abi::RIG_CHAIN:
        evaluateChain<N>(rig, driver, memory);
        break;
      default:
        evaluateLinear<N>(rig, driver, memory);
    }
  }
}
