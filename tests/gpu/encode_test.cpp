// How encode.glsl rounds, for all floats there are. RoundingTest has the ties, on every change.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <utility>

#include "dermis_exhaustive_shaders.h"
#include "kit/bench/storage_kernels.h"
#include "kit/buffer.h"
#include "test_device.h"
#include "vertex_encoder.h"

namespace dermis::test {
namespace {

template <typename T>
T must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}

constexpr std::uint32_t valuesTogether = 1u << 21;
constexpr std::uint32_t workgroupSize = 64;

struct Encoded {
  std::uint16_t half, negatedHalf, snorm16, snorm8;
};

/// Encodes `valuesTogether` floats whose bits follow each other.
class Encoder {
 public:
  explicit Encoder(samples::Device& device)
      : device_(device),
        kernels_(must(samples::StorageKernels::create(device, 1, sizeof(std::uint32_t), 1))),
        pipeline_(must(kernels_.makePipeline(shaders::encode_spirv))),
        encoded_(must(samples::MappedBuffer::create(device, valuesTogether * sizeof(Encoded),
                                                    VK_BUFFER_USAGE_STORAGE_BUFFER_BIT, true))) {}

  std::span<const Encoded> encode(std::uint32_t first) {
    const Result<void> done = device_.run([&](VkCommandBuffer commands) -> Result<void> {
      if (Result<void> bound = kernels_.bind(commands, pipeline_.get(), {{encoded_.range()}});
          !bound)
        return bound;
      kernels_.push(commands, {&first, 1});
      device_.functions().CmdDispatch(commands, valuesTogether / workgroupSize, 1, 1);
      samples::recordBarrier(device_, commands, Use::computeWrite, Use::hostRead);
      return {};
    });
    if (!done) throw std::runtime_error(done.error().message);
    return {reinterpret_cast<const Encoded*>(encoded_.bytes().data()), valuesTogether};
  }

 private:
  samples::Device& device_;
  samples::StorageKernels kernels_;
  samples::render::Owned<VkPipeline> pipeline_;
  samples::MappedBuffer encoded_;
};

float floatOf(std::uint32_t bits) {
  float value = 0;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

/// The binary16 nearest to a positive float, for floats that come in ascending order: `halfOf` for
/// all of them would take minutes.
class AscendingHalves {
 public:
  std::uint32_t of(float value) {
    while (half_ < 0x7c00 && (value > tie_ || (value == tie_ && half_ % 2 == 1))) {
      ++half_;
      tie_ = tieAfter(half_);
    }
    return half_;
  }

 private:
  /// Halfway to the next one; after the largest, to the one that would follow.
  static float tieAfter(std::uint32_t half) {
    const int exponent = std::max(1, static_cast<int>(half >> 10));
    const auto steps = static_cast<float>((half >> 10 != 0 ? 1024 : 0) + half % 1024) + 0.5f;
    return std::ldexp(steps, exponent - 25);
  }

  std::uint32_t half_ = 0;
  float tie_ = tieAfter(0);
};

class EncodeTest : public DeviceTest {};

TEST_F(EncodeTest, AllFloatsAreRoundedToTheNearestTiesToTheEvenOne) {
  Encoder encoder(device());
  AscendingHalves halves;
  std::uint64_t wrong = 0;
  // Of each magnitude both signs: the shader negates.
  for (std::uint64_t first = 0; first < 1ull << 32; first += valuesTogether) {
    const std::span<const Encoded> encoded = encoder.encode(static_cast<std::uint32_t>(first));
    if (first == 1ull << 31) halves = {};
    for (std::uint32_t i = 0; i < valuesTogether; ++i) {
      const std::uint32_t bits = static_cast<std::uint32_t>(first) + i;
      const float value = floatOf(bits);
      const std::uint32_t sign = bits >> 31 << 15;
      const std::uint32_t half = std::isnan(value) ? 0x7e00 : halves.of(floatOf(bits & 0x7fffffff));
      bool right =
          encoded[i].half == (half | sign) && encoded[i].negatedHalf == (half | (sign ^ 0x8000));
      if (!std::isnan(value)) {
        const float clamped = std::min(std::max(value, -1.0f), 1.0f);
        right = right &&
                encoded[i].snorm16 == static_cast<std::uint16_t>(std::lrint(clamped * 32767)) &&
                encoded[i].snorm8 == static_cast<std::uint16_t>(std::lrint(clamped * 127));
      }
      if (right) continue;
      if (++wrong < 10)
        ADD_FAILURE() << std::hex << "of " << bits << ": " << encoded[i].half << " "
                      << encoded[i].negatedHalf << " " << encoded[i].snorm16 << " "
                      << encoded[i].snorm8 << ", not " << half;
    }
  }
  EXPECT_EQ(wrong, 0u);
}

// That the expected values come from the plain definition.
TEST_F(EncodeTest, AscendingHalvesAreTheNearest) {
  AscendingHalves halves;
  for (std::uint64_t bits = 0; bits <= 0x7f800000; bits += 4099) {
    const float value = floatOf(static_cast<std::uint32_t>(bits));
    ASSERT_EQ(halves.of(value), halfOf(double{value})) << value;
  }
}

}  // namespace
}  // namespace dermis::test
