// Reading attributes of a mesh view: for validation, repair and packing. The reference reads them
// by its own means.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "dermis/mesh.h"

namespace dermis {

/// What `loadWeight` returns for a weight of 1.
inline constexpr double wholeWeight = 65535.0;

template <typename Stored>
Stored loadComponent(const AttributeView& view, std::uint32_t element, std::uint32_t component) {
  Stored value;
  const auto* bytes = static_cast<const std::byte*>(view.data) +
                      std::size_t{element} * view.stride + std::size_t{component} * sizeof(Stored);
  std::memcpy(&value, bytes, sizeof(Stored));
  return value;
}

inline std::uint32_t loadUnsigned(const AttributeView& view, std::uint32_t element,
                                  std::uint32_t component) {
  switch (view.type) {
    case ComponentType::uint8:
    case ComponentType::unorm8:
      return loadComponent<std::uint8_t>(view, element, component);
    case ComponentType::uint16:
    case ComponentType::unorm16:
      return loadComponent<std::uint16_t>(view, element, component);
    case ComponentType::uint32:
      return loadComponent<std::uint32_t>(view, element, component);
    default:
      break;
  }
  return 0;
}

/// A weight times 65535. In these units weights that are stored as integers are integers, whose
/// sums are exact: which influence is the strongest must not depend on how a quotient is rounded.
inline double loadWeight(const AttributeView& view, std::uint32_t element,
                         std::uint32_t component) {
  switch (view.type) {
    case ComponentType::unorm8:
      return loadUnsigned(view, element, component) * 257.0;
    case ComponentType::unorm16:
      return loadUnsigned(view, element, component);
    default:
      return static_cast<double>(loadComponent<float>(view, element, component)) * wholeWeight;
  }
}

}  // namespace dermis
