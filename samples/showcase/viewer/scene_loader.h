// Reads models on another thread, so that the window stays responsive.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "skinned_scene.h"

namespace dermis::viewer {

struct LoadRequest {
  std::string path;
  /// Compute the centers of rotation, which some methods need. This takes some time.
  bool findsCenters = false;
};

struct LoadedScene {
  LoadRequest request;
  Result<cli::Scene> scene;
};

class SceneLoader {
 public:
  /// Cancels an earlier request that has not begun.
  void load(LoadRequest request);
  /// The current request, or null.
  const LoadRequest* current() const { return current_ ? &*current_ : nullptr; }
  /// Returns a finished model, once. Call it repeatedly.
  std::optional<LoadedScene> poll();

 private:
  void begin(LoadRequest request);

  std::optional<LoadRequest> current_, next_;
  std::mutex mutex_;
  std::optional<Result<cli::Scene>> done_;
  std::jthread thread_;  // last, so that it ends first
};

}  // namespace dermis::viewer
