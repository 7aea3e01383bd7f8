#include "kit/output_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <system_error>
#include <utility>
#include <vector>

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
  std::signal(SIGPIPE, SIG_IGN);
  std::signal(SIGXFSZ, SIG_IGN);
  constexpr std::array harmless{SIGCHLD, SIGCONT, SIGTSTP, SIGTTIN, SIGTTOU, SIGURG, SIGWINCH};
  for (int number = 1; number < NSIG; ++number) {
    if (std::ranges::find(harmless, number) != harmless.end()) continue;
    struct sigaction action {};
    // Fails for SIGKILL and SIGSTOP.
    if (sigaction(number, nullptr, &action) != 0 || action.sa_handler != SIG_DFL) continue;
    action = {};
    action.sa_handler = removeAndEnd;
    sigfillset(&action.sa_mask);
    sigaction(number, &action, nullptr);
  }
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

namespace {

constexpr mode_t permissionBits = 0777;

Error cannotWrite(const std::filesystem::path& path, int reason) {
  return {ErrorCode::ioError, fmt::format("{} cannot be written: {}", path.string(),
                                          std::generic_category().message(reason))};
}

bool isSame(const struct stat& a, const struct stat& b) {
  return a.st_dev == b.st_dev && a.st_ino == b.st_ino;
}

/// Follows symbolic links to a name that is not a link. There need not be a file of that name.
Result<std::filesystem::path> followLinks(const std::filesystem::path& name) {
  constexpr int mostLinks = 40;  // as many as Linux follows
  std::filesystem::path path = name;
  for (int link = 0; link < mostLinks; ++link) {
    std::error_code error;
    if (!std::filesystem::is_symlink(std::filesystem::symlink_status(path, error))) return path;
    const std::filesystem::path next = std::filesystem::read_symlink(path, error);
    if (error) return cannotWrite(name, error.value());
    path = path.parent_path() / next;
  }
  return cannotWrite(name, ELOOP);
}

/// The descriptor of standard output or error if it is that file, otherwise -1.
int streamOf(const struct stat& file) {
  for (const int stream : {STDOUT_FILENO, STDERR_FILENO}) {
    struct stat other {};
    if (fstat(stream, &other) == 0 && isSame(file, other)) return stream;
  }
  return -1;
}

}  // namespace

Result<OutputTarget> findTarget(const std::filesystem::path& name) {
  OutputTarget target;
  target.name = name;
  struct stat file {};
  const bool exists = stat(name.c_str(), &file) == 0;
  if (!exists && errno != ENOENT) return cannotWrite(name, errno);
  if (exists && S_ISDIR(file.st_mode)) return cannotWrite(name, EISDIR);
  if (exists) {
    target.stream = streamOf(file);
    target.isThrough = target.stream >= 0 || !S_ISREG(file.st_mode);
    target.permissions = file.st_mode & permissionBits;
  }
  if (target.isThrough) {
    target.path = name;
    return target;
  }
  Result<std::filesystem::path> path = followLinks(name);
  if (!path) return path.error();
  target.path = std::move(*path);
  if (!exists) return target;
  // Links in /proc lead to open files, which may have no name.
  struct stat followed {};
  if (stat(target.path.c_str(), &followed) != 0 || !isSame(file, followed)) {
    target.isThrough = true;
    target.path = name;
  } else if (faccessat(AT_FDCWD, target.path.c_str(), W_OK, AT_EACCESS) != 0) {
    return cannotWrite(name, errno);  // It could be replaced, but is protected.
  }
  return target;
}

namespace {

/// 0 or the reason, as an `errno`.
int writeAll(int file, std::span<const std::byte> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(file, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

/// Opens a device, FIFO or stream. Returns -1 if that fails; `errno` is then the reason.
int openThrough(const OutputTarget& target) {
  if (target.stream < 0)
    return open(target.path.c_str(), O_WRONLY | O_TRUNC | O_CLOEXEC | O_NOCTTY);
  std::fflush(stdout);  // What was printed before must come first.
  return fcntl(target.stream, F_DUPFD_CLOEXEC, 3);
}

}  // namespace

Result<void> writeThrough(const OutputTarget& target, std::span<const std::byte> bytes) {
  const int file = openThrough(target);
  if (file < 0) return cannotWrite(target.name, errno);
  int failure = writeAll(file, bytes);
  if (close(file) != 0 && failure == 0) failure = errno;
  if (failure != 0) return cannotWrite(target.name, failure);
  return {};
}

namespace {

/// Copies a file to a target that is written through.
Result<void> copyThrough(const OutputTarget& target, int from) {
  const int to = openThrough(target);
  if (to < 0) return cannotWrite(target.name, errno);
  std::vector<std::byte> piece(std::size_t{1} << 20);
  int failure = 0;
  off_t place = 0;
  for (ssize_t count = 0; failure == 0; place += count) {
    count = pread(from, piece.data(), piece.size(), place);
    if (count < 0) failure = errno;
    if (count <= 0) break;
    failure = writeAll(to, std::span(piece).first(static_cast<std::size_t>(count)));
  }
  if (close(to) != 0 && failure == 0) failure = errno;
  if (failure != 0) return cannotWrite(target.name, failure);
  return {};
}

/// Copies the permissions and, if allowed, the owner of the file that is replaced.
void imitate(const OutputTarget& target, int file) {
  struct stat old {};
  if (!target.permissions || stat(target.path.c_str(), &old) != 0) return;
  const bool isOwned = fchown(file, old.st_uid, old.st_gid) == 0;
  // If the group differs, it must not get the permissions of the old group.
  const mode_t kept = isOwned ? permissionBits : permissionBits & ~mode_t{070};
  (void)fchmod(file, *target.permissions & kept);
}

}  // namespace

Result<std::unique_ptr<OutputFile>> OutputFile::createFor(const OutputTarget& target) {
  std::error_code error;
  std::filesystem::path folder = target.path.parent_path();
  if (target.isThrough) folder = std::filesystem::temp_directory_path(error);
  if (error) return cannotWrite(target.name, error.value());
  std::unique_ptr<OutputFile> made(new OutputFile(target, temporaryNameIn(folder)));
  made->file_ = open(made->temporary_.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC,
                     S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP | S_IROTH | S_IWOTH);
  if (made->file_ < 0) return cannotWrite(target.name, errno);
  made->isThere_ = true;
  if (!target.isThrough) imitate(target, made->file_);
  return made;
}

OutputFile::~OutputFile() {
  if (file_ >= 0) close(file_);
  if (isThere_) unlink(temporary_.c_str());
}

Result<void> OutputFile::write(std::span<const std::byte> bytes) {
  const int failure = writeAll(file_, bytes);
  if (failure != 0) return cannotWrite(target_.name, failure);
  return {};
}

Result<void> OutputFile::commit() {
  if (target_.isThrough) return copyThrough(target_, file_);
  // Some file systems cannot synchronize and return EINVAL.
  if (fsync(file_) != 0 && errno != EINVAL) return cannotWrite(target_.name, errno);
  if (close(std::exchange(file_, -1)) != 0) return cannotWrite(target_.name, errno);
  if (rename(temporary_.c_str(), target_.path.c_str()) != 0)
    return cannotWrite(target_.name, errno);
  isThere_ = false;
  return {};
}

}  // namespace dermis::samples
