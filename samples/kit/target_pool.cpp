#include "kit/target_pool.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <optional>
#include <utility>

#include "kit/joining_threads.h"

namespace dermis::samples {
namespace {

/// Hands out the tasks of one call, and collects their results.
class Tasks {
 public:
  Tasks(const TargetPool::Work& work, std::size_t workers)
      : work_(work), workers_(workers), next_(work.pinnedTasks), end_(work.tasks) {
    for (std::size_t worker = 0; worker < workers; ++worker) nextPinned_.push_back(worker);
  }

  /// The next task of a worker: first its pinned tasks, then any.
  std::optional<std::size_t> take(std::size_t worker) {
    const std::lock_guard lock(mutex_);
    std::size_t& pinned = nextPinned_[worker];
    const bool isPinned = pinned < work_.pinnedTasks;
    const std::size_t index = isPinned ? pinned : next_;
    if (index >= end_) return {};
    (isPinned ? pinned : next_) += isPinned ? workers_ : 1;
    return index;
  }
  void end(std::size_t index, Result<void> result) {
    const std::lock_guard lock(mutex_);
    if (result) return work_.done();
    if (index >= end_) return;
    end_ = index;
    result_ = std::move(result);
  }
  void end(std::exception_ptr exception) {
    const std::lock_guard lock(mutex_);
    exception_ = std::move(exception);
    end_ = 0;
  }
  Result<void> result() const {
    if (exception_) std::rethrow_exception(exception_);
    return result_;
  }

 private:
  const TargetPool::Work& work_;
  std::size_t workers_;
  std::mutex mutex_;
  std::vector<std::size_t> nextPinned_;  ///< by worker
  std::size_t next_;
  std::size_t end_;  ///< the lowest index that failed, or the number of tasks
  Result<void> result_;
  std::exception_ptr exception_;
};

}  // namespace

TargetPool::TargetPool(std::shared_ptr<BatchTarget> first, MakeTarget makeTarget,
                       std::size_t threads)
    : targets_{std::move(first)}, makeTarget_(std::move(makeTarget)), threads_(threads) {}

void TargetPool::makeTargets(std::size_t count) {
  while (targets_.size() < std::min(threads_, count)) {
    Result<std::shared_ptr<BatchTarget>> made = makeTarget_();
    if (made) {
      targets_.push_back(std::move(*made));
    } else {
      threads_ = targets_.size();
    }
  }
}

Result<void> TargetPool::run(const Work& work, const Task& task) {
  makeTargets(work.tasks);
  Tasks tasks(work, targets_.size());
  const auto serve = [&](std::size_t worker) {
    try {
      while (const std::optional<std::size_t> index = tasks.take(worker))
        tasks.end(*index, task(*index, *targets_[worker]));
    } catch (...) {
      tasks.end(std::current_exception());
    }
  };
  {
    JoiningThreads others;
    for (std::size_t worker = 1; worker < targets_.size(); ++worker) others.start(serve, worker);
    serve(0);
  }
  return tasks.result();
}

}  // namespace dermis::samples
