#include "interface.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include <imgui.h>
#include <glm/vec4.hpp>

#include "kit/render/draw.h"
#include "kit/text.h"

namespace dermis::viewer {
namespace {

constexpr float sceneLeft = panelWidth;
constexpr ImU32 white = IM_COL32(232, 236, 240, 255), dark = IM_COL32(23, 28, 34, 220),
                orange = IM_COL32(255, 180, 84, 255), red = IM_COL32(255, 160, 148, 255);
constexpr ImGuiWindowFlags fixedWindow = ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                                         ImGuiWindowFlags_NoNav |
                                         ImGuiWindowFlags_NoFocusOnAppearing;

// -- Keys ---------------------------------------------------------------------------------------

struct KeyHelp {
  const char* keys;
  const char* what;
};
constexpr std::array keyHelp{
    KeyHelp{"Space", "play or pause"},
    KeyHelp{"←  →", "one step back or forward; with Shift, ten"},
    KeyHelp{"↑  ↓", "previous clip, next clip"},
    KeyHelp{"1 – 9", "choose the method; with Shift, of the second view"},
    KeyHelp{"C", "show two methods side by side"},
    KeyHelp{"J", "show or hide the joints"},
    KeyHelp{"W", "show the weights of a joint as colors"},
    KeyHelp{"Tab", "next joint; with Shift, the previous one"},
    KeyHelp{"E", "show the error against the reference as colors"},
    KeyHelp{"Left drag", "orbit"},
    KeyHelp{"Right drag", "pan; also the middle button"},
    KeyHelp{"Wheel", "zoom in or out"},
    KeyHelp{"F", "frame the whole model from the initial direction"},
    KeyHelp{"P", "write a screenshot, dermis-viewer.png in the current folder"},
    KeyHelp{"H", "show or hide this help"},
    KeyHelp{"Esc", "close the help or a message"},
    KeyHelp{"Q", "quit"},
};

void toggle(State& state, Coloring coloring) {
  Coloring& now = state.shot.coloring;
  now = now == coloring ? Coloring::surface : coloring;
}

void chooseClip(std::uint32_t clip, State& state) {
  state.shot.clip = clip;
  state.shot.time = 0;
}

void stepClip(std::uint32_t step, const SceneView& view, State& state) {
  // The rest pose counts as a clip before the first: `noIndex` + 1 is 0.
  const auto count = static_cast<std::uint32_t>(view.scene().model->clips.size() + 1);
  chooseClip((state.shot.clip + 1 + step) % count - 1, state);
}

void stepJoint(bool isBack, const SceneView& view, State& state) {
  const std::size_t count = view.joints().size();
  if (count == 0) return;
  state.shot.joint =
      static_cast<std::uint32_t>((state.shot.joint + (isBack ? count - 1 : 1)) % count);
  if (state.shot.coloring != Coloring::weights) state.showsJoints = true;
}

/// Keys that may be held down.
void handleStep(SDL_Keycode key, bool isShifted, const SceneView& view, State& state) {
  const double seconds = (isShifted ? 10.0 : 1.0) / 30;
  if (key == SDLK_LEFT || key == SDLK_RIGHT) {
    const double time = state.shot.time + (key == SDLK_LEFT ? -seconds : seconds);
    state.shot.time = repeatedTime(time, view.duration(state.shot.clip));
    state.isPlaying = false;
  }
  if (key == SDLK_UP)
    stepClip(static_cast<std::uint32_t>(view.scene().model->clips.size()), view, state);
  if (key == SDLK_DOWN) stepClip(1, view, state);
  if (key == SDLK_TAB) stepJoint(isShifted, view, state);
}

void handlePress(SDL_Keycode key, State& state) {
  if (key == SDLK_SPACE) state.isPlaying = !state.isPlaying;
  if (key == SDLK_c) state.shot.views = 3 - state.shot.views;
  if (key == SDLK_j) state.showsJoints = !state.showsJoints;
  if (key == SDLK_w) toggle(state, Coloring::weights);
  if (key == SDLK_e) toggle(state, Coloring::error);
  if (key == SDLK_f) state.shot.camera = {};
  if (key == SDLK_p) state.takesScreenshot = true;
  if (key == SDLK_h) state.showsHelp = !state.showsHelp;
  if (key == SDLK_q) state.quits = true;
  if (key != SDLK_ESCAPE) return;
  state.showsHelp = false;
  state.error.clear();
}

// -- Panel --------------------------------------------------------------------------------------

/// Draws text literally; `Text` would treat it as a format string.
void say(const std::string& text, ImU32 color = white) {
  ImGui::PushStyleColor(ImGuiCol_Text, color);
  ImGui::PushTextWrapPos(0);
  ImGui::TextUnformatted(text.c_str());
  ImGui::PopTextWrapPos();
  ImGui::PopStyleColor();
}

void heading(const char* text) {
  ImGui::Dummy({0, 6});
  ImGui::TextDisabled("%s", text);
  ImGui::Separator();
}

/// A line with a name on the left and a value on the right.
void fact(const char* name, const std::string& value) {
  ImGui::TextUnformatted(name);
  const float width = ImGui::CalcTextSize(value.c_str()).x;
  ImGui::SameLine(ImGui::GetWindowContentRegionMax().x - width);
  ImGui::TextUnformatted(value.c_str());
}

void drawFile(const SceneView* view, const State& state) {
  heading("File");
  if (view == nullptr) return say("none");
  say(state.file);
  say(fmt::format("{} vertices, {} joints", view->vertexCount(), view->joints().size()));
}

/// A list to choose from. Returns the index of a new choice.
template <typename Name>
std::optional<std::uint32_t> choose(const char* label, std::uint32_t count, std::uint32_t chosen,
                                    const Name& name) {
  std::optional<std::uint32_t> choice;
  ImGui::SetNextItemWidth(-1);
  if (!ImGui::BeginCombo(label, name(chosen).c_str(), ImGuiComboFlags_HeightLarge)) return choice;
  for (std::uint32_t index = 0; index < count; ++index) {
    ImGui::PushID(static_cast<int>(index));
    if (ImGui::Selectable(name(index).c_str(), index == chosen)) choice = index;
    ImGui::PopID();
  }
  ImGui::EndCombo();
  return choice;
}

void drawClip(const SceneView& view, State& state) {
  heading("Clip");
  const std::vector<gltf::Clip>& clips = view.scene().model->clips;
  const auto count = static_cast<std::uint32_t>(clips.size());
  const auto name = [&](std::uint32_t index) {
    if (index >= count) return std::string("rest pose");
    const std::string& own = clips[index].name;
    return own.empty() ? fmt::format("clip {}", index) : samples::shortName(own);
  };
  if (const auto clip = choose("##clip", count + 1, std::min(state.shot.clip, count), name); clip)
    chooseClip(*clip < count ? *clip : noIndex, state);
  if (ImGui::Button(state.isPlaying ? "Pause" : "Play", {58, 0}))
    state.isPlaying = !state.isPlaying;
  ImGui::SameLine();
  auto time = static_cast<float>(state.shot.time);
  const auto end = static_cast<float>(view.duration(state.shot.clip));
  ImGui::SetNextItemWidth(-1);
  const std::string format = fmt::format("%.2f / {:.2f} s", end);
  if (!ImGui::SliderFloat("##time", &time, 0, end, format.c_str(), ImGuiSliderFlags_NoInput))
    return;
  state.isPlaying = false;
  state.shot.time = std::min(static_cast<double>(time), view.duration(state.shot.clip));
}

void drawMethod(const char* label, Method& method) {
  const auto name = [](std::uint32_t index) { return std::string(methodName(allMethods[index])); };
  const auto count = static_cast<std::uint32_t>(allMethods.size());
  const auto chosen = choose(label, count, static_cast<std::uint32_t>(method), name);
  if (chosen) method = allMethods[*chosen];
}

void drawMethods(Shot& shot) {
  heading("Method");
  drawMethod("##method", shot.methods[0]);
  bool isSideBySide = shot.views == 2;
  ImGui::Checkbox("side by side with", &isSideBySide);
  shot.views = isSideBySide ? 2 : 1;
  if (isSideBySide) drawMethod("##beside", shot.methods[1]);
}

/// The colors of a heat map, and the value of the last.
void drawColors(const std::string& greatest) {
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x, height = 12;
  constexpr int steps = 32;
  for (int step = 0; step < steps; ++step) {
    const auto rgb = samples::render::heatColor((static_cast<float>(step) + 0.5f) / steps);
    const float left = corner.x + width * static_cast<float>(step) / steps;
    ImGui::GetWindowDrawList()->AddRectFilled({left, corner.y},
                                              {left + width / steps, corner.y + height},
                                              IM_COL32(rgb[0], rgb[1], rgb[2], 255));
  }
  ImGui::Dummy({width, height});
  fact("0", greatest);
}

void drawErrors(const SceneView& view, const Shot& shot) {
  double greatest = 0;
  for (const PositionErrors& error : view.errors()) greatest = std::max(greatest, error.greatest);
  drawColors(fmt::format("{:.2g}", greatest));  // Only the author of the model knows the unit.
  for (std::size_t index = 0; index < view.errors().size(); ++index) {
    const PositionErrors& error = view.errors()[index];
    say(std::string(methodName(shot.methods[index])));
    fact("   largest", fmt::format("{:.2g}", error.greatest));
    fact("   of its bound", fmt::format("{:.0f} %", 100 * error.greatestPartOfBound));
  }
}

void drawLooks(const SceneView& view, State& state) {
  heading("Show");
  Shot& shot = state.shot;
  ImGui::Checkbox("joints", &state.showsJoints);
  bool showsWeights = shot.coloring == Coloring::weights;
  if (ImGui::Checkbox("weights of a joint", &showsWeights)) toggle(state, Coloring::weights);
  bool showsErrors = shot.coloring == Coloring::error;
  if (ImGui::Checkbox("error against the reference", &showsErrors)) toggle(state, Coloring::error);
  const std::vector<Joint>& joints = view.joints();
  if ((state.showsJoints || shot.coloring == Coloring::weights) && shot.joint < joints.size()) {
    const auto chosen = choose("##joint", static_cast<std::uint32_t>(joints.size()), shot.joint,
                               [&](std::uint32_t index) { return joints[index].name; });
    shot.joint = chosen.value_or(shot.joint);
  }
  if (shot.coloring == Coloring::weights) drawColors("1");
  if (shot.coloring == Coloring::error) drawErrors(view, shot);
}

void drawTimes(const SceneView& view, const State& state) {
  heading("Times");
  const auto milliseconds = [](double seconds) {
    return seconds > 0 ? fmt::format("{:.2f} ms", seconds * 1e3) : "–";
  };
  fact("GPU, skinning", milliseconds(view.times().skinningSeconds));
  fact("GPU, drawing", milliseconds(view.times().drawingSeconds));
  fact("CPU, plan + record", milliseconds(view.times().planSeconds));
  ImGui::TextDisabled("%s", state.device.c_str());
}

void drawPanel(const SceneView* view, State& state) {
  const float height = ImGui::GetIO().DisplaySize.y;
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({sceneLeft, height});
  ImGui::Begin(
      "panel", nullptr,
      (fixedWindow & ~ImGuiWindowFlags_NoScrollbar) | ImGuiWindowFlags_NoBringToFrontOnFocus);
  drawFile(view, state);
  if (view != nullptr) {
    drawClip(*view, state);
    drawMethods(state.shot);
    drawLooks(*view, state);
    drawTimes(*view, state);
  }
  ImGui::Dummy({0, 6});
  say(state.notice, orange);
  ImGui::TextDisabled("H shows the keys");
  ImGui::End();
}

// -- Overlay ------------------------------------------------------------------------------------

/// A line of text on a dark background.
void drawLabel(const std::string& text, float centerX, float y, ImU32 color = white) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  const ImVec2 size = ImGui::CalcTextSize(text.c_str());
  const float left = centerX - size.x / 2;
  list.AddRectFilled({left - 10, y}, {left + size.x + 10, y + size.y + 10}, dark, 6);
  list.AddText({left, y + 5}, color, text.c_str());
}

void drawJoints(const SceneView& view, const Shot& shot, const ImVec2& corner, const ImVec2& size) {
  ImDrawList& list = *ImGui::GetBackgroundDrawList();
  list.PushClipRect(corner, {corner.x + size.x, corner.y + size.y}, true);
  const samples::render::Camera camera = shot.camera.camera({}, size.x / size.y);
  std::vector<std::optional<ImVec2>> places;  // nothing: behind the eye
  for (const glm::vec3& position :
       jointPositions(view.scene(), view.joints(), shot.clip, shot.time)) {
    const glm::vec4 clip = camera.viewProjection * glm::vec4(position, 1);
    std::optional<ImVec2>& place = places.emplace_back();
    if (clip.w > 0) {
      place.emplace(corner.x + (clip.x / clip.w * 0.5f + 0.5f) * size.x,
                    corner.y + (clip.y / clip.w * 0.5f + 0.5f) * size.y);
    }
  }
  for (std::uint32_t index = 0; index < places.size(); ++index) {
    const std::uint32_t parent = view.joints()[index].parent;
    if (!places[index]) continue;
    const ImU32 color = index == shot.joint ? orange : white;
    if (parent != noIndex && places[parent]) {
      list.AddLine(*places[parent], *places[index], dark, 4);
      list.AddLine(*places[parent], *places[index], white, 1.5f);
    }
    list.AddCircleFilled(*places[index], 5, dark);
    list.AddCircleFilled(*places[index], 3.5f, color);
  }
  if (shot.joint < places.size() && places[shot.joint]) {
    const ImVec2 place = *places[shot.joint];
    const std::string& name = view.joints()[shot.joint].name;
    drawLabel(name, place.x + 20 + ImGui::CalcTextSize(name.c_str()).x / 2, place.y - 12, orange);
  }
  list.PopClipRect();
}

void drawOverlay(const SceneView* view, const State& state) {
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  const float width = window.x - sceneLeft, center = sceneLeft + width / 2;
  if (!state.loading.empty()) {
    drawLabel(state.loading, center, window.y / 2, orange);
  } else if (view == nullptr) {
    drawLabel("drop a .gltf or .glb file here", center, window.y / 2);
  }
  if (view == nullptr) return;
  const auto views = static_cast<float>(state.shot.views);
  for (std::uint32_t index = 0; index < state.shot.views; ++index) {
    const float left = sceneLeft + width * static_cast<float>(index) / views;
    if (state.showsJoints) drawJoints(*view, state.shot, {left, 0}, {width / views, window.y});
    if (index > 0) ImGui::GetBackgroundDrawList()->AddLine({left, 0}, {left, window.y}, dark, 2);
    drawLabel(std::string(methodName(state.shot.methods[index])), left + width / views / 2, 16);
  }
}

void drawHelp() {
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({(sceneLeft + window.x) / 2, window.y / 2}, ImGuiCond_Always,
                          {0.5f, 0.5f});
  ImGui::Begin("help", nullptr, fixedWindow | ImGuiWindowFlags_AlwaysAutoResize);
  for (const KeyHelp& line : keyHelp) {
    ImGui::TextDisabled("%s", line.keys);
    ImGui::SameLine(110);
    ImGui::TextUnformatted(line.what);
  }
  ImGui::End();
}

void drawError(const State& state) {
  const ImVec2 window = ImGui::GetIO().DisplaySize;
  ImGui::SetNextWindowPos({(sceneLeft + window.x) / 2, 56}, ImGuiCond_Always, {0.5f, 0});
  ImGui::SetNextWindowSize({std::min(window.x - sceneLeft - 32, 620.0f), 0});
  ImGui::Begin("error", nullptr, fixedWindow);
  say(state.error, red);
  ImGui::TextDisabled("Esc closes this message");
  ImGui::End();
}

}  // namespace

