// Joints and bones over the picture.
#pragma once

#include <optional>

#include "state.h"

namespace dermis::viewer {

/// The place in the window of a point of the scene; nothing if it is behind the eye.
std::optional<std::array<float, 2>> project(const samples::render::Camera& camera, const Area& area,
                                            const glm::vec3& point);

/// Draws joints behind the interface's windows. The chosen joint is highlighted.
void drawJoints(const SceneView& view, const State& state, const std::vector<glm::vec3>& positions,
                const samples::render::Camera& camera, const Area& area);

/// The joint at a position in the window, or nothing.
std::optional<std::uint32_t> jointAt(const std::vector<glm::vec3>& positions,
                                     const samples::render::Camera& camera, const Area& area,
                                     float x, float y);

}  // namespace dermis::viewer
