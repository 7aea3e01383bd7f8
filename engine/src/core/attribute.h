// Reads attributes of a mesh view, for validation, repair and packing. The reference has its own
// code for this.
#pragma once

#include <algorithm>
#include <bit>
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
      return 0;
  }
}

/// What `loadJoint` returns for a float that is no joint index. No pose has this joint.
inline constexpr std::uint32_t noJoint = 0xffffffffu;

inline std::uint32_t loadJoint(const AttributeView& view, std::uint32_t element,
                               std::uint32_t component) {
  if (view.type != ComponentType::float32) return loadUnsigned(view, element, component);
  const float value = loadComponent<float>(view, element, component);
  if (!(value >= 0 && value < static_cast<float>(maxPoseJoints))) return noJoint;
  const auto joint = static_cast<std::uint32_t>(value);
  return static_cast<float>(joint) == value ? joint : noJoint;
}

/// IEEE 754 binary16, which float32 holds exactly.
inline float fromHalf(std::uint16_t half) {
  const std::uint32_t sign = std::uint32_t{half & 0x8000u} << 16;
  const std::uint32_t exponent = (half >> 10) & 0x1fu, mantissa = half & 0x3ffu;
  if (exponent == 0) {
    const float magnitude = static_cast<float>(mantissa) * 0x1p-24f;
    return sign != 0 ? -magnitude : magnitude;
  }
  const std::uint32_t bits =
      exponent == 0x1f ? 0x7f800000u | mantissa << 13 : (exponent + 112) << 23 | mantissa << 13;
  return std::bit_cast<float>(sign | bits);
}

/// A component of any attribute except joints and weights. Normalized integers are divided by their
/// largest value; signed ones are at least -1.
inline double loadReal(const AttributeView& view, std::uint32_t element, std::uint32_t component) {
  switch (view.type) {
    case ComponentType::float32:
      return static_cast<double>(loadComponent<float>(view, element, component));
    case ComponentType::float16:
      return static_cast<double>(fromHalf(loadComponent<std::uint16_t>(view, element, component)));
    case ComponentType::snorm8:
      return std::max(loadComponent<std::int8_t>(view, element, component) / 127.0, -1.0);
    case ComponentType::snorm16:
      return std::max(loadComponent<std::int16_t>(view, element, component) / 32767.0, -1.0);
    case ComponentType::unorm8:
      return loadUnsigned(view, element, component) / 255.0;
    case ComponentType::unorm16:
      return loadUnsigned(view, element, component) / 65535.0;
    default:
      return loadUnsigned(view, element, component);
  }
}

/// The same, rounded once to what kernels read.
inline float loadFloat(const AttributeView& view, std::uint32_t element, std::uint32_t component) {
  return static_cast<float>(loadReal(view, element, component));
}

/// A component of a position in bind pose.
inline float loadPosition(const MeshView& mesh, std::uint32_t vertex, std::uint32_t component) {
  return static_cast<float>(loadReal(mesh.positions, vertex, component) *
                                static_cast<double>(mesh.positionScale[component]) +
                            static_cast<double>(mesh.positionOffset[component]));
}

/// A component of a morph target's displacement of a position. `element` is an index into the
/// target's own elements, not a vertex of the mesh.
inline float loadMorphPosition(const MorphTargetView& target, std::uint32_t element,
                               std::uint32_t component) {
  return static_cast<float>(loadReal(target.positions, element, component) *
                            static_cast<double>(target.positionScale[component]));
}

/// A weight times 65535. In these units weights that are stored as integers remain integers, and
/// their sums are exact: which influence is the strongest must not depend on rounding.
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
