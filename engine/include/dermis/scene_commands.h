// A scene for an engine with its own RHI: the commands of each frame, and the buffers that they
// use.
//
//     SceneCommands commands = *SceneCommands::create({.limits = limits, .memory = memory});
//     Scene& scene = commands.scene();
//
// and in each frame:
//
//     scene.beginFrame(frame, completedFrame);
//     ... add, remove, change, write poses ...
//     for (const Command& command : *commands.plan()) ...       // execute it
//     commands.commit();
//     draw from the buffer `commands.outputBuffer()` at scene.output(instance)
//
// Buffers have numbers, which the scene chooses. samples/own_rhi is such an engine.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>

#include "dermis/export.h"
#include "dermis/handle.h"
#include "dermis/plan.h"
#include "dermis/result.h"
#include "dermis/scene.h"

namespace dermis {

/// A buffer that a scene asks for.
struct SceneBuffer {
  std::uint32_t number = 0;  ///< by which commands name it; no other buffer of the scene gets it
  BufferRole role = BufferRole::positions;
  /// Its usage includes what the scene copies; the engine adds its own, for example VERTEX_BUFFER
  /// for `positions`, the output of all attributes.
  BufferRequirement requirement;
  /// Whether the scene writes it (`poses`) or reads it (`readBack`) through a mapping, if it gets
  /// one. The memory is then host-coherent, and for `readBack` host-cached if possible.
  bool isMapped = false;
};

/// Creates and releases the buffers of a scene. Functions of the scene and of its owner call it. It
/// must not throw, and must not call the scene.
struct SceneMemory {
  void* user = nullptr;  ///< passed to both functions
  /// Creates a buffer, or reserves a part of one that the engine has. Returns the address of its
  /// first byte if it is mapped, otherwise null. If poses are not mapped, the plan uploads them; if
  /// a read-back buffer is not, the engine calls `SceneCommands::readBack`. If it fails, the scene
  /// asks for a smaller buffer, or the function of the scene fails with the same error.
  Result<void*> (*create)(void* user, const SceneBuffer& buffer) = nullptr;
  /// Releases a buffer that no frame in flight uses. Buffers that remain when the owner is
  /// destroyed are not released.
  void (*release)(void* user, std::uint32_t number) = nullptr;
};

/// What `SceneCommands::create` needs to know.
struct SceneCommandsDescription {
  SceneDescription scene;
  DeviceLimits limits;  ///< of the device
  Tuning tuning;
  SceneMemory memory;  ///< required
  /// Byte offset of the output in its buffer, if that is part of a larger one. Offsets in
  /// `InstanceOutput` count from the beginning of that buffer, those in commands from here. Must be
  /// a multiple of the alignment of the output, which need not be a power of two.
  std::uint64_t outputOffset = 0;
};

/// Owns a scene, and lists the commands of its frames. May be moved.
class DERMIS_CORE_API SceneCommands {
 public:
  /// Creates the first buffers. Fails with `invalidArgument` if a member of the description is not
  /// valid, with `limitExceeded` if an initial capacity needs a buffer larger than a storage buffer
  /// range, and with the error of `SceneMemory::create`.
  static Result<SceneCommands> create(const SceneCommandsDescription& description);
  ~SceneCommands();
  SceneCommands(SceneCommands&&) noexcept;
  SceneCommands& operator=(SceneCommands&&) noexcept;

  /// As long as this object exists.
  Scene& scene() const;

  /// Lists the commands for everything that changed since the last `commit`. If nothing changed,
  /// there are none; but if instances are culled on the GPU, there are commands in every frame. May
  /// be called any number of times between `beginFrame` and `commit`. The list is valid until the
  /// next call of a function of the scene or of this object. Fails with `invalidArgument` if
  /// `beginFrame` was not called, with `limitExceeded` if the tables are larger than a storage
  /// buffer range, and with the error of `SceneMemory::create`.
  Result<std::span<const Command>> plan();
  /// States that the commands of the last `plan` have been recorded, and will be executed in the
  /// order of frames. Without it, the next `plan` lists the same work again. Fails with
  /// `invalidArgument` if there is no plan, or if the scene was changed after it.
  Result<void> commit();
  /// For read-back buffers that are not mapped: reads the results of a complete frame. Call it
  /// after `beginFrame`, for each complete frame in ascending order. Boxes of a frame that is left
  /// out are missing until the instance is skinned again. `bytes` are those of the buffer that the
  /// commands of the frame copied to; empty if they copied nothing. Fails with `invalidArgument` if
  /// the frame is not complete, not newer than the last one that was read back, or not one of the
  /// last `framesInFlight` that were committed, and if `bytes` is smaller than what was copied.
  Result<void> readBack(std::uint64_t frame, std::span<const std::byte> bytes);

  /// The number of the output buffer as of the last `commit`. It changes when the output grows;
  /// offsets stay the same.
  std::uint32_t outputBuffer() const;
  /// Where a GPU pass of the engine writes the joint matrices of a pose. The place stays the same
  /// until the pose is removed. Fails with `invalidArgument` for a pose that the CPU writes.
  Result<BufferPart> posePart(PoseHandle pose) const;

 private:
  SceneCommands();
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace dermis
