#include "glb_writer.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>

namespace dermis::models {
namespace {

using Json = nlohmann::ordered_json;

constexpr int byteComponent = 5121;
constexpr int shortComponent = 5123;
constexpr int floatComponent = 5126;
constexpr int vertexTarget = 34962;
constexpr int indexTarget = 34963;
constexpr int noTarget = 0;

float toFloat(double value) {
  return static_cast<float>(value) + 0.0F;
}  // + 0 turns −0 into 0

// Nine decimals: short to read in the file, and finer than a float.
double rounded(double value) {
  return std::floor(value * 1e9 + 0.5) / 1e9 + 0.0;
}

// Collects little-endian bytes and the accessors that describe them.
class Buffer {
 public:
  void put(std::uint32_t value, int byteCount) {
    for (int byte = 0; byte < byteCount; ++byte) {
      bytes_.push_back(static_cast<std::byte>((value >> (8 * byte)) & 0xFFU));
    }
  }
  void putFloat(float value) { put(std::bit_cast<std::uint32_t>(value), 4); }

  // Starts a view; what is put until `end` is its content.
  void begin() {
    while (bytes_.size() % 4 != 0) bytes_.push_back(std::byte{0});
    start_ = bytes_.size();
  }
  int end(int componentType, const char* type, std::size_t count, int target) {
    Json view = {{"buffer", 0}, {"byteOffset", start_}, {"byteLength", bytes_.size() - start_}};
    if (target != noTarget) view["target"] = target;
    views_.push_back(view);
    accessors_.push_back({{"bufferView", views_.size() - 1},
                          {"componentType", componentType},
                          {"count", count},
                          {"type", type}});
    return static_cast<int>(accessors_.size()) - 1;
  }
  Json& accessor(int index) { return accessors_[static_cast<std::size_t>(index)]; }

  const std::vector<std::byte>& bytes() const { return bytes_; }
  const Json& views() const { return views_; }
  const Json& accessors() const { return accessors_; }

