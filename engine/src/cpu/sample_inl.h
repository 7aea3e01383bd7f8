// Samples figures. Each operation rounds as in core's clips/sample.cpp, and they have the same
// order, so that the bits are the same. Keys of the same size are decoded together, whatever their
// tracks and layers are; then the layers of several nodes are blended together.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>

#include "attribute.h"
#include "cpu/clip_plan.h"
#include "cpu/simd_inl.h"
#include "strict_floating_point.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

using WideBits = hn::RebindToUnsigned<Wide>;
inline constexpr std::size_t wideLanes = hn::MaxLanes(Wide());

// -- Keys.

/// Finds the rows of each class of a clip at a time.
inline HWY_ATTR void findRows(const PlanClip& clip, float time, ClassTime* times) {
  const float frame = time * clip.rate;
  for (std::size_t i = 0; i < clip.classes.size(); ++i) {
    const PlanClass& keys = clip.classes[i];
    const float position = frame * keys.scale;
    // Positions are not negative, so that this is the floor.
    const auto row = static_cast<std::int32_t>(std::min(position, keys.last));
    const std::byte* const from = keys.keys + keys.rowBytes * static_cast<std::uint32_t>(row);
    times[i] = {from, from + keys.rowBytes, position - static_cast<float>(row),
                static_cast<std::uint32_t>(row)};
  }
}

/// Copies the keys of a clip's tracks to the others of their size. `locals`: of the layer.
inline HWY_ATTR void gatherKeys(const ClipPlan& plan, const PlanTracks& tracks, bool areVectors,
                                const ClassTime* times, float* locals, KeyBatch& batch) {
  const std::size_t first = batch.count, count = tracks.tracks.size();
  std::uint64_t* const from = batch.from.data() + first;
  std::uint64_t* const to = batch.to.data() + first;
  float* const fractions = batch.fractions.data() + first;
  float** const places = batch.places.data() + first;
  for (std::size_t i = 0; i < count; ++i) {
    const PlanTrack& track = tracks.tracks[i];
    const ClassTime& time = times[track.keyClass];
    std::memcpy(from + i, time.from + track.key, sizeof(*from));
    std::memcpy(to + i, time.to + track.key, sizeof(*to));
    fractions[i] = time.fraction;
    places[i] = locals + track.place;
  }
  if (areVectors) {
    for (std::size_t i = 0; i < count; ++i) {
      batch.ranges[first + i] =
          reinterpret_cast<const float*>(plan.words.data() + tracks.tracks[i].range);
    }
  }
  const auto* const bytes = reinterpret_cast<const unsigned char*>(plan.words.data());
  for (const PlanJumps& track : tracks.jumps) {
    const std::uint32_t jump = bytes[track.jumps + track.rowBytes * times[track.keyClass].row];
    // The jump is at (jump + 1) / 256.
    if (jump != 0) {
      float& fraction = fractions[track.track];
      fraction = fraction * 256 >= static_cast<float>(jump + 1) ? 1.0f : 0.0f;
    }
  }
  batch.count += count;
}

/// 64 bits for each lane, whose last are those of its key.
struct WideKeys {
  hn::Vec<WideBits> low, high;
};

DERMIS_INLINE WideKeys loadKeys(const std::uint64_t* keys) {
  const WideBits d;
  const auto* const words = reinterpret_cast<const std::uint32_t*>(keys);
  const auto first = hn::LoadU(d, words), second = hn::LoadU(d, words + wideLanes);
  return {hn::ConcatEven(d, second, first), hn::ConcatOdd(d, second, first)};
}

DERMIS_INLINE Vec<Wide> numberOf(hn::Vec<WideBits> bits) {
  const hn::RebindToSigned<Wide> di;
  return hn::ConvertTo(Wide(), hn::BitCast(di, bits));
}

template <int from>
DERMIS_INLINE hn::Vec<WideBits> bitsFrom(hn::Vec<WideBits> word, std::uint32_t mask) {
  return hn::And(hn::ShiftRight<from>(word), hn::Set(WideBits(), mask));
}

