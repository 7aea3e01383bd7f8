#include "keys.h"

#include <algorithm>
#include <array>

namespace dermis::viewer {
namespace {

constexpr double stepSeconds = 1.0 / 30;

constexpr std::array help{
    KeyHelp{"Space", "play or pause"},
    KeyHelp{"←  →", "one step back or forward; with Shift, ten"},
    KeyHelp{"Home", "go to the beginning of the clip"},
    KeyHelp{"↑  ↓   [  ]", "previous clip, next clip"},
    KeyHelp{nullptr, nullptr},
    KeyHelp{"1 – 9", "choose the method; with Shift, of the second view"},
    KeyHelp{"M", "next method; with Shift, of the second view"},
    KeyHelp{"C", "show two methods side by side"},
    KeyHelp{nullptr, nullptr},
    KeyHelp{"J", "show or hide the joints"},
    KeyHelp{"W", "show the weights of a joint as colors"},
    KeyHelp{"Tab", "next joint; with Shift, the previous one; or click on a joint"},
    KeyHelp{"E", "show the error against the reference as colors"},
    KeyHelp{nullptr, nullptr},
    KeyHelp{"Left drag", "orbit"},
    KeyHelp{"Right drag", "pan; also the middle button"},
    KeyHelp{"Wheel", "zoom in or out"},
    KeyHelp{"F", "frame the whole model; with Shift, from the initial direction"},
    KeyHelp{nullptr, nullptr},
    KeyHelp{"O", "open a file: type or paste its path, or drop it on the window"},
    KeyHelp{"P  S", "take a screenshot"},
    KeyHelp{"U", "show or hide the panel"},
    KeyHelp{"H  F1", "this help"},
    KeyHelp{"Q  Esc", "quit"},
};

Method methodAfter(Method method) {
  const auto place = std::ranges::find(allMethods, method);
  const auto next = static_cast<std::size_t>(place - allMethods.begin()) + 1;
  return allMethods[next % allMethods.size()];
}

void toggle(State& state, Coloring coloring) {
  state.coloring = state.coloring == coloring ? Coloring::surface : coloring;
}

/// The rest pose counts as a clip before the first.
void stepClip(const SceneView& view, int step, State& state) {
  const int count = static_cast<int>(view.scene().model->clips.size()) + 1;
  const int now = state.clip == gltf::none ? 0 : static_cast<int>(state.clip) + 1;
  const int next = (now + step + count) % count;
  chooseClip(view, next == 0 ? gltf::none : static_cast<std::uint32_t>(next - 1), state);
}

void stepJoint(const SceneView& view, bool isBack, State& state) {
  const std::size_t count = view.joints().size();
  if (count == 0) return;
  state.joint = static_cast<std::uint32_t>((state.joint + (isBack ? count - 1 : 1)) % count);
  if (state.coloring != Coloring::weights) state.showsJoints = true;
}

/// Esc closes what is open, one thing at a time.
void leave(State& state) {
  if (state.showsHelp) {
    state.showsHelp = false;
  } else if (!state.error.empty()) {
    state.error.clear();
  } else {
    state.quits = true;
  }
}

void handleAlways(SDL_Keycode key, State& state) {
  switch (key) {
    case SDLK_h:
    case SDLK_F1:
      state.showsHelp = !state.showsHelp;
      break;
    case SDLK_u:
      state.showsPanel = !state.showsPanel;
      break;
    case SDLK_o:
      state.showsPanel = state.editsPath = true;
      break;
    case SDLK_p:
    case SDLK_s:
      state.takesScreenshot = true;
      break;
    case SDLK_q:
      state.quits = true;
      break;
    case SDLK_ESCAPE:
      leave(state);
      break;
    default:
      break;
  }
}

void handleTime(SDL_Keycode key, bool isShifted, const SceneView& view, State& state) {
  const double step = isShifted ? 10 * stepSeconds : stepSeconds;
  switch (key) {
    case SDLK_LEFT:
      state.playback.step(-step);
      break;
    case SDLK_RIGHT:
      state.playback.step(step);
      break;
    case SDLK_HOME:
      state.playback.seek(0);
      break;
    case SDLK_UP:
    case SDLK_LEFTBRACKET:
      stepClip(view, -1, state);
      break;
    case SDLK_DOWN:
    case SDLK_RIGHTBRACKET:
      stepClip(view, 1, state);
      break;
    default:
      break;
  }
}

void handleLooks(SDL_Keycode key, bool isShifted, const SceneView& view, State& state) {
  switch (key) {
    case SDLK_SPACE:
      state.playback.setPlaying(!state.playback.isPlaying());
      break;
    case SDLK_m:
      state.methods[isShifted] = methodAfter(state.methods[isShifted]);
      if (isShifted) state.isSideBySide = true;
      break;
    case SDLK_c:
      state.isSideBySide = !state.isSideBySide;
      break;
    case SDLK_j:
      state.showsJoints = !state.showsJoints;
      break;
    case SDLK_w:
      toggle(state, Coloring::weights);
      break;
    case SDLK_e:
      toggle(state, Coloring::error);
      break;
    case SDLK_TAB:
      stepJoint(view, isShifted, state);
      break;
    case SDLK_f:
      if (isShifted) state.camera.resetDirection();
      state.frames = true;
      break;
    default:
      break;
  }
}

/// Uses the position of the key, because Shift changes the characters of digits.
void handleDigit(SDL_Scancode code, bool isShifted, State& state) {
  if (code < SDL_SCANCODE_1 || code > SDL_SCANCODE_9) return;
  const auto index = static_cast<std::size_t>(code - SDL_SCANCODE_1);
  if (index >= allMethods.size()) return;
  state.methods[isShifted] = allMethods[index];
  if (isShifted) state.isSideBySide = true;
}

}  // namespace

std::span<const KeyHelp> keyHelp() {
  return help;
}

void handleKey(const SDL_KeyboardEvent& key, const SceneView* view, State& state) {
  // Combinations with Ctrl, Alt and the like belong to the window manager.
  if ((key.keysym.mod & (KMOD_CTRL | KMOD_ALT | KMOD_GUI)) != 0) return;
  const SDL_Keycode code = key.keysym.sym;
  const bool isShifted = (key.keysym.mod & KMOD_SHIFT) != 0;
  if (key.repeat == 0) handleAlways(code, state);
  if (view == nullptr) return;
  handleTime(code, isShifted, *view, state);
  if (key.repeat != 0 && code != SDLK_TAB) return;
  handleLooks(code, isShifted, *view, state);
  handleDigit(key.keysym.scancode, isShifted, state);
}

void chooseClip(const SceneView& view, std::uint32_t clip, State& state) {
  const std::vector<gltf::Clip>& clips = view.scene().model->clips;
  state.clip = clip < clips.size() ? clip : gltf::none;
  state.playback.begin(state.clip == gltf::none ? 0 : clips[state.clip].duration);
}

}  // namespace dermis::viewer
