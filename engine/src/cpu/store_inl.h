// The last stages: encodes the attributes of a tile, and stores them in the output.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>
#include <utility>

#include "cpu/dense_inl.h"
#include "cpu/encode_inl.h"
#include "cpu/tile_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Whether the words of an attribute are not its components.
inline bool isEncoded(Stream stream, VertexFormat format) {
  return format != VertexFormat::none && format != VertexFormat::float32x3 &&
         (stream != Stream::tangents || format != VertexFormat::float32x4);
}

/// Replaces the components of an attribute by its words.
template <Stream stream, class D>
HWY_NOINLINE HWY_ATTR void encodeStream(D d, VertexFormat format, std::size_t units,
                                        Vec<D> (*slots)[slotCount]) {
  for (std::size_t unit = 0; unit < units; ++unit) {
    Vec<D>* const own = slots[unit] + static_cast<std::size_t>(stream) * 4;
    const Vec3<D> v{own[0], own[1], own[2]};
    Encoded<D> encoded;
    if constexpr (stream == Stream::positions) {
      encoded = encodePosition(d, format, v);
    } else if constexpr (stream == Stream::normals) {
      encoded = encodeNormal(d, format, v);
    } else {
      encoded = encodeTangent(d, format, v, own[3]);
    }
    for (std::size_t k = 0; k < 4; ++k) own[k] = hn::BitCast(d, encoded.words[k]);
  }
}

/// Replaces the components of all attributes by their words.
template <class D>
DERMIS_INLINE void encodeUnits(D d, const VertexPlaces& places, std::size_t units,
                               Vec<D> (*slots)[slotCount]) {
  const auto encode = [&](auto stream) HWY_ATTR {
    if (isEncoded(stream(), places[stream()].format))
      encodeStream<stream()>(d, places[stream()].format, units, slots);
  };
  encode(std::integral_constant<Stream, Stream::positions>());
  encode(std::integral_constant<Stream, Stream::normals>());
  encode(std::integral_constant<Stream, Stream::tangents>());
}

/// Copies the positions of vertices `first` to `end` to their previous positions.
inline void keepPositions(const Task& task, const TaskInstance& instance, std::size_t first,
                          std::size_t end) {
  const OutputAttribute &from = task.places[Stream::positions],
                        &to = task.places[Stream::previousPositions];
  copyLanes(instance.outputs[Stream::previousPositions], to.stride,
            instance.outputs[Stream::positions], from.stride, formatSize(from.format), first, end);
}

/// The positions in the output, which become the previous ones. `at`: of the tile's first vertex of
/// each instance, or of a lone one's first vertices.
template <class D>
struct Kept {
  const std::byte* at[hn::MaxLanes(D())];
  std::size_t stride;
  std::uint32_t words;
  HWY_ALIGN float restarts[hn::MaxLanes(D())];  ///< 1 for lanes that keep the new positions
};

/// Loads two to four words for each block, from `at[4 i]` for block i, `offset` bytes on.
DERMIS_INLINE Vec<Four> loadWords(Four d, const std::byte* const* at, std::size_t offset,
                                  std::uint32_t words) {
  const hn::FixedTag<std::uint8_t, 16> bytes;
  const hn::Half<decltype(bytes)> half;
  const auto* const from = reinterpret_cast<const std::uint8_t*>(at[0] + offset);
  if (words == 4) return hn::BitCast(d, hn::LoadU(bytes, from));
  const Vec<Four> low = hn::BitCast(d, hn::ZeroExtendVector(bytes, hn::LoadU(half, from)));
  if (words == 2) return low;
  float last;
  std::memcpy(&last, from + 8, sizeof(last));
  return hn::ConcatLowerLower(d, hn::Set(d, last), low);
}
#if HWY_MAX_BYTES >= 32
template <class D>
DERMIS_INLINE Vec<D> loadWords(D d, const std::byte* const* at, std::size_t offset,
                               std::uint32_t words) {
  const hn::Half<D> half;
  return hn::Combine(d, loadWords(half, at + hn::MaxLanes(half), offset, words),
                     loadWords(half, at, offset, words));
}
#endif

/// Puts the kept positions of a unit, whose words have been made, into its slots. `offset`: bytes
/// from the tile's first unit.
template <class D>
DERMIS_INLINE void keepUnit(D d, const Kept<D>& kept, std::size_t offset, Vec<D>* slots) {
  Vec<D> v[4];
  for (std::size_t k = 0; k < 4; ++k) v[k] = loadWords(d, kept.at + k, offset, kept.words);
  transpose4(d, v[0], v[1], v[2], v[3]);
  const auto restarts = hn::Ne(hn::Load(d, kept.restarts), hn::Zero(d));
  constexpr auto first = static_cast<std::size_t>(Stream::previousPositions) * 4;
  for (std::size_t k = 0; k < 4; ++k) slots[first + k] = hn::IfThenElse(restarts, slots[k], v[k]);
}

