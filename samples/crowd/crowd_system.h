// A SkinningSystem of either kind, on the GPU or the CPU, with the calls that both have.
#pragma once

#include <utility>
#include <variant>

#include "dermis/cpu/skinning_system.h"
#include "dermis/vulkan/skinning_system.h"

namespace crowd {

class CrowdSystem {
 public:
  explicit CrowdSystem(dermis::vulkan::SkinningSystem system) : system_(std::move(system)) {}
  explicit CrowdSystem(dermis::cpu::SkinningSystem system) : system_(std::move(system)) {}

  /// Exactly one of the two is not null.
  const dermis::vulkan::SkinningSystem* onDevice() const {
    return std::get_if<dermis::vulkan::SkinningSystem>(&system_);
  }
  dermis::vulkan::SkinningSystem* onDevice() {
    return std::get_if<dermis::vulkan::SkinningSystem>(&system_);
  }
  const dermis::cpu::SkinningSystem* onCpu() const {
    return std::get_if<dermis::cpu::SkinningSystem>(&system_);
  }
  dermis::cpu::SkinningSystem* onCpu() {
    return std::get_if<dermis::cpu::SkinningSystem>(&system_);
  }

  dermis::Result<dermis::MeshHandle> addMesh(const dermis::PackedMesh& mesh) {
    return std::visit([&](auto& system) { return system.addMesh(mesh); }, system_);
  }
  dermis::Result<dermis::PoseHandle> addPose(std::uint32_t jointCount) {
    return std::visit([&](auto& system) { return system.addPose(jointCount); }, system_);
  }
  dermis::Result<void> removePose(dermis::PoseHandle pose) {
    return std::visit([&](auto& system) { return system.removePose(pose); }, system_);
  }
  dermis::Result<dermis::InstanceHandle> addInstance(
      const dermis::InstanceDescription& description) {
    return std::visit([&](auto& system) { return system.addInstance(description); }, system_);
  }
  dermis::Result<void> removeInstance(dermis::InstanceHandle instance) {
    return std::visit([&](auto& system) { return system.removeInstance(instance); }, system_);
  }
  dermis::Result<std::span<dermis::JointMatrix>> writePose(dermis::PoseHandle pose) {
    return std::visit([&](auto& system) { return system.writePose(pose); }, system_);
  }
  dermis::Result<void> change(const dermis::InstanceChange& change) {
    return std::visit([&](auto& system) { return system.change(change); }, system_);
  }
  std::uint64_t compact(std::uint64_t maxBytes) {
    return std::visit([&](auto& system) { return system.compact(maxBytes); }, system_);
  }
  dermis::Result<dermis::InstanceOutput> output(dermis::InstanceHandle instance) const {
    return std::visit([&](const auto& system) { return system.output(instance); }, system_);
  }
  std::span<const dermis::InstanceHandle> skinnedInstances() const {
    return std::visit([](const auto& system) { return system.skinnedInstances(); }, system_);
  }

 private:
  std::variant<dermis::vulkan::SkinningSystem, dermis::cpu::SkinningSystem> system_;
};

}  // namespace crowd