double repeatedTime(double time, double duration) {
  if (!(duration > 0)) return 0;
  if (time >= 0 && time <= duration) return time;
  const double rest = std::fmod(time, duration);
  return rest < 0 ? rest + duration : rest;
}

void handleKey(const SDL_KeyboardEvent& key, const SceneView* view, State& state) {
  // Combinations with Ctrl, Alt and the like belong to the window manager.
  if ((key.keysym.mod & (KMOD_CTRL | KMOD_ALT | KMOD_GUI)) != 0) return;
  const bool isShifted = (key.keysym.mod & KMOD_SHIFT) != 0;
  if (view != nullptr) handleStep(key.keysym.sym, isShifted, *view, state);
  if (key.repeat != 0) return;
  handlePress(key.keysym.sym, state);
  // The position of the key, because Shift changes the characters of digits.
  const int digit = key.keysym.scancode - SDL_SCANCODE_1;
  if (digit < 0 || digit >= static_cast<int>(allMethods.size())) return;
  state.shot.methods[isShifted] = allMethods[static_cast<std::size_t>(digit)];
  if (isShifted) state.shot.views = 2;
}

void styleInterface() {
  ImGui::StyleColorsDark();
  ImGuiStyle& style = ImGui::GetStyle();
  style.WindowRounding = style.FrameRounding = style.GrabRounding = 4;
  style.WindowBorderSize = 0;
  style.WindowPadding = {14, 10};
  style.FramePadding = {8, 4};
  style.Colors[ImGuiCol_WindowBg] = ImGui::ColorConvertU32ToFloat4(dark | IM_COL32_A_MASK);
}

void drawInterface(const SceneView* view, State& state) {
  drawOverlay(view, state);
  drawPanel(view, state);
  if (!state.error.empty()) drawError(state);
  if (state.showsHelp) drawHelp();
}

}  // namespace dermis::viewer
