#include "glb_writer.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "glb_file.h"

namespace dermis::models {
namespace {

using Json = nlohmann::ordered_json;
using Buffer = samples::GlbBuffer;
using samples::GlbComponent;
using samples::GlbTarget;

float toFloat(double value) {
  return static_cast<float>(value) + 0.0F;
}  // + 0 turns −0 into 0

// Nine decimals: short to read in the file, and finer than a float.
double rounded(double value) {
  return std::floor(value * 1e9 + 0.5) / 1e9 + 0.0;
}

int putVectors(Buffer& buffer, const std::vector<Vec3>& vectors, GlbTarget target) {
  buffer.begin();
  for (const Vec3& vector : vectors) {
    for (int axis = 0; axis < 3; ++axis) buffer.putFloat(toFloat(vector[axis]));
  }
  return buffer.end(GlbComponent::float32, "VEC3", vectors.size(), target);
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
  const int accessor = putVectors(buffer, positions, GlbTarget::vertices);
  // glTF wants the very floats that are stored.
  buffer.accessor(accessor)["min"] = {toFloat(low.x), toFloat(low.y), toFloat(low.z)};
  buffer.accessor(accessor)["max"] = {toFloat(high.x), toFloat(high.y), toFloat(high.z)};
  return accessor;
}

int putColors(Buffer& buffer, const std::vector<Vec3>& colors) {
  buffer.begin();
  for (const Vec3& color : colors) {
    for (int axis = 0; axis < 3; ++axis) {
      const double level = std::clamp(color[axis], 0.0, 1.0) * 255.0 + 0.5;
      buffer.put(static_cast<std::uint32_t>(level), 1);
    }
    buffer.put(255, 1);
  }
  const int accessor =
      buffer.end(GlbComponent::unsignedByte, "VEC4", colors.size(), GlbTarget::vertices);
  buffer.accessor(accessor)["normalized"] = true;
  return accessor;
}

Json putPrimitive(Buffer& buffer, const Mesh& mesh, std::size_t material) {
  Json attributes;
  attributes["POSITION"] = putPositions(buffer, mesh.positions);
  attributes["NORMAL"] = putVectors(buffer, mesh.normals, GlbTarget::vertices);
  if (!mesh.colors.empty()) attributes["COLOR_0"] = putColors(buffer, mesh.colors);

  buffer.begin();
  for (const Influences& influences : mesh.influences) {
    for (const std::uint16_t joint : influences.joints) buffer.put(joint, 1);
  }
  attributes["JOINTS_0"] =
      buffer.end(GlbComponent::unsignedByte, "VEC4", mesh.influences.size(), GlbTarget::vertices);
  buffer.begin();
  for (const Influences& influences : mesh.influences) {
    for (const float weight : influences.weights) buffer.putFloat(weight);
  }
  attributes["WEIGHTS_0"] =
      buffer.end(GlbComponent::float32, "VEC4", mesh.influences.size(), GlbTarget::vertices);

  buffer.begin();
  for (const std::uint32_t index : mesh.indices) buffer.put(index, 2);
  const int indices =
      buffer.end(GlbComponent::unsignedShort, "SCALAR", mesh.indices.size(), GlbTarget::indices);
  return {{"attributes", attributes}, {"indices", indices}, {"material", material}, {"mode", 4}};
}

Json putPrimitives(Buffer& buffer, const Model& model) {
  if (model.parts.empty()) return Json::array({putPrimitive(buffer, model.mesh, 0)});
  Json primitives = Json::array();
  for (const Part& part : model.parts)
    primitives.push_back(putPrimitive(buffer, partOf(model.mesh, part), primitives.size()));
  return primitives;
}

Json materialOf(const Model& model, const std::string& name) {
  return {{"name", name},
          {"pbrMetallicRoughness",
           {{"baseColorFactor", {1, 1, 1, 1}},
            {"metallicFactor", 0},
            {"roughnessFactor", model.roughness}}}};
}

Json materialsOf(const Model& model) {
  if (model.parts.empty()) return Json::array({materialOf(model, model.name)});
  Json materials = Json::array();
  for (const Part& part : model.parts) materials.push_back(materialOf(model, part.name));
  return materials;
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
  return buffer.end(GlbComponent::float32, "MAT4", skeleton.joints.size(), GlbTarget::none);
}

// Quaternions q and −q turn alike; neighbors in time are kept in one half so that interpolation
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
  const int input = buffer.end(GlbComponent::float32, "SCALAR", clip.times.size(), GlbTarget::none);
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
      addChannel(joint, "translation", putVectors(buffer, translations, GlbTarget::none));
    }
    if (isAnimated(clip, joint)) {
      buffer.begin();
      for (const Quat& rotation : rotationsOf(skeleton, clip, joint)) {
        for (const double part : {rotation.x, rotation.y, rotation.z, rotation.w}) {
          buffer.putFloat(toFloat(part));
        }
      }
      addChannel(joint, "rotation",
                 buffer.end(GlbComponent::float32, "VEC4", clip.times.size(), GlbTarget::none));
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

}  // namespace

std::vector<std::byte> writeGlb(const Model& model) {
  // Node 0 is the mesh, at the root of the scene because glTF ignores what stands above a skinned
  // mesh.
  constexpr int firstJointNode = 1;
  Buffer buffer;
  const Json primitives = putPrimitives(buffer, model);
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
  document["meshes"] = Json::array({{{"name", model.name}, {"primitives", primitives}}});
  document["skins"] = Json::array({{{"name", model.name},
                                    {"inverseBindMatrices", inverseBindMatrices},
                                    {"skeleton", firstJointNode},
                                    {"joints", joints}}});
  document["materials"] = materialsOf(model);
  document["animations"] = animations;
  return samples::glbFile(std::move(document), buffer);
}

}  // namespace dermis::models
