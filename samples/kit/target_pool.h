// Skins many batches in parallel: a thread for each target, all targets of the same kind.
//
// Mesa's lavapipe compiles a kernel in the thread of the queue that first executes it. To compile
// on all cores, each thread needs its own device.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "dermis/result.h"
#include "kit/batch_runner.h"

namespace dermis::samples {

class TargetPool {
 public:
  /// Creates another target that gives the same results as the first.
  using MakeTarget = std::function<Result<std::shared_ptr<BatchTarget>>()>;
  /// The pool uses at most `threads` targets, including `first`. More targets are created when
  /// there is work for them. If one cannot be created, the pool uses fewer.
  TargetPool(std::shared_ptr<BatchTarget> first, MakeTarget makeTarget, std::size_t threads);

  BatchTarget& first() { return *targets_.front(); }

  using Task = std::function<Result<void>(std::size_t index, BatchTarget& target)>;
  struct Work {
    std::size_t tasks = 0;
    /// The first `pinnedTasks` tasks run on the same targets in every call, as long as the pool has
    /// the same number of targets, because those targets have the pipelines already.
    std::size_t pinnedTasks = 0;
    /// Called after each task that succeeds, by one thread at a time.
    std::function<void()> done = [] {};
  };
  /// Calls `task` for each index below `work.tasks`, and returns when all tasks have ended. If
  /// tasks fail, it returns the error of the lowest index and starts no task above that index.
  /// Exceptions of a task are rethrown.
  Result<void> run(const Work& work, const Task& task);

 private:
  void makeTargets(std::size_t count);

  std::vector<std::shared_ptr<BatchTarget>> targets_;
  MakeTarget makeTarget_;
  std::size_t threads_;
};

}  // namespace dermis::samples
