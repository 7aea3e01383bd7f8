// Groups of instances that one part of a dispatch skins: one mesh or a part of its vertices, one
// variant, one output layout.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/plan.h"
#include "plan/check.h"
#include "plan/placement.h"

namespace dermis {

inline constexpr std::uint32_t notUsed = 0xffffffffu;

/// Runs of instances with equal keys form a group.
struct GroupKey {
  std::uint64_t mesh = 0;  ///< bytes into the mesh buffer
  PipelineId pipeline{};
  ByStream<std::uint32_t> windows{};
  ByStream<std::uint32_t> strides{};
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  bool isCulled = false;  ///< its instances are chosen on the GPU

  friend bool operator==(const GroupKey&, const GroupKey&) = default;
};

struct Group {
  GroupKey key;
  Variant variant;  ///< of its dispatch
  std::uint32_t instances = 0;
  std::uint32_t firstInstance = 0;  ///< among all, in the order of the dispatches
};

/// A run of an instance's vertices: its group, and where the first vertex of each attribute is.
struct PlacedRun {
  std::uint32_t group = notUsed;
  std::uint32_t joints = 0;           ///< of its pose
  ByStream<std::uint32_t> offsets{};  ///< bytes from the beginning of the window
};

/// What the place of an instance depends on, besides its job.
struct Placing {
  Subject subject;
  OutputWindows windows;
  std::uint32_t jointCount = 0;  ///< of its palette
  bool mayScale = false;         ///< a palette that it reads may scale
  bool isCulled = false;         ///< the GPU chooses whether it is skinned
};

/// Groups exist as long as they contain instances.
class Groups {
 public:
  /// Cuts the vertices of a job into runs (`cutIntoRuns`), appends them, and acquires their groups.
  /// Fails with `limitExceeded` if a kernel cannot see all windows of a run, or if the instance is
  /// culled on the GPU and needs more than one run; nothing is appended then.
  Result<void> place(const Job& job, const OutputStreams& streams, const Placing& placing,
                     const DeviceLimits& limits, const Tuning& tuning,
                     std::vector<PlacedRun>& runs);
  void release(std::uint32_t group);
  void clear();

 private:
  friend struct Work;
  struct Entry {
    Group group;
    std::uint32_t users = 0;
    std::uint32_t next = notUsed;  ///< of those with the same head
    std::uint64_t plan = 0;        ///< the last one that it was used in …
    std::uint32_t planGroup = 0;   ///< … and its number there
  };
  void chooseVariant(const Job& job, const OutputStreams& streams, bool mayScale,
                     const DeviceLimits& limits, const Tuning& tuning);
  std::uint32_t acquire(const GroupKey& key, const Variant& variant);
  std::uint32_t findOrAdd(const GroupKey& key, const Variant& variant);
  std::uint32_t& headOf(const GroupKey& key);
  void growHeads();

  std::vector<Entry> entries_;
  std::vector<std::uint32_t> free_;
  std::vector<std::uint32_t> heads_;  ///< hash table: lists of entries; its size is a power of two
  /// The group that was acquired last: consecutive instances mostly have the same one.
  std::uint32_t last_ = notUsed;
  LayoutNeeds lastLayout_;  ///< of the job that was placed last …
  FormNeeds lastForm_;
  Variant lastVariant_;        ///< … its variant …
  PipelineId lastPipeline_{};  ///< … and the ID of that; 0: there is none
  std::vector<VertexRun> vertexRuns_;
};

}  // namespace dermis
