// The program: the loaded model, the shown picture, and the main loop.
#pragma once

#include <chrono>
#include <memory>
#include <optional>
#include <string>

#include "options.h"
#include "pace.h"
#include "presenter.h"
#include "scene_loader.h"
#include "state.h"

namespace dermis::viewer {

class Viewer {
 public:
  Viewer(const Options& options, Presenter& presenter);

  /// Runs until the user quits, or until the requested number of frames has been shown. With a
  /// number of frames, the run is unattended and ends at the first error. Returns the exit status:
  /// not `done` if the program could not do what the command line requests. Fails with
  /// `vulkanError` if a Vulkan call fails.
  Result<samples::ExitStatus> run();

 private:
  using Clock = std::chrono::steady_clock;

  // Input
  void waitForEvents();
  bool waitsForTextField();
  bool isOpeningLetter(const SDL_TextInputEvent& text);
  void handle(const SDL_Event& event);
  void handleMouseMotion(const SDL_MouseMotionEvent& motion);
  void handleMouseButton(const SDL_MouseButtonEvent& button);

  // Reactions
  void update();
  void openFiles();
  void reloadKernels();
  void adopt(LoadedScene loaded);
  Result<void> adoptScene(const std::string& path, cli::Scene scene);
  void beginWith(const std::string& path);
  void chooseMethods();
  void placeCamera();
  void takeErrors();

  // Pictures
  Result<void> draw();
  Shot shot() const;
  bool isChecked(const Shot& shot) const;
  bool isSettled() const;
  Facts facts() const;
  Area area() const;
  VkRect2D pixelArea() const;
  Result<void> afterPicture(bool isStill, bool wasCopied);
  void countPicture();
  void keepScreenshot();
  void tell(std::string notice);
  void fail(samples::ExitStatus status, std::string error);
  float aspect() const;

  const Options& options_;
  Presenter* presenter_;
  State state_;
  SceneLoader loader_;
  std::unique_ptr<SceneView> view_;
  std::unique_ptr<ErrorCheck> check_;  // declared after the view, whose scene it reads
  std::optional<CheckResult> errors_;
  std::string path_;  ///< of the view's file
  std::vector<std::string> notes_;
  bool hasSoughtCenters_ = false;    ///< in the view's file
  std::array<Method, 2> methods_{};  ///< methods that are shown
  std::string kernelsUpdate_, kernelError_;
  bool hasBegun_ = false;  ///< the first model has been read, or reading it has failed

  Pace pace_;
  std::optional<Shot> drawn_;
  bool hasNewColors_ = false, isStillDrawn_ = false, wasScaled_ = false;
  Clock::time_point lastChange_ = Clock::now(), lastUpdate_ = Clock::now(), noticeEnd_;
  int framesToDraw_ = 3;  ///< of the interface, which needs some to settle
  int framesToTextField_ = 0;
  bool opensTextField_ = false;
  std::uint32_t shownFrames_ = 0;
  std::string screenshotName_;  ///< of the next screenshot; empty: none
  bool isEnding_ = false;
  samples::ExitStatus status_ = samples::ExitStatus::done;
  float framedAspect_ = 0;
  std::uint32_t framedClip_ = gltf::none;  ///< the last clip that could be shown
  int pressedX_ = 0, pressedY_ = 0;
  bool isDragging_ = false, hasDragged_ = false;
  Clock::time_point countedSince_ = Clock::now();
  int counted_ = 0;
  double framesPerSecond_ = 0;
};

}  // namespace dermis::viewer
