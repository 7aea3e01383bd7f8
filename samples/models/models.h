// The sample models, as binary glTF files in memory. Each call returns the same bytes on every
// machine.
#pragma once

#include <cstddef>
#include <vector>

#include "glb_writer.h"

namespace dermis::models {

// A round bar of two joints along x. Clip "twist": joint 1 turns about the bar's axis to 175° and
// back.
Model barModel();

// An arm of three joints along x, palm to +z. Clip "bend": the elbow bends to 140° and back.
Model armModel();

// A person of 1.75 m in an A-pose, facing +z, in several meshes on one skeleton. Clips "walk",
// "idle", "wave".
Model figureModel();

std::vector<std::byte> makeBar();
std::vector<std::byte> makeArm();
std::vector<std::byte> makeFigure();

}  // namespace dermis::models
