// What the layer of wrong_bytes_layer.cpp gives a test of its own process.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

namespace dermis::test {

/// A buffer whose memory is mapped, as it stands when the device has finished some work.
struct WrittenBuffer {
  std::uint32_t usage = 0;  ///< VkBufferUsageFlags
  std::span<std::byte> bytes;
};

/// Called whenever the host has waited for the device: in the order in which they were made, the
/// buffers that the host can read. What is changed in them is what the host sees.
using AfterWait = std::function<void(std::span<const WrittenBuffer>)>;

/// The symbol of the layer's library that takes one; null takes it away.
inline constexpr const char* setAfterWaitSymbol = "dermisSetAfterWait";
using SetAfterWait = void (*)(const AfterWait*);

inline constexpr const char* wrongBytesLayer = "VK_LAYER_DERMIS_wrong_bytes";

}  // namespace dermis::test
