// The sample models, as binary glTF files in memory. Each call returns the same bytes on every
// machine.
#pragma once

#include <cstddef>
#include <vector>

#include "glb_writer.h"

namespace dermis::models {

// A round bar along x with two joints. Clip "twist": joint 1 rotates about the axis of the bar to
// 175° and back.
Model barModel();

// An arm along x with three joints; the palm faces +z. Clip "bend": the elbow bends to 140° and
// back.
Model armModel();

// A person, 1.75 m tall, in an A-pose, facing +z. It has several primitives and one skeleton.
// Clips: "walk", "idle" and "wave".
Model figureModel();

std::vector<std::byte> makeBar();
std::vector<std::byte> makeArm();
std::vector<std::byte> makeFigure();

}  // namespace dermis::models
