// Skins many batches in parallel: a thread for each target, all targets of the same kind.
//
// Mesa's lavapipe compiles a kernel in the thread of the queue that first executes it: to compile
// on all cores takes as many devices.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <vector>

#include "batch_runner.h"
#include "dermis/result.h"

namespace dermis::samples {

class TargetPool {
 public:
  /// Creates another target that gives the same results as the first.
  using MakeTarget = std::function<Result<std::shared_ptr<BatchTarget>>()>;
  /// `first` is used as well. There are at most `threads` targets; others than the first are made
  /// when there is work for them, and if one cannot be made, the pool does without.
  TargetPool(std::shared_ptr<BatchTarget> first, MakeTarget makeTarget, std::size_t threads);

  BatchTarget& first() { return *targets_.front(); }

  using Task = std::function<Result<void>(std::size_t index, BatchTarget& target)>;
  struct Work {
    std::size_t tasks = 0;
    /// The first `settled` tasks always run on the same targets in every call, as long as the pool
    /// has the same number of targets: those have the pipelines already.
    std::size_t settled = 0;
    /// Called after each task that succeeded, by one thread at a time.
    std::function<void()> done = [] {};
  };
  /// Calls `task` for each index below `work.tasks`, and returns when all have ended. If tasks
  /// fail, it returns the error with the lowest index, and does not start any task above that
  /// index. Exceptions of a task are rethrown.
  Result<void> run(const Work& work, const Task& task);

 private:
  void makeTargets(std::size_t count);

  std::vector<std::shared_ptr<BatchTarget>> targets_;
  MakeTarget makeTarget_;
  std::size_t threads_;
};

}  // namespace dermis::samples
