// The current time in a clip.
#pragma once

namespace dermis::viewer {

/// Plays a clip repeatedly. Times are in seconds.
class Playback {
 public:
  /// Goes to the beginning, and keeps playing if it was. A duration of 0 is a static pose.
  void begin(double duration);
  void seek(double time);
  /// Stops, and moves by a step forwards or backwards.
  void step(double seconds);
  void setPlaying(bool isPlaying) { isPlaying_ = isPlaying; }
  /// Call when this much time has passed.
  void advance(double seconds);

  double time() const { return time_; }
  double duration() const { return duration_; }
  /// Whether there is something to play, and it is playing.
  bool isPlaying() const { return isPlaying_ && duration_ > 0; }

 private:
  void wrap();

  double time_ = 0, duration_ = 0;
  bool isPlaying_ = true;
};

}  // namespace dermis::viewer
