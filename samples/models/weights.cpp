#include "weights.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace dermis::models {
namespace {

constexpr int quanta = 65536;
constexpr double negligible = 0.004;

}  // namespace

Influences quantize(const WeightRow& weights) {
  std::vector<std::size_t> order(weights.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return weights[a] > weights[b]; });
  std::size_t count = std::min<std::size_t>(4, order.size());
  while (count > 1 && weights[order[count - 1]] < negligible) --count;

  double sum = 0.0;
  for (std::size_t i = 0; i < count; ++i) sum += weights[order[i]];
  Influences influences;
  int left = quanta;
  for (std::size_t i = count; i-- > 1;) {
    const int share = static_cast<int>(std::floor(weights[order[i]] / sum * quanta + 0.5));
    left -= share;
    influences.joints[i] = static_cast<std::uint16_t>(order[i]);
    influences.weights[i] = static_cast<float>(share) / static_cast<float>(quanta);
  }
  influences.joints[0] = static_cast<std::uint16_t>(order[0]);
  influences.weights[0] = static_cast<float>(left) / static_cast<float>(quanta);
  return influences;
}

std::vector<Influences> diffuseWeights(const Mesh& mesh, const Diffusion& diffusion) {
  const std::size_t jointCount = diffusion.jointCount;
  const auto neighbors = neighborsOf(mesh.positions.size(), mesh.indices);
  std::vector<double> current(mesh.positions.size() * jointCount, 0.0);
  for (std::size_t vertex = 0; vertex < neighbors.size(); ++vertex) {
    current[vertex * jointCount + diffusion.nearestJoint[vertex]] = 1.0;
  }
  std::vector<double> next(current.size());
  for (int step = 0; step < diffusion.steps; ++step) {
    for (std::size_t vertex = 0; vertex < neighbors.size(); ++vertex) {
      double* row = &next[vertex * jointCount];
      const double share = 0.5 * diffusion.spread[vertex];
      const double part = share / static_cast<double>(neighbors[vertex].size());
      for (std::size_t joint = 0; joint < jointCount; ++joint) {
        row[joint] = current[vertex * jointCount + joint] * (1.0 - share);
      }
      for (const std::uint32_t neighbor : neighbors[vertex]) {
        const double* from = &current[neighbor * jointCount];
        for (std::size_t joint = 0; joint < jointCount; ++joint) row[joint] += from[joint] * part;
      }
    }
    current.swap(next);
  }
  std::vector<Influences> influences;
  influences.reserve(neighbors.size());
  for (std::size_t vertex = 0; vertex < neighbors.size(); ++vertex) {
    WeightRow row(jointCount);
    for (std::size_t joint = 0; joint < jointCount; ++joint) {
      const double weight = current[vertex * jointCount + joint];
      row[joint] = weight * diffusion.allowance(mesh.positions[vertex], joint);
    }
    influences.push_back(quantize(row));
  }
  return influences;
}

}  // namespace dermis::models
