// Which nodes are below others.
#pragma once

#include <cstdint>
#include <vector>

#include "dermis/gltf.h"

namespace dermis::gltf {

/// Tells whether a node is below another, in constant time: its number is in that node's range.
class Descendants {
 public:
  explicit Descendants(const Model& model) : first_(model.nodes.size()), end_(first_) {
    std::vector<std::uint32_t> size(first_.size(), 1);
    for (auto node = model.nodeOrder.rbegin(); node != model.nodeOrder.rend(); ++node)
      if (model.nodes[*node].parent != noIndex) size[model.nodes[*node].parent] += size[*node];
    std::uint32_t nextRoot = 0;
    std::vector<std::uint32_t> nextChild(first_.size());
    for (const std::uint32_t node : model.nodeOrder) {
      const std::uint32_t parent = model.nodes[node].parent;
      std::uint32_t& next = parent == noIndex ? nextRoot : nextChild[parent];
      first_[node] = next;
      nextChild[node] = next + 1;
      end_[node] = next += size[node];
    }
  }

  bool isOrIsBelow(std::uint32_t node, std::uint32_t ancestor) const {
    return first_[ancestor] <= first_[node] && first_[node] < end_[ancestor];
  }

 private:
  std::vector<std::uint32_t> first_, end_;
};

}  // namespace dermis::gltf
