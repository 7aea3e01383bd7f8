// Reads models on a thread of its own, so that the window goes on.
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
  /// Find the centers of rotation, which some methods need and which takes its time.
  bool findsCenters = false;
};

struct LoadedScene {
  LoadRequest request;
  Result<cli::Scene> scene;
};

class SceneLoader {
 public:
  /// What was asked for before and has not begun is forgotten.
  void load(LoadRequest request);
  /// What is being read, or nothing.
  const LoadRequest* current() const { return current_ ? &*current_ : nullptr; }
  /// What has been read since, once. To be called again and again.
  std::optional<LoadedScene> poll();

 private:
  void begin(LoadRequest request);

  std::optional<LoadRequest> current_, next_;
  std::mutex mutex_;
  std::optional<Result<cli::Scene>> done_;
  std::jthread thread_;  // last, so that it ends first
};

}  // namespace dermis::viewer
