#include <algorithm>
#include <cmath>
#include <span>

#include "gltf/descendants.h"
#include "gltf/failure.h"
#include "gltf/reader.h"
#include "strict_floating_point.h"

namespace dermis::gltf {
namespace {

constexpr Format matrixFormat[] = {{TINYGLTF_COMPONENT_TYPE_FLOAT, false}};

JointMatrix readMatrix(std::span<const float, 16> columns, const std::string& where, Notes& notes) {
  // The specification requires an exact fourth row, but exporters that invert in float32 leave
  // rounding errors in it. A row farther off may mean something.
  constexpr float refused = 1e-2f;
  float error = 0;
  for (std::size_t i = 0; i < 16; ++i) {
    if (!std::isfinite(columns[i])) failInvalid(where, " contains a number that is not finite");
    if (i % 4 == 3) error = std::max(error, std::abs(columns[i] - (i == 15 ? 1.0f : 0.0f)));
  }
  if (error > refused) failInvalid(where, ": its fourth row is not 0 0 0 1");
  if (error > 0)
    notes.broken(NoteKind::matrix, where, ": its fourth row is not exactly 0 0 0 1; it is ignored");
  return toJointMatrix(columns);
}

std::vector<JointMatrix> readInverseBindMatrices(Source& source, int accessor, std::size_t joints,
                                                 const std::string& where) {
  source.spend(joints, sizeof(JointMatrix), where);
  if (accessor < 0) return std::vector<JointMatrix>(joints);
  const std::string place = where + " inverseBindMatrices";
  source.require(accessor, TINYGLTF_TYPE_MAT4, matrixFormat, place);
  source.noteStride(accessor, place);
  if (source.count(accessor) < joints) {
    failInvalid(place, ": accessor ", accessor, " has ", source.count(accessor), " matrices for ",
                joints, " joints");
  }
  // An accessor without data is all zeros, and no such matrix is valid.
  if (source.hasNoData(accessor)) return std::vector<JointMatrix>(joints);
  const std::vector<float> floats = source.floats(accessor);
  std::vector<JointMatrix> matrices(joints);
  for (std::size_t i = 0; i < joints; ++i) {
    matrices[i] = readMatrix(std::span(floats).subspan(i * 16).first<16>(),
                             join(where, ": inverse bind matrix ", i), source.notes());
  }
  return matrices;
}

// The root of each node's tree.
std::vector<std::uint32_t> findRoots(const Model& model) {
  std::vector<std::uint32_t> roots(model.nodes.size());
  for (const std::uint32_t node : model.nodeOrder) {
    const std::uint32_t parent = model.nodes[node].parent;
    roots[node] = parent == noIndex ? node : roots[parent];
  }
  return roots;
}

Skin readSkin(Source& source, const tinygltf::Skin& from, const std::string& where) {
  if (from.joints.size() > maxPoseJoints) {
    fail(ErrorCode::limitExceeded,
         join(where, ": it has ", from.joints.size(), " joints; the maximum is ", maxPoseJoints));
  }
  Skin skin;
  std::transform(from.joints.begin(), from.joints.end(), std::back_inserter(skin.joints), indexOf);
  skin.inverseBindMatrices =
      readInverseBindMatrices(source, from.inverseBindMatrices, skin.joints.size(), where);
  return skin;
}

}  // namespace

void readSkins(Source& source, Model& model) {
  const tinygltf::Model& content = source.content();
  const std::vector<std::uint32_t> roots = findRoots(model);
  const Descendants descendants(model);
  for (std::size_t i = 0; i < content.skins.size(); ++i) {
    const tinygltf::Skin& from = content.skins[i];
    const std::string where = join("skin ", i);
    Skin skin;
    source.notes().tolerateUnlessUsed(source.usage().skins[i],
                                      [&] { skin = readSkin(source, from, where); });
    skin.name = from.name;
    skin.rig = source.takeRig(i);
    const bool oneRoot = std::all_of(skin.joints.begin(), skin.joints.end(), [&](auto joint) {
      return roots[joint] == roots[skin.joints[0]];
    });
    if (!oneRoot)
      source.notes().broken(NoteKind::skeleton, where, ": its joints have no common root");
    const bool isCommonRoot =
        from.skeleton < 0 || std::all_of(skin.joints.begin(), skin.joints.end(), [&](auto joint) {
          return descendants.isOrIsBelow(joint, indexOf(from.skeleton));
        });
    if (!isCommonRoot) {
      source.notes().broken(NoteKind::skeleton, where, ": its skeleton, node ", from.skeleton,
                            ", is not a common root of its joints");
    }
    model.skins.push_back(std::move(skin));
  }
}

}  // namespace dermis::gltf
