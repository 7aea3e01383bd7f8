#include "dermis/centers_of_rotation.h"

#include <algorithm>
#include <atomic>
#include <thread>

#include "dermis/text.h"

namespace dermis {
namespace {

/// The vertices in pieces, which threads take as they get to them.
class Work {
 public:
  Work(const CenterOfRotationSolver& solver, std::span<float> centers)
      : solver_(solver), centers_(centers) {}

  std::uint32_t pieces() const {
    return static_cast<std::uint32_t>((centers_.size() + pieceSize - 1) / pieceSize);
  }

  /// Solves one piece; false where none is left, or the work was cancelled.
  bool step() {
    if (cancelled_.load(std::memory_order_relaxed)) return false;
    const std::uint32_t piece = next_.fetch_add(1, std::memory_order_relaxed);
    if (piece >= pieces()) return false;
    const std::size_t first = piece * pieceSize;
    const std::span<float> centers =
        centers_.subspan(first, std::min(pieceSize, centers_.size() - first));
    // Cannot fail: pieces lie in the mesh.
    static_cast<void>(solver_.solve(piece * pieceVertices, centers));
    done_.fetch_add(1, std::memory_order_relaxed);
    return true;
  }

  std::uint32_t done() const { return done_.load(std::memory_order_relaxed); }
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }

 private:
  static constexpr std::uint32_t pieceVertices = 64;
  static constexpr std::size_t pieceSize = std::size_t{3} * pieceVertices;

  const CenterOfRotationSolver& solver_;
  std::span<float> centers_;
  std::atomic<std::uint32_t> next_ = 0, done_ = 0;
  std::atomic<bool> cancelled_ = false;
};

/// Whether to go on.
bool report(const CentersOfRotationOptions& options, float fraction) {
  return options.progress == nullptr || options.progress(options.user, fraction);
}

std::uint32_t threadCount(const CentersOfRotationOptions& options, std::uint32_t pieces) {
  const std::uint32_t wanted =
      options.threadCount != 0 ? options.threadCount : std::thread::hardware_concurrency();
  return std::clamp(wanted, 1u, std::max(pieces, 1u));
}

/// False where it was cancelled. Other threads end before it returns, whatever the outcome.
bool solveAll(Work& work, const CentersOfRotationOptions& options) {
  std::vector<std::thread> others;
  for (std::uint32_t i = 1; i < threadCount(options, work.pieces()); ++i) {
    others.emplace_back([&work] {
      while (work.step()) {
      }
    });
  }
  bool goOn = true;
  while (goOn && work.step()) {
    // The last report is made once all is done.
    const std::uint32_t done = work.done();
    if (done == work.pieces()) break;
    goOn = report(options, static_cast<float>(done) / static_cast<float>(work.pieces()));
  }
  if (!goOn) work.cancel();
  for (std::thread& other : others) other.join();
  return goOn && report(options, 1);
}

}  // namespace

Result<std::vector<float>> centersOfRotation(const MeshView& mesh, std::uint32_t jointCount,
                                             std::span<const std::uint32_t> triangles,
                                             const CentersOfRotationOptions& options) {
  const Error cancelled{ErrorCode::cancelled,
                        "mesh " + inQuotes(mesh.name) + ": its centres were cancelled"};
  const Result<CenterOfRotationSolver> solver =
      CenterOfRotationSolver::make(mesh, jointCount, triangles);
  if (!solver) return solver.error();
  if (!report(options, 0)) return cancelled;
  std::vector<float> centers(std::size_t{3} * solver->vertexCount());
  Work work(*solver, centers);
  if (!solveAll(work, options)) return cancelled;
  return centers;
}

}  // namespace dermis
