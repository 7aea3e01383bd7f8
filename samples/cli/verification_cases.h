// Which cases `dermis verify` goes through for a scene.
#pragma once

#include <cstddef>
#include <vector>

#include "dermis/method.h"
#include "verification_product.h"

namespace dermis::cli {

/// A part of the scene with one of the methods that it allows.
struct Figure {
  std::size_t part = 0;
  Method method = Method::linear;
};

/// A way to store the result, and the methods to verify in it.
struct OutputToVerify {
  samples::OutputCase output;
  std::vector<Method> methods;
};

/// Positions, normals and tangents as float32, however the work is cut up.
samples::OutputCase divisionOutput(const samples::Division& division);

/// Figures that are skinned together, in one pose and one way. Ways are numbered: those to cut up
/// the work, then those to store the result.
struct SceneBatch {
  std::size_t pose = 0;
  std::size_t way = 0;
  std::vector<std::size_t> figures;
};

/// All of what is verified of a scene.
struct SceneCases {
  std::vector<Figure> figures;
  std::vector<samples::Division> divisions;
  std::vector<OutputToVerify> outputs;
  std::vector<SceneBatch> batches;  ///< by pose, then by way
};

/// In each pose all figures in each division, and in each way to store the result, which are shared
/// out among the poses, all figures of its methods.
SceneCases sceneCases(std::vector<Figure> figures, std::vector<samples::Division> divisions,
                      std::vector<OutputToVerify> outputs, std::size_t poseCount);

}  // namespace dermis::cli