/// The three integers of a key.
template <std::uint32_t size, bool isRotation>
DERMIS_INLINE Vec3<Wide> integersOf(const WideKeys& key) {
  [[maybe_unused]] const WideBits d;
  if constexpr (size == 0) {
    return {numberOf(bitsFrom<0>(key.high, 1023)), numberOf(bitsFrom<10>(key.high, 1023)),
            numberOf(bitsFrom<20>(key.high, 1023))};
  } else if constexpr (size == 1) {
    const std::uint32_t mask = isRotation ? 0x7fff : 0xffff;
    return {numberOf(bitsFrom<16>(key.low, mask)), numberOf(bitsFrom<0>(key.high, mask)),
            numberOf(bitsFrom<16>(key.high, mask))};
  } else if constexpr (isRotation) {
    const auto middle = hn::Or(bitsFrom<20>(key.low, 1023),
                               hn::ShiftLeft<10>(hn::And(key.high, hn::Set(d, 1023u))));
    return {numberOf(bitsFrom<0>(key.low, 0xfffff)), numberOf(middle),
            numberOf(bitsFrom<10>(key.high, 0xfffff))};
  } else {
    const auto middle = hn::Or(hn::ShiftRight<21>(key.low),
                               hn::ShiftLeft<11>(hn::And(key.high, hn::Set(d, 1023u))));
    return {numberOf(bitsFrom<0>(key.low, 0x1fffff)), numberOf(middle),
            numberOf(bitsFrom<10>(key.high, 0x1fffff))};
  }
}

template <class D>
DERMIS_INLINE Vec<D> dot4(const Vec4<D>& a, const Vec4<D>& b) {
  return hn::Add(hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z)),
                 hn::Mul(a.w, b.w));
}

/// (0, 0, 0, 1) if the length is 0.
template <class D>
DERMIS_INLINE Vec4<D> normalized(D d, const Vec4<D>& q) {
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f);
  const auto squared = dot4(q, q);
  const auto isGood = hn::Gt(squared, zero);
  const auto length = hn::Sqrt(squared);
  const Vec4<D> unit{hn::Div(q.x, length), hn::Div(q.y, length), hn::Div(q.z, length),
                     hn::Div(q.w, length)};
  if (HWY_LIKELY(hn::AllTrue(d, isGood))) return unit;
  return {hn::IfThenElse(isGood, unit.x, zero), hn::IfThenElse(isGood, unit.y, zero),
          hn::IfThenElse(isGood, unit.z, zero), hn::IfThenElse(isGood, unit.w, one)};
}

/// share a + other b.
template <class D>
DERMIS_INLINE Vec<D> mix(Vec<D> a, Vec<D> share, Vec<D> b, Vec<D> other) {
  return hn::Add(hn::Mul(share, a), hn::Mul(other, b));
}

/// -share where the dot product is negative.
template <class D>
DERMIS_INLINE Vec<D> toHemisphere(D d, const Vec4<D>& first, const Vec4<D>& other, Vec<D> share) {
  const auto isFar = hn::Lt(dot4(first, other), hn::Zero(d));
  return hn::Xor(share, hn::And(hn::VecFromMask(d, isFar), hn::SignBit(d)));
}

/// `yes` where the first bit is 1. As integers, since -0 is not negative on every target.
DERMIS_INLINE Vec<Wide> bySign(hn::Vec<WideBits> bits, Vec<Wide> yes, Vec<Wide> no) {
  const hn::RebindToSigned<Wide> di;
  return hn::BitCast(Wide(), hn::IfNegativeThenElse(hn::BitCast(di, bits), hn::BitCast(di, yes),
                                                    hn::BitCast(di, no)));
}

