// What a plan consists of, and how it is made.
#pragma once

#include <bit>
#include <unordered_map>
#include <vector>

#include "dermis/plan.h"
#include "plan/windows.h"

namespace dermis {

inline constexpr std::uint64_t unitBytes = 16;  ///< offsets into palettes and matrices count these
inline constexpr std::uint32_t notUsed = 0xffffffffu;

/// One mesh with one output layout, in one dispatch; the instances follow in the instance table.
struct GroupKey {
  std::uint64_t mesh = 0;  ///< bytes into the mesh buffer
  std::uint32_t window = 0;
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  std::uint32_t positionStride = 0;
  std::uint32_t normalStride = 0;
  Method method = Method::linear;

  friend bool operator==(const GroupKey&, const GroupKey&) = default;
};

struct GroupKeyHash {
  std::size_t operator()(const GroupKey& key) const {
    std::uint64_t hash = key.mesh;
    for (const std::uint64_t part :
         {std::uint64_t{key.window} << 32 | key.firstVertex,
          std::uint64_t{key.vertexEnd} << 8 | static_cast<std::uint64_t>(key.method),
          std::uint64_t{key.positionStride} << 32 | key.normalStride}) {
      hash = (std::rotl(hash, 29) ^ part) * 0x9e3779b97f4a7c15u;
    }
    return static_cast<std::size_t>(hash ^ (hash >> 32));
  }
};

struct Group {
  GroupKey key;
  std::uint32_t maxInfluences = 0;
  std::uint32_t instances = 0;
  std::uint32_t firstInstance = 0;
  std::uint32_t filled = 0;
};

/// A piece of a job: the whole instance, or a run of its vertices where it is too long for one
/// output range.
struct Piece {
  std::uint32_t group;
  std::uint32_t job;
};

struct Plan::State {
  std::vector<Dispatch> dispatches;
  std::vector<Variant> variants;
  std::vector<std::uint32_t> tables;  ///< palette records, group records, instance records
  std::vector<std::uint32_t>
      paletteUnits;  ///< where each palette stands in the palettes buffer, or notUsed
  std::uint64_t palettesSize = 0;
  std::uint64_t meshesSize = 0, matricesSize = 0, outputSize = 0;
  DeviceLimits limits;
  std::uint32_t instanceCount = 0;
  std::uint64_t vertexCount = 0;

  // Scratch of `makePlan`, kept for its memory.
  std::vector<Group> groups;
  std::vector<VertexRun> runs;
  std::vector<Piece> pieces;
  std::vector<std::uint32_t> order;
  std::unordered_map<GroupKey, std::uint32_t, GroupKeyHash> groupOf;

  void clear();
  Result<void> build(const Batch& batch, const DeviceLimits& deviceLimits, const Tuning& tuning);

 private:
  Result<void> gatherPieces(const Batch& batch);
  void addPiece(const Job& job, std::uint32_t jobIndex, GroupKey key);
  Result<void> placePalettes(const Batch& batch, const Tuning& tuning);
  Result<void> placeGroups(const Batch& batch, const Tuning& tuning);
  void writeInstances(const Batch& batch, std::uint32_t firstRecord);
  Result<void> addDispatch(const Variant& variant, std::uint64_t workgroups,
                           const DispatchConstants& constants);
};

}  // namespace dermis
