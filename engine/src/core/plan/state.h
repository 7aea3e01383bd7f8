// What a plan consists of, and how it is made.
#pragma once

#include <array>
#include <bit>
#include <optional>
#include <unordered_map>
#include <vector>

#include "abi.h"
#include "dermis/plan.h"
#include "plan/windows.h"

namespace dermis {

inline constexpr std::uint64_t unitBytes = 16;  ///< offsets into palettes and matrices count these
inline constexpr std::uint32_t notUsed = 0xffffffffu;

/// What stands in the palettes buffer for a joint.
enum class PaletteForm : std::uint8_t { dualQuaternions, logarithms };
inline constexpr std::size_t paletteFormCount = 2;

/// What a method reads; nothing where it reads the joint matrices themselves.
inline std::optional<PaletteForm> paletteForm(Method method) {
  if (method == Method::linear) return std::nullopt;
  return method == Method::logMatrix ? PaletteForm::logarithms : PaletteForm::dualQuaternions;
}

inline std::uint32_t unitsOfJoint(PaletteForm form) {
  return form == PaletteForm::logarithms ? abi::UNITS_OF_LOGARITHM : abi::UNITS_OF_DUAL_QUATERNION;
}

/// Units of a palette: its status, its joints, and their scale/shear parts.
inline std::uint64_t paletteSize(PaletteForm form, std::uint32_t jointCount, bool mayScale) {
  return 1 + std::uint64_t{jointCount} * (unitsOfJoint(form) + (mayScale ? 2 : 0));
}

/// The flags of its record.
inline std::uint32_t paletteFlags(PaletteForm form, bool mayScale) {
  return (mayScale ? abi::PALETTE_MAY_SCALE : 0u) |
         (form == PaletteForm::logarithms ? abi::PALETTE_LOGARITHMS : 0u);
}

/// One mesh with one output layout, in one dispatch; the instances follow in the instance table.
struct GroupKey {
  std::uint64_t mesh = 0;     ///< bytes into the mesh buffer
  std::uint64_t variant = 0;  ///< its key
  std::array<std::uint32_t, streamCount> windows{};
  std::array<std::uint32_t, streamCount> strides{};
  std::uint32_t firstVertex = 0;
  std::uint32_t vertexEnd = 0;
  bool isCulled = false;  ///< its instances are chosen on the GPU

  friend bool operator==(const GroupKey&, const GroupKey&) = default;
};

struct GroupKeyHash {
  std::size_t operator()(const GroupKey& key) const {
    std::uint64_t hash = key.mesh;
    const auto add = [&hash](std::uint64_t part) {
      hash = (std::rotl(hash, 29) ^ part) * 0x9e3779b97f4a7c15u;
    };
    add(key.variant);
    for (std::size_t stream = 0; stream < streamCount; ++stream)
      add(std::uint64_t{key.windows[stream]} << 32 | key.strides[stream]);
    add(std::uint64_t{key.firstVertex} << 32 | key.vertexEnd);
    add(key.isCulled ? 1 : 0);
    return static_cast<std::size_t>(hash ^ (hash >> 32));
  }
};

struct Group {
  GroupKey key;
  Variant variant;  ///< of its dispatch, but for the influences and scale
  std::uint32_t maxInfluences = 0;
  bool scales = false;
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
  /// Palette records, group records, instance records, then extensions and active morph targets.
  std::vector<std::uint32_t> tables;
  /// Where each palette stands in the palettes buffer in each form, or notUsed.
  std::array<std::vector<std::uint32_t>, paletteFormCount> paletteUnits;
  std::vector<std::uint32_t> results;  ///< each job's number among the results, or notUsed
  std::uint32_t resultCount = 0;
  std::uint64_t palettesSize = 0;
  std::uint64_t meshesSize = 0, matricesSize = 0;
  OutputSizes outputs;
  DeviceLimits limits;
  std::uint32_t instanceCount = 0;
  std::uint64_t vertexCount = 0;

  // Scratch of `makePlan`, kept for its memory.
  std::vector<Group> groups;
  std::vector<VertexRun> runs;
  std::vector<Piece> pieces;
  std::vector<std::uint32_t> order;
  std::vector<MorphWeight> sortedMorphs;
  std::unordered_map<GroupKey, std::uint32_t, GroupKeyHash> groupOf;

  void clear();
  Result<void> build(const Batch& batch, const DeviceLimits& deviceLimits, const Tuning& tuning);

  /// Appends the palette kernel's records: `palettes` of them stand at the beginning of the tables,
  /// and behind them the numbers of the results that it clears.
  Result<void> addPaletteDispatch(const Tuning& tuning, std::uint32_t palettes,
                                  std::span<const std::uint32_t> clearedResults);
  /// Appends a record for each of `groups`, whose instances follow, and the dispatches.
  Result<void> placeGroups(const Tuning& tuning);
  /// When all tables have been written: how the dispatches read, and which variants there are.
  void chooseTexels();
  void listVariants();

 private:
  Result<void> addDispatch(const Variant& variant, std::uint64_t workgroups,
                           const DispatchConstants& constants);
  Result<void> gatherPieces(const Batch& batch, const Tuning& tuning);
  void addPiece(const Job& job, std::uint32_t jobIndex, const GroupKey& key, const Variant& variant,
                bool scales);
  Result<void> placePalettes(const Batch& batch, const Tuning& tuning);
  std::uint32_t placePalettes(const Batch& batch, PaletteForm form, std::uint64_t& units);
  void writeInstances(const Batch& batch, std::uint32_t firstRecord);
  std::uint32_t paletteOf(const Batch& batch, Method method, std::uint32_t palette) const;
  std::uint32_t appendExtension(const Batch& batch, std::uint32_t jobIndex);
  std::array<std::uint32_t, 2> appendMorphs(std::span<const MorphWeight> morphs);
};

}  // namespace dermis
