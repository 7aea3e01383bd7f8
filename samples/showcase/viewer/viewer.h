// The program: the loaded model, the shown picture, and the main loop.
#pragma once

#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>

#include "dermis/layout.h"
#include "interface.h"
#include "kit/program.h"
#include "window.h"

namespace dermis {
class RuntimeCompiler;
}

namespace dermis::viewer {

struct ViewerOptions {
  std::string model;  ///< empty: no model
  Method method = Method::dualQuaternion;
  std::optional<Method> comparison;  ///< shown next to `method`
  double time = 0;                   ///< seconds
  bool isPaused = false;
  std::optional<std::uint32_t> frames;  ///< end after this number of frames
  std::string screenshot;               ///< written at the end; empty: none
  RuntimeCompiler* compiler = nullptr;  ///< of the device's kernels, if they can change
};

class Viewer {
 public:
  /// `options` and `window` must outlive it.
  Viewer(const ViewerOptions& options, Window& window);

  /// Runs until the user quits, or until the requested number of frames has been shown. With a
  /// number of frames, the run is unattended and ends at the first error. Returns the exit status:
  /// not `done` if the program could not do what the command line requests. Fails with
  /// `vulkanError` if a Vulkan call fails.
  Result<samples::ExitStatus> run();

 private:
  using Clock = std::chrono::steady_clock;

  void handleEvents();
  void handle(const SDL_Event& event);
  void handleMotion(const SDL_MouseMotionEvent& motion);
  void update();
  void load(const std::string& path);
  void adopt(Result<cli::Scene> scene);
  Result<void> showScene(cli::Scene scene);
  void checkMethods();
  void placeCamera();
  void reloadKernels();
  bool isMoving() const {
    return view_ != nullptr && state_.isPlaying && view_->duration(state_.shot.clip) > 0;
  }
  bool isLoading() const { return opens_ || loading_.valid(); }
  Result<void> draw();
  void takeScreenshot();
  void tell(std::string notice);
  void fail(samples::ExitStatus status, std::string error);

  const ViewerOptions& options_;
  Window& window_;
  State state_;
  std::unique_ptr<SceneView> view_;
  std::optional<std::string> opens_;    ///< the file to load next
  std::string path_;                    ///< of the file that is being loaded
  std::optional<Shot> drawn_;           ///< the last picture of the view
  std::uint32_t framedClip_ = noIndex;  ///< the last clip that could be shown
  Clock::time_point lastUpdate_ = Clock::now();
  int framesToDraw_ = 3;  ///< of the interface, which needs some to settle
  std::uint32_t shownFrames_ = 0;
  std::string screenshot_;  ///< name of the next screenshot; empty: none
  bool isFirst_ = true;     ///< the model of the command line is not there yet
  bool isEnding_ = false;
  samples::ExitStatus status_ = samples::ExitStatus::done;
  std::future<Result<cli::Scene>> loading_;  ///< last: its destructor waits
};

}  // namespace dermis::viewer
