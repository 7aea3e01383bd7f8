#include "dermis/scene.h"

#include <utility>

#include "plan/check.h"
#include "scene/books.h"

namespace dermis {

struct SceneCommands::State {
  std::unique_ptr<Scene> scene;
  Plan plan;
};

SceneCommands::SceneCommands() = default;
SceneCommands::~SceneCommands() = default;
SceneCommands::SceneCommands(SceneCommands&&) noexcept = default;
SceneCommands& SceneCommands::operator=(SceneCommands&&) noexcept = default;

Result<SceneCommands> SceneCommands::create(const SceneCommandsDescription& description) {
  if (description.createBuffer == nullptr || description.releaseBuffer == nullptr)
    return invalid("SceneCommandsDescription::createBuffer and releaseBuffer are required");
  SceneOwner owner;
  owner.user = description.user;
  owner.createBuffer = description.createBuffer;
  owner.releaseBuffer = description.releaseBuffer;
  Result<std::unique_ptr<Scene>> scene = SceneAccess::create(
      {description.scene, description.limits, description.tuning, description.outputOffset}, owner);
  if (!scene) return scene.error();
  SceneCommands commands;
  commands.state_ = std::make_unique<State>();
  commands.state_->scene = std::move(*scene);
  return commands;
}

Scene& SceneCommands::scene() const {
  return *state_->scene;
}

Result<std::span<const Command>> SceneCommands::plan(std::span<std::byte> tables) {
  if (Result<void> planned = SceneAccess::books(scene()).plan(state_->plan, tables); !planned)
    return planned.error();
  return state_->plan.commands();
}
Result<void> SceneCommands::commit() {
  return SceneAccess::books(scene()).commit();
}
Result<void> SceneCommands::readBack(std::uint64_t frame, std::span<const std::byte> bytes) {
  return SceneAccess::books(scene()).readBack(frame, bytes);
}
std::uint32_t SceneCommands::outputBuffer() const {
  return SceneAccess::books(scene()).output_;
}
Result<BufferPart> SceneCommands::posePart(PoseHandle pose) const {
  return SceneAccess::books(scene()).posePart(pose);
}
Result<BufferPart> SceneCommands::weightsPart(InstanceHandle instance) const {
  return SceneAccess::books(scene()).weightsPart(instance);
}
Result<BufferPart> SceneCommands::drivenPart(PoseHandle pose) const {
  return SceneAccess::books(scene()).drivenPart(pose);
}

}  // namespace dermis
