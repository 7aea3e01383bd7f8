// What the tests of SceneRecorder share: meshes, poses, and each instance skinned alone by
// makePlan and `Context::record`, which is what the system must give, bit for bit. That itself is
// held against the reference: both go through the same kernels.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/vulkan/scene_recorder.h"
#include "random_rig.h"
#include "scene_meshes.h"
#include "system_engine.h"
#include "test_device.h"

namespace dermis::test {

class SystemTest : public DeviceTest {
 protected:
  /// Small, and with an output that the engine may copy from and fill.
  vulkan::SceneRecorderDescription description();

  /// What tier 1 makes of a mesh of `systemMesh` as the only job, inside the bounds of the
  /// reference. Previous positions are the current ones.
  Streams alone(const PackedMesh& mesh, std::span<const JointMatrix> pose,
                const InstanceDescription& description, std::span<const MorphWeight> morphs = {},
                JointPromise promise = JointPromise::scaling);

  /// Expects the positions, normals and tangents of an instance to be those of the job alone.
  static void expectSkinned(const Streams& skinned, const Streams& expected);
};

/// One mesh, one palette and one instance, in an engine.
struct SingleInstance {
  SingleInstance(samples::Device& device, const vulkan::Context& context,
                 const vulkan::SceneRecorderDescription& system, const VertexLayout& layout,
                 std::uint32_t vertexCount = 100);

  PackedMesh packed;
  SystemEngine engine;
  InstanceDescription description;
  InstanceHandle instance;
};

}  // namespace dermis::test
