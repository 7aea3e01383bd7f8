#include <fmt/format.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <sstream>
#include <utility>
#include <vector>

#include "kit/file_name.h"
#include "kit/output_file.h"
#include "kit/render/picture.h"

extern char** environ;

namespace dermis::samples::render {
namespace {

/// Sends raw pictures to the standard input of ffmpeg. It uses a socket, not a pipe: if ffmpeg ends
/// early, writing is then an error and not a signal.
class FilmWriter final : public PictureWriter {
 public:
  FilmWriter(std::string name, std::unique_ptr<OutputFile> output, int input, pid_t child)
      : name_(std::move(name)), output_(std::move(output)), input_(input), child_(child) {
    setUnfinishedChild(child);
  }
  ~FilmWriter() override {
    if (child_ != 0) (void)end();
  }
  FilmWriter(const FilmWriter&) = delete;
  FilmWriter& operator=(const FilmWriter&) = delete;

  Result<void> write(const Picture& picture) override {
    const std::uint8_t* next = picture.pixels.data();
    std::size_t left = picture.pixels.size();
    while (left != 0) {
      const ssize_t sent = send(input_, next, left, MSG_NOSIGNAL);
      if (sent < 0 && errno == EINTR) continue;
      if (sent <= 0) return failure();
      next += sent;
      left -= static_cast<std::size_t>(sent);
    }
    return {};
  }

  Result<void> finish() override {
    if (!end()) return failure();
    return output_->commit();
  }

 private:
  Error failure() const {
    return {ErrorCode::ioError, fmt::format("{} cannot be written: ffmpeg failed", name_)};
  }

  /// Waits for ffmpeg, and returns whether it succeeded.
  bool end() {
    close(input_);
    siginfo_t information{};
    // The process is reaped only when no signal handler can kill it any more.
    while (waitid(P_PID, static_cast<id_t>(child_), &information, WEXITED | WNOWAIT) != 0 &&
           errno == EINTR) {
    }
    setUnfinishedChild(0);
    int status = 0;
    while (waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
    child_ = 0;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

  std::string name_;
  std::unique_ptr<OutputFile> output_;
  int input_ = -1;
  pid_t child_ = 0;
};

/// The program of that name in the PATH; empty if there is none.
std::optional<std::string> findProgram(const std::string& name) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    const std::string program = folder + "/" + name;
    if (!folder.empty() && access(program.c_str(), X_OK) == 0) return program;
  }
  return std::nullopt;
}

std::vector<std::string> encoderArguments(PictureKind kind) {
  switch (kind) {
    case PictureKind::gif:
      return {"-filter_complex", "split[a][b];[a]palettegen=stats_mode=diff[p];[b][p]paletteuse",
              "-f", "gif"};
    case PictureKind::apng:
      return {"-plays", "0", "-f", "apng"};
    default:
      // Every player supports 4:2:0, which needs even sides.
      return {"-vf",       "pad=ceil(iw/2)*2:ceil(ih/2)*2",
              "-pix_fmt",  "yuv420p",
              "-crf",      "18",
              "-movflags", "+faststart",
              "-f",        "mp4"};
  }
}

std::vector<std::string> ffmpegArguments(const std::string& output, PictureKind kind,
                                         std::uint32_t width, std::uint32_t height,
                                         double framesPerSecond) {
  std::vector<std::string> arguments{"ffmpeg",   "-loglevel",
                                     "error",    "-y",
                                     "-f",       "rawvideo",
                                     "-pix_fmt", "rgba",
                                     "-s",       fmt::format("{}x{}", width, height),
                                     "-r",       fmt::format("{}", framesPerSecond),
                                     "-i",       "pipe:0"};
  for (std::string& argument : encoderArguments(kind)) arguments.push_back(std::move(argument));
  // So that ffmpeg takes the name for neither an option nor an address.
  arguments.push_back("file:" + output);
  return arguments;
}

/// Starts ffmpeg. Returns its process, or 0. ffmpeg does not inherit the signals that this program
/// ignores.
pid_t spawnFfmpeg(const std::string& program, std::vector<std::string> arguments, int input) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, input, STDIN_FILENO);
  posix_spawnattr_t attributes;
  posix_spawnattr_init(&attributes);
  sigset_t ignored;
  sigemptyset(&ignored);
  sigaddset(&ignored, SIGPIPE);
  sigaddset(&ignored, SIGXFSZ);
  posix_spawnattr_setsigdefault(&attributes, &ignored);
  posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
  std::vector<char*> words;
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  pid_t child = 0;
  if (posix_spawn(&child, program.c_str(), &actions, &attributes, words.data(), environ) != 0)
    child = 0;
  posix_spawnattr_destroy(&attributes);
  posix_spawn_file_actions_destroy(&actions);
  return child;
}

}  // namespace

Result<void> checkFilmProgram(const std::string& output) {
  if (findProgram("ffmpeg")) return {};
  return Error{ErrorCode::missingFeature,
               fmt::format("{} needs the program ffmpeg, which is not in the PATH; numbered "
                           "pictures do not need it: name them like frame%04d.png",
                           output)};
}

Result<std::unique_ptr<PictureWriter>> writeFilm(const std::string& output, PictureKind kind,
                                                 std::uint32_t width, std::uint32_t height,
                                                 double framesPerSecond) {
  if (Result<void> checked = checkFilmProgram(output); !checked) return checked.error();
  const std::string program = findProgram("ffmpeg").value_or("ffmpeg");
  Result<std::unique_ptr<OutputFile>> file = OutputFile::create(pathOf(output));
  if (!file) return file.error();
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    return Error{ErrorCode::ioError, "cannot create a socket for ffmpeg"};
  const pid_t child = spawnFfmpeg(
      program, ffmpegArguments((*file)->temporaryName(), kind, width, height, framesPerSecond),
      ends[1]);
  close(ends[1]);
  if (child == 0) {
    close(ends[0]);
    return Error{ErrorCode::ioError, fmt::format("{} cannot be run", program)};
  }
  return std::unique_ptr<PictureWriter>(
      std::make_unique<FilmWriter>(output, std::move(*file), ends[0], child));
}

}  // namespace dermis::samples::render