 private:
  std::vector<std::byte> bytes_;
  std::size_t start_ = 0;
  Json views_ = Json::array();
  Json accessors_ = Json::array();
};

int putVectors(Buffer& buffer, const std::vector<Vec3>& vectors, int target) {
  buffer.begin();
  for (const Vec3& vector : vectors) {
    for (int axis = 0; axis < 3; ++axis) buffer.putFloat(toFloat(vector[axis]));
  }
  return buffer.end(floatComponent, "VEC3", vectors.size(), target);
}

int putPositions(Buffer& buffer, const std::vector<Vec3>& positions) {
  Vec3 low = positions.front();
  Vec3 high = low;
  for (const Vec3& position : positions) {
    for (int axis = 0; axis < 3; ++axis) {
      low[axis] = std::min(low[axis], position[axis]);
      high[axis] = std::max(high[axis], position[axis]);
    }
  }
  const int accessor = putVectors(buffer, positions, vertexTarget);
  // glTF wants the very floats that are stored.
  buffer.accessor(accessor)["min"] = {toFloat(low.x), toFloat(low.y), toFloat(low.z)};
  buffer.accessor(accessor)["max"] = {toFloat(high.x), toFloat(high.y), toFloat(high.z)};
  return accessor;
}

int putColours(Buffer& buffer, const std::vector<Vec3>& colours) {
  buffer.begin();
  for (const Vec3& colour : colours) {
    for (int axis = 0; axis < 3; ++axis) {
      const double level = std::clamp(colour[axis], 0.0, 1.0) * 255.0 + 0.5;
      buffer.put(static_cast<std::uint32_t>(level), 1);
    }
    buffer.put(255, 1);
  }
  const int accessor = buffer.end(byteComponent, "VEC4", colours.size(), vertexTarget);
  buffer.accessor(accessor)["normalized"] = true;
  return accessor;
}

Json putPrimitive(Buffer& buffer, const Mesh& mesh) {
  Json attributes;
  attributes["POSITION"] = putPositions(buffer, mesh.positions);
  attributes["NORMAL"] = putVectors(buffer, mesh.normals, vertexTarget);
  if (!mesh.colours.empty()) attributes["COLOR_0"] = putColours(buffer, mesh.colours);

  buffer.begin();
  for (const Influences& influences : mesh.influences) {
    for (const std::uint16_t joint : influences.joints) buffer.put(joint, 1);
  }
  attributes["JOINTS_0"] = buffer.end(byteComponent, "VEC4", mesh.influences.size(), vertexTarget);
  buffer.begin();
  for (const Influences& influences : mesh.influences) {
    for (const float weight : influences.weights) buffer.putFloat(weight);
  }
  attributes["WEIGHTS_0"] =
      buffer.end(floatComponent, "VEC4", mesh.influences.size(), vertexTarget);

  buffer.begin();
  for (const std::uint32_t index : mesh.indices) buffer.put(index, 2);
  const int indices = buffer.end(shortComponent, "SCALAR", mesh.indices.size(), indexTarget);
  return {{"attributes", attributes}, {"indices", indices}, {"material", 0}, {"mode", 4}};
}

int putInverseBindMatrices(Buffer& buffer, const Skeleton& skeleton) {
  buffer.begin();
  for (const Joint& joint : skeleton.joints) {
    const Quat inverse = glm::conjugate(joint.rotation);
    const std::array<Vec3, 4> columns = {
        inverse * Vec3(1.0, 0.0, 0.0), inverse * Vec3(0.0, 1.0, 0.0), inverse * Vec3(0.0, 0.0, 1.0),
        -(inverse * joint.position)};
    for (std::size_t column = 0; column < 4; ++column) {
      for (int row = 0; row < 3; ++row) buffer.putFloat(toFloat(columns[column][row]));
      buffer.putFloat(column == 3 ? 1.0F : 0.0F);
    }
  }
  return buffer.end(floatComponent, "MAT4", skeleton.joints.size(), noTarget);
}

// Quaternions q and −q turn alike; neighbours in time are kept in one half so that interpolation
// goes the short way.
std::vector<Quat> rotationsOf(const Skeleton& skeleton, const Clip& clip, std::size_t joint) {
  std::vector<Quat> rotations;
  for (const Pose& pose : clip.poses) {
    Quat rotation = localTransform(skeleton, joint, pose[joint]).rotation;
    if (!rotations.empty() && glm::dot(rotations.back(), rotation) < 0.0) rotation = -rotation;
    rotations.push_back(rotation);
  }
  return rotations;
}

bool isAnimated(const Clip& clip, std::size_t joint) {
  return std::any_of(clip.poses.begin(), clip.poses.end(), [&](const Pose& pose) {
    const Quat& turn = pose[joint].turn;
    return turn.x != 0.0 || turn.y != 0.0 || turn.z != 0.0;
  });
}

bool isMoved(const Clip& clip, std::size_t joint) {
  return std::any_of(clip.poses.begin(), clip.poses.end(),
                     [&](const Pose& pose) { return pose[joint].offset != Vec3(0.0); });
}

Json putClip(Buffer& buffer, const Skeleton& skeleton, const Clip& clip, int firstJointNode) {
  buffer.begin();
  for (const double time : clip.times) buffer.putFloat(toFloat(time));
  const int input = buffer.end(floatComponent, "SCALAR", clip.times.size(), noTarget);
  buffer.accessor(input)["min"] = {toFloat(clip.times.front())};
  buffer.accessor(input)["max"] = {toFloat(clip.times.back())};

  Json samplers = Json::array();
  Json channels = Json::array();
  const auto addChannel = [&](std::size_t joint, const char* path, int output) {
    channels.push_back(
        {{"sampler", samplers.size()},
         {"target", {{"node", static_cast<int>(joint) + firstJointNode}, {"path", path}}}});
    samplers.push_back({{"input", input}, {"output", output}, {"interpolation", "LINEAR"}});
  };
  for (std::size_t joint = 0; joint < skeleton.joints.size(); ++joint) {
    if (isMoved(clip, joint)) {
      std::vector<Vec3> translations;
      for (const Pose& pose : clip.poses) {
        translations.push_back(localTransform(skeleton, joint, pose[joint]).translation);
      }
      addChannel(joint, "translation", putVectors(buffer, translations, noTarget));
    }
    if (isAnimated(clip, joint)) {
      buffer.begin();
      for (const Quat& rotation : rotationsOf(skeleton, clip, joint)) {
        for (const double part : {rotation.x, rotation.y, rotation.z, rotation.w}) {
          buffer.putFloat(toFloat(part));
        }
      }
      addChannel(joint, "rotation",
                 buffer.end(floatComponent, "VEC4", clip.times.size(), noTarget));
    }
  }
  return {{"name", clip.name}, {"channels", channels}, {"samplers", samplers}};
}

Json jointNode(const Skeleton& skeleton, std::size_t joint, int firstJointNode) {
  const LocalTransform local = localTransform(skeleton, joint, {});
  const Quat& r = local.rotation;
  const Vec3& t = local.translation;
  Json node = {{"name", skeleton.joints[joint].name}};
  node["translation"] = {rounded(t.x), rounded(t.y), rounded(t.z)};
  node["rotation"] = {rounded(r.x), rounded(r.y), rounded(r.z), rounded(r.w)};
  for (std::size_t other = joint + 1; other < skeleton.joints.size(); ++other) {
    if (skeleton.joints[other].parent == static_cast<int>(joint)) {
      node["children"].push_back(static_cast<int>(other) + firstJointNode);
    }
  }
  return node;
}

std::vector<std::byte> assemble(std::string json, std::vector<std::byte> binary) {
  while (json.size() % 4 != 0) json.push_back(' ');
  while (binary.size() % 4 != 0) binary.push_back(std::byte{0});
  constexpr std::uint32_t magic = 0x46546C67U;        // "glTF"
  constexpr std::uint32_t jsonChunk = 0x4E4F534AU;    // "JSON"
  constexpr std::uint32_t binaryChunk = 0x004E4942U;  // "BIN\0"
  constexpr std::size_t headerSize = 12;
  constexpr std::size_t chunkHeaderSize = 8;

  std::vector<std::byte> file;
  const auto putWord = [&file](std::size_t value) {
    for (unsigned byte = 0; byte < 4; ++byte) {
      file.push_back(static_cast<std::byte>((value >> (8U * byte)) & 0xFFU));
    }
  };
  putWord(magic);
  putWord(2);
  putWord(headerSize + 2 * chunkHeaderSize + json.size() + binary.size());
  putWord(json.size());
  putWord(jsonChunk);
  for (const char character : json) file.push_back(static_cast<std::byte>(character));
  putWord(binary.size());
  putWord(binaryChunk);
  file.insert(file.end(), binary.begin(), binary.end());
  return file;
}

}  // namespace

std::vector<std::byte> writeGlb(const Model& model) {
  // Node 0 is the mesh, at the root of the scene because glTF ignores what stands above a skinned
  // mesh.
  constexpr int firstJointNode = 1;
  Buffer buffer;
  const Json primitive = putPrimitive(buffer, model.mesh);
  const int inverseBindMatrices = putInverseBindMatrices(buffer, model.skeleton);

  Json nodes = Json::array({{{"name", model.name}, {"mesh", 0}, {"skin", 0}}});
  Json joints = Json::array();
  for (std::size_t joint = 0; joint < model.skeleton.joints.size(); ++joint) {
    nodes.push_back(jointNode(model.skeleton, joint, firstJointNode));
    joints.push_back(static_cast<int>(joint) + firstJointNode);
  }
  Json animations = Json::array();
  for (const Clip& clip : model.clips) {
    animations.push_back(putClip(buffer, model.skeleton, clip, firstJointNode));
  }

  Json document;
  document["asset"] = {{"version", "2.0"}, {"generator", "dermis-models"}};
  document["scene"] = 0;
  document["scenes"] = Json::array({{{"name", model.name}, {"nodes", {0, firstJointNode}}}});
  document["nodes"] = nodes;
  document["meshes"] = Json::array({{{"name", model.name}, {"primitives", {primitive}}}});
  document["skins"] = Json::array({{{"name", model.name},
                                    {"inverseBindMatrices", inverseBindMatrices},
                                    {"skeleton", firstJointNode},
                                    {"joints", joints}}});
  document["materials"] = Json::array({{{"name", model.name},
                                        {"pbrMetallicRoughness",
                                         {{"baseColorFactor", {1, 1, 1, 1}},
                                          {"metallicFactor", 0},
                                          {"roughnessFactor", model.roughness}}}}});
  document["animations"] = animations;
  document["accessors"] = buffer.accessors();
  document["bufferViews"] = buffer.views();
  document["buffers"] = Json::array({{{"byteLength", (buffer.bytes().size() + 3) / 4 * 4}}});
  return assemble(document.dump(), buffer.bytes());
}

}  // namespace dermis::models
