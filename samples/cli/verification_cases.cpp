#include "verification_cases.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace dermis::cli {

samples::OutputCase divisionOutput(const samples::Division& division) {
  samples::OutputCase output;
  output.layout.tangents = VertexFormat::float32x4;
  output.tuning = division.tuning;
  return output;
}

SceneCases sceneCases(std::vector<Figure> figures, std::vector<samples::Division> divisions,
                      std::vector<OutputToVerify> outputs, std::size_t poseCount) {
  SceneCases cases{std::move(figures), std::move(divisions), std::move(outputs), {}};
  std::vector<std::size_t> all;
  for (std::size_t figure = 0; figure < cases.figures.size(); ++figure) all.push_back(figure);
  for (std::size_t pose = 0; pose < poseCount; ++pose) {
    for (std::size_t way = 0; way < cases.divisions.size(); ++way)
      cases.batches.push_back({pose, way, all});
    const std::size_t end = cases.outputs.size() * (pose + 1) / poseCount;
    for (std::size_t index = cases.outputs.size() * pose / poseCount; index < end; ++index) {
      SceneBatch& batch = cases.batches.emplace_back();
      batch.pose = pose;
      batch.way = cases.divisions.size() + index;
      std::ranges::copy_if(all, std::back_inserter(batch.figures), [&](std::size_t figure) {
        return std::ranges::count(cases.outputs[index].methods, cases.figures[figure].method) != 0;
      });
    }
  }
  return cases;
}

}  // namespace dermis::cli
