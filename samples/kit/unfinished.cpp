#include "kit/unfinished.h"

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <climits>
#include <csignal>
#include <cstring>

namespace dermis::samples {
namespace {

enum class SlotState : int { unused, claimed, named };

struct Slot {
  std::atomic<SlotState> state = SlotState::unused;
  std::array<char, PATH_MAX> path{};
};

// Signal handlers can only use globals.
std::array<Slot, 8> slots;
std::atomic<pid_t> childToKill = 0;
static_assert(std::atomic<SlotState>::is_always_lock_free &&
              std::atomic<pid_t>::is_always_lock_free);

/// Calls only functions that POSIX lists as safe in a signal handler.
void removeAndEnd(int signalNumber) {
  if (const pid_t child = childToKill; child != 0) {
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
  }
  for (const Slot& slot : slots) {
    if (slot.state == SlotState::named) unlink(slot.path.data());
  }
  // The signal is blocked until the handler returns; then it ends the program.
  std::signal(signalNumber, SIG_DFL);
  raise(signalNumber);
}

}  // namespace

void handleSignals() {
  for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
    struct sigaction action {};
    if (sigaction(number, nullptr, &action) != 0 || action.sa_handler == SIG_IGN) continue;
    action = {};
    action.sa_handler = removeAndEnd;
    sigfillset(&action.sa_mask);
    sigaction(number, &action, nullptr);
  }
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
}

UnfinishedFile::UnfinishedFile(const std::string& path) {
  if (path.size() >= slots[0].path.size()) return;  // It cannot be opened either.
  for (std::size_t slot = 0; slot < slots.size(); ++slot) {
    SlotState expected = SlotState::unused;
    if (!slots[slot].state.compare_exchange_strong(expected, SlotState::claimed)) continue;
    std::memcpy(slots[slot].path.data(), path.c_str(), path.size() + 1);
    slots[slot].state = SlotState::named;
    slot_ = static_cast<int>(slot);
    return;
  }
}

UnfinishedFile::~UnfinishedFile() {
  if (slot_ >= 0) slots[static_cast<std::size_t>(slot_)].state = SlotState::unused;
}

void setUnfinishedChild(pid_t child) {
  childToKill = child;
}

}  // namespace dermis::samples
