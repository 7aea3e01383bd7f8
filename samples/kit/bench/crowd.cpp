#include "kit/bench/crowd.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <functional>
#include <numbers>
#include <numeric>
#include <random>
#include <utility>

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

AttributeView viewOf(std::span<const PlainVertex> vertices, const void* first, ComponentType type,
                     std::uint32_t components) {
  return {first, static_cast<std::uint32_t>(vertices.size()), sizeof(PlainVertex), type,
          components};
}

Result<PackedMesh> packVertices(const std::vector<PlainVertex>& vertices,
                                std::uint32_t jointCount) {
  const PlainMesh plain(vertices);
  MeshView mesh = plain.view();
  // What tangents and centers are does not affect the time of what reads them.
  std::vector<std::array<float, 4>> tangents;
  for (const PlainVertex& vertex : vertices)
    tangents.push_back({vertex.normal[1], vertex.normal[2], vertex.normal[0], 1});
  mesh.tangents = attributeView(tangents[0].data(), mesh.vertexCount, 4);
  mesh.centersOfRotation = mesh.positions;
  return pack(mesh, jointCount);
}

/// Packs two clips that turn each joint to and fro. Five limbs hang on joint 0.
Result<PackedClips> packSwayingClips(std::uint32_t jointCount) {
  constexpr std::uint32_t limbs = 5, keys = 33;
  std::vector<std::uint32_t> joints(jointCount);
  std::vector<JointMatrix> inverseBind(jointCount);
  Skeleton skeleton;
  for (std::uint32_t joint = 0; joint < jointCount; ++joint) {
    joints[joint] = joint;
    SkeletonNode& node = skeleton.nodes.emplace_back();
    if (joint == 0) continue;
    node.parent = joint <= limbs ? 0 : joint - limbs;
    node.translation = {0, 0.125, 0};
    inverseBind[joint].m[1][3] = inverseBind[node.parent].m[1][3] - 0.125f;
  }
  skeleton.skins.push_back({"crowd", joints, inverseBind});

  std::array<std::vector<float>, 2> times;
  std::vector<std::vector<float>> rotations(times.size() * jointCount);
  std::vector<ClipView> clips;
  for (std::size_t number = 0; number < times.size(); ++number) {
    ClipView& clip = clips.emplace_back();
    clip.duration = number == 0 ? 1 : 1.5;
    for (std::uint32_t key = 0; key < keys; ++key)
      times[number].push_back(static_cast<float>(clip.duration * key / (keys - 1)));
    for (std::uint32_t joint = 0; joint < jointCount; ++joint) {
      std::vector<float>& values = rotations[number * jointCount + joint];
      for (std::uint32_t key = 0; key < keys; ++key) {
        const double turn = 2 * std::numbers::pi * (key % (keys - 1)) / (keys - 1);
        const double half = 0.2 * std::sin(turn + joint);
        std::array<float, 4> rotation{0, 0, 0, static_cast<float>(std::cos(half))};
        rotation[(joint + number) % 3] = static_cast<float>(std::sin(half));
        values.insert(values.end(), rotation.begin(), rotation.end());
      }
      clip.channels.push_back(
          {joint, ChannelPath::rotation, Interpolation::linear, times[number], values});
    }
  }
  return packClips(skeleton, clips);
}

}  // namespace

PlainMesh::PlainMesh(std::span<const PlainVertex> vertices)
    : vertices_(vertices),
      influences_{viewOf(vertices, &vertices.front().joints, ComponentType::uint16, 4),
                  viewOf(vertices, &vertices.front().weights, ComponentType::float32, 4)} {}

MeshView PlainMesh::view() const {
  MeshView mesh;
  mesh.name = "crowd";
  mesh.vertexCount = static_cast<std::uint32_t>(vertices_.size());
  mesh.positions = viewOf(vertices_, &vertices_.front().position, ComponentType::float32, 3);
  mesh.normals = viewOf(vertices_, &vertices_.front().normal, ComponentType::float32, 3);
  mesh.influenceSets = std::span(&influences_, 1);
  return mesh;
}

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
  if (!model->clips.empty()) {
    Skeleton skeleton = gltf::skeleton(*model);
    skeleton.skins = {skeleton.skins[skin]};
    crowd.clips = packClips(skeleton, gltf::clips(*model));
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
  crowd.clips = packSwayingClips(jointCount);
  return crowd;
}

}  // namespace dermis::samples
