// The joints of a scene, as one list to choose from.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <glm/vec3.hpp>

#include "skinned_scene.h"

namespace dermis::viewer {

struct Joint {
  std::string name;
  std::uint32_t node = gltf::none;
  std::uint32_t parent = gltf::none;  ///< the nearest joint above it, in the same list
};

/// Of all skins that are drawn, parents before their children, none twice.
std::vector<Joint> jointsOf(const cli::Scene& scene);

/// Where they are in a pose, in the scene's space.
std::vector<glm::vec3> jointPositions(const cli::Scene& scene, const std::vector<Joint>& joints,
                                      std::uint32_t clip, double time);

/// How much of each vertex of a part follows a joint, 0 to 1: those of its weights that are the
/// joint's, of all its weights.
std::vector<float> jointWeights(const cli::Scene& scene, const cli::ScenePart& part,
                                std::uint32_t node);

}  // namespace dermis::viewer