/// The quaternion of a key.
template <std::uint32_t size>
DERMIS_INLINE Vec4<Wide> quaternionOf(const WideKeys& key) {
  const Wide d;
  constexpr float step =
      2 * rootOfHalf / static_cast<float>(KeyFormat{.isRotation = true, .size = size}.largest());
  const auto unit = hn::Set(d, step), root = hn::Set(d, rootOfHalf);
  Vec3<Wide> v = integersOf<size, true>(key);
  v = {hn::Sub(hn::Mul(v.x, unit), root), hn::Sub(hn::Mul(v.y, unit), root),
       hn::Sub(hn::Mul(v.z, unit), root)};
  const auto other = hn::Sqrt(hn::Max(hn::Zero(d), hn::Sub(hn::Set(d, 1.0f), dot3(v, v))));
  // The two bits of the missing component, as signs.
  const auto high = size == 0 ? key.high : size == 1 ? hn::ShiftLeft<16>(key.high) : key.low;
  const auto low = size == 0   ? hn::ShiftLeft<1>(key.high)
                   : size == 1 ? key.low
                               : hn::ShiftLeft<1>(key.low);
  return {bySign(hn::Or(high, low), v.x, other), bySign(high, v.y, bySign(low, other, v.x)),
          bySign(high, bySign(low, v.z, other), v.y), bySign(hn::And(high, low), other, v.z)};
}

/// Interpolates the rotations of a batch.
template <std::uint32_t size>
inline HWY_ATTR void sampleRotations(const KeyBatch& batch) {
  const Wide d;
  for (std::size_t i = 0; i < batch.count; i += wideLanes) {
    const Vec4<Wide> a = quaternionOf<size>(loadKeys(batch.from.data() + i));
    const Vec4<Wide> b = quaternionOf<size>(loadKeys(batch.to.data() + i));
    const auto fraction = hn::LoadU(d, batch.fractions.data() + i);
    const auto share = hn::Sub(hn::Set(d, 1.0f), fraction);
    const auto other = toHemisphere(d, a, b, fraction);
    const Vec4<Wide> q{mix<Wide>(a.x, share, b.x, other), mix<Wide>(a.y, share, b.y, other),
                       mix<Wide>(a.z, share, b.z, other), mix<Wide>(a.w, share, b.w, other)};
    scatterRows(d, normalized(d, q), batch.places.data() + i, 0);
  }
}

/// Interpolates the vectors of a batch, whose coordinates are `apart` floats apart.
template <std::uint32_t size>
inline HWY_ATTR void sampleVectors(const KeyBatch& batch, std::size_t apart) {
  const Wide d;
  HWY_ALIGN float results[3][wideLanes];
  for (std::size_t i = 0; i < batch.count; i += wideLanes) {
    const Vec3<Wide> from = integersOf<size, false>(loadKeys(batch.from.data() + i));
    const Vec3<Wide> to = integersOf<size, false>(loadKeys(batch.to.data() + i));
    const Vec4<Wide> least = gatherRows(d, batch.ranges.data() + i, 0);
    const Vec4<Wide> steps = gatherRows(d, batch.ranges.data() + i, 4);
    const auto fraction = hn::LoadU(d, batch.fractions.data() + i);
    const auto share = hn::Sub(hn::Set(d, 1.0f), fraction);
    const auto between = [&](Vec<Wide> a, Vec<Wide> b, Vec<Wide> low, Vec<Wide> step) HWY_ATTR {
      return mix<Wide>(hn::Add(low, hn::Mul(a, step)), share, hn::Add(low, hn::Mul(b, step)),
                       fraction);
    };
    hn::Store(between(from.x, to.x, least.x, steps.x), d, results[0]);
    hn::Store(between(from.y, to.y, least.y, steps.y), d, results[1]);
    hn::Store(between(from.z, to.z, least.z, steps.z), d, results[2]);
    for (std::size_t lane = 0; lane < std::min(wideLanes, batch.count - i); ++lane) {
      float* const place = batch.places[i + lane];
      place[0] = results[0][lane];
      place[apart] = results[1][lane];
      place[2 * apart] = results[2][lane];
    }
  }
}

// -- Nodes.

struct LayerLocals {
  const float* locals;
  const float* mask;  ///< null: ones
  float weight;
};

struct BlendTask {
  const ClipPlan& plan;
  std::span<const LayerLocals> blended, added;
  float* matrices;  ///< of nodes: 3×4
};

/// Local transforms of as many nodes as vectors have lanes.
struct WideLocals {
  Vec3<Wide> translation;
  Vec4<Wide> rotation;
  Vec3<Wide> scale;
};

