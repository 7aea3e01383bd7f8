#include "joint_overlay.h"

#include <cmath>

#include <glm/vec4.hpp>

#include "gui_style.h"

namespace dermis::viewer {
namespace {

constexpr float clickRadius = 14;

ImVec2 at(const std::array<float, 2>& place) {
  return {place[0], place[1]};
}

/// A slender kite, thick near the joint that rotates it.
void drawBone(ImDrawList& list, const ImVec2& from, const ImVec2& to, bool isChosen) {
  const ImVec2 along{to.x - from.x, to.y - from.y};
  const float length = std::sqrt(along.x * along.x + along.y * along.y);
  if (length < 1) return;
  const float half = std::min(length * 0.09f, 7.0f) / length;
  const ImVec2 waist{from.x + along.x * 0.16f, from.y + along.y * 0.16f};
  const ImVec2 left{waist.x - along.y * half, waist.y + along.x * half};
  const ImVec2 right{waist.x + along.y * half, waist.y - along.x * half};
  const std::uint32_t tint = isChosen ? warmColor : 0xF4F7FA;
  list.AddQuadFilled(from, left, to, right, color(tint, isChosen ? 0.55f : 0.32f));
  list.AddQuad(from, left, to, right, color(0x0B0F14, 0.55f), 2.4f);
  list.AddQuad(from, left, to, right, color(tint, 0.95f), 1.2f);
}

void drawName(ImDrawList& list, const std::string& name, const ImVec2& place) {
  const ImVec2 size = ImGui::CalcTextSize(name.c_str());
  const ImVec2 corner{place.x + 12, place.y - size.y / 2};
  list.AddRectFilled({corner.x - 6, corner.y - 3}, {corner.x + size.x + 6, corner.y + size.y + 3},
                     color(panelColor, 0.88f), 5);
  list.AddText(corner, color(warmColor), name.c_str());
}

}  // namespace

std::optional<std::array<float, 2>> project(const samples::render::Camera& camera, const Area& area,
                                            const glm::vec3& point) {
  const glm::vec4 clip = camera.viewProjection * glm::vec4(point, 1);
  if (clip.w <= 0) return std::nullopt;
  return std::array{area.x + (clip.x / clip.w * 0.5f + 0.5f) * area.width,
                    area.y + (clip.y / clip.w * 0.5f + 0.5f) * area.height};
}

void drawJoints(const SceneView& view, const State& state, const std::vector<glm::vec3>& positions,
                const samples::render::Camera& camera, const Area& area) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  list.PushClipRect({area.x, area.y}, {area.x + area.width, area.y + area.height}, true);
  const std::vector<Joint>& joints = view.joints();
  for (const bool isChosen : {false, true}) {
    for (std::uint32_t index = 0; index < joints.size(); ++index) {
      const auto place = project(camera, area, positions[index]);
      if (!place) continue;
      const std::uint32_t parent = joints[index].parent;
      if (parent != gltf::none && (parent == state.joint) == isChosen) {
        const auto from = project(camera, area, positions[parent]);
        if (from) drawBone(list, at(*from), at(*place), isChosen);
      }
      if ((index == state.joint) != isChosen) continue;
      list.AddCircleFilled(at(*place), isChosen ? 6.5f : 4.0f, color(0x0B0F14, 0.75f));
      list.AddCircleFilled(at(*place), isChosen ? 5.0f : 2.6f,
                           color(isChosen ? warmColor : 0xF4F7FA));
      if (isChosen) drawName(list, joints[index].name, at(*place));
    }
  }
  list.PopClipRect();
}

std::optional<std::uint32_t> jointAt(const std::vector<glm::vec3>& positions,
                                     const samples::render::Camera& camera, const Area& area,
                                     float x, float y) {
  std::optional<std::uint32_t> nearest;
  float best = clickRadius;
  for (std::uint32_t index = 0; index < positions.size(); ++index) {
    const auto place = project(camera, area, positions[index]);
    if (!place) continue;
    const float distance = std::hypot((*place)[0] - x, (*place)[1] - y);
    if (distance >= best) continue;
    best = distance;
    nearest = index;
  }
  return nearest;
}

}  // namespace dermis::viewer
