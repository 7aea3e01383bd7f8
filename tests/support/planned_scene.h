// A scene whose buffers are only counted: for tests of what its frames list.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "dermis/scene.h"
#include "plan/plan_data.h"
#include "plan_commands.h"
#include "scene/books.h"
#include "scene_meshes.h"

namespace dermis::test {

class PlannedScene {
 public:
  explicit PlannedScene(const SceneCommandsDescription& description) : PlannedScene() {
    must(tryToCreate(description));
  }
  PlannedScene() = default;
  PlannedScene(const PlannedScene&) = delete;
  PlannedScene& operator=(const PlannedScene&) = delete;

  /// The functions of the description are not used.
  Result<void> tryToCreate(const SceneCommandsDescription& description) {
    SceneOwner owner;
    owner.user = this;
    owner.createBuffer = [](void* user, const SceneBuffer& wanted) {
      return static_cast<PlannedScene*>(user)->create(wanted);
    };
    owner.releaseBuffer = [](void* user, std::uint32_t number) {
      EXPECT_EQ(static_cast<PlannedScene*>(user)->buffers.erase(number), 1u);
    };
    Result<std::unique_ptr<Scene>> made = SceneAccess::create(
        {description.scene, description.limits, description.tuning, description.outputOffset},
        owner);
    if (!made) return made.error();
    scene_ = std::move(*made);
    return {};
  }

  Scene& scene() const { return *scene_; }
  SceneBooks& books() const { return SceneAccess::books(*scene_); }
  /// Without its bytes.
  Result<MeshHandle> addMesh(const MeshInfo& info) {
    return SceneAccess::changed(*scene_).addMesh(info, nullptr);
  }
  /// Plans twice, into memory with other contents: the tables are the same. With `lentBytes` 0, or
  /// where they are too few, the tables are elsewhere.
  Result<void> plan() {
    std::vector<std::byte> tables;
    const std::uint32_t version = books().nextVersion_;  // each plan gives new ones
    for (const std::byte before : {std::byte{0xff}, std::byte{0x35}}) {
      books().nextVersion_ = version;
      lent_.assign(lentBytes + 4, before);
      if (Result<void> good = planOnce(std::span(lent_).first(lentBytes)); !good) return good;
      const std::span<const std::byte> now = PlanData::of(planned).tables.bytes();
      if (before != std::byte{0xff}) {
        EXPECT_TRUE(std::ranges::equal(now, tables)) << "words of the tables were not written";
      }
      tables.assign(now.begin(), now.end());
      if (!now.empty()) {
        EXPECT_EQ(now.data() == lent_.data(), now.size() <= lentBytes);
      }
      EXPECT_TRUE(std::ranges::all_of(std::span(lent_).subspan(lentBytes),
                                      [&](std::byte byte) { return byte == before; }));
    }
    return {};
  }
  Result<void> planOnce(std::span<std::byte> lent) { return books().plan(planned, lent); }
  Result<void> commit() { return books().commit(); }
  Result<void> readBack(std::uint64_t frame, std::span<const std::byte> bytes) {
    return books().readBack(frame, bytes);
  }
  void record() {
    must(plan());
    must(commit());
  }
  /// Vulkan does not order copies that no barrier separates: none may write what another reads or
  /// writes.
  void expectCopiesApart() const {
    std::vector<BufferPart> written, read;
    const auto overlap = [](const BufferPart& a, const BufferPart& b) {
      return a.buffer == b.buffer && a.offset < b.offset + b.size && b.offset < a.offset + a.size;
    };
    const auto expectApart = [&](const BufferPart& part, const std::vector<BufferPart>& others) {
      for (const BufferPart& other : others)
        EXPECT_FALSE(overlap(part, other)) << "buffer " << part.buffer << ", at " << part.offset;
    };
    for (const Command& command : planned.commands()) {
      if (std::holds_alternative<BarrierCommand>(command)) {
        written.clear();
        read.clear();
      }
      BufferPart to;
      if (const auto* upload = std::get_if<UploadCommand>(&command)) to = upload->to;
      if (const auto* clear = std::get_if<ClearCommand>(&command)) to = clear->part;
      if (const auto* copy = std::get_if<CopyCommand>(&command)) {
        to = {copy->to, copy->toOffset, copy->size};
        read.push_back({copy->from, copy->fromOffset, copy->size});
        expectApart(read.back(), written);
      }
      expectApart(to, written);
      expectApart(to, read);
      written.push_back(to);
    }
  }
  /// Of the buffer with this role, the newest one; 0 if there is none.
  std::uint64_t sizeOf(BufferRole role) const {
    std::uint64_t size = 0;
    for (const auto& [number, buffer] : buffers) {
      if (buffer.role == role) size = buffer.requirement.size;
    }
    return size;
  }
  BufferRole roleOf(std::uint32_t number) const {
    return number == visibilityBuffer ? BufferRole::visibility : buffers.at(number).role;
  }

  std::map<std::uint32_t, SceneBuffer> buffers;  ///< by number
  std::vector<SceneBuffer> asked;                ///< all that were
  /// Refuses a buffer, if it returns an error.
  std::function<Result<void>(const SceneBuffer&)> refuses;
  bool mapsPoses = true;
  std::size_t lentBytes = 4096;  ///< for tables
  Plan planned;

 private:
  std::vector<std::byte> lent_;

  Result<void*> create(const SceneBuffer& wanted) {
    asked.push_back(wanted);
    if (refuses) {
      if (Result<void> good = refuses(wanted); !good) return good.error();
    }
    EXPECT_TRUE(buffers.emplace(wanted.number, wanted).second) << "a number is used again";
    if (wanted.role != BufferRole::poses || !mapsPoses) return static_cast<void*>(nullptr);
    memory_.emplace_back(wanted.requirement.size);
    return static_cast<void*>(memory_.back().data());
  }

  std::unique_ptr<Scene> scene_;
  std::vector<std::vector<std::byte>> memory_;
};

}  // namespace dermis::test
