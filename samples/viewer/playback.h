// Where in a clip we are.
#pragma once

namespace dermis::viewer {

/// A clip is played again and again. Times are in seconds.
class Playback {
 public:
  /// From its beginning; goes on playing where it played. 0: a pose that does not move.
  void begin(double duration);
  void seek(double time);
  /// Stops, and goes a step on or back.
  void step(double seconds);
  void setPlaying(bool isPlaying) { isPlaying_ = isPlaying; }
  /// So much time has gone by.
  void advance(double seconds);

  double time() const { return time_; }
  double duration() const { return duration_; }
  /// Whether there is something to play, and it plays.
  bool isPlaying() const { return isPlaying_ && duration_ > 0; }

 private:
  void wrap();

  double time_ = 0, duration_ = 0;
  bool isPlaying_ = true;
};

}  // namespace dermis::viewer
