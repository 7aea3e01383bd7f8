// Shows the progress of long work, on a terminal only.
#pragma once

#include <cstddef>
#include <string>

namespace dermis::samples {

class Progress {
 public:
  Progress(std::string what, std::size_t total);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  void step();

 private:
  std::string what_;
  std::size_t total_;
  std::size_t done_ = 0;
  bool visible_;
};

}  // namespace dermis::samples
