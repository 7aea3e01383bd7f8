// Cleans up when a signal ends the program: removes unfinished files, and ends the program that
// writes one.
#pragma once

#ifndef _WIN32
#include <sys/types.h>
#endif

#include <string>

namespace dermis::samples {

/// SIGINT, SIGTERM and SIGHUP, unless they are ignored already, remove what is registered below and
/// then end the program as usual. On Windows, Ctrl+C, Ctrl+Break and closing the console do so.
/// SIGPIPE and SIGXFSZ are ignored: writing then fails as on a full disk. Call it once, when the
/// program begins.
void handleSignals();

/// A signal removes this file as long as the object lives. At most eight files are removed.
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
/// Sets the child process that a signal kills before it removes files; 0 for none. The caller must
/// set it to 0 again before it reaps the process.
void setUnfinishedChild(pid_t child);
#endif

}  // namespace dermis::samples
