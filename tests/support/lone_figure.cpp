#include "lone_figure.h"

#include "random_rig.h"
#include "scene_meshes.h"

namespace dermis::test {

LoneFigure::LoneFigure(samples::Device& device, const vulkan::Context& context,
                       const PackedClips& clips)
    : engine_(device, context, {}) {
  figure_ = must(engine_->addFigure(must(engine_->addClips(PackedClips(clips)))));
  // Poses are sampled for somebody.
  const MeshHandle mesh = engine_.addMesh(must(pack(randomMesh(1, 3, 1, 1).view(), 1)));
  for (std::uint32_t skin = 0; skin < clips.skinCount(); ++skin)
    engine_.addInstance({.mesh = mesh, .pose = must(engine_->pose(figure_, skin))});
}

std::vector<JointMatrix> LoneFigure::sample(std::span<const ClipLayer> layers, std::uint32_t skin) {
  const FigurePlay play{figure_, layers};
  must(engine_->play({&play, 1}));
  engine_.runFrame();
  return engine_.readPose(must(engine_->pose(figure_, skin)));
}

}  // namespace dermis::test
