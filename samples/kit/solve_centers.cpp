#include "kit/solve_centers.h"

#include <algorithm>
#include <atomic>
#include <span>
#include <thread>

namespace dermis::samples {
namespace {

constexpr std::uint32_t verticesOfJob = 64;

/// The jobs of a mesh. Each thread takes the next until none is left.
class Jobs {
 public:
  Jobs(const CenterOfRotationSolver& solver, std::span<float> centers)
      : solver_(solver),
        centers_(centers),
        count_((solver.vertexCount() + verticesOfJob - 1) / verticesOfJob) {}

  std::uint32_t count() const { return count_; }
  std::uint32_t done() const { return done_.load(std::memory_order_relaxed); }

  /// False if none is left.
  bool doNext() {
    const std::uint32_t job = next_.fetch_add(1, std::memory_order_relaxed);
    if (job >= count_) return false;
    const std::uint32_t first = job * verticesOfJob;
    const std::uint32_t vertices = std::min(verticesOfJob, solver_.vertexCount() - first);
    // Cannot fail: the vertices are in the mesh.
    static_cast<void>(
        solver_.solve(first, centers_.subspan(std::size_t{3} * first, std::size_t{3} * vertices)));
    done_.fetch_add(1, std::memory_order_relaxed);
    return true;
  }

 private:
  const CenterOfRotationSolver& solver_;
  std::span<float> centers_;
  std::uint32_t count_;
  std::atomic<std::uint32_t> next_ = 0, done_ = 0;
};

}  // namespace

std::vector<float> solveCenters(const CenterOfRotationSolver& solver, std::uint32_t threadCount,
                                const std::function<void(float)>& progress) {
  std::vector<float> centers(std::size_t{3} * solver.vertexCount());
  Jobs jobs(solver, centers);
  if (threadCount == 0) threadCount = std::max(std::thread::hardware_concurrency(), 1u);
  std::vector<std::thread> others;
  for (std::uint32_t i = 1; i < std::min(threadCount, jobs.count()); ++i) {
    others.emplace_back([&jobs] {
      while (jobs.doNext()) {
      }
    });
  }
  while (jobs.doNext()) {
    const std::uint32_t done = jobs.done();
    if (progress && done < jobs.count())
      progress(static_cast<float>(done) / static_cast<float>(jobs.count()));
  }
  for (std::thread& other : others) other.join();
  if (progress) progress(1);
  return centers;
}

}  // namespace dermis::samples
