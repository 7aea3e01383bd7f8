// Batches for tests of plans, and a stand-in for the kernels: it reads the tables as shaders/abi.h
// lays them out, as skin.comp and palette.comp do, and marks what they would write.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <random>
#include <vector>

#include "dermis/mesh.h"
#include "dermis/plan.h"

namespace dermis::test {

struct MeshParts {
  bool normals = false;
  bool tangents = false;
  std::uint32_t morphTargets = 0;
  bool centers = true;  ///< of rotation
};

/// A packed mesh of which every vertex has so many influences and the last joint is used.
PackedMesh meshOf(std::uint32_t vertices, std::uint32_t influences, std::uint32_t joints,
                  MeshParts parts);
PackedMesh meshOf(std::uint32_t vertices, std::uint32_t influences, std::uint32_t joints,
                  bool normals);

enum class Arrangement { interleaved, planar, separate };

/// A batch that owns what it points to. Meshes and poses are laid out one after another.
struct OwnedBatch {
  OwnedBatch() = default;
  /// One mesh and a pose that does not scale.
  OwnedBatch(PackedMesh mesh, std::uint32_t joints);
  OwnedBatch(OwnedBatch&&) = default;
  OwnedBatch& operator=(OwnedBatch&&) = default;

  std::vector<PackedMesh> meshes;
  std::vector<std::uint64_t> meshOffsets;
  std::vector<PoseDescription> poses;
  std::vector<Job> jobs;
  std::uint64_t meshesSize = 0, posesSize = 0;
  std::uint64_t outputSize = 0;  ///< of the one buffer …
  bool hasSeparateOutputs = false;
  ByStream<std::uint64_t> separateSizes{};  ///< … or of these

  void addMesh(PackedMesh mesh);
  void addPose(std::uint32_t joints, JointPromise promise);

  /// Positions, and normals behind them, as float32x3 in a stretch of its own at the output's end.
  Job& addJob(std::uint32_t mesh, std::uint32_t pose, Method method, bool normals,
              std::uint32_t stride = 24);
  /// A job whose formats, motion and the like are chosen already: finds a place for its attributes,
  /// with `gap` unused bytes after each vertex.
  Job& place(Job job, Arrangement arrangement, std::uint32_t gap = 0);
  /// A job of that mesh, not yet placed.
  Job jobOf(std::uint32_t mesh, std::uint32_t pose, Method method) const;

  /// The batch keeps the list; the span is valid as long as it lives.
  std::span<const MorphWeight> keep(std::vector<MorphWeight> morphs);

  Batch batch() const;

 private:
  std::uint64_t& endOf(std::size_t stream) {
    return hasSeparateOutputs ? separateSizes[stream] : outputSize;
  }
  std::deque<std::vector<MorphWeight>> morphLists_;
};

/// Meshes of awkward counts, with and without normals, tangents and morph targets, with 1 to 8
/// influences; and four poses.
OwnedBatch batchOfFiveMeshes();

/// Float32 positions and normals in one buffer, interleaved or planar: what any device can do.
OwnedBatch randomBatch(std::uint32_t seed, std::uint32_t jobs);
/// Everything that jobs may have, in one buffer or several.
OwnedBatch randomRichBatch(std::uint32_t seed, std::uint32_t jobs, bool separate);

/// A device with storage buffers for every attribute that may store bytes.
DeviceLimits richLimits();

bool wantsResult(const Job& job);
/// What the tables must list: by rising target, none of weight 0.
std::vector<MorphWeight> activeMorphs(std::span<const MorphWeight> morphs);

std::vector<std::uint32_t> tablesOf(const Plan& plan);
void expectEmpty(const Plan& plan);

/// Makes the plan and runs it; fails the test where what the kernels would do is not the batch's
/// work, done once.
void expectPlanned(const OwnedBatch& batch, const DeviceLimits& limits, const Tuning& tuning,
                   Plan& out);
/// The same; throws where it fails the test.
Plan planned(const OwnedBatch& batch, const DeviceLimits& limits = {}, const Tuning& tuning = {});

}  // namespace dermis::test
