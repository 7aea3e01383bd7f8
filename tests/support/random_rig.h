// The samples' random meshes and poses, by the names of tests.
#pragma once

#include "kit/random_rig.h"

namespace dermis::test {

using samples::addMorphs;
using samples::addTangents;
using samples::OwnedMesh;
using samples::OwnedMorph;
using samples::randomMesh;
using samples::randomPose;
using samples::Rigidity;

}  // namespace dermis::test