DERMIS_INLINE WideLocals loadLocals(const PlanLocals& layout, const float* locals,
                                    std::size_t node) {
  const Wide d;
  const float* const t = locals + layout.translations() + node;
  const float* const s = locals + layout.scales() + node;
  const std::size_t apart = layout.padded;
  return {{hn::LoadU(d, t), hn::LoadU(d, t + apart), hn::LoadU(d, t + 2 * apart)},
          loadRows(d, locals + layout.rotations() + 4 * node, 4),
          {hn::LoadU(d, s), hn::LoadU(d, s + apart), hn::LoadU(d, s + 2 * apart)}};
}

template <class M>
DERMIS_INLINE WideLocals choose(M mask, const WideLocals& yes, const WideLocals& no) {
  return {choose3<M, Wide>(mask, yes.translation, no.translation),
          {hn::IfThenElse(mask, yes.rotation.x, no.rotation.x),
           hn::IfThenElse(mask, yes.rotation.y, no.rotation.y),
           hn::IfThenElse(mask, yes.rotation.z, no.rotation.z),
           hn::IfThenElse(mask, yes.rotation.w, no.rotation.w)},
          choose3<M, Wide>(mask, yes.scale, no.scale)};
}

/// sum + share local, with the rotation in the hemisphere of `first`.
DERMIS_INLINE WideLocals mixLocals(const WideLocals& sum, const WideLocals& local, Vec<Wide> share,
                                   Vec<Wide> turn) {
  const auto add = [](Vec<Wide> to, Vec<Wide> what, Vec<Wide> factor)
                       HWY_ATTR { return hn::Add(to, hn::Mul(factor, what)); };
  return {
      {add(sum.translation.x, local.translation.x, share),
       add(sum.translation.y, local.translation.y, share),
       add(sum.translation.z, local.translation.z, share)},
      {add(sum.rotation.x, local.rotation.x, turn), add(sum.rotation.y, local.rotation.y, turn),
       add(sum.rotation.z, local.rotation.z, turn), add(sum.rotation.w, local.rotation.w, turn)},
      {add(sum.scale.x, local.scale.x, share), add(sum.scale.y, local.scale.y, share),
       add(sum.scale.z, local.scale.z, share)}};
}

DERMIS_INLINE Vec<Wide> weightOf(const LayerLocals& layer, std::size_t node) {
  const Wide d;
  const auto weight = hn::Set(d, layer.weight);
  return layer.mask == nullptr ? weight : hn::Mul(weight, hn::LoadU(d, layer.mask + node));
}

/// The weighted mean of the layers that are not additive.
DERMIS_INLINE WideLocals blend(const BlendTask& task, std::size_t node) {
  const Wide d;
  const PlanLocals& layout = task.plan.locals;
  const auto zero = hn::Zero(d);
  auto weights = zero;
  for (const LayerLocals& layer : task.blended) weights = hn::Add(weights, weightOf(layer, node));
  const auto isBlended = hn::Gt(weights, zero);
  const float* const rest = numbersOf(task.plan.rest.data());
  if (hn::AllFalse(d, isBlended)) return loadLocals(layout, rest, node);
  WideLocals sum{{zero, zero, zero}, {zero, zero, zero, zero}, {zero, zero, zero}};
  Vec4<Wide> first = sum.rotation;
  auto isFirst = hn::Eq(zero, zero);
  for (const LayerLocals& layer : task.blended) {
    const auto weight = weightOf(layer, node);
    const auto takesPart = hn::Gt(weight, zero);
    if (hn::AllFalse(d, takesPart)) continue;
    const auto share = hn::Div(weight, weights);
    const WideLocals local = loadLocals(layout, layer.locals, node);
    // A rotation is in its own hemisphere.
    first = {hn::IfThenElse(isFirst, local.rotation.x, first.x),
             hn::IfThenElse(isFirst, local.rotation.y, first.y),
             hn::IfThenElse(isFirst, local.rotation.z, first.z),
             hn::IfThenElse(isFirst, local.rotation.w, first.w)};
    const auto turn = toHemisphere(d, first, local.rotation, share);
    const WideLocals mixed = mixLocals(sum, local, share, turn);
    if (HWY_LIKELY(hn::AllTrue(d, takesPart))) {
      sum = mixed;
      isFirst = hn::Lt(zero, zero);
    } else {
      sum = choose(takesPart, mixed, sum);
      isFirst = hn::AndNot(takesPart, isFirst);
    }
  }
  sum.rotation = normalized(d, sum.rotation);
  if (HWY_LIKELY(hn::AllTrue(d, isBlended))) return sum;
  return choose(isBlended, sum, loadLocals(layout, rest, node));
}

