#include "viewer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>

#include "interface.h"
#include "joint_overlay.h"
#include "keys.h"
#include "kit/exit_status.h"
#include "kit/file_name.h"
#include "screenshot.h"

namespace dermis::viewer {
namespace {

using namespace std::chrono_literals;

constexpr auto restBeforeStill = 120ms;
constexpr auto noticeTime = 2500ms;
constexpr double longestStep = 0.25;  // seconds; longer pauses do not count
constexpr int framesAfterEvent = 3;

std::string fileName(const std::string& path) {
  return std::filesystem::path(path).filename().string();
}

double seconds(std::chrono::steady_clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

}  // namespace

Viewer::Viewer(const Options& options, Presenter& presenter)
    : options_(options),
      presenter_(&presenter),
      pace_(presenter.device().device->info().type == "CPU") {
  state_.methods[0] = options.method;
  if (options.comparison) {
    state_.methods[1] = *options.comparison;
    state_.isSideBySide = true;
  }
  methods_ = state_.methods;
  state_.playback.setPlaying(!options.isPaused);
  if (options.model.empty()) {
    hasBegun_ = true;
  } else {
    state_.opens = options.model;
  }
}

Result<samples::ExitStatus> Viewer::run() {
  while (true) {
    waitForEvents();
    update();
    if (status_ == samples::ExitStatus::wrongUsage) return status_;
    if (status_ != samples::ExitStatus::done && options_.frames) return status_;
    // Wait for a model that is still being read: it may cause the error that the run ends with.
    const bool hasShownAll = options_.frames && shownFrames_ >= *options_.frames && hasBegun_ &&
                             loader_.current() == nullptr;
    const bool isOver = state_.quits || hasShownAll;
    if (isOver && (options_.screenshot.empty() || isEnding_) && screenshotName_.empty())
      return status_;
    if (isOver && !isEnding_) {
      isEnding_ = true;
      screenshotName_ = options_.screenshot;
    }
    if (Result<void> done = draw(); !done) return done.error();
  }
}

// -- Input --------------------------------------------------------------------------------------

void Viewer::waitForEvents() {
  if (presenter_->gui().hasUnseenKey()) framesToDraw_ = std::max(framesToDraw_, 1);
  const bool isHurried = state_.playback.isPlaying() || options_.frames || framesToDraw_ > 0 ||
                         presenter_->gui().hasQueuedInput();
  const bool isBusy = !isSettled() || !screenshotName_.empty() || !state_.notice.empty();
  SDL_Event event;
  const bool isMinimized = presenter_->window().isMinimized();
  if (framesToTextField_ > 0) --framesToTextField_;
  const int patience = isMinimized ? 100 : isHurried ? 0 : isBusy ? 15 : 250;
  if (patience > 0 && SDL_WaitEventTimeout(&event, patience) != 0) handle(event);
  while (!waitsForTextField() && !presenter_->gui().hasUnseenKey() && SDL_PollEvent(&event) != 0)
    handle(event);
}

/// Text typed after the key that opens the text field is meant for the field, which gets the
/// keyboard only after some frames.
bool Viewer::waitsForTextField() {
  if (state_.editsPath) {
    framesToTextField_ = 4;
    opensTextField_ = true;
  }
  if (presenter_->gui().wantsText()) framesToTextField_ = 0;
  framesToDraw_ = std::max(framesToDraw_, framesToTextField_);
  return framesToTextField_ > 0;
}

/// The key that opens the text field is also a letter, which must not be added to the field.
bool Viewer::isOpeningLetter(const SDL_TextInputEvent& text) {
  const char letter = text.text[0];
  const bool isIt = opensTextField_ && (letter == 'o' || letter == 'O') && text.text[1] == 0;
  opensTextField_ = false;
  return isIt;
}

void Viewer::handle(const SDL_Event& event) {
  framesToDraw_ = framesAfterEvent;
  if (event.type == SDL_TEXTINPUT && isOpeningLetter(event.text)) return;
  presenter_->gui().handle(event);
  switch (event.type) {
    case SDL_QUIT:
      state_.quits = true;
      break;
    case SDL_DROPFILE:
      state_.opens = event.drop.file;
      SDL_free(event.drop.file);
      break;
    case SDL_KEYDOWN:
      if (!presenter_->gui().wantsText()) handleKey(event.key, view_.get(), state_);
      break;
    case SDL_MOUSEWHEEL:
      if (!presenter_->gui().wantsMouse()) state_.camera.zoom(event.wheel.preciseY);
      break;
    case SDL_MOUSEMOTION:
      handleMouseMotion(event.motion);
      break;
    case SDL_MOUSEBUTTONDOWN:
    case SDL_MOUSEBUTTONUP:
      handleMouseButton(event.button);
      break;
    default:
      break;
  }
}

void Viewer::handleMouseMotion(const SDL_MouseMotionEvent& motion) {
  if (!isDragging_) return;
  hasDragged_ = hasDragged_ || std::abs(motion.x - pressedX_) + std::abs(motion.y - pressedY_) > 4;
  if (!hasDragged_) return;
  const float height = std::max(area().height, 1.0f);
  const float right = static_cast<float>(motion.xrel) / height;
  const float down = static_cast<float>(motion.yrel) / height;
  if ((motion.state & SDL_BUTTON_LMASK) != 0) {
    state_.camera.orbit(right, down);
  } else if ((motion.state & (SDL_BUTTON_RMASK | SDL_BUTTON_MMASK)) != 0) {
    state_.camera.pan(right, down);
  }
}

void Viewer::handleMouseButton(const SDL_MouseButtonEvent& button) {
  if (button.type == SDL_MOUSEBUTTONDOWN) {
    isDragging_ = !presenter_->gui().wantsMouse();
    hasDragged_ = false;
    pressedX_ = button.x;
    pressedY_ = button.y;
    return;
  }
  const bool isClick = isDragging_ && !hasDragged_ && button.button == SDL_BUTTON_LEFT;
  isDragging_ = false;
  const bool hasJoints = state_.showsJoints || state_.coloring == Coloring::weights;
  if (!isClick || view_ == nullptr || !hasJoints) return;
  const auto x = static_cast<float>(button.x), y = static_cast<float>(button.y);
  const std::vector<glm::vec3> positions =
      jointPositions(view_->scene(), view_->joints(), state_.clip, state_.playback.time());
  for (std::uint32_t index = 0; index < state_.views(); ++index) {
    const Area part = area().part(index, state_.views());
    if (!part.holds(x, y)) continue;
    const samples::render::Camera camera =
        state_.camera.camera(Box{{0, 0, 0}, {0, 0, 0}}, part.width / part.height);
    state_.joint = jointAt(positions, camera, part, x, y).value_or(state_.joint);
  }
}

// -- Reactions ----------------------------------------------------------------------------------

void Viewer::update() {
  const Clock::time_point now = Clock::now();
  const double step = std::min(seconds(now - lastUpdate_), longestStep);
  lastUpdate_ = now;
  openFiles();
  reloadKernels();
  if (!state_.notice.empty() && now > noticeEnd_) {
    state_.notice.clear();
    framesToDraw_ = framesAfterEvent;
  }
  if (view_ == nullptr) return;
  state_.playback.advance(step);
  chooseMethods();
  placeCamera();
  takeErrors();
}

void Viewer::openFiles() {
  if (state_.opens) {
    LoadRequest request;
    request.path = *std::exchange(state_.opens, std::nullopt);
    request.findsCenters = std::ranges::any_of(std::span(state_.methods).first(state_.views()),
                                               needsCentersOfRotation);
    loader_.load(std::move(request));
    framesToDraw_ = framesAfterEvent;
  }
  std::optional<LoadedScene> loaded = loader_.poll();
  if (!loaded) return;
  framesToDraw_ = framesAfterEvent;
  adopt(std::move(*loaded));
}

void Viewer::reloadKernels() {
  KernelFolder* kernels = presenter_->kernels();
  if (kernels == nullptr) return;
  const Result<std::optional<KernelUpdate>> update = kernels->reload(presenter_->device().context);
  if (!update) {
    kernelError_ = update.error().message;
    kernelsUpdate_ = "the old kernels stay in use: " + kernelError_;
    return fail(samples::ExitStatus::badInput, kernelError_);
  }
  if (!*update) return;
  if (state_.error == kernelError_) state_.error.clear();
  kernelError_.clear();
  kernelsUpdate_ = (*update)->text;
  tell(kernelsUpdate_);
  if (!(*update)->isOther || view_ == nullptr) return;
  view_->skinAgain();
  drawn_.reset();
  errors_.reset();
}

void Viewer::adopt(LoadedScene loaded) {
  const std::string path = loaded.request.path;
  Result<void> done = loaded.scene ? adoptScene(path, std::move(*loaded.scene))
                                   : Result<void>(loaded.scene.error());
  if (done) {
    state_.error.clear();
    hasSoughtCenters_ = loaded.request.findsCenters;
  } else {
    state_.methods = methods_;  // The file may have been read again for one of these methods.
    const std::string name = fileName(path), message = done.error().message;
    fail(samples::ExitStatus::badInput,
         message.find(name) == std::string::npos ? name + ": " + message : message);
  }
  hasBegun_ = true;
}

Result<void> Viewer::adoptScene(const std::string& path, cli::Scene scene) {
  std::vector<std::string> notes = scene.warnings;
  for (const auto* more : {&scene.remarks, &scene.notes})
    notes.insert(notes.end(), more->begin(), more->end());
  Result<std::unique_ptr<SceneView>> made =
      SceneView::create(presenter_->device(), std::move(scene));
  if (!made) return made.error();
  const std::uint32_t first = (*made)->scene().model->clips.empty() ? gltf::none : 0u;
  const bool isSame = view_ != nullptr && path == path_;
  const std::uint32_t clip = isSame ? state_.clip : first;
  if (const Result<Box> box = (*made)->extent(clip); !box) return box.error();
  framedClip_ = clip;
  check_.reset();
  errors_.reset();
  drawn_.reset();
  view_ = std::move(*made);
  check_ = std::make_unique<ErrorCheck>(view_->scene());
  notes_ = std::move(notes);
  notes_.insert(notes_.end(), view_->notes().begin(), view_->notes().end());
  if (!isSame) beginWith(path);
  return {};
}

/// Called for a file that was not shown before.
void Viewer::beginWith(const std::string& path) {
  path_ = path;
  const bool isFirst = !hasBegun_;
  const Result<std::uint32_t> clip = cli::chooseClip(
      *view_->scene().model, isFirst ? options_.animation : std::optional<std::string>());
  chooseClip(*view_, clip ? *clip : gltf::none, state_);
  if (isFirst) state_.playback.seek(options_.time);
  if (!clip) fail(samples::ExitStatus::wrongUsage, clip.error().message);
  state_.joint = 0;
  state_.camera.resetDirection();
  state_.frames = true;
  presenter_->window().setTitle(fileName(path) + " – Dermis");
}

/// If a method needs centers of rotation, the file is read again to compute them.
void Viewer::chooseMethods() {
  bool waits = false;
  for (std::size_t index = 0; index < state_.views(); ++index) {
    if (cli::allows(view_->scene(), state_.methods[index])) {
      methods_[index] = state_.methods[index];
      continue;
    }
    if (hasSoughtCenters_) {
      fail(samples::ExitStatus::badInput,
           fmt::format("{} needs centers of rotation, which take too long to compute for {}",
                       methodName(state_.methods[index]), fileName(path_)));
      state_.methods[index] = methods_[index];
      continue;
    }
    waits = true;
  }
  if (waits && loader_.current() == nullptr) loader_.load({path_, true});
}

float Viewer::aspect() const {
  const Area part = area().part(0, state_.views());
  return part.width / std::max(part.height, 1.0f);
}

/// Unless the user has moved it, the camera follows the window's shape and the clip.
void Viewer::placeCamera() {
  const Result<Box> box = view_->extent(state_.clip);
  if (!box) {
    fail(samples::ExitStatus::badInput, box.error().message);
    chooseClip(*view_, framedClip_, state_);
    return;
  }
  const bool isOther = framedAspect_ != aspect() || framedClip_ != state_.clip;
  framedClip_ = state_.clip;
  if (!state_.frames && !(isOther && state_.camera.isFramed())) return;
  state_.frames = false;
  state_.camera.frame(*box, aspect());
  framedAspect_ = aspect();
}

void Viewer::takeErrors() {
  std::optional<Result<CheckResult>> result = check_->poll();
  if (!result) return;
  framesToDraw_ = framesAfterEvent;
  if (!*result) {
    fail(samples::ExitStatus::stopped, (*result).error().message);
    state_.coloring = Coloring::surface;
    return;
  }
  errors_ = std::move(**result);
  if (state_.coloring != Coloring::error) return;
  view_->setErrors(*errors_);
  hasNewColors_ = true;
}

// -- Pictures -----------------------------------------------------------------------------------

Area Viewer::area() const {
  int width = 0, height = 0;
  SDL_GetWindowSize(presenter_->window().handle(), &width, &height);
  return pictureArea(state_, static_cast<float>(width), static_cast<float>(height));
}

VkRect2D Viewer::pixelArea() const {
  const Area part = area();
  const float scale = presenter_->window().pixelsPerUnit();
  const VkExtent2D pixels = presenter_->window().pixels();
  const auto left = std::min(static_cast<std::uint32_t>(part.x * scale), pixels.width - 1);
  return {{static_cast<std::int32_t>(left), 0}, {pixels.width - left, pixels.height}};
}

Shot Viewer::shot() const {
  Shot shot;
  shot.clip = state_.clip;
  shot.time = state_.playback.time();
  shot.methods = methods_;
  shot.views = state_.views();
  shot.camera = state_.camera;
  shot.coloring = state_.coloring;
  shot.joint = state_.joint;
  shot.pixels = pixelArea().extent;
  return shot;
}

/// Whether the errors belong to what is shown.
bool Viewer::isChecked(const Shot& shot) const {
  if (!errors_ || errors_->clip != shot.clip || errors_->time != shot.time ||
      errors_->figures.size() != shot.views)
    return false;
  for (std::size_t index = 0; index < shot.views; ++index) {
    if (errors_->figures[index].method != shot.methods[index]) return false;
  }
  return true;
}

/// Whether the picture has its best quality.
bool Viewer::isSettled() const {
  if (state_.opens || loader_.current() != nullptr) return false;
  if (view_ == nullptr || state_.playback.isPlaying()) return true;
  if (hasNewColors_ || !drawn_ || !(shot() == *drawn_)) return false;
  if (pace_.hasTwo() && !isStillDrawn_) return false;
  return state_.coloring != Coloring::error || (!check_->isBusy() && isChecked(shot()));
}

Facts Viewer::facts() const {
  Facts facts;
  facts.view = view_.get();
  facts.file = fileName(path_);
  facts.notes = notes_;
  facts.methods = methods_;
  facts.device = presenter_->device().device->info().name;
  if (const KernelFolder* kernels = presenter_->kernels(); kernels != nullptr) {
    facts.kernels = options_.shaders;
    facts.kernelsSummary = kernels->summary();
    facts.kernelsUpdate = kernelsUpdate_;
    facts.kernelsAreBroken = !kernelError_.empty();
  }
  if (const LoadRequest* current = loader_.current(); current != nullptr) {
    facts.isLoading = true;
    facts.loading = view_ != nullptr && current->path == path_
                        ? "computing centers of rotation …"
                        : fmt::format("reading {} …", fileName(current->path));
  }
  facts.errors = errors_ ? &*errors_ : nullptr;
  facts.framesPerSecond = state_.playback.isPlaying() ? framesPerSecond_ : 0;
  facts.scale = wasScaled_ ? pace_.moving().scale : 1;
  return facts;
}

Result<void> Viewer::draw() {
  if (state_.takesScreenshot && screenshotName_.empty()) screenshotName_ = nextScreenshotName();
  state_.takesScreenshot = false;
  const Clock::time_point now = Clock::now();
  const Shot wanted = shot();
  const bool isNew = view_ != nullptr && (!drawn_ || !(wanted == *drawn_) || hasNewColors_);
  if (isNew) lastChange_ = now;
  const bool isStill = view_ != nullptr && !isNew && pace_.hasTwo() && !isStillDrawn_ &&
                       (now - lastChange_ >= restBeforeStill || !screenshotName_.empty());
  const bool isCopied = view_ != nullptr && state_.coloring == Coloring::error &&
                        !check_->isBusy() && !isChecked(wanted);
  const bool drawsScene = isNew || isStill || isCopied;
  const bool takesScreenshot = !screenshotName_.empty() && isSettled();
  if (!drawsScene && !takesScreenshot && framesToDraw_ <= 0 && !options_.frames) return {};

  const Result<bool> isReady = presenter_->prepare();
  if (!isReady) return isReady.error();
  if (!*isReady) {
    SDL_Delay(10);  // There is nothing to draw on, and nothing to wait for.
    return {};
  }
  const std::string notice = takesScreenshot ? std::exchange(state_.notice, {}) : state_.notice;
  presenter_->gui().beginFrame();
  drawInterface(facts(), area(), state_);
  presenter_->gui().endFrame();
  state_.notice = notice;

  WindowFrame frame;
  frame.record = [&](VkCommandBuffer commandBuffer) -> Result<void> {
    if (!drawsScene) return {};
    return view_->record(commandBuffer, wanted, isStill ? pace_.still() : pace_.moving(), isStill,
                         isCopied);
  };
  frame.picture = [&] { return view_ != nullptr ? view_->picture() : nullptr; };
  frame.area = pixelArea();
  frame.isReadBack = takesScreenshot;
  const Result<bool> isShown = presenter_->show(frame);
  if (!isShown) return isShown.error();
  if (!*isShown) return {};
  --framesToDraw_;
  ++shownFrames_;
  if (takesScreenshot) keepScreenshot();
  if (!drawsScene) return {};
  drawn_ = wanted;
  hasNewColors_ = false;
  return afterPicture(isStill, isCopied);
}

Result<void> Viewer::afterPicture(bool isStill, bool wasCopied) {
  isStillDrawn_ = isStill;
  wasScaled_ = !isStill && pace_.moving().scale < 1;
  if (Result<void> done = view_->finish(); !done) return done;
  if (!isStill) pace_.measured(view_->times().drawingSeconds);
  if (wasCopied) check_->begin(view_->skinned());
  countPicture();
  framesToDraw_ = std::max(framesToDraw_, 1);  // so that the panel shows its times
  return {};
}

void Viewer::countPicture() {
  ++counted_;
  const double elapsed = seconds(Clock::now() - countedSince_);
  if (elapsed < 0.5) return;
  // A rate that includes a pause is meaningless.
  framesPerSecond_ = elapsed < 3 ? counted_ / elapsed : 0;
  counted_ = 0;
  countedSince_ = Clock::now();
}

void Viewer::keepScreenshot() {
  const std::string name = std::exchange(screenshotName_, {});
  const samples::RequestedOutput picture{"--screenshot", name};
  if (view_ != nullptr) {
    const auto kept = samples::checkOutputFiles({&picture, 1}, view_->scene().model->sideFiles);
    if (!kept) return fail(samples::ExitStatus::wrongUsage, kept.error().message);
  }
  if (Result<void> written = writeScreenshot(presenter_->picture(), name); !written) {
    fail(samples::ExitStatus::stopped, written.error().message);
    return;
  }
  fmt::print("wrote {}\n", name);
  std::fflush(stdout);
  tell("wrote " + name);
}

/// Reports an error in the window and on standard error. Errors caused by the command line
/// determine the exit status, and so do all errors in a run with a fixed number of frames.
void Viewer::fail(samples::ExitStatus status, std::string error) {
  state_.error = std::move(error);
  framesToDraw_ = framesAfterEvent;
  if (status == samples::ExitStatus::wrongUsage) {
    samples::reportWrongUsage(state_.error);
  } else {
    samples::reportError(status, state_.error);
  }
  const bool isAsked = !hasBegun_ || isEnding_ || options_.frames.has_value();
  if (isAsked && status_ == samples::ExitStatus::done) status_ = status;
}

void Viewer::tell(std::string notice) {
  state_.notice = std::move(notice);
  noticeEnd_ = Clock::now() + noticeTime;
  framesToDraw_ = framesAfterEvent;
}

}  // namespace dermis::viewer
