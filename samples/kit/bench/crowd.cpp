#include "kit/bench/crowd.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <numeric>
#include <random>

#include "dermis/gltf.h"
#include "kit/random_rig.h"

namespace dermis::samples {
namespace {

template <typename T>
T read(const std::vector<std::byte>& bytes, std::size_t index) {
  T value;
  std::memcpy(&value, bytes.data() + index * sizeof(T), sizeof(T));
  return value;
}

std::uint16_t jointOf(const gltf::Influences& influences, std::size_t index) {
  if (influences.jointType == ComponentType::uint8)
    return read<std::uint8_t>(influences.joints, index);
  return read<std::uint16_t>(influences.joints, index);
}

float weightOf(const gltf::Influences& influences, std::size_t index) {
  switch (influences.weightType) {
    case ComponentType::unorm8:
      return static_cast<float>(read<std::uint8_t>(influences.weights, index)) / 255;
    case ComponentType::unorm16:
      return static_cast<float>(read<std::uint16_t>(influences.weights, index)) / 65535;
    default:
      return read<float>(influences.weights, index);
  }
}

PlainVertex plainVertex(const gltf::Primitive& primitive, std::size_t vertex) {
  PlainVertex plain{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    plain.position[axis] = primitive.positions[vertex * 3 + axis];
    plain.normal[axis] = primitive.normals[vertex * 3 + axis];
  }
  for (std::size_t slot = 0; slot < 4; ++slot) {
    plain.joints[slot] = jointOf(primitive.influences[0], vertex * 4 + slot);
    plain.weights[slot] = weightOf(primitive.influences[0], vertex * 4 + slot);
  }
  const float sum = std::accumulate(plain.weights.begin(), plain.weights.end(), 0.0f);
  for (float& weight : plain.weights) weight /= sum != 0 ? sum : 1;
  return plain;
}

Result<PackedMesh> packVertices(const std::vector<PlainVertex>& vertices,
                                std::uint32_t jointCount) {
  const auto view = [&](const void* first, ComponentType type, std::uint32_t components) {
    return AttributeView{first, static_cast<std::uint32_t>(vertices.size()), sizeof(PlainVertex),
                         type, components};
  };
  const PlainVertex& first = vertices.front();
  const InfluenceSet influences{view(&first.joints, ComponentType::uint16, 4),
                                view(&first.weights, ComponentType::float32, 4)};
  MeshView mesh;
  mesh.name = "crowd";
  mesh.vertexCount = static_cast<std::uint32_t>(vertices.size());
  mesh.positions = view(&first.position, ComponentType::float32, 3);
  mesh.normals = view(&first.normal, ComponentType::float32, 3);
  // What tangents and centers are does not affect the time of what reads them.
  std::vector<std::array<float, 4>> tangents;
  for (const PlainVertex& vertex : vertices)
    tangents.push_back({vertex.normal[1], vertex.normal[2], vertex.normal[0], 1});
  mesh.tangents = attributeView(tangents[0].data(), mesh.vertexCount, 4);
  mesh.centersOfRotation = mesh.positions;
  mesh.influenceSets = std::span(&influences, 1);
  return pack(mesh, jointCount);
}

}  // namespace

bool Crowd::isRigid() const {
  constexpr float tolerance = 1e-3f;
  for (const std::vector<JointMatrix>& pose : poses) {
    for (const JointMatrix& joint : pose) {
      for (std::size_t a = 0; a < 3; ++a) {
        for (std::size_t b = a; b < 3; ++b) {
          float product = 0;
          for (std::size_t row = 0; row < 3; ++row) product += joint.m[row][a] * joint.m[row][b];
          if (!(std::abs(product - (a == b ? 1.0f : 0.0f)) <= tolerance)) return false;
        }
      }
    }
  }
  return true;
}

std::vector<SkinRequest> Crowd::requests(Method method, std::uint32_t count) const {
  std::vector<SkinRequest> requests;
  for (const std::vector<JointMatrix>& pose : std::span(poses).first(count)) {
    SkinRequest& request = requests.emplace_back();
    request.mesh = &*mesh;
    request.pose = pose;
    request.promise = JointPromise::scaleIgnored;
    request.method = method;
  }
  return requests;
}

Result<Crowd> loadCrowd(const std::filesystem::path& path, std::uint32_t instanceCount) {
  const Result<gltf::Model> model = gltf::load(path);
  if (!model) return model.error();
  Crowd crowd;
  crowd.name = path.stem().string();
  const auto refuse = [&](const char* reason) {
    return Error{ErrorCode::invalidData, "'" + crowd.name + "' " + reason};
  };
  if (model->skinnedPrimitives.empty()) return refuse("has no skinned primitive");
  const std::uint32_t skin = model->skinnedPrimitives.front().skin;
  for (const gltf::SkinnedPrimitive& source : model->skinnedPrimitives) {
    if (source.skin != skin) continue;
    const gltf::Primitive& primitive = model->meshes[source.mesh].primitives[source.primitive];
    if (primitive.normals.empty()) return refuse("has no normals");
    if (primitive.influences.size() != 1) return refuse("does not have four influences per vertex");
    for (std::size_t vertex = 0; vertex < primitive.vertexCount; ++vertex)
      crowd.vertices.push_back(plainVertex(primitive, vertex));
  }
  Result<PackedMesh> packed =
      packVertices(crowd.vertices, static_cast<std::uint32_t>(model->skins[skin].joints.size()));
  if (!packed) return packed.error();
  crowd.mesh.emplace(std::move(*packed));

  const std::uint32_t clip = model->clips.empty() ? noIndex : 0;
  const double duration = clip == noIndex ? 0 : model->clips[clip].duration;
  // Multiples of the golden ratio are evenly distributed: no two instances are in step.
  const double step = (std::sqrt(5.0) - 1) / 2;
  for (std::uint32_t instance = 0; instance < instanceCount; ++instance) {
    const double phase = std::fmod(instance * step, 1.0);
    crowd.poses.push_back(gltf::pose(*model, skin, clip, phase * duration));
  }
  return crowd;
}

Result<Crowd> longFigure(std::uint32_t vertexCount, std::uint32_t instanceCount) {
  constexpr int jointCount = 60;
  Crowd crowd;
  crowd.name = "a long figure";
  std::mt19937 random(7);
  std::uniform_real_distribution<float> coordinate(-1, 1), weight(0.05f, 1);
  for (std::uint32_t v = 0; v < vertexCount; ++v) {
    PlainVertex& vertex = crowd.vertices.emplace_back();
    const auto middle = static_cast<int>(std::uint64_t{v} * jointCount / vertexCount);
    const int side = random() % 2 == 0 ? 1 : -1;
    const std::array<int, 4> steps{0, side, -side, 2 * side};
    float sum = 0, length = 0;
    for (float& w : vertex.weights) sum += w = weight(random);
    std::ranges::sort(vertex.weights, std::greater<>());
    for (std::size_t k = 0; k < 4; ++k) {
      // Wraps around at the ends, so that the four joints differ.
      vertex.joints[k] = static_cast<std::uint16_t>((middle + steps[k] + jointCount) % jointCount);
      vertex.weights[k] /= sum;
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      vertex.position[axis] = coordinate(random);
      vertex.normal[axis] = coordinate(random);
      length += vertex.normal[axis] * vertex.normal[axis];
    }
    for (float& component : vertex.normal) component /= std::sqrt(length);
  }
  for (std::uint32_t i = 0; i < instanceCount; ++i)
    crowd.poses.push_back(randomPose(i, jointCount, Rigidity::rigid));
  Result<PackedMesh> packed = packVertices(crowd.vertices, jointCount);
  if (!packed) return packed.error();
  crowd.mesh.emplace(std::move(*packed));
  return crowd;
}

}  // namespace dermis::samples
