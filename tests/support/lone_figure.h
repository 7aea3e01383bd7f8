// A figure alone in a scene on the device: its poses, as the kernels sample them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "dermis/clips.h"
#include "system_engine.h"

namespace dermis::test {

class LoneFigure {
 public:
  LoneFigure(samples::Device& device, const vulkan::Context& context, const PackedClips& clips);

  std::vector<JointMatrix> sample(std::span<const ClipLayer> layers, std::uint32_t skin);
  const Scene& scene() const { return engine_.scene(); }
  FigureHandle figure() const { return figure_; }

 private:
  SystemEngine engine_;
  FigureHandle figure_;
};

}  // namespace dermis::test
