// Names for things that a SkinningSystem owns.
#pragma once

#include <cstdint>

namespace dermis {

/// A number that stands for a thing of one kind, until that thing is removed. A handle of a removed
/// thing is noticed, also where its place was given to another since: `generation` counts those
/// that had the place. Plain data: copy it, store it, compare it.
template <typename Thing>
struct Handle {
  std::uint32_t index = 0;
  std::uint32_t generation = 0;  ///< 0: no thing at all

  friend bool operator==(const Handle&, const Handle&) = default;
  explicit operator bool() const { return generation != 0; }
};

using MeshHandle = Handle<struct MeshOfSystem>;
using PoseHandle = Handle<struct PoseOfSystem>;
using InstanceHandle = Handle<struct InstanceOfSystem>;

}  // namespace dermis
