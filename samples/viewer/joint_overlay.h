// Joints and bones over the picture.
#pragma once

#include <optional>

#include "state.h"

namespace dermis::viewer {

/// Where a point of the scene is seen; nothing if it is behind the eye.
std::optional<std::array<float, 2>> project(const samples::render::Camera& camera, const Area& area,
                                            const glm::vec3& point);

/// Draws them behind the interface's windows; the chosen one stands out.
void drawJoints(const SceneView& view, const State& state, const std::vector<glm::vec3>& positions,
                const samples::render::Camera& camera, const Area& area);

/// The joint at a place on the window, or nothing.
std::optional<std::uint32_t> jointAt(const std::vector<glm::vec3>& positions,
                                     const samples::render::Camera& camera, const Area& area,
                                     float x, float y);

}  // namespace dermis::viewer