/// Numbers of the slots that the words of a vertex come from.
struct Shape {
  std::uint8_t count, slot[10];
};
/// Those of usual dense vertices.
inline constexpr Shape shapes[] = {
    {3, {0, 1, 2}},                          // float32x3
    {6, {0, 1, 2, 4, 5, 6}},                 // with normals in float32x3
    {10, {0, 1, 2, 4, 5, 6, 8, 9, 10, 11}},  // and tangents in float32x4
    {9, {0, 1, 2, 4, 5, 6, 12, 13, 14}},     // or previous positions
    {3, {0, 1, 4}},                          // float16x4 + octahedral16x2
    {5, {0, 1, 2, 3, 4}},                    // float32x4 + octahedral16x2
};

/// Attributes that are side by side in every instance, so that they are stored at once.
struct Record {
  Stream stream{};                        ///< of the first
  std::uint32_t bytes = 0;                ///< more than 4 only in whole words
  std::uint32_t slots = 0;                ///< number of `slot`
  bool isDense = false;                   ///< whole words, and nothing between two vertices
  std::size_t shape = std::size(shapes);  ///< of a company's dense vertices, if it is there
  std::uint8_t slot[slotCount] = {};      ///< in the order of words
  /// Of eight dense vertices: how many floats after the slots of the first each word's vector is.
  std::uint16_t words[blockVertices * slotCount] = {};
};

struct Records {
  Record all[streamCount];
  std::size_t count = 0;
  bool keepsPositions = false;  ///< the records have previous positions
};

inline Records recordsOf(const VertexPlaces& places, const TaskInstance* const* instances,
                         std::size_t instanceCount, std::size_t lanes) {
  Records records;
  records.keepsPositions =
      places.hasMotion() && formatSize(places[Stream::positions].format) % 4 == 0;
  for (std::size_t number = 0; number < streamCount; ++number) {
    const auto stream = static_cast<Stream>(number);
    const OutputAttribute& attribute = places[stream];
    if (attribute.format == VertexFormat::none) continue;
    if (stream == Stream::previousPositions && !records.keepsPositions) continue;
    const std::uint32_t bytes = formatSize(attribute.format);
    const auto follows = [&](const Record& record) {
      if (record.bytes % 4 != 0 || bytes % 4 != 0 ||
          places[record.stream].stride != attribute.stride)
        return false;
      return std::all_of(instances, instances + instanceCount, [&](const TaskInstance* instance) {
        return instance->outputs[stream] == instance->outputs[record.stream] + record.bytes;
      });
    };
    if (records.count == 0 || !follows(records.all[records.count - 1])) {
      records.all[records.count++].stream = stream;
    }
    Record& record = records.all[records.count - 1];
    record.bytes += bytes;
    for (std::uint32_t k = 0; k < (bytes + 3) / 4; ++k)
      record.slot[record.slots++] =
          static_cast<std::uint8_t>(static_cast<std::size_t>(stream) * 4 + k);
  }
  for (Record& record : std::span(records.all).first(records.count)) {
    const auto isAligned = [&](const TaskInstance* instance) {
      return reinterpret_cast<std::uintptr_t>(instance->outputs[record.stream]) % 4 == 0;
    };
    record.isDense = record.bytes == places[record.stream].stride && record.bytes % 4 == 0 &&
                     std::all_of(instances, instances + instanceCount, isAligned);
    const auto isShape = [&](const Shape& shape) {
      return std::equal(shape.slot, shape.slot + shape.count, record.slot,
                        record.slot + record.slots);
    };
    record.shape =
        static_cast<std::size_t>(std::find_if(shapes, std::end(shapes), isShape) - shapes);
    for (std::uint32_t word = 0; lanes > 1 && word < record.slots * blockVertices; ++word) {
      const std::size_t vertex = word / record.slots;
      record.words[word] = static_cast<std::uint16_t>(
          (vertex * std::size(record.slot) + record.slot[word % record.slots]) * lanes);
    }
  }
  return records;
}

