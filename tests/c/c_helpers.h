// What the tests of the C interface share.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include <vulkan/vulkan_core.h>

#include "dermis/dermis.h"
#include "random_rig.h"
#include "scene_meshes.h"

namespace dermis::test {

/// An object of the C interface.
template <typename T>
struct Owned {
  Owned() = default;
  ~Owned() { dermis_destroy(object); }
  Owned(const Owned&) = delete;
  Owned& operator=(const Owned&) = delete;
  operator T*() const { return object; }
  T** operator&() { return &object; }

  T* object = nullptr;
};

/// A structure of zeros with its size.
template <typename T>
T sized() {
  T made{};
  made.size = sizeof(T);
  return made;
}

inline dermis_error error;

/// The call succeeds.
inline void expectOk(dermis_code code) {
  EXPECT_EQ(code, DERMIS_OK) << error.message;
}
/// The call fails, with this in its message.
inline void expectError(dermis_code code, const std::string& part,
                        dermis_code expected = DERMIS_INVALID_ARGUMENT) {
  EXPECT_EQ(code, expected) << part;
  EXPECT_EQ(error.code, code) << part;
  EXPECT_NE(std::string(error.message).find(part), std::string::npos) << error.message;
  error = {};
}

/// A random mesh with every attribute, and the view of it that a program in C would write.
struct CMesh {
  explicit CMesh(std::uint32_t seed, std::uint32_t vertices = 50, std::uint32_t joints = 8)
      : mesh(samples::randomMesh(seed, vertices, joints, 4)), jointCount(joints) {
    samples::addTangents(mesh, seed + 1);
    samples::addMorphs(mesh, seed + 2, 3);
    const auto floats = [](const std::vector<float>& values, std::uint32_t components) {
      return dermis_attribute{values.data(), 0, DERMIS_FLOAT32, components};
    };
    set = {{mesh.joints.data(), 0, DERMIS_UINT32, 4}, floats(mesh.weights, 4)};
    for (const samples::OwnedMorph& morph : mesh.morphs) {
      targets.push_back({morph.vertices.data(),
                         static_cast<std::uint32_t>(morph.vertices.size()),
                         floats(morph.positions, 3),
                         floats(morph.normals, 3),
                         floats(morph.tangents, 3),
                         {0, 0, 0}});
    }
    view.vertex_count = vertices;
    view.name = "a mesh of C";
    view.positions = floats(mesh.positions, 3);
    view.normals = floats(mesh.normals, 3);
    view.tangents = floats(mesh.tangents, 4);
    view.influence_sets = &set;
    view.influence_set_count = 1;
    view.morph_targets = targets.data();
    view.morph_target_count = static_cast<std::uint32_t>(targets.size());
    view.dual_quaternion_weights = floats(mesh.dualQuaternionWeights, 1);
    view.bulge_strengths = floats(mesh.bulgeStrengths, 1);
    view.centers_of_rotation = floats(mesh.centersOfRotation, 3);
  }

  samples::OwnedMesh mesh;
  std::uint32_t jointCount;
  dermis_influence_set set{};
  std::vector<dermis_morph_target> targets;
  dermis_mesh_view view = sized<dermis_mesh_view>();
};

inline bool isSame(const void* a, const void* b, std::size_t size) {
  return size == 0 || std::memcmp(a, b, size) == 0;
}

}  // namespace dermis::test
