#include "scene_loader.h"

#include <exception>
#include <utility>

namespace dermis::viewer {
namespace {

Result<cli::Scene> read(const LoadRequest& request) {
  cli::MeshPreparation preparation;
  preparation.images = true;
  preparation.centersOfRotation = request.findsCenters;
  preparation.mostCenterTerms = cli::mostCenterTermsAsked;
  try {
    return cli::loadScene(request.path, preparation);
  } catch (const std::exception& error) {
    return Error{ErrorCode::ioError, "'" + request.path + "': " + error.what()};
  }
}

}  // namespace

void SceneLoader::load(LoadRequest request) {
  if (current_) {
    next_ = std::move(request);
  } else {
    begin(std::move(request));
  }
}

void SceneLoader::begin(LoadRequest request) {
  current_ = request;
  thread_ = std::jthread([this, request = std::move(request)] {
    Result<cli::Scene> scene = read(request);
    const std::lock_guard lock(mutex_);
    done_.emplace(std::move(scene));
  });
}

std::optional<LoadedScene> SceneLoader::poll() {
  if (!current_) return std::nullopt;
  {
    const std::lock_guard lock(mutex_);
    if (!done_) return std::nullopt;
  }
  thread_.join();
  LoadedScene loaded{*std::exchange(current_, std::nullopt), *std::exchange(done_, std::nullopt)};
  if (!next_) return loaded;
  begin(*std::exchange(next_, std::nullopt));
  return std::nullopt;  // superseded by a later request
}

}  // namespace dermis::viewer