/// Stores the first `size` bytes of a block.
template <std::size_t size>
DERMIS_INLINE void storeQuad(Vec<Four> value, std::byte* to) {
  const hn::FixedTag<std::uint8_t, 16> bytes;
  auto* const memory = reinterpret_cast<std::uint8_t*>(to);
  if constexpr (size == 16) {
    hn::StoreU(hn::BitCast(bytes, value), bytes, memory);
  } else if constexpr (size == 8 || size == 12) {
    const hn::Half<decltype(bytes)> half;
    hn::StoreU(hn::LowerHalf(half, hn::BitCast(bytes, value)), half, memory);
    if constexpr (size == 12) {
      const float last = hn::ExtractLane(value, 2);
      std::memcpy(memory + 8, &last, 4);
    }
  } else {
    HWY_ALIGN float words[4];
    hn::Store(value, Four(), words);
    std::memcpy(memory, words, size);
  }
}

/// Stores the first `size` bytes of each block: block i to `to[i * step]`, `offset` bytes on.
template <std::size_t size, std::size_t step>
DERMIS_INLINE void storeEach(Four, Vec<Four> value, std::byte* const* to, std::size_t offset) {
  storeQuad<size>(value, to[0] + offset);
}
#if HWY_MAX_BYTES >= 32
template <std::size_t size, std::size_t step, class D>
DERMIS_INLINE void storeEach(D, Vec<D> value, std::byte* const* to, std::size_t offset) {
  const hn::Half<D> half;
  storeEach<size, step>(half, hn::LowerHalf(half, value), to, offset);
  storeEach<size, step>(half, hn::UpperHalf(half, value), to + hn::MaxLanes(half) / 4 * step,
                        offset);
}
#endif

/// Four slots, or fewer of a record's last, that are side by side in each vertex.
struct Quad {
  std::uint8_t slot[4];
  std::size_t bytes, offset;  ///< in the record
};

// -- Of a company. `to`: where the first vertex of each instance goes.

/// Stores words of four instances, eight at a time. `rows`: where the first lane of each word is.
DERMIS_INLINE void storeEight(const float* const* rows, float* const* to, std::size_t offset) {
#if HWY_MAX_BYTES >= 32
  const Eight d;
  const Four four;
  Vec<Eight> v[4];
  for (std::size_t k = 0; k < 4; ++k)
    v[k] = hn::Combine(d, hn::Load(four, rows[k + 4]), hn::Load(four, rows[k]));
  transpose4(d, v[0], v[1], v[2], v[3]);
  for (std::size_t k = 0; k < 4; ++k) hn::StoreU(v[k], d, to[k] + offset);
#else
  const Four d;
  for (std::size_t half = 0; half < 8; half += 4) {
    Vec<Four> v[4];
    for (std::size_t k = 0; k < 4; ++k) v[k] = hn::Load(d, rows[half + k]);
    transpose4(d, v[0], v[1], v[2], v[3]);
    for (std::size_t k = 0; k < 4; ++k) hn::StoreU(v[k], d, to[k] + offset + half);
  }
#endif
}

/// Stores eight vertices of a shape. Without a loop, so that all places are constants.
template <std::size_t number, class D>
HWY_NOINLINE HWY_ATTR void storeShape(D d, float* const* to, std::size_t offset,
                                      const Vec<D>* slots) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  constexpr const Shape& shape = shapes[number];
  const auto* const numbers = reinterpret_cast<const float*>(slots);
  float* own[lanes];
  for (std::size_t lane = 0; lane < lanes; ++lane) own[lane] = to[lane] + offset;
  const auto storeWords = [&](std::size_t word, std::size_t lane) HWY_ATTR {
    const float* rows[8];
    for (std::size_t k = 0; k < 8; ++k) {
      const std::size_t slot = shape.slot[(word + k) % shape.count];
      rows[k] = numbers + ((word + k) / shape.count * slotCount + slot) * lanes + lane;
    }
    storeEight(rows, own + lane, word);
  };
#pragma GCC unroll 16
  for (std::size_t word = 0; word < shape.count * blockVertices; word += 8) {
#pragma GCC unroll 4
    for (std::size_t lane = 0; lane < lanes; lane += 4) storeWords(word, lane);
  }
}

