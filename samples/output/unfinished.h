// What must not outlive the program when a signal ends it: unfinished files, and the program that
// writes one.
#pragma once

#ifndef _WIN32
#include <sys/types.h>
#endif

#include <string>

namespace dermis::samples {

/// On Windows: Ctrl+C, Ctrl+Break and the closing of the console do so. Elsewhere:
/// SIGINT, SIGTERM and SIGHUP, unless they are ignored already, remove what is registered below and
/// then end the program as they would without this. SIGPIPE and SIGXFSZ are ignored: writing fails
/// instead, like on a full disk. To be called once, when the program begins.
void handleSignals();

/// A file that a signal removes, as long as this lives. Eight at a time: more are not removed.
class UnfinishedFile {
 public:
  explicit UnfinishedFile(const std::string& path);
  ~UnfinishedFile();
  UnfinishedFile(const UnfinishedFile&) = delete;
  UnfinishedFile& operator=(const UnfinishedFile&) = delete;

 private:
  int slot_ = -1;
};

#ifndef _WIN32
/// The child process that a signal kills before it removes files, or 0 for none. The caller must
/// not reap it before it is set to 0 again.
void setUnfinishedChild(pid_t child);
#endif

}  // namespace dermis::samples
