#include "playback.h"

#include <algorithm>
#include <cmath>

namespace dermis::viewer {

void Playback::begin(double duration) {
  duration_ = std::max(duration, 0.0);
  time_ = 0;
}

void Playback::seek(double time) {
  time_ = std::clamp(time, 0.0, duration_);
}

void Playback::step(double seconds) {
  isPlaying_ = false;
  time_ += seconds;
  wrap();
}

void Playback::advance(double seconds) {
  if (!isPlaying()) return;
  time_ += seconds;
  wrap();
}

void Playback::wrap() {
  if (!(duration_ > 0)) {
    time_ = 0;
    return;
  }
  // The end of the clip is a valid pose; only later times wrap around.
  if (time_ >= 0 && time_ <= duration_) return;
  time_ = std::fmod(time_, duration_);
  if (time_ < 0) time_ += duration_;
}

}  // namespace dermis::viewer
