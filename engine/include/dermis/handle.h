// Handles of the objects of a Scene.
#pragma once

#include <cstdint>

namespace dermis {

/// Identifies an object of one kind. Functions reject the handle of a removed object, even if
/// another object has the same index: its `generation` differs. Plain data.
template <typename Thing>
struct Handle {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  ///< 0: no object

  friend bool operator==(const Handle&, const Handle&) = default;
  /// Whether it is a handle of an object, which may have been removed.
  explicit operator bool() const { return generation != 0; }
};

using MeshHandle = Handle<struct MeshOfSystem>;          ///< a mesh
using PoseHandle = Handle<struct PoseOfSystem>;          ///< a pose
using InstanceHandle = Handle<struct InstanceOfSystem>;  ///< an instance

}  // namespace dermis
