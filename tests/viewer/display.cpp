#include "display.h"

#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <thread>

namespace dermis::test {
namespace {

/// Long enough for a busy machine and a sanitizer; nothing waits longer than it has to.
constexpr std::chrono::seconds patience{240};

[[noreturn]] void execute(std::vector<char*>& arguments, const std::string& folder,
                          const std::string& output, const std::string& errors) {
  const int flags = O_WRONLY | O_CREAT | O_TRUNC;
  dup2(open(output.c_str(), flags, 0600), STDOUT_FILENO);
  dup2(open(errors.c_str(), flags, 0600), STDERR_FILENO);
  if (chdir(folder.c_str()) == 0) execvp(arguments[0], arguments.data());
  _exit(127);
}

bool isInstalled(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::istringstream folders(path != nullptr ? path : "");
  for (std::string folder; std::getline(folders, folder, ':');) {
    if (std::ifstream(folder + "/" + program)) return true;
  }
  return false;
}

std::string firstLine(const std::string& file) {
  std::ifstream stream(file);
  std::string line;
  std::getline(stream, line);
  return stream.eof() ? std::string() : line;  // The line break is still to come.
}

std::uint8_t channel(unsigned long pixel, unsigned long mask) {
  const unsigned long part = pixel & mask;
  return static_cast<std::uint8_t>(part / (mask & (~mask + 1)));
}

}  // namespace

bool waitUntil(const std::function<bool()>& isSo) {
  const auto end = std::chrono::steady_clock::now() + patience;
  while (!isSo()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return true;
}

ChildProcess::ChildProcess(const std::vector<std::string>& command, const std::string& folder,
                           const std::string& output, const std::string& errors) {
  std::vector<char*> arguments;
  for (const std::string& argument : command)
    arguments.push_back(const_cast<char*>(argument.c_str()));
  arguments.push_back(nullptr);
  child_ = fork();
  if (child_ == 0) execute(arguments, folder, output, errors);
}

ChildProcess::~ChildProcess() {
  if (!isRunning()) return;
  kill(child_, SIGKILL);
  waitpid(child_, nullptr, 0);
}

bool ChildProcess::isRunning() {
  if (status_) return false;
  int status = 0;
  if (waitpid(child_, &status, WNOHANG) == 0) return true;
  status_ = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return false;
}

int ChildProcess::wait() {
  waitUntil([this] { return !isRunning(); });
  return status_.value_or(-1);
}

std::unique_ptr<Display> Display::open(const std::string& folder, int width, int height,
                                       std::string& reason) {
  for (const char* program : {"Xvfb", "xdotool"}) {
    if (isInstalled(program)) continue;
    reason = std::string("there is no ") + program + " on this machine (Debian: xvfb, xdotool)";
    return nullptr;
  }
  std::unique_ptr<Display> display(new Display);
  const std::string number = folder + "/display", errors = folder + "/display-errors";
  const std::string screen = std::to_string(width) + "x" + std::to_string(height) + "x24";
  // The server chooses a number that is free, and writes it to its standard output.
  display->server_ = std::make_unique<ChildProcess>(
      std::vector<std::string>{"Xvfb", "-displayfd", "1", "-screen", "0", screen, "-nolisten",
                               "tcp", "-noreset"},
      folder, number, errors);
  waitUntil([&] { return !firstLine(number).empty() || !display->server_->isRunning(); });
  display->name_ = std::string(1, ':').append(firstLine(number));
  if (display->name_.size() > 1) return display;
  reason = "Xvfb did not start: " + firstLine(errors);
  return nullptr;
}

CommandResult Display::user(std::vector<std::string> arguments) const {
  arguments.insert(arguments.begin(), {"/usr/bin/env", "timeout", "240", "xdotool"});
  return runCommand(arguments, {"DISPLAY=" + name_});
}

std::optional<std::string> Display::focusWindow(const std::string& title) const {
  const CommandResult found = user({"search", "--sync", "--onlyvisible", "--name", title});
  std::istringstream lines(found.output);
  std::string window, line;
  while (std::getline(lines, line)) window = line;
  if (window.empty()) return std::nullopt;
  // Without a window manager nobody else gives it the keyboard.
  if (user({"windowfocus", "--sync", window}).status != 0) return std::nullopt;
  return window;
}

void Display::press(const std::vector<std::string>& keys) const {
  std::vector<std::string> arguments{"key", "--delay", "20"};
  arguments.insert(arguments.end(), keys.begin(), keys.end());
  user(arguments);
}

std::optional<samples::render::Picture> Display::picture() const {
  ::Display* display = XOpenDisplay(name_.c_str());
  if (display == nullptr) return std::nullopt;
  const Window root = DefaultRootWindow(display);
  XWindowAttributes attributes;
  XGetWindowAttributes(display, root, &attributes);
  const auto width = static_cast<unsigned>(attributes.width);
  const auto height = static_cast<unsigned>(attributes.height);
  XImage* image = XGetImage(display, root, 0, 0, width, height, AllPlanes, ZPixmap);
  std::optional<samples::render::Picture> picture;
  if (image != nullptr) {
    picture.emplace();
    picture->width = width;
    picture->height = height;
    for (int y = 0; y < attributes.height; ++y) {
      for (int x = 0; x < attributes.width; ++x) {
        const unsigned long pixel = XGetPixel(image, x, y);
        picture->pixels.insert(picture->pixels.end(),
                               {channel(pixel, image->red_mask), channel(pixel, image->green_mask),
                                channel(pixel, image->blue_mask), 255});
      }
    }
    XDestroyImage(image);
  }
  XCloseDisplay(display);
  return picture;
}

}  // namespace dermis::test
