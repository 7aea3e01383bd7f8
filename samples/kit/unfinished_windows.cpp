#include <windows.h>

#include <array>
#include <filesystem>
#include <mutex>

#include "kit/file_name.h"
#include "kit/unfinished.h"

namespace dermis::samples {
namespace {

// The handler runs in its own thread.
std::mutex mutex;
std::array<std::filesystem::path, 8> slots;  // empty: unused

BOOL WINAPI removeFiles(DWORD) {
  const std::scoped_lock lock(mutex);
  for (const std::filesystem::path& path : slots) {
    if (!path.empty()) DeleteFileW(path.c_str());
  }
  return FALSE;  // The next handler ends the program.
}

}  // namespace

void handleSignals() {
  SetConsoleCtrlHandler(removeFiles, TRUE);
}

UnfinishedFile::UnfinishedFile(const std::string& path) {
  const std::scoped_lock lock(mutex);
  for (std::size_t slot = 0; slot < slots.size(); ++slot) {
    if (!slots[slot].empty()) continue;
    slots[slot] = pathOf(path);
    slot_ = static_cast<int>(slot);
    return;
  }
}

UnfinishedFile::~UnfinishedFile() {
  const std::scoped_lock lock(mutex);
  if (slot_ >= 0) slots[static_cast<std::size_t>(slot_)].clear();
}

}  // namespace dermis::samples
