#include "figure.h"

#include "models.h"

namespace dermis::models {

Model figureModel() {
  const FigureShape shape = figureShape();
  FigureSurface surface = figureSurface(shape);
  Model model;
  model.name = "figure";
  model.skeleton = figureSkeleton();
  model.mesh.positions = surface.positions;
  model.mesh.normals = surface.normals;
  model.mesh.indices = surface.indices;
  model.mesh.influences = figureWeights(shape, model.mesh);
  paint(model.mesh, figureRegions(shape), figureColors());
  model.parts = figureParts();
  model.clips = {walkClip(), idleClip(), waveClip()};
  return model;
}

std::vector<std::byte> makeFigure() {
  return writeGlb(figureModel());
}

}  // namespace dermis::models
