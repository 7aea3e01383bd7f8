// Normals for primitives that have none.
#include "dermis/mesh.h"

#include <algorithm>
#include <array>
#include <limits>
#include <numeric>

#include "gltf/failure.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

using Indices = std::vector<std::uint32_t>;

MeshView positionsOf(const Primitive& primitive) {
  MeshView view;
  view.vertexCount = primitive.vertexCount;
  view.positions = attributeView(primitive.positions.data(), primitive.vertexCount, 3);
  return view;
}

SharedArray<float> shared(Result<std::vector<float>> normals) {
  if (!normals) throw Failure{std::move(normals).error()};
  return *std::move(normals);
}

/// Makes a new vertex of each corner of a triangle. What it reads and makes is spent from the
/// budget: a small file may use the same vertices in very many primitives.
class Unwelder {
 public:
  Unwelder(Source& source, const std::string& where, std::uint32_t vertexCount,
           const SharedArray<std::uint32_t>& corners)
      : source_(source), where_(where), vertexCount_(vertexCount), corners_(corners) {}

  /// Repeats an attribute, of any number of components.
  template <typename T>
  void repeat(SharedArray<T>& values) {
    if (values.empty()) return;
    const std::size_t components = values.size() / vertexCount_;
    source_.spend(corners_.size(), components * sizeof(T), where_);
    std::vector<T> repeated(corners_.size() * components);
    auto to = repeated.begin();
    for (const std::uint32_t vertex : corners_)
      to = std::copy_n(values.begin() + static_cast<std::ptrdiff_t>(vertex * components),
                       components, to);
    values = std::move(repeated);
  }

  /// Repeats the displacements of positions.
  void repeat(MorphTarget& target) {
    if (target.vertices.empty()) return repeat(target.positions);
    if (order_.empty()) sortCorners();
    source_.spend(target.vertices.size(), 4, where_);
    std::vector<std::array<std::uint32_t, 2>> displaced;  // new vertex, element of the target
    for (std::uint32_t element = 0; element < target.vertices.size(); ++element) {
      const std::uint32_t vertex = target.vertices[element];
      auto corner = std::ranges::lower_bound(order_, vertex, {},
                                             [&](std::uint32_t of) { return corners_[of]; });
      for (; corner != order_.end() && corners_[*corner] == vertex; ++corner) {
        source_.spend(1, 24, where_);
        displaced.push_back({*corner, element});
      }
    }
    std::ranges::sort(displaced);
    Indices vertices;
    std::vector<float> positions;
    for (const auto& [vertex, element] : displaced) {
      vertices.push_back(vertex);
      if (target.positions.empty()) continue;
      const auto from = target.positions.begin() + static_cast<std::ptrdiff_t>(element) * 3;
      positions.insert(positions.end(), from, from + 3);
    }
    target.vertices = std::move(vertices);
    target.positions = std::move(positions);
  }

 private:
  void sortCorners() {
    source_.spend(corners_.size(), 4, where_);
    order_.resize(corners_.size());
    std::iota(order_.begin(), order_.end(), 0u);
    std::ranges::stable_sort(order_, {}, [&](std::uint32_t corner) { return corners_[corner]; });
  }

  Source& source_;
  const std::string& where_;
  const std::uint32_t vertexCount_;
  const SharedArray<std::uint32_t> corners_;  ///< their vertices
  Indices order_;                             ///< corners, by ascending vertex
};

void unweld(Source& source, const std::string& where, Primitive& primitive) {
  const std::size_t count = primitive.triangles.size();
  if (count > std::numeric_limits<std::uint32_t>::max()) {
    fail(ErrorCode::limitExceeded,
         join(where, ": with flat normals it would have more than 2^32 - 1 vertices"));
  }
  Unwelder unwelder(source, where, primitive.vertexCount, primitive.triangles);
  unwelder.repeat(primitive.positions);
  for (SharedArray<float>& set : primitive.texcoords) unwelder.repeat(set);
  unwelder.repeat(primitive.colors);
  for (Influences& set : primitive.influences) {
    unwelder.repeat(set.joints);
    unwelder.repeat(set.weights);
  }
  for (MorphTarget& target : primitive.morphTargets) unwelder.repeat(target);
  source.spend(count, 4, where);
  Indices triangles(count);
  std::iota(triangles.begin(), triangles.end(), 0u);
  primitive.triangles = std::move(triangles);
  primitive.vertexCount = static_cast<std::uint32_t>(count);
}

}  // namespace

void addNormals(Source& source, MissingNormals kind, const std::string& where,
                Primitive& primitive) {
  if (kind == MissingNormals::leave || !primitive.normals.empty() || primitive.triangles.empty())
    return;
  primitive.tangents = {};
  for (MorphTarget& target : primitive.morphTargets) target.normals = target.tangents = {};
  source.spend(primitive.triangles.size(), 12, where);
  if (kind == MissingNormals::smooth) {
    source.spend(primitive.vertexCount, 36, where);
    primitive.normals = shared(smoothNormals(positionsOf(primitive), primitive.triangles.values()));
  } else {
    primitive.normals = shared(flatNormals(positionsOf(primitive), primitive.triangles.values()));
    unweld(source, where, primitive);
  }
}

}  // namespace dermis::gltf
