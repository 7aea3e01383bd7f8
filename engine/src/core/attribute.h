// Reading attributes of a mesh view: for validation, repair and packing. The reference reads them
// by its own means.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "dermis/mesh.h"

namespace dermis {

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
    case ComponentType::float32:
      break;
  }
  return 0;
}

/// A float, or a normalised integer's value.
inline double loadNumber(const AttributeView& view, std::uint32_t element,
                         std::uint32_t component) {
  switch (view.type) {
    case ComponentType::float32:
      return static_cast<double>(loadComponent<float>(view, element, component));
    case ComponentType::unorm8:
      return loadUnsigned(view, element, component) / 255.0;
    case ComponentType::unorm16:
      return loadUnsigned(view, element, component) / 65535.0;
    default:
      return loadUnsigned(view, element, component);
  }
}

}  // namespace dermis
