#include "picture_writer.h"

#include <fmt/format.h>
#include <spawn.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <sstream>
#include <system_error>
#include <utility>
#include <vector>

#include "frame_name.h"
#include "output_file.h"

extern char** environ;

namespace dermis::samples {
namespace {

using render::Picture;

class PngWriter final : public PictureWriter {
 public:
  explicit PngWriter(std::string output) : output_(std::move(output)) {}

  Result<void> write(const Picture& picture) override {
    const Result<std::vector<std::byte>> bytes = render::encodePng(picture);
    if (!bytes) return bytes.error();
    return writeFile(frameName(output_, frame_++).value_or(output_), *bytes);
  }

  Result<void> finish() override { return {}; }

 private:
  std::string output_;
  std::uint32_t frame_ = 0;
};

/// ffmpeg, fed with raw pictures on its standard input. A socket and not a pipe: when ffmpeg ends
/// early, writing to it is then an error and no signal.
class FilmWriter final : public PictureWriter {
 public:
  FilmWriter(std::string output, int input, pid_t child)
      : output_(std::move(output)), input_(input), child_(child) {}
  ~FilmWriter() override {
    if (child_ == 0) return;
    (void)end();
    std::error_code error;
    std::filesystem::remove(output_, error);  // Half a film.
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
    if (end()) return {};
    std::error_code error;
    std::filesystem::remove(output_, error);
    return failure();
  }

 private:
  Error failure() const {
    return {ErrorCode::ioError, fmt::format("{}: ffmpeg could not write it", output_)};
  }

  /// Waits for ffmpeg; whether it has done its work.
  bool end() {
    close(input_);
    int status = 0;
    while (waitpid(child_, &status, 0) < 0 && errno == EINTR) {
    }
    child_ = 0;
    return WIFEXITED(status) && WEXITSTATUS(status) == 0;
  }

  std::string output_;
  int input_ = -1;
  pid_t child_ = 0;
};

/// The program of that name in the PATH, or nothing.
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
      // What every player shows: 4:2:0, which wants even sides.
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
  // A name is neither an option nor an address.
  arguments.push_back("file:" + output);
  return arguments;
}

bool endsWith(std::string_view name, std::string_view ending) {
  return name.size() > ending.size() &&
         std::equal(ending.begin(), ending.end(),
                    name.end() - static_cast<std::ptrdiff_t>(ending.size()),
                    [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? b - 'A' + 'a' : b); });
}

}  // namespace

std::optional<PictureKind> pictureKind(std::string_view fileName) {
  for (const auto& [ending, kind] : {std::pair{".png", PictureKind::png},
                                     {".mp4", PictureKind::mp4},
                                     {".gif", PictureKind::gif},
                                     {".apng", PictureKind::apng}}) {
    if (endsWith(fileName, ending)) return kind;
  }
  return std::nullopt;
}

std::unique_ptr<PictureWriter> writePngs(const std::string& output) {
  return std::make_unique<PngWriter>(output);
}

Result<std::unique_ptr<PictureWriter>> writeFilm(const std::string& output, PictureKind kind,
                                                 std::uint32_t width, std::uint32_t height,
                                                 double framesPerSecond) {
  const std::optional<std::string> program = findProgram("ffmpeg");
  if (!program) {
    return Error{ErrorCode::missingFeature,
                 fmt::format("{} takes the program ffmpeg, which is not in the PATH; numbered "
                             "pictures need none: name them like frame%04d.png",
                             output)};
  }
  int ends[2];
  if (socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0)
    return Error{ErrorCode::ioError, "no socket can be made for ffmpeg"};
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, ends[1], STDIN_FILENO);
  std::vector<std::string> arguments =
      ffmpegArguments(output, kind, width, height, framesPerSecond);
  std::vector<char*> words;
  for (std::string& argument : arguments) words.push_back(argument.data());
  words.push_back(nullptr);
  pid_t child = 0;
  const int result =
      posix_spawn(&child, program->c_str(), &actions, nullptr, words.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  close(ends[1]);
  if (result != 0) {
    close(ends[0]);
    return Error{ErrorCode::ioError, fmt::format("{} cannot be run", *program)};
  }
  return std::unique_ptr<PictureWriter>(std::make_unique<FilmWriter>(output, ends[0], child));
}

}  // namespace dermis::samples
