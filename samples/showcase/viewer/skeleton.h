// The joints of a scene, as one list.
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
  std::uint32_t parent = gltf::none;  ///< nearest ancestor that is a joint, in the same list
};

/// The joints of all skins that are drawn, without duplicates, parents before their children.
std::vector<Joint> jointsOf(const cli::Scene& scene);

/// The positions of joints in a pose, in the scene's space.
std::vector<glm::vec3> jointPositions(const cli::Scene& scene, const std::vector<Joint>& joints,
                                      std::uint32_t clip, double time);

/// The share of a joint in the weights of each vertex of a part, 0 to 1.
std::vector<float> jointWeights(const cli::Scene& scene, const cli::ScenePart& part,
                                std::uint32_t node);

}  // namespace dermis::viewer
