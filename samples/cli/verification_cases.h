// The cases that `dermis verify` checks for a scene.
#pragma once

#include <cstddef>
#include <vector>

#include "dermis/method.h"
#include "kit/verification_product.h"

namespace dermis::cli {

/// A part of the scene with one of the methods that it allows.
struct Figure {
  std::size_t part = 0;
  Method method = Method::linear;
};

/// An output layout, and the methods to verify with it.
struct OutputToVerify {
  samples::OutputCase output;
  std::vector<Method> methods;
};

/// The output for all divisions of the work: positions, normals and tangents as float32.
samples::OutputCase divisionOutput(const samples::Division& division);

/// Figures that are skinned together, in one pose and one way. `way` is an index: first into the
/// divisions of the work, then into the outputs.
struct SceneBatch {
  std::size_t pose = 0;
  std::size_t way = 0;
  std::vector<std::size_t> figures;
};

/// All cases of a scene.
struct SceneCases {
  std::vector<Figure> figures;
  std::vector<samples::Division> divisions;
  std::vector<OutputToVerify> outputs;
  std::vector<SceneBatch> batches;  ///< ordered by pose, then by way
};

/// Makes the cases. In each pose, all figures are skinned with each division. The outputs are
/// distributed among the poses; each is verified with all figures of its methods.
SceneCases sceneCases(std::vector<Figure> figures, std::vector<samples::Division> divisions,
                      std::vector<OutputToVerify> outputs, std::size_t poseCount);

}  // namespace dermis::cli
