// Handles of the objects of a Scene or SkinningSystem.
#pragma once

#include <cstdint>

namespace dermis {

/// Identifies an object of one kind until it is removed. Functions reject the handle of a removed
/// object, even if its index is in use again: `generation` differs. Plain data.
template <typename Thing>
struct Handle {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  ///< 0: no object

  friend bool operator==(const Handle&, const Handle&) = default;
  explicit operator bool() const { return generation != 0; }
};

using MeshHandle = Handle<struct MeshOfSystem>;
using PoseHandle = Handle<struct PoseOfSystem>;
using InstanceHandle = Handle<struct InstanceOfSystem>;

}  // namespace dermis