DERMIS_INLINE void addDifference(WideLocals& local, const WideLocals& difference,
                                 Vec<Wide> weight) {
  const Wide d;
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f), minusOne = hn::Set(d, -1.0f);
  Vec4<Wide> turn = difference.rotation;
  const auto isFar = hn::Lt(turn.w, zero);
  const auto negated = [&](Vec<Wide> x) HWY_ATTR {
    return hn::IfThenElse(isFar, hn::Add(hn::Mul(minusOne, x), zero), x);
  };
  turn = {negated(turn.x), negated(turn.y), negated(turn.z), negated(turn.w)};
  const auto rest = hn::Sub(one, weight);
  const auto none = hn::Mul(rest, zero);
  const Vec4<Wide> t = normalized(
      d, Vec4<Wide>{hn::Add(none, hn::Mul(weight, turn.x)), hn::Add(none, hn::Mul(weight, turn.y)),
                    hn::Add(none, hn::Mul(weight, turn.z)),
                    hn::Add(hn::Mul(rest, one), hn::Mul(weight, turn.w))});
  const Vec4<Wide> q = local.rotation;
  const auto sum = [](Vec<Wide> a, Vec<Wide> b, Vec<Wide> c, Vec<Wide> e)
                       HWY_ATTR { return hn::Sub(hn::Add(hn::Add(a, b), c), e); };
  using hn::Mul;
  local.rotation = normalized(
      d,
      Vec4<Wide>{
          sum(Mul(q.w, t.x), Mul(q.x, t.w), Mul(q.y, t.z), Mul(q.z, t.y)),
          hn::Add(hn::Add(hn::Sub(Mul(q.w, t.y), Mul(q.x, t.z)), Mul(q.y, t.w)), Mul(q.z, t.x)),
          hn::Add(hn::Sub(hn::Add(Mul(q.w, t.z), Mul(q.x, t.y)), Mul(q.y, t.x)), Mul(q.z, t.w)),
          hn::Sub(hn::Sub(hn::Sub(Mul(q.w, t.w), Mul(q.x, t.x)), Mul(q.y, t.y)), Mul(q.z, t.z))});
  const auto shifted = [&](Vec<Wide> value, Vec<Wide> by)
                           HWY_ATTR { return hn::Add(value, Mul(weight, by)); };
  const auto grown = [&](Vec<Wide> value, Vec<Wide> by) HWY_ATTR {
    return Mul(value, hn::Add(one, Mul(weight, hn::Sub(by, one))));
  };
  local.translation = {shifted(local.translation.x, difference.translation.x),
                       shifted(local.translation.y, difference.translation.y),
                       shifted(local.translation.z, difference.translation.z)};
  local.scale = {grown(local.scale.x, difference.scale.x), grown(local.scale.y, difference.scale.y),
                 grown(local.scale.z, difference.scale.z)};
}

/// Writes translation × rotation × scale.
DERMIS_INLINE void storeMatrices(const WideLocals& local, float* matrices) {
  using hn::Add, hn::Mul, hn::Sub;
  const Wide d;
  const auto one = hn::Set(d, 1.0f), two = hn::Set(d, 2.0f);
  const auto& [x, y, z, w] = local.rotation;
  const auto& [s0, s1, s2] = local.scale;
  const auto xx = Mul(x, x), yy = Mul(y, y), zz = Mul(z, z);
  const auto xy = Mul(x, y), xz = Mul(x, z), yz = Mul(y, z);
  const auto wx = Mul(w, x), wy = Mul(w, y), wz = Mul(w, z);
  storeRows(d,
            Vec4<Wide>{Mul(Sub(one, Mul(two, Add(yy, zz))), s0), Mul(Mul(two, Sub(xy, wz)), s1),
                       Mul(Mul(two, Add(xz, wy)), s2), local.translation.x},
            matrices, 12);
  storeRows(d,
            Vec4<Wide>{Mul(Mul(two, Add(xy, wz)), s0), Mul(Sub(one, Mul(two, Add(xx, zz))), s1),
                       Mul(Mul(two, Sub(yz, wx)), s2), local.translation.y},
            matrices + 4, 12);
  storeRows(d,
            Vec4<Wide>{Mul(Mul(two, Sub(xz, wy)), s0), Mul(Mul(two, Add(yz, wx)), s1),
                       Mul(Sub(one, Mul(two, Add(xx, yy))), s2), local.translation.z},
            matrices + 8, 12);
}

