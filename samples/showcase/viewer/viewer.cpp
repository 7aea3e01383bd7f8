#include "viewer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <utility>

#include <imgui.h>

#include "kit/file_name.h"
#include "kit/output_file.h"

#ifdef DERMIS_RUNTIME_COMPILER
#include "dermis/compilers.h"
#endif

namespace dermis::viewer {
namespace {

using samples::ExitStatus;

constexpr double longestStep = 0.25;  // seconds; longer pauses do not count
constexpr int framesAfterChange = 3;

std::string fileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

}  // namespace

Viewer::Viewer(const ViewerOptions& options, Window& window) : options_(options), window_(window) {
  styleInterface();
  state_.device = window.device().device->info().name;
  state_.shot.methods[0] = options.method;
  state_.shot.methods[1] = options.comparison.value_or(state_.shot.methods[1]);
  state_.shot.views = options.comparison ? 2 : 1;
  state_.isPlaying = !options.isPaused;
  isFirst_ = !options.model.empty();
  if (isFirst_) opens_ = options.model;
}

Result<ExitStatus> Viewer::run() {
  while (true) {
    handleEvents();
    update();
    if (status_ != ExitStatus::done && options_.frames) return status_;
    // Wait for a model that is still being read: it may cause the error that the run ends with.
    const bool hasShownAll = options_.frames && shownFrames_ >= *options_.frames && !isLoading();
    if (!isEnding_ && (state_.quits || hasShownAll)) {
      isEnding_ = true;
      screenshot_ = options_.screenshot;
    }
    if (isEnding_ && screenshot_.empty()) return status_;
    if (Result<void> done = draw(); !done) return done.error();
  }
}

void Viewer::handleEvents() {
  const bool isHurried = isMoving() || options_.frames || framesToDraw_ > 0 || isEnding_;
  SDL_Event event;
  if (!isHurried && SDL_WaitEventTimeout(&event, loading_.valid() ? 15 : 250) != 0) handle(event);
  while (SDL_PollEvent(&event) != 0) handle(event);
}

void Viewer::handle(const SDL_Event& event) {
  framesToDraw_ = framesAfterChange;
  Window::handle(event);
  switch (event.type) {
    case SDL_QUIT:
      state_.quits = true;
      break;
    case SDL_DROPFILE:
      opens_ = event.drop.file;
      SDL_free(event.drop.file);
      break;
    case SDL_KEYDOWN:
      handleKey(event.key, view_.get(), state_);
      break;
    case SDL_MOUSEWHEEL:
      if (!ImGui::GetIO().WantCaptureMouse) state_.shot.camera.zoom(event.wheel.preciseY);
      break;
    case SDL_MOUSEMOTION:
      if (!ImGui::GetIO().WantCaptureMouse) handleMotion(event.motion);
      break;
    default:
      break;
  }
}

void Viewer::handleMotion(const SDL_MouseMotionEvent& motion) {
  const float height = std::max(ImGui::GetIO().DisplaySize.y, 1.0f);
  const float right = static_cast<float>(motion.xrel) / height;
  const float down = static_cast<float>(motion.yrel) / height;
  if ((motion.state & SDL_BUTTON_LMASK) != 0) {
    state_.shot.camera.orbit(right, down);
  } else if ((motion.state & (SDL_BUTTON_RMASK | SDL_BUTTON_MMASK)) != 0) {
    state_.shot.camera.pan(right, down);
  }
}

/// Reads a model on another thread, so that the window stays responsive.
void Viewer::load(const std::string& path) {
  path_ = path;
  state_.loading = fmt::format("reading {} …", fileName(path));
  framesToDraw_ = framesAfterChange;
  loading_ = std::async(std::launch::async, [path] {
    cli::MeshPreparation preparation;
    preparation.images = true;
    preparation.centersOfRotation = true;
    return cli::loadScene(samples::pathOf(path), preparation);
  });
}

void Viewer::adopt(Result<cli::Scene> scene) {
  state_.loading.clear();
  framesToDraw_ = framesAfterChange;
  Result<void> done = scene ? showScene(std::move(*scene)) : Result<void>(scene.error());
  if (done) {
    state_.error.clear();
  } else {
    const std::string name = fileName(path_), message = done.error().message;
    fail(ExitStatus::badInput,
         message.find(name) == std::string::npos ? name + ": " + message : message);
  }
  isFirst_ = false;
}

Result<void> Viewer::showScene(cli::Scene scene) {
  Result<std::unique_ptr<SceneView>> made = SceneView::create(window_.device(), std::move(scene));
  if (!made) return made.error();
  const std::uint32_t clip = (*made)->scene().model->clips.empty() ? noIndex : 0u;
  if (const Result<Box> box = (*made)->extent(clip); !box) return box.error();
  view_ = std::move(*made);
  drawn_.reset();
  state_.shot.clip = framedClip_ = clip;
  state_.shot.time = isFirst_ ? std::clamp(options_.time, 0.0, view_->duration(clip)) : 0;
  state_.shot.joint = 0;
  state_.shot.camera = {};
  state_.file = fileName(path_);
  window_.setTitle(state_.file + " – Dermis");
  return {};
}

void Viewer::update() {
  const Clock::time_point now = Clock::now();
  const double passed = std::chrono::duration<double>(now - lastUpdate_).count();
  lastUpdate_ = now;
  if (loading_.valid() && loading_.wait_for(Clock::duration(0)) == std::future_status::ready)
    adopt(loading_.get());
  if (opens_ && !loading_.valid()) load(*std::exchange(opens_, std::nullopt));
  reloadKernels();
  if (view_ == nullptr) return;
  if (isMoving()) {
    double& time = state_.shot.time;
    time = repeatedTime(time + std::min(passed, longestStep), view_->duration(state_.shot.clip));
  }
  checkMethods();
  placeCamera();
}

/// Some methods need data that a large model may lack.
void Viewer::checkMethods() {
  for (std::uint32_t index = 0; index < state_.shot.views; ++index) {
    Method& method = state_.shot.methods[index];
    if (cli::allows(view_->scene(), method)) continue;
    fail(ExitStatus::badInput,
         fmt::format("{} needs centers of rotation, which take too long to compute for {}",
                     methodName(method), state_.file));
    method = Method::dualQuaternion;
  }
}

/// Unless the user has moved it, the camera follows the window's shape and the clip.
void Viewer::placeCamera() {
  Shot& shot = state_.shot;
  shot.width = std::max(window_.size().width, panelWidth + 1) - panelWidth;
  shot.height = std::max(window_.size().height, 1u);
  const Result<Box> box = view_->extent(shot.clip);
  if (!box) {
    fail(ExitStatus::badInput, box.error().message);
    shot.clip = framedClip_;
    shot.time = 0;
    return;
  }
  framedClip_ = shot.clip;
  const auto width = static_cast<float>(shot.width) / static_cast<float>(shot.views);
  if (!shot.camera.isMoved()) shot.camera.frame(*box, width / static_cast<float>(shot.height));
}

void Viewer::reloadKernels() {
#ifdef DERMIS_RUNTIME_COMPILER
  if (options_.compiler == nullptr) return;
  const vulkan::Context& context = window_.device().context;
  // [reload]
  // Called between two frames, with the next frame and the newest complete one.
  const Result<RuntimeCompiler::Reload> done =
      options_.compiler->reload(context, shownFrames_ + 1, shownFrames_);
  if (!done) return fail(ExitStatus::badInput, done.error().message);  // glslang's message
  // [/reload]
  if (done->replaced.empty()) return;
  state_.error.clear();
  tell(fmt::format("kernels reloaded: {}", done->replaced.size()));
  drawn_.reset();
  if (view_ != nullptr) view_->skinAgain();
#endif
}

Result<void> Viewer::draw() {
  if (std::exchange(state_.takesScreenshot, false)) screenshot_ = "dermis-viewer.png";
  const Shot shot = state_.shot;  // The interface may change it.
  const bool isNew = view_ != nullptr && (!drawn_ || *drawn_ != shot);
  if (!isNew && framesToDraw_ <= 0 && !options_.frames && screenshot_.empty()) return {};
  const Result<bool> hasBegun = window_.begin();
  if (!hasBegun) return hasBegun.error();
  if (!*hasBegun) {
    SDL_Delay(10);  // There is nothing to draw on, and nothing to wait for.
    return {};
  }
  drawInterface(view_.get(), state_);
  --framesToDraw_;
  const auto record =
      [&](VkCommandBuffer commands) -> Result<const samples::render::RenderTarget*> {
    if (view_ == nullptr) return nullptr;
    if (!isNew) return view_->picture();
    return view_->record(commands, shot);
  };
  const bool isReadBack = !screenshot_.empty() && !isLoading() && framesToDraw_ <= 0;
  const Result<bool> isShown = window_.show(record, panelWidth, isReadBack);
  if (!isShown) return isShown.error();
  if (!*isShown) return {};
  ++shownFrames_;
  if (isReadBack) takeScreenshot();
  if (!isNew) return {};
  drawn_ = shot;
  framesToDraw_ = std::max(framesToDraw_, 1);  // so that the panel shows the times
  return view_->finish();
}

void Viewer::takeScreenshot() {
  const std::string name = std::exchange(screenshot_, {});
  const samples::RequestedOutput output{"--screenshot", name};
  if (view_ != nullptr) {
    const auto kept = samples::checkOutputFiles({&output, 1}, view_->scene().model->sideFiles);
    if (!kept) return fail(ExitStatus::stopped, kept.error().message);
  }
  const Result<std::vector<std::byte>> bytes = samples::render::encodePng(window_.picture());
  const Result<void> written =
      bytes ? samples::writeFile(samples::pathOf(name), *bytes) : Result<void>(bytes.error());
  if (!written) return fail(ExitStatus::stopped, written.error().message);
  fmt::print("wrote {}\n", name);
  std::fflush(stdout);
  tell("wrote " + name);
}

void Viewer::tell(std::string notice) {
  state_.notice = std::move(notice);
  framesToDraw_ = framesAfterChange;
}

/// Reports an error in the window and on standard error. Errors caused by the command line
/// determine the exit status, and so do all errors in a run with a fixed number of frames.
void Viewer::fail(ExitStatus status, std::string error) {
  state_.error = std::move(error);
  framesToDraw_ = framesAfterChange;
  samples::reportError(status, state_.error);
  const bool isAsked = isFirst_ || isEnding_ || options_.frames.has_value();
  if (isAsked && status_ == ExitStatus::done) status_ = status;
}

}  // namespace dermis::viewer
