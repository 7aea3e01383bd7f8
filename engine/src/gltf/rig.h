// Rigs as JSON: docs/rigs.md describes the text.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "dermis/rig.h"
#include "gltf/memory_budget.h"

namespace dermis::gltf {

/// A rig, and all arrays that its view points to.
struct OwnedRig {
  RigView view;
  std::vector<RigJoint> joints;
  std::vector<TwistDriver> twists;
  std::vector<CorrectiveDriver> correctives;
  std::vector<ChainDriver> chains;
  std::vector<LinearDriver> linears;
  // What the drivers' spans point to.
  std::vector<std::vector<std::uint32_t>> jointLists, weightLists;
  std::vector<std::vector<std::array<float, 4>>> rotations;
  std::vector<std::vector<float>> weights;
  std::vector<std::vector<JointOffset>> offsets;
  std::vector<std::vector<JointMatrix>> matrices;

  std::vector<std::uint32_t> places;  ///< by joint of the skin: the joint of the rig
  /// By mesh that has some: the target that each driven weight is, or `none`.
  std::map<std::uint32_t, std::vector<std::uint32_t>> targets;
  std::vector<std::string> notes;
};

/// Reads the text for a skin of the model. Throws `Failure`.
void readRig(const Model& model, std::uint32_t skin, std::string_view text, MemoryBudget& budget,
             OwnedRig& rig);

}  // namespace dermis::gltf
