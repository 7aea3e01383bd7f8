#include "built_in_scenes.h"

#include <utility>

#include "built_in_models.h"

namespace dermis::cli {
namespace {

double middleOfClip(const Scene& scene) {
  return scene.model->clips[0].duration / 2;
}

}  // namespace

Result<BuiltInScenes> loadBuiltInScenes(const MeshPreparation& preparation) {
  Result<Scene> bar = loadScene(embeddedBar, "bar.glb", preparation);
  if (!bar) return bar.error();
  Result<Scene> arm = loadScene(embeddedArm, "arm.glb", preparation);
  if (!arm) return arm.error();
  return BuiltInScenes{std::move(*bar), std::move(*arm)};
}

double builtInArmTime(const Scene& arm) {
  return middleOfClip(arm);
}

std::vector<ComparisonStrip> builtInStrips(const BuiltInScenes& scenes) {
  std::vector<ComparisonStrip> strips(2);
  ComparisonStrip& bar = strips[0];
  bar.scene = &scenes.bar;
  bar.pose = scenePose(scenes.bar, 0, middleOfClip(scenes.bar));
  bar.title = "A bar twisted by 175°";
  bar.remark = "smallest cross-section area, relative to bind pose";
  bar.camera.azimuth = 18;
  bar.camera.elevation = 16;
  bar.sections = SectionRange{0.3, 0.7};
  ComparisonStrip& arm = strips[1];
  arm.scene = &scenes.arm;
  arm.pose = scenePose(scenes.arm, 0, middleOfClip(scenes.arm));
  arm.title = "An arm bent by 140°";
  arm.remark = "smallest cross-section area, relative to bind pose";
  arm.camera.azimuth = 18;
  arm.camera.elevation = 12;
  arm.sections = SectionRange{0.2, 0.45};
  return strips;
}

}  // namespace dermis::cli
