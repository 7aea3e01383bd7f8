// The last stages: encodes the attributes of a tile, and stores them in the output.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <span>
#include <type_traits>

#include "cpu/dense_inl.h"
#include "cpu/encode_inl.h"
#include "cpu/tile_inl.h"

HWY_BEFORE_NAMESPACE();
namespace dermis::cpu::HWY_NAMESPACE {

/// Replaces the components of an attribute by its words.
template <Stream stream, class D>
HWY_NOINLINE HWY_ATTR void encodeUnits(D d, VertexFormat format, std::size_t units, Tile<D>& tile) {
  if (format == VertexFormat::none || format == VertexFormat::float32x3 ||
      (stream == Stream::tangents && format == VertexFormat::float32x4))
    return;
  for (std::size_t unit = 0; unit < units; ++unit) {
    Vec<D>* const own = tile.slots[unit] + static_cast<std::size_t>(stream) * 4;
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

/// Copies the positions of vertices `first` to `end` to their previous positions.
inline void keepPositions(const Task& task, const TaskInstance& instance, std::size_t first,
                          std::size_t end) {
  const OutputAttribute &from = task.places[Stream::positions],
                        &to = task.places[Stream::previousPositions];
  copyLanes(instance.outputs[Stream::previousPositions], to.stride,
            instance.outputs[Stream::positions], from.stride, formatSize(from.format), first, end);
}

/// Attributes that are side by side in every instance, so that they are stored at once.
struct Record {
  Stream stream{};             ///< of the first
  std::uint32_t bytes = 0;     ///< more than 4 only in whole words
  std::uint32_t slots = 0;     ///< number of `slot`
  std::uint32_t dense = 0;     ///< words of a vertex that `storeDense` can store, or 0
  std::uint8_t slot[12] = {};  ///< in the order of words
};

struct Records {
  Record all[3];
  std::size_t count = 0;
};

inline Records recordsOf(const VertexPlaces& places, const TaskInstance* const* instances,
                         std::size_t instanceCount) {
  Records records;
  for (const Stream stream : {Stream::positions, Stream::normals, Stream::tangents}) {
    const OutputAttribute& attribute = places[stream];
    if (attribute.format == VertexFormat::none) continue;
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
    const bool isDense = record.bytes == places[record.stream].stride && record.bytes % 4 == 0 &&
                         isDenseSize(record.slots);
    const auto isAligned = [&](const TaskInstance* instance) {
      return reinterpret_cast<std::uintptr_t>(instance->outputs[record.stream]) % 4 == 0;
    };
    if (isDense && std::all_of(instances, instances + instanceCount, isAligned))
      record.dense = record.slots;
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

/// Stores the first `size` bytes of each block: block i to `to[i]`, `offset` bytes on.
template <std::size_t size>
DERMIS_INLINE void storeEach(Four, Vec<Four> value, std::byte* const* to, std::size_t offset) {
  storeQuad<size>(value, to[0] + offset);
}
#if HWY_MAX_BYTES >= 32
template <std::size_t size>
DERMIS_INLINE void storeEach(Eight, Vec<Eight> value, std::byte* const* to, std::size_t offset) {
  const Four four;
  storeQuad<size>(hn::LowerHalf(four, value), to[0] + offset);
  storeQuad<size>(hn::UpperHalf(four, value), to[1] + offset);
}
#endif
#if HWY_MAX_BYTES >= 64
template <std::size_t size>
DERMIS_INLINE void storeEach(Sixteen, Vec<Sixteen> value, std::byte* const* to,
                             std::size_t offset) {
  const Eight half;
  storeEach<size>(half, hn::LowerHalf(half, value), to, offset);
  storeEach<size>(half, hn::UpperHalf(half, value), to + 2, offset);
}
#endif

/// Four slots, or fewer of a record's last, that are side by side in each vertex.
struct Quad {
  std::uint8_t slot[4];
  std::size_t bytes, offset;  ///< in the record
};

/// Stores a quad of the vertices of whole units. `to`: where the first vertex of each block goes.
/// `isDense`: a vertex may be stored with some bytes after it, which the next one overwrites.
template <bool isLone, std::size_t size, bool isDense, class D>
HWY_NOINLINE HWY_ATTR void storeUnits(D d, const Quad& quad, std::size_t stride,
                                      std::byte* const* to, std::size_t first, std::size_t end,
                                      const Tile<D>& tile) {
  const std::size_t step = unitVertices<isLone, D> * stride;
  std::byte* places[blocksOf<D>];
  for (std::size_t i = 0; i < blocksOf<D>; ++i)
    places[i] = to[isLone ? 0 : i] + first * step + (isLone ? i * 4 * stride : 0) + quad.offset;
  const auto [a, b, c, e] = quad.slot;
  for (std::size_t unit = first; unit < end; ++unit) {
    const Vec<D>* const slots = tile.slots[unit];
    if constexpr (size > 4) {
      Vec<D> v0 = slots[a], v1 = slots[b], v2 = slots[c], v3 = slots[e];
      transpose4(d, v0, v1, v2, v3);
      constexpr std::size_t most = isDense ? 16 : size;
      storeEach<most>(d, v0, places, 0);
      storeEach<most>(d, v1, places, stride);
      storeEach<most>(d, v2, places, 2 * stride);
      storeEach<size>(d, v3, places, 3 * stride);
    } else if constexpr (isDense) {
      storeEach<16>(d, slots[a], places, 0);
    } else {
      HWY_ALIGN float words[hn::MaxLanes(d)];
      hn::Store(slots[a], d, words);
      for (std::size_t lane = 0; lane < hn::MaxLanes(d); ++lane)
        std::memcpy(places[lane / 4] + lane % 4 * stride, words + lane, size);
    }
    for (std::byte*& next : places) next += step;
  }
}

/// Stores whole units of dense vertices, whose words are those of the record.
template <bool isLone, std::size_t count, class D>
HWY_NOINLINE HWY_ATTR void storeDenseUnits(D d, const Record& record, std::byte* const* to,
                                           std::size_t first, std::size_t end,
                                           const Tile<D>& tile) {
  constexpr std::size_t step = unitVertices<isLone, D> * count;
  float* places[blocksOf<D>];
  for (std::size_t i = 0; i < blocksOf<D>; ++i) {
    places[i] =
        reinterpret_cast<float*>(to[isLone ? 0 : i]) + first * step + (isLone ? i * 4 * count : 0);
  }
  for (std::size_t unit = first; unit < end; ++unit) {
    Vec<D> words[count];
    for (std::size_t k = 0; k < count; ++k) words[k] = tile.slots[unit][record.slot[k]];
    storeDense(d, words, places);
    for (float*& next : places) next += step;
  }
}

/// Stores a quad of those vertices of a unit that are in the range.
template <bool isLone, class D>
HWY_NOINLINE HWY_ATTR void storeSome(D d, const Quad& quad, std::size_t stride,
                                     std::byte* const* to, std::size_t unit,
                                     const VertexRange& range, const Tile<D>& tile) {
  Vec<D> words[4];
  for (std::size_t k = 0; k < 4; ++k) words[k] = tile.slots[unit][quad.slot[k]];
  transpose4(d, words[0], words[1], words[2], words[3]);
  HWY_ALIGN float all[4][hn::MaxLanes(d)];
  for (std::size_t vertex = 0; vertex < 4; ++vertex) hn::Store(words[vertex], d, all[vertex]);
  for (std::size_t i = 0; i < blocksOf<D>; ++i) {
    for (std::size_t vertex = 0; vertex < 4; ++vertex) {
      const std::size_t number = unit * unitVertices<isLone, D> + (isLone ? i * 4 : 0) + vertex;
      if (number < range.first || number >= range.end) continue;
      std::memcpy(to[isLone ? 0 : i] + number * stride + quad.offset, all[vertex] + i * 4,
                  quad.bytes);
    }
  }
}

/// Calls `store` with the number of words of a dense vertex as a constant.
template <class Store>
DERMIS_INLINE void byDenseSize(std::uint32_t words, const Store& store) {
  switch (words) {
    case 3:
      return store(std::integral_constant<std::size_t, 3>());
    case 5:
      return store(std::integral_constant<std::size_t, 5>());
    case 6:
      return store(std::integral_constant<std::size_t, 6>());
    case 10:
      return store(std::integral_constant<std::size_t, 10>());
    default:
      return;
  }
}

/// Stores the vertices of a tile. `to`: where the first vertex of each instance goes.
template <bool isLone, class D>
inline HWY_ATTR void storeRecord(D d, const Record& record, std::size_t stride,
                                 std::byte* const* to, const VertexRange& range,
                                 const Tile<D>& tile) {
  constexpr std::size_t vertices = unitVertices<isLone, D>;
  const std::size_t whole = (range.first + vertices - 1) / vertices;
  const std::size_t wholeEnd = std::max(whole, range.end / vertices);
  byDenseSize(record.dense, [&](auto words) HWY_ATTR {
    storeDenseUnits<isLone, words()>(d, record, to, whole, wholeEnd, tile);
  });
  for (std::size_t first = 0; first < record.slots; first += 4) {
    Quad quad{{}, std::min<std::size_t>(record.bytes - first * 4, 16), first * 4};
    for (std::size_t k = 0; k < 4; ++k)
      quad.slot[k] = record.slot[std::min<std::size_t>(first + k, record.slots - 1)];
    if (range.first != whole * vertices)
      storeSome<isLone>(d, quad, stride, to, range.first / vertices, range, tile);
    if (record.dense == 0) {
      bySize(static_cast<std::uint32_t>(quad.bytes), [&](auto size) HWY_ATTR {
        if (size() % 4 == 0 && stride == size()) {
          storeUnits<isLone, size(), size() < 16>(d, quad, stride, to, whole, wholeEnd, tile);
        } else {
          storeUnits<isLone, size(), false>(d, quad, stride, to, whole, wholeEnd, tile);
        }
      });
    }
    if (range.end > wholeEnd * vertices)
      storeSome<isLone>(d, quad, stride, to, wholeEnd, range, tile);
  }
}

}  // namespace dermis::cpu::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();