/// Stores eight dense vertices of each instance, whose slots are given: `offset` floats from `to`.
template <class D>
DERMIS_INLINE void storeBlock(D d, const Record& record, float* const* to, std::size_t offset,
                              const Vec<D>* slots) {
#ifndef DERMIS_CPU_SMALL
  const auto byShape = [&]<std::size_t... number>(std::index_sequence<number...>) HWY_ATTR {
    return ((record.shape == number && (storeShape<number>(d, to, offset, slots), true)) || ...);
  };
  if (byShape(std::make_index_sequence<std::size(shapes)>())) return;
#endif
  const auto* const numbers = reinterpret_cast<const float*>(slots);
  const std::size_t words = record.slots * blockVertices;
  for (std::size_t word = 0; word < words; word += 8) {
    const float* rows[8];
    for (std::size_t k = 0; k < 8; ++k) rows[k] = numbers + record.words[word + k];
    for (std::size_t lane = 0; lane < hn::MaxLanes(d); lane += 4) {
      const float* own[8];
      for (std::size_t k = 0; k < 8; ++k) own[k] = rows[k] + lane;
      storeEight(own, to + lane, offset + word);
    }
  }
}

/// Stores a quad of the vertices in the range.
template <std::size_t size, class D>
HWY_NOINLINE HWY_ATTR void storeCompany(D d, const Quad& quad, std::size_t stride,
                                        std::byte* const* to, const VertexRange& range,
                                        const Tile<D>& tile) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  for (std::size_t vertex = range.first; vertex < range.end; ++vertex) {
    const Vec<D>* const slots = tile.slots[vertex];
    const std::size_t offset = vertex * stride + quad.offset;
    if constexpr (size > 4) {
      Vec<D> v[4];
      for (std::size_t k = 0; k < 4; ++k) v[k] = slots[quad.slot[k]];
      transpose4(d, v[0], v[1], v[2], v[3]);
      for (std::size_t k = 0; k < 4; ++k) storeEach<size, 4>(d, v[k], to + k, offset);
    } else {
      HWY_ALIGN float words[lanes];
      hn::Store(slots[quad.slot[0]], d, words);
      for (std::size_t lane = 0; lane < lanes; ++lane)
        std::memcpy(to[lane] + offset, words + lane, size);
    }
  }
}

// -- Of a lone instance. `to`: where its first vertex goes.

/// Stores a quad of the vertices of whole units. `isDense`: a vertex may be stored with some bytes
/// after it, which the next one overwrites.
template <std::size_t size, bool isDense, class D>
HWY_NOINLINE HWY_ATTR void storeLone(D d, const Quad& quad, std::size_t stride, std::byte* to,
                                     std::size_t first, std::size_t end, const Tile<D>& tile) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const std::size_t step = lanes * stride;
  std::byte* places[lanes / 4];
  for (std::size_t i = 0; i < lanes / 4; ++i)
    places[i] = to + first * step + i * 4 * stride + quad.offset;
  const auto [a, b, c, e] = quad.slot;
  for (std::size_t unit = first; unit < end; ++unit) {
    const Vec<D>* const slots = tile.slots[unit];
    if constexpr (size > 4) {
      Vec<D> v0 = slots[a], v1 = slots[b], v2 = slots[c], v3 = slots[e];
      transpose4(d, v0, v1, v2, v3);
      constexpr std::size_t most = isDense ? 16 : size;
      storeEach<most, 1>(d, v0, places, 0);
      storeEach<most, 1>(d, v1, places, stride);
      storeEach<most, 1>(d, v2, places, 2 * stride);
      storeEach<size, 1>(d, v3, places, 3 * stride);
    } else if constexpr (isDense) {
      storeEach<16, 1>(d, slots[a], places, 0);
    } else {
      HWY_ALIGN float words[lanes];
      hn::Store(slots[a], d, words);
      for (std::size_t lane = 0; lane < lanes; ++lane)
        std::memcpy(places[lane / 4] + lane % 4 * stride, words + lane, size);
    }
    for (std::byte*& next : places) next += step;
  }
}

/// Stores a quad of those vertices of a unit that are in the range.
template <class D>
HWY_NOINLINE HWY_ATTR void storeSome(D d, const Quad& quad, std::size_t stride, std::byte* to,
                                     std::size_t unit, const VertexRange& range,
                                     const Tile<D>& tile) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  Vec<D> words[4];
  for (std::size_t k = 0; k < 4; ++k) words[k] = tile.slots[unit][quad.slot[k]];
  transpose4(d, words[0], words[1], words[2], words[3]);
  HWY_ALIGN float all[4][lanes];
  for (std::size_t vertex = 0; vertex < 4; ++vertex) hn::Store(words[vertex], d, all[vertex]);
  for (std::size_t lane = 0; lane < lanes; ++lane) {
    const std::size_t number = unit * lanes + lane;
    if (number < range.first || number >= range.end) continue;
    std::memcpy(to + number * stride + quad.offset, all[lane % 4] + lane / 4 * 4, quad.bytes);
  }
}

