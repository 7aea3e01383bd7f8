// Stores `JointBounds` as words with a header like that of a packed mesh. Stored data is checked
// when it is read, so that `skinnedBounds` never reads out of range and never finds a NaN.

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <vector>

#include "bounds/joint_bounds_data.h"
#include "dermis/mesh.h"
#include "stored.h"
#include "strict_floating_point.h"

namespace dermis {
namespace {

constexpr std::uint32_t magic = 0x42425344u;  // "DSBB"
constexpr std::uint32_t version = 1;

struct Header {
  std::uint32_t magic, version, checksum, wordCount;
  std::uint32_t joints, pairs, trios, requiredJoints;
  Box unweighted;
};

static_assert(sizeof(JointBoundsData::Joint) == 27 * 4 && sizeof(JointBoundsData::Pair) == 34 * 4);

constexpr std::uint64_t wordsOf(std::uint64_t joints, std::uint64_t pairs, std::uint64_t trios) {
  return sizeof(Header) / 4 + joints * sizeof(JointBoundsData::Joint) / 4 +
         pairs * sizeof(JointBoundsData::Pair) / 4 + trios * 3;
}

constexpr StoredKind storedBounds{"joint bounds", magic, version, sizeof(Header) / 4};

bool hasNan(std::span<const float> numbers) {
  return std::ranges::any_of(numbers, [](float number) { return std::isnan(number); });
}

/// Copies the elements to the first of the bytes, and removes these from the span.
template <typename Element>
void put(std::span<std::byte>& bytes, const std::vector<Element>& elements) {
  const std::size_t size = elements.size() * sizeof(Element);
  if (size != 0) std::memcpy(bytes.data(), elements.data(), size);
  bytes = bytes.subspan(size);
}

template <typename Element>
void take(std::span<const std::byte>& bytes, std::size_t count, std::vector<Element>& elements) {
  elements.resize(count);
  const std::size_t size = count * sizeof(Element);
  if (size != 0) std::memcpy(elements.data(), bytes.data(), size);
  bytes = bytes.subspan(size);
}

Result<void> checkJoints(const JointBoundsData& bounds) {
  std::uint32_t required = 0;
  for (const JointBoundsData::Joint& joint : bounds.joints) {
    if (joint.joint < required || joint.joint >= maxPoseJoints || hasNan(joint.alone.reach))
      return storedBounds.damaged("its joints are not in ascending order, or contain NaN");
    required = joint.joint + 1;
  }
  if (required != bounds.requiredJoints) {
    return storedBounds.damaged("requiredJoints is " + std::to_string(bounds.requiredJoints) +
                                ", not " + std::to_string(required));
  }
  return {};
}

Result<void> checkPairs(const JointBoundsData& bounds) {
  std::uint64_t next = 0;
  for (const JointBoundsData::Pair& pair : bounds.pairs) {
    const std::uint64_t key = std::uint64_t{pair.first} << 32 | pair.second;
    const float ratios[] = {pair.firstOverSecond[0], pair.firstOverSecond[1],
                            pair.secondOverFirst[0], pair.secondOverFirst[1], pair.minSum};
    if (pair.first >= pair.second || pair.second >= bounds.joints.size() || key < next ||
        pair.influences < 2 || hasNan(pair.extent.reach) || hasNan(ratios) ||
        std::ranges::any_of(ratios, [](float ratio) { return ratio < 0; }))
      return storedBounds.damaged(
          "its pairs of joints are not in ascending order, or contain values that are not valid");
    next = key + 1;
  }
  return {};
}

Result<void> checkTrios(const JointBoundsData& bounds) {
  const std::array<std::uint32_t, 3>* before = nullptr;
  for (const std::array<std::uint32_t, 3>& trio : bounds.trios) {
    if (trio[0] >= trio[1] || trio[1] >= trio[2] || trio[2] >= bounds.joints.size() ||
        (before != nullptr && !(*before < trio)))
      return storedBounds.damaged("its trios of joints are not in ascending order");
    before = &trio;
  }
  return {};
}

}  // namespace

std::vector<std::byte> JointBoundsData::bytes() const {
  static_assert(std::endian::native == std::endian::little, "the words are little-endian");
  const Header header{magic,
                      version,
                      0,
                      0,
                      static_cast<std::uint32_t>(joints.size()),
                      static_cast<std::uint32_t>(pairs.size()),
                      static_cast<std::uint32_t>(trios.size()),
                      requiredJoints,
                      unweighted};
  std::vector<std::uint32_t> words(
      static_cast<std::size_t>(wordsOf(joints.size(), pairs.size(), trios.size())));
  std::memcpy(words.data(), &header, sizeof(header));
  std::span<std::byte> rest = std::as_writable_bytes(std::span(words)).subspan(sizeof(header));
  put(rest, joints);
  put(rest, pairs);
  put(rest, trios);
  finishStored(words);
  const std::span<const std::byte> bytes = std::as_bytes(std::span(words));
  return {bytes.begin(), bytes.end()};
}

Result<JointBoundsData> JointBoundsData::fromBytes(std::span<const std::byte> bytes) {
  const Result<std::vector<std::uint32_t>> words = storedBounds.wordsOf(bytes);
  if (!words) return words.error();
  Header header;
  std::memcpy(static_cast<void*>(&header), words->data(), sizeof(header));
  if (wordsOf(header.joints, header.pairs, header.trios) != header.wordCount)
    return storedBounds.damaged("its header does not describe as many bytes");

  JointBoundsData bounds;
  bytes = bytes.subspan(sizeof(header));
  take(bytes, header.joints, bounds.joints);
  take(bytes, header.pairs, bounds.pairs);
  take(bytes, header.trios, bounds.trios);
  bounds.unweighted = header.unweighted;
  bounds.requiredJoints = header.requiredJoints;
  if (hasNan(bounds.unweighted.min) || hasNan(bounds.unweighted.max))
    return storedBounds.damaged("the box of vertices without weight contains NaN");
  if (Result<void> good = checkJoints(bounds); !good) return good.error();
  if (Result<void> good = checkPairs(bounds); !good) return good.error();
  if (Result<void> good = checkTrios(bounds); !good) return good.error();
  return bounds;
}

JointBounds::JointBounds() : data_(std::make_unique<JointBoundsData>()) {}
JointBounds::~JointBounds() = default;
JointBounds::JointBounds(JointBounds&&) noexcept = default;
JointBounds& JointBounds::operator=(JointBounds&&) noexcept = default;

JointBounds JointBoundsData::joined(JointBoundsData data) {
  JointBounds bounds;
  *bounds.data_ = std::move(data);
  return bounds;
}

const JointBoundsData& JointBoundsData::of(const JointBounds& bounds) {
  return *bounds.data_;
}

std::vector<std::byte> JointBounds::bytes() const {
  return JointBoundsData::of(*this).bytes();
}

Result<JointBounds> JointBounds::fromBytes(std::span<const std::byte> bytes) {
  Result<JointBoundsData> data = JointBoundsData::fromBytes(bytes);
  if (!data) return data.error();
  return JointBoundsData::joined(*std::move(data));
}

}  // namespace dermis
