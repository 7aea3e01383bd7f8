#include "interface.h"

#include <fmt/format.h>

#include <imgui.h>
#include <imgui_stdlib.h>

#include "dermis/text.h"
#include "gui_style.h"
#include "keys.h"
#include "legend.h"
#include "overlay.h"

namespace dermis::viewer {
namespace {

constexpr float panelWidth = 300;

/// Draws text literally; `Text` would treat it as a format string.
void say(const std::string& text) {
  ImGui::TextUnformatted(text.c_str());
}

void sayDim(const std::string& text) {
  ImGui::PushStyleColor(ImGuiCol_Text, color(dimColor));
  ImGui::PushTextWrapPos(0);
  say(text);
  ImGui::PopTextWrapPos();
  ImGui::PopStyleColor();
}

void heading(const char* text) {
  ImGui::Dummy({0, 6});
  ImGui::PushStyleColor(ImGuiCol_Text, color(accentColor));
  ImGui::TextUnformatted(text);
  ImGui::PopStyleColor();
  ImGui::Separator();
  ImGui::Dummy({0, 1});
}

/// A line with a name on the left and a value on the right.
void fact(const char* name, const std::string& value) {
  ImGui::TextDisabled("%s", name);
  const float width = ImGui::CalcTextSize(value.c_str()).x;
  ImGui::SameLine(std::max(ImGui::GetWindowContentRegionMax().x - width, 110.0f));
  say(value);
}

std::string milliseconds(double seconds) {
  return seconds > 0 ? fmt::format("{:.2f} ms", seconds * 1e3) : "–";
}

void drawFile(const Facts& facts, State& state) {
  heading("File");
  if (facts.view != nullptr) {
    say(facts.file);
    sayDim(fmt::format("{} vertices, {} joints", facts.view->vertexCount(),
                       facts.view->joints().size()));
  } else {
    sayDim("none");
  }
  if (!facts.notes.empty()) {
    sayDim(facts.notes.size() == 1 ? "1 note" : fmt::format("{} notes", facts.notes.size()));
    if (ImGui::IsItemHovered()) {
      ImGui::BeginTooltip();
      ImGui::PushTextWrapPos(420);
      for (const std::string& note : facts.notes) say(note);
      ImGui::PopTextWrapPos();
      ImGui::EndTooltip();
    }
  }
  const float button = ImGui::CalcTextSize("Open").x + 2 * ImGui::GetStyle().FramePadding.x;
  ImGui::SetNextItemWidth(-button - ImGui::GetStyle().ItemSpacing.x);
  if (state.editsPath) {
    ImGui::SetWindowFocus();  // ImGui 1.90 needs this: it sets the focus within the focused window
    ImGui::SetKeyboardFocusHere();
  }
  state.editsPath = false;
  const bool isEntered = ImGui::InputTextWithHint(
      "##path", "path of a .gltf or .glb", &state.path,
      ImGuiInputTextFlags_EnterReturnsTrue | ImGuiInputTextFlags_AutoSelectAll);
  ImGui::SameLine();
  const bool isPressed = ImGui::Button("Open");
  if ((isEntered || isPressed) && !state.path.empty()) state.opens = state.path;
}

void drawMethodChoice(const char* label, Method& method) {
  ImGui::SetNextItemWidth(-1);
  if (!ImGui::BeginCombo(label, std::string(methodName(method)).c_str(),
                         ImGuiComboFlags_HeightLargest))
    return;
  for (const Method choice : allMethods) {
    if (ImGui::Selectable(std::string(methodName(choice)).c_str(), choice == method))
      method = choice;
  }
  ImGui::EndCombo();
}

void drawMethods(State& state) {
  heading("Method");
  drawMethodChoice("##method", state.methods[0]);
  ImGui::Checkbox("side by side with", &state.isSideBySide);
  if (state.isSideBySide) drawMethodChoice("##beside", state.methods[1]);
}

void drawJointChoice(const SceneView& view, State& state) {
  ImGui::SetNextItemWidth(-1);
  const std::string chosen = view.joints()[state.joint].name;
  if (!ImGui::BeginCombo("##joint", chosen.c_str(), ImGuiComboFlags_HeightLarge)) return;
  for (std::uint32_t index = 0; index < view.joints().size(); ++index) {
    ImGui::PushID(static_cast<int>(index));
    if (ImGui::Selectable(view.joints()[index].name.c_str(), index == state.joint))
      state.joint = index;
    ImGui::PopID();
  }
  ImGui::EndCombo();
}

void drawLooks(const Facts& facts, State& state) {
  const SceneView& view = *facts.view;
  heading("Show");
  ImGui::Checkbox("joints", &state.showsJoints);
  bool showsWeights = state.coloring == Coloring::weights;
  if (ImGui::Checkbox("weights of a joint", &showsWeights))
    state.coloring = showsWeights ? Coloring::weights : Coloring::surface;
  bool showsError = state.coloring == Coloring::error;
  if (ImGui::Checkbox("error against the reference", &showsError))
    state.coloring = showsError ? Coloring::error : Coloring::surface;
  if ((state.showsJoints || showsWeights) && !view.joints().empty()) drawJointChoice(view, state);
  if (state.coloring == Coloring::surface) return;
  ImGui::Dummy({0, 4});
  const ImVec2 corner = ImGui::GetCursorScreenPos();
  const float width = ImGui::GetContentRegionAvail().x;
  drawLegend(facts, state, *ImGui::GetWindowDrawList(), corner.x, corner.y, width);
  ImGui::Dummy({width, legendHeight(facts, state)});
}

void drawTimes(const Facts& facts) {
  heading("Times");
  const SceneTimes& times = facts.view->times();
  fact("GPU, skinning", milliseconds(times.skinningSeconds));
  fact("GPU, drawing", milliseconds(times.drawingSeconds));
  fact("CPU, plan + record", milliseconds(times.planSeconds));
  fact("frames per second",
       facts.framesPerSecond > 0 ? fmt::format("{:.1f}", facts.framesPerSecond) : "–");
  if (facts.scale < 1) sayDim(fmt::format("while moving: {:.0f} % resolution", 100 * facts.scale));
  ImGui::Dummy({0, 2});
  sayDim(facts.device);
}

void drawKernels(const Facts& facts) {
  heading("Kernels");
  sayDim(facts.kernels);
  sayDim(facts.kernelsSummary);
  if (facts.kernelsUpdate.empty()) return;
  ImGui::PushStyleColor(ImGuiCol_Text, color(facts.kernelsAreBroken ? errorColor : textColor));
  ImGui::PushTextWrapPos(0);
  say(facts.kernelsUpdate);
  ImGui::PopTextWrapPos();
  ImGui::PopStyleColor();
}

void drawPanel(const Facts& facts, float height, State& state) {
  ImGui::SetNextWindowPos({0, 0});
  ImGui::SetNextWindowSize({panelWidth, height});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowRounding, 0);
  ImGui::Begin("panel", nullptr,
               ImGuiWindowFlags_NoTitleBar | ImGuiWindowFlags_NoResize |
                   ImGuiWindowFlags_NoCollapse | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_NoBringToFrontOnFocus | ImGuiWindowFlags_NoNav);
  ImGui::PopStyleVar();
  drawFile(facts, state);
  if (facts.view != nullptr) {
    drawMethods(state);
    drawLooks(facts, state);
    drawTimes(facts);
  }
  if (!facts.kernels.empty()) drawKernels(facts);
  const float line = ImGui::GetTextLineHeight();
  ImGui::SetCursorPosY(std::max(ImGui::GetCursorPosY(), height - line - 16));
  ImGui::TextDisabled("H shows the keys");
  ImGui::End();
}

std::string clipName(const SceneView& view, std::uint32_t clip) {
  if (clip == gltf::none) return "rest pose";
  const std::string& name = view.scene().model->clips[clip].name;
  return name.empty() ? fmt::format("clip {}", clip) : shortName(name);
}

void drawClipChoice(const SceneView& view, State& state) {
  const auto count = static_cast<std::uint32_t>(view.scene().model->clips.size());
  ImGui::SetNextItemWidth(150);
  if (!ImGui::BeginCombo("##clip", clipName(view, state.clip).c_str())) return;
  for (std::uint32_t index = 0; index <= count; ++index) {
    const std::uint32_t clip = index == count ? gltf::none : index;
    ImGui::PushID(static_cast<int>(index));
    if (ImGui::Selectable(clipName(view, clip).c_str(), clip == state.clip))
      chooseClip(view, clip, state);
    ImGui::PopID();
  }
  ImGui::EndCombo();
}

void drawScrubber(State& state) {
  const std::string text =
      fmt::format("{:.2f} / {:.2f} s", state.playback.time(), state.playback.duration());
  const float width = ImGui::CalcTextSize("00.00 / 00.00 s").x;
  const float gap = ImGui::GetStyle().ItemSpacing.x;
  auto time = static_cast<float>(state.playback.time());
  const auto end = static_cast<float>(state.playback.duration());
  ImGui::SetNextItemWidth(std::max(ImGui::GetContentRegionAvail().x - width - gap, 60.0f));
  if (ImGui::SliderFloat("##time", &time, 0, end > 0 ? end : 1, "")) {
    state.playback.setPlaying(false);
    state.playback.seek(static_cast<double>(time));
  }
  ImGui::SameLine();
  say(text);
}

/// Below the picture: the play button, the time in the clip, and the choice of a clip.
void drawTransport(const SceneView& view, const Area& picture, State& state) {
  const float height = 48, margin = 16;
  ImGui::SetNextWindowPos({picture.x + margin, picture.y + picture.height - height - margin});
  ImGui::SetNextWindowSize({std::max(picture.width - 2 * margin, 320.0f), height});
  ImGui::PushStyleVar(ImGuiStyleVar_WindowPadding, ImVec2(10, 9));
  ImGui::PushStyleColor(ImGuiCol_WindowBg, color(panelColor, 0.86f));
  ImGui::Begin("transport", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoNav);
  ImGui::PopStyleColor();
  ImGui::PopStyleVar();
  if (ImGui::Button(state.playback.isPlaying() ? "Pause" : "Play", {58, 0}))
    state.playback.setPlaying(!state.playback.isPlaying());
  ImGui::SameLine();
  drawClipChoice(view, state);
  ImGui::SameLine();
  drawScrubber(state);
  ImGui::End();
}

void drawHelp(const Area& picture, State& state) {
  ImGui::SetNextWindowPos({picture.x + picture.width / 2, picture.y + picture.height / 2},
                          ImGuiCond_Always, {0.5f, 0.5f});
  ImGui::Begin("help", &state.showsHelp,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove |
                   ImGuiWindowFlags_AlwaysAutoResize | ImGuiWindowFlags_NoNav);
  for (const KeyHelp& line : keyHelp()) {
    if (line.keys == nullptr) {
      ImGui::Dummy({0, 3});
      ImGui::Separator();
      ImGui::Dummy({0, 3});
      continue;
    }
    ImGui::PushStyleColor(ImGuiCol_Text, color(accentColor));
    ImGui::TextUnformatted(line.keys);
    ImGui::PopStyleColor();
    ImGui::SameLine(130);
    ImGui::TextUnformatted(line.what);
  }
  ImGui::End();
}

/// The last error, until it is closed or something else succeeds.
void drawError(const Area& picture, State& state) {
  const float width = std::min(picture.width - 32, 620.0f);
  ImGui::SetNextWindowPos({picture.x + picture.width / 2, picture.y + 56}, ImGuiCond_Always,
                          {0.5f, 0});
  ImGui::SetNextWindowSize({width, 0});
  ImGui::PushStyleColor(ImGuiCol_WindowBg, color(0x3A1713, 0.96f));
  ImGui::Begin("error", nullptr,
               ImGuiWindowFlags_NoDecoration | ImGuiWindowFlags_NoMove | ImGuiWindowFlags_NoNav |
                   ImGuiWindowFlags_NoFocusOnAppearing);
  ImGui::PopStyleColor();
  ImGui::PushTextWrapPos(0);
  ImGui::PushStyleColor(ImGuiCol_Text, color(errorColor));
  say(state.error);
  ImGui::PopStyleColor();
  ImGui::PopTextWrapPos();
  if (ImGui::SmallButton("Close")) state.error.clear();
  ImGui::End();
}

}  // namespace

Area pictureArea(const State& state, float windowWidth, float windowHeight) {
  const float left = state.showsPanel && windowWidth > panelWidth + 64 ? panelWidth : 0;
  return {left, 0, windowWidth - left, windowHeight};
}

void drawInterface(const Facts& facts, const Area& picture, State& state) {
  drawOverlay(facts, picture, state);
  if (state.showsPanel) drawPanel(facts, picture.height, state);
  if (facts.view != nullptr) drawTransport(*facts.view, picture, state);
  if (!state.error.empty()) drawError(picture, state);
  if (state.showsHelp) drawHelp(picture, state);
}

}  // namespace dermis::viewer