/// Writes the local matrices of all nodes.
inline HWY_ATTR void blendNodes(const BlendTask& task) {
  for (std::size_t node = 0; node < task.plan.locals.padded; node += wideLanes) {
    WideLocals local = blend(task, node);
    for (const LayerLocals& layer : task.added) {
      addDifference(local, loadLocals(task.plan.locals, layer.locals, node), weightOf(layer, node));
    }
    storeMatrices(local, task.matrices + 12 * node);
  }
}

// -- Matrices.

/// left × right. They have 3×4 numbers, at any address.
DERMIS_INLINE void multiply(const float* left, const float* right, float* product) {
  const Four d;
  HWY_ALIGN static constexpr std::uint32_t lastLane[4] = {0, 0, 0, ~0u};
  const hn::RebindToUnsigned<Four> du;
#if HWY_MAX_BYTES >= 32
  const Eight wide;
  const auto r0 = hn::LoadDup128(wide, right), r1 = hn::LoadDup128(wide, right + 4),
             r2 = hn::LoadDup128(wide, right + 8);
  const auto last = hn::BitCast(wide, hn::LoadDup128(hn::RebindToUnsigned<Eight>(), lastLane));
  const auto rows = hn::LoadU(wide, left);
  auto sums = hn::Add(hn::And(rows, last), hn::Mul(hn::Broadcast<0>(rows), r0));
  sums = hn::Add(sums, hn::Mul(hn::Broadcast<1>(rows), r1));
  sums = hn::Add(sums, hn::Mul(hn::Broadcast<2>(rows), r2));
  const auto row = hn::LoadU(d, left + 8);
  auto sum = hn::Add(hn::And(row, hn::LowerHalf(d, last)),
                     hn::Mul(hn::Broadcast<0>(row), hn::LowerHalf(d, r0)));
  sum = hn::Add(sum, hn::Mul(hn::Broadcast<1>(row), hn::LowerHalf(d, r1)));
  sum = hn::Add(sum, hn::Mul(hn::Broadcast<2>(row), hn::LowerHalf(d, r2)));
  hn::StoreU(sums, wide, product);
  hn::StoreU(sum, d, product + 8);
  static_cast<void>(du);
#else
  const auto last = hn::BitCast(d, hn::Load(du, lastLane));
  const auto r0 = hn::LoadU(d, right), r1 = hn::LoadU(d, right + 4), r2 = hn::LoadU(d, right + 8);
  Vec<Four> sums[3];
  for (std::size_t i = 0; i < 3; ++i) {
    const auto row = hn::LoadU(d, left + 4 * i);
    sums[i] = hn::Add(hn::And(row, last), hn::Mul(hn::Broadcast<0>(row), r0));
    sums[i] = hn::Add(sums[i], hn::Mul(hn::Broadcast<1>(row), r1));
    sums[i] = hn::Add(sums[i], hn::Mul(hn::Broadcast<2>(row), r2));
  }
  for (std::size_t i = 0; i < 3; ++i) hn::StoreU(sums[i], d, product + 4 * i);
#endif
}

/// Turns local matrices into global ones.
inline HWY_ATTR void multiplyNodes(const ClipPlan& plan, float* matrices) {
  const auto* const words = reinterpret_cast<const float*>(plan.words.data());
  for (std::size_t i = 0; i < plan.nodeCount; ++i) {
    const PlanNode node = plan.nodes[i];
    float* const matrix = matrices + 12 * i;
    if (node.fixed != 0) multiply(words + node.fixed, matrix, matrix);
    if (node.parent != noNode) multiply(matrices + std::size_t{12} * node.parent, matrix, matrix);
  }
}