/// Calls `store` with the number of words of a dense vertex as a constant. Returns whether
/// `storeDense` can store so many.
template <class Store>
DERMIS_INLINE bool byDenseSize(const Record& record, const Store& store) {
  switch (record.isDense ? record.slots : 0) {
    case 3:
      store(std::integral_constant<std::size_t, 3>());
      return true;
    case 5:
      store(std::integral_constant<std::size_t, 5>());
      return true;
    case 6:
      store(std::integral_constant<std::size_t, 6>());
      return true;
    case 10:
      store(std::integral_constant<std::size_t, 10>());
      return true;
    default:
      return false;
  }
}

/// Stores the dense vertices of whole units.
template <class D>
HWY_NOINLINE HWY_ATTR void storeDenseUnits(D d, const Record& record, float* to,
                                           const Vec<D> (*slots)[slotCount], std::size_t units) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  byDenseSize(record, [&](auto count) HWY_ATTR {
    for (std::size_t unit = 0; unit < units; ++unit) {
      Vec<D> words[count()];
      for (std::size_t k = 0; k < count(); ++k) words[k] = slots[unit][record.slot[k]];
      float* places[lanes / 4];
      for (std::size_t i = 0; i < lanes / 4; ++i) places[i] = to + (unit * lanes + i * 4) * count();
      storeDense(d, words, places);
    }
  });
}

// -- Of both.

/// Calls `store` with each quad of a record.
template <class Store>
DERMIS_INLINE void forQuads(const Record& record, const Store& store) {
  for (std::size_t first = 0; first < record.slots; first += 4) {
    Quad quad{{}, std::min<std::size_t>(record.bytes - first * 4, 16), first * 4};
    for (std::size_t k = 0; k < 4; ++k)
      quad.slot[k] = record.slot[std::min<std::size_t>(first + k, record.slots - 1)];
    store(quad);
  }
}

/// Stores the vertices of a company's tile. `to`: where the first vertex of each instance goes.
template <class D>
inline HWY_ATTR void storeRecord(D d, const Record& record, std::size_t stride,
                                 std::byte* const* to, const VertexRange& range,
                                 const Tile<D>& tile) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const auto storeSome = [&](const VertexRange& some) HWY_ATTR {
    if (some.first >= some.end) return;
    forQuads(record, [&](const Quad& quad) HWY_ATTR {
      bySize(static_cast<std::uint32_t>(quad.bytes),
             [&](auto size) HWY_ATTR { storeCompany<size()>(d, quad, stride, to, some, tile); });
    });
  };
  if (!record.isDense) return storeSome(range);
  const std::size_t block = (range.first + blockVertices - 1) / blockVertices * blockVertices;
  const std::size_t end = std::max(block, range.end / blockVertices * blockVertices);
  storeSome({range.first, std::min(range.end, block)});
  float* places[lanes];
  for (std::size_t i = 0; i < lanes; ++i) places[i] = reinterpret_cast<float*>(to[i]);
  for (std::size_t vertex = block; vertex < end; vertex += blockVertices)
    storeBlock(d, record, places, vertex * record.slots, tile.slots[vertex]);
  storeSome({std::max(range.first, end), range.end});
}

/// Stores the vertices of a lone instance's tile. `to`: where the first one goes.
template <class D>
inline HWY_ATTR void storeRecord(D d, const Record& record, std::size_t stride, std::byte* to,
                                 const VertexRange& range, const Tile<D>& tile) {
  constexpr std::size_t lanes = hn::MaxLanes(d);
  const std::size_t whole = (range.first + lanes - 1) / lanes;
  const std::size_t wholeEnd = std::max(whole, range.end / lanes);
  const bool isStored = byDenseSize(record, [](auto) {});
  if (isStored) {
    float* const first = reinterpret_cast<float*>(to) + whole * lanes * record.slots;
    storeDenseUnits(d, record, first, tile.slots + whole, wholeEnd - whole);
  }
  forQuads(record, [&](const Quad& quad) HWY_ATTR {
    if (range.first != whole * lanes)
      storeSome(d, quad, stride, to, range.first / lanes, range, tile);
    if (!isStored) {
      bySize(static_cast<std::uint32_t>(quad.bytes), [&](auto size) HWY_ATTR {
        if (size() % 4 == 0 && stride == size()) {
          storeLone<size(), size() < 16>(d, quad, stride, to, whole, wholeEnd, tile);
        } else {
          storeLone<size(), false>(d, quad, stride, to, whole, wholeEnd, tile);
        }
      });
    }
    if (range.end > wholeEnd * lanes) storeSome(d, quad, stride, to, wholeEnd, range, tile);
  });
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
