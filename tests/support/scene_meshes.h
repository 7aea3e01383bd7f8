// What the tests of scenes share, on any device and on the CPU: meshes, poses, layouts, and their
// vertices as bytes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <set>
#include <span>
#include <stdexcept>
#include <utility>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/scene.h"
#include "random_rig.h"

namespace dermis::test {

/// The value; where there is none the test fails with the error's message, and ends.
template <typename T>
T must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().message);
  return std::move(*result);
}
inline void must(const Result<void>& result) {
  if (!result) throw std::runtime_error(result.error().message);
}

/// The attributes of an instance as they are stored, tightly packed, by `Stream`.
using Streams = std::array<std::vector<std::byte>, streamCount>;

/// All attributes of an output with `vertexCount` vertices; empty if there is no output.
Streams readStreams(std::span<const std::byte> bytes, const InstanceOutput& output,
                    std::uint32_t vertexCount);

/// One attribute of `vertexCount` vertices, copied from the bytes of an output buffer.
std::vector<std::byte> readAttribute(std::span<const std::byte> bytes,
                                     const OutputAttribute& attribute, std::uint32_t vertexCount);

inline constexpr auto positionStream = static_cast<std::size_t>(Stream::positions);
inline constexpr auto normalStream = static_cast<std::size_t>(Stream::normals);
inline constexpr auto previousStream = static_cast<std::size_t>(Stream::previousPositions);

using Pose = std::vector<JointMatrix>;

/// A random mesh with every attribute that methods and layouts use, for poses of `jointCount`
/// joints.
PackedMesh systemMesh(std::uint32_t seed, std::uint32_t vertexCount, std::uint32_t jointCount = 8,
                      std::uint32_t influences = 4, std::uint32_t morphTargets = 3);

inline Pose systemPose(std::uint32_t seed, std::uint32_t jointCount = 8) {
  return randomPose(seed, jointCount, seed % 5 == 4 ? Rigidity::shear : Rigidity::rigid);
}

/// What a mesh of `systemMesh` was packed from: the reference starts from there. Null for others.
OwnedMesh* sourceOf(const PackedMesh& mesh);

/// Positions and normals in float32.
VertexLayout plainLayout();
/// The same with previous positions.
VertexLayout motionLayout();

/// Of instances that the last `record` skinned or settled, in an order that can be compared.
std::set<std::uint32_t> indicesOf(std::span<const InstanceHandle> instances);

}  // namespace dermis::test