inline HWY_ATTR void poseSkins(const ClipPlan& plan, const float* matrices,
                               std::span<JointMatrix> poses) {
  const auto* const words = reinterpret_cast<const float*>(plan.words.data());
  JointMatrix* pose = poses.data();
  for (const PlanSkin& skin : plan.skins) {
    const std::uint32_t* const nodes = plan.words.data() + skin.nodes;
    const float* const inverse = words + skin.matrices;
    for (std::size_t joint = 0; joint < skin.jointCount; ++joint, ++pose) {
      if (nodes[joint] == noNode) {
        std::memcpy(pose->m, inverse + 12 * joint, sizeof(pose->m));
      } else {
        multiply(matrices + std::size_t{12} * nodes[joint], inverse + 12 * joint, numbersOf(pose));
      }
    }
  }
}

// -- A figure.

/// Decodes the keys of a batch.
template <std::uint32_t size, bool isRotation>
inline HWY_ATTR void sampleBatch(KeyBatch& batch, float* unused, std::size_t apart) {
  if (batch.count == 0) return;
  // What lanes without a track write is not read.
  const std::size_t end = (batch.count + wideLanes - 1) / wideLanes * wideLanes;
  std::fill(batch.places.begin() + static_cast<std::ptrdiff_t>(batch.count),
            batch.places.begin() + static_cast<std::ptrdiff_t>(end), unused);
  if constexpr (isRotation) {
    sampleRotations<size>(batch);
  } else {
    std::fill(batch.ranges.begin() + static_cast<std::ptrdiff_t>(batch.count),
              batch.ranges.begin() + static_cast<std::ptrdiff_t>(end), batch.ranges[0]);
    sampleVectors<size>(batch, apart);
  }
}

inline HWY_ATTR void sampleFigure(const ClipPlan& plan, const PackedLayers& layers,
                                  ClipScratch& scratch, std::span<JointMatrix> poses) {
  for (KeyBatch& batch : scratch.batches) batch.count = 0;
  float* const locals = numbersOf(scratch.locals.data());
  float* const matrices = numbersOf(scratch.matrices.data());
  LayerLocals sampled[maxClipLayers];
  std::size_t blended = 0;
  for (std::uint32_t i = 0; i < layers.count; ++i) {
    const PackedLayer& layer = layers.layers[i];
    const PlanClip& clip = plan.clips[layer.clip()];
    float* const own = locals + plan.locals.size() * i;
    if (!clip.isAdditive) blended = i + 1;
    std::memcpy(own, numbersOf(clip.base.data()), plan.locals.size() * 4);
    sampled[i] = {own,
                  layer.mask() == 0
                      ? nullptr
                      : numbersOf(plan.masks.data()) + plan.locals.padded * layer.mask(),
                  fromHalf(layer.weight())};
    findRows(clip, layer.time, scratch.times.data());
    for (std::size_t format = 0; format < keyFormats; ++format) {
      if (!clip.tracks[format].tracks.empty()) {
        gatherKeys(plan, clip.tracks[format], format < 3, scratch.times.data(), own,
                   scratch.batches[format]);
      }
    }
  }
  float* const unused = locals + plan.locals.size() * maxClipLayers;
  const std::size_t apart = plan.locals.padded;
  sampleBatch<0, false>(scratch.batches[0], unused, apart);
  sampleBatch<1, false>(scratch.batches[1], unused, apart);
  sampleBatch<2, false>(scratch.batches[2], unused, apart);
  sampleBatch<0, true>(scratch.batches[3], unused, apart);
  sampleBatch<1, true>(scratch.batches[4], unused, apart);
  sampleBatch<2, true>(scratch.batches[5], unused, apart);
  const std::span<const LayerLocals> all(sampled, layers.count);
  blendNodes({plan, all.first(blended), all.subspan(blended), matrices});
  multiplyNodes(plan, matrices);
  poseSkins(plan, matrices, poses);
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
