// `diagnose` on a small rig: each mistake is named, and what is missing is listed. The models of
// the test data are in diagnose_models_test.cpp.
#include <dermis/verify.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>

namespace dermis::test {
namespace {

using glm::mat4;
using glm::vec3;

constexpr std::uint32_t noParent = 0xffffffffu;

/// A figure of six bones, each with a box around it. Node 0 is above the skeleton. The joints are
/// neither in the order of the nodes nor in that of their names.
class Rig {
 public:
  Rig() {
    const std::array<vec3, 6> ends{vec3(0, 1, 0),    vec3(0, 0.8f, 0.1f),  vec3(0.7f, 0.2f, 0.1f),
                                   vec3(0.6f, 0, 0), vec3(-0.5f, 0, 0.3f), vec3(0.1f, 0.5f, 0.2f)};
    const std::array<std::uint32_t, 6> above{0, 1, 2, 3, 2, 2};
    const std::array<vec3, 6> turns{vec3(0, 0.2f, 0),    vec3(0.4f, 0, 0),     vec3(0, 0, 0.9f),
                                    vec3(0, 0.7f, 0.3f), vec3(0.2f, 0, -0.8f), vec3(0.5f, 0.4f, 0)};
    parents = {noParent};
    const mat4 root =
        glm::rotate(glm::translate(mat4(1), vec3(0.2f, 0, 3)), -1.5707963f, vec3(1, 0, 0));
    bind_ = locals = {root};
    for (std::size_t i = 0; i < 6; ++i) {
      parents.push_back(above[i]);
      const vec3 start = above[i] == 0 ? vec3(0.1f, 0.2f, 0.3f) : ends[above[i] - 1];
      const mat4 rest = glm::rotate(glm::translate(mat4(1), start), 0.3f, vec3(0, 0, 1));
      bind_.push_back(rest);
      const float angle = glm::length(turns[i]);
      locals.push_back(glm::rotate(rest, angle, turns[i] / angle));
    }
    for (const std::uint32_t node : jointNodes)
      inverseBind.push_back(glm::inverse(globals(bind_)[node]) * root);
    for (std::size_t joint = 0; joint < 6; ++joint) addBox(joint, ends[jointNodes[joint] - 1]);
  }

  std::vector<mat4> globals(const std::vector<mat4>& of) const {
    std::vector<mat4> all = of;
    for (std::size_t node = 1; node < all.size(); ++node) all[node] = all[parents[node]] * of[node];
    return all;
  }

  std::vector<mat4> pose(const std::vector<mat4>& with) const {
    const std::vector<mat4> all = globals(with);
    std::vector<mat4> result;
    for (std::size_t joint = 0; joint < 6; ++joint)
      result.push_back(all[jointNodes[joint]] * inverseBind[joint]);
    return result;
  }

  /// The mesh in which set `weightsOfFirst` has the weights of the first set's joints.
  MeshView mesh(std::size_t weightsOfFirst = 0) {
    const auto count = static_cast<std::uint32_t>(positions_.size());
    const auto view = [count](const auto& values, ComponentType type) {
      return AttributeView{values.data(), count, sizeof(values[0]), type, 2};
    };
    for (std::size_t set = 0; set < 2; ++set) {
      sets_[set].joints = view(joints_[set], ComponentType::uint32);
      sets_[set].weights = view(weights_[set == weightsOfFirst ? 0 : 1], ComponentType::float32);
    }
    MeshView mesh;
    mesh.name = "figure";
    mesh.vertexCount = count;
    mesh.positions = attributeView(&positions_[0].x, count, 3);
    mesh.influenceSets = sets_;
    return mesh;
  }

  std::vector<std::uint32_t> parents;
  const std::vector<std::uint32_t> jointNodes{2, 1, 6, 3, 5, 4};
  const std::vector<std::string_view> names{"chest", "hips", "head", "upper", "tail", "fore"};
  std::vector<mat4> locals, inverseBind;
  std::vector<std::uint32_t> triangles;

 private:
  /// A box around the bone of a joint, in four rings. The first ring moves with the parent, too.
  void addBox(std::size_t joint, const vec3& end) {
    const std::uint32_t above = parents[jointNodes[joint]];
    const auto parent =
        static_cast<std::uint32_t>(std::ranges::find(jointNodes, above) - jointNodes.begin());
    const mat4 place = glm::inverse(inverseBind[joint]);
    const auto first = static_cast<std::uint32_t>(positions_.size());
    for (std::uint32_t ring = 0; ring < 4; ++ring) {
      for (std::uint32_t corner = 0; corner < 4; ++corner) {
        const vec3 side((corner & 1u) != 0 ? 0.1f : -0.1f, 0, (corner & 2u) != 0 ? 0.1f : -0.1f);
        positions_.emplace_back(place * glm::vec4(end * (static_cast<float>(ring) / 3) + side, 1));
        const bool both = ring == 0 && parent < 6;
        joints_[0].push_back({static_cast<std::uint32_t>(joint), both ? parent : 0});
        joints_[1].push_back({static_cast<std::uint32_t>(joint + 2) % 6, 0});
        weights_[0].push_back({both ? 0.5f : 0.98f, both ? 0.48f : 0});
        weights_[1].push_back({0.02f, 0});
        if (ring == 0) continue;
        const std::uint32_t here = first + ring * 4 + corner;
        const std::uint32_t next = first + ring * 4 + (corner ^ (ring % 2 + 1));
        triangles.insert(triangles.end(), {here, here - 4, next, next, here - 4, next - 4});
      }
    }
  }

  std::vector<mat4> bind_;
  std::vector<vec3> positions_;
  std::array<std::vector<std::array<std::uint32_t, 2>>, 2> joints_;
  std::array<std::vector<std::array<float, 2>>, 2> weights_;
  std::array<InfluenceSet, 2> sets_;
};

class DiagnoseTest : public ::testing::Test {
 protected:
  static std::vector<JointMatrix> rows(const std::vector<mat4>& matrices) {
    std::vector<JointMatrix> result;
    for (const mat4& matrix : matrices) result.push_back(toJointMatrix(matrix));
    return result;
  }

  static std::vector<JointMatrix> each(std::vector<JointMatrix> pose, auto change) {
    for (JointMatrix& matrix : pose) matrix = change(matrix);
    return pose;
  }

  /// All that is known of the rig.
  PoseInput input(const std::vector<JointMatrix>& pose) {
    PoseInput input;
    input.jointMatrices = pose;
    input.triangles = rig_.triangles;
    input.inverseBindMatrices = inverseBind_;
    input.jointNames = rig_.names;
    input.jointNodes = rig_.jointNodes;
    input.parents = rig_.parents;
    input.localTransforms = locals_;
    return input;
  }

  Diagnosis found(const PoseInput& input, std::size_t weightsOfFirst = 0) {
    const Result<Diagnosis> result = diagnose(rig_.mesh(weightsOfFirst), input);
    EXPECT_TRUE(result) << (result ? "" : result.error().message);
    return result ? *result : Diagnosis();
  }

  /// The mistake, found with the local transforms and without.
  void expectNamed(PoseMistake mistake, const std::vector<JointMatrix>& pose, std::string_view line,
                   bool needsLocals = false) {
    PoseInput known = input(pose);
    for (const bool hasLocals : {true, false}) {
      if (!hasLocals && needsLocals) continue;
      if (!hasLocals) known.localTransforms = {};
      const Diagnosis diagnosis = found(known);
      EXPECT_EQ(diagnosis.mistake, mistake) << poseMistakeName(diagnosis.mistake);
      EXPECT_NE(diagnosis.message.find(line), std::string::npos) << diagnosis.message;
      EXPECT_FALSE(diagnosis.message.ends_with("."));
      EXPECT_LE(diagnosis.mendedStretch, 0.3);
    }
  }

  std::vector<JointMatrix> ordered(const std::vector<std::size_t>& from) const {
    std::vector<JointMatrix> pose;
    for (const std::size_t joint : from) pose.push_back(right_[joint]);
    return pose;
  }

  Rig rig_;
  const std::vector<JointMatrix> right_ = rows(rig_.pose(rig_.locals));
  const std::vector<JointMatrix> inverseBind_ = rows(rig_.inverseBind);
  std::vector<JointMatrix> locals_ = rows(rig_.locals);
};

TEST_F(DiagnoseTest, SoundPosesHaveNoFinding) {
  PoseInput known = input(right_);
  EXPECT_TRUE(found(known).plausible());
  EXPECT_EQ(found(known).message, "");
  EXPECT_TRUE(found(known).notTested.empty()) << found(known).notTested[0].second;
  known.localTransforms = {};
  EXPECT_TRUE(found(known).plausible());
  PoseInput matrices;
  matrices.jointMatrices = right_;
  EXPECT_TRUE(found(matrices).plausible());
}

TEST_F(DiagnoseTest, AScaledModelIsSound) {
  for (const float factor : {100.0f, 0.01f}) {
    const std::vector<JointMatrix> scaled = each(right_, [factor](JointMatrix m) {
      for (auto& row : m.m)
        for (float& value : row) value *= factor;
      return m;
    });
    PoseInput known = input(scaled);
    known.localTransforms = {};
    EXPECT_TRUE(found(known).plausible());
    known.localTransforms = locals_;
    EXPECT_EQ(found(known).mistake, PoseMistake::units) << "the local transforms do not scale";
  }
}

TEST_F(DiagnoseTest, NamesTransposedMatrices) {
  expectNamed(PoseMistake::transposed,
              each(right_,
                   [](const JointMatrix& m) {
                     JointMatrix wrong;
                     for (std::size_t row = 0; row < 3; ++row)
                       for (std::size_t column = 0; column < 3; ++column)
                         wrong.m[row][column] = m.m[column][row];
                     return wrong;
                   }),
              "jointMatrices[j] = toJointMatrix(matrices[j])");
}

TEST_F(DiagnoseTest, NamesColumnMajorFloats) {
  expectNamed(PoseMistake::columnMajor,
              each(right_,
                   [](const JointMatrix& m) {
                     JointMatrix wrong;
                     for (std::size_t i = 0; i < 12; ++i) wrong.m[i / 4][i % 4] = m.m[i % 3][i / 3];
                     return wrong;
                   }),
              "jointMatrices[j].m[row][column] = columns[column][row]");
}

TEST_F(DiagnoseTest, NamesInverseBindMatrices) {
  const std::vector<mat4> globals = rig_.globals(rig_.locals);
  std::vector<mat4> missing, twice, wrongSide;
  for (std::size_t joint = 0; joint < 6; ++joint) {
    const mat4& global = globals[rig_.jointNodes[joint]];
    const mat4& bind = rig_.inverseBind[joint];
    missing.push_back(global);
    twice.push_back(global * bind * bind);
    wrongSide.push_back(bind * global);
  }
  const std::string line = "jointMatrices[j] = globalTransforms[j] * inverseBindMatrices[j]";
  expectNamed(PoseMistake::inverseBindMissing, rows(missing), line);
  expectNamed(PoseMistake::inverseBindTwice, rows(twice), line + ", once");
  expectNamed(PoseMistake::inverseBindWrongSide, rows(wrongSide), line + ", not");
}

TEST_F(DiagnoseTest, NamesOrdersOfJoints) {
  expectNamed(PoseMistake::jointsInNodeOrder, ordered({1, 0, 3, 5, 4, 2}), "skin.joints[j]");
  expectNamed(PoseMistake::jointsSortedByName, ordered({0, 5, 2, 1, 4, 3}), "jointNames[j]");
  // The chest is lost, to which most bones are attached.
  expectNamed(PoseMistake::jointsOffByOne, ordered({1, 2, 3, 4, 5, 5}), "jointMatrices[j - 1]",
              true);
  expectNamed(PoseMistake::jointsOffByOne, ordered({0, 0, 1, 2, 3, 4}), "jointMatrices[j + 1]");
}

TEST_F(DiagnoseTest, NamesTheRootTransform) {
  const mat4& root = rig_.locals[0];
  std::vector<mat4> missing, twice;
  for (const mat4& matrix : rig_.pose(rig_.locals)) {
    missing.push_back(glm::inverse(root) * matrix);
    twice.push_back(root * matrix);
  }
  const std::vector<JointMatrix> withoutRoot = rows(missing), withTwo = rows(twice);
  EXPECT_EQ(found(input(withoutRoot)).mistake, PoseMistake::rootMissing);
  EXPECT_EQ(found(input(withTwo)).mistake, PoseMistake::rootTwice);
  PoseInput unknown = input(withTwo);
  unknown.localTransforms = {};
  EXPECT_TRUE(found(unknown).plausible()) << "the model may be anywhere";
}

// In the code that samples, and in the loader: the local transforms are wrong, too.
TEST_F(DiagnoseTest, NamesUnitsAxesAndQuaternions) {
  std::vector<mat4> large = rig_.locals, mirrored = rig_.locals, turned = rig_.locals;
  for (std::size_t node = 0; node < large.size(); ++node) {
    large[node][3] = glm::vec4(100.0f * vec3(large[node][3]), 1);
    const mat4 mirror = glm::scale(mat4(1), vec3(1, 1, -1));
    mirrored[node] = mirror * mirrored[node] * mirror;
    // w, x, y, z read as x, y, z, w.
    const mat4& m = rig_.locals[node];
    const float w = std::sqrt(1 + m[0][0] + m[1][1] + m[2][2]) / 2;
    const vec3 v = vec3(m[1][2] - m[2][1], m[2][0] - m[0][2], m[0][1] - m[1][0]) / (4 * w);
    const vec3 axis(w, v.x, v.y);
    turned[node] = glm::translate(mat4(1), vec3(m[3])) *
                   glm::rotate(mat4(1), 2 * std::atan2(glm::length(axis), v.z), axis);
  }
  expectNamed(PoseMistake::units, rows(rig_.pose(large)), "translation *= 0.01f");
  expectNamed(PoseMistake::axes, rows(rig_.pose(mirrored)), "mirrorZ");
  expectNamed(PoseMistake::quaternionOrder, rows(rig_.pose(turned)), "{x, y, z, w}");
  for (const auto& [mistake, locals] :
       {std::pair(PoseMistake::units, large), std::pair(PoseMistake::axes, mirrored),
        std::pair(PoseMistake::quaternionOrder, turned)}) {
    locals_ = rows(locals);
    const std::vector<JointMatrix> pose = rows(rig_.pose(locals));
    EXPECT_EQ(found(input(pose)).mistake, mistake) << poseMistakeName(mistake);
  }
}

TEST_F(DiagnoseTest, NamesWeightsOfAnotherSet) {
  const Diagnosis diagnosis = found(input(right_), 1);
  EXPECT_EQ(diagnosis.mistake, PoseMistake::weightSet);
  EXPECT_NE(diagnosis.message.find("influenceSets[0].weights = WEIGHTS_0"), std::string::npos)
      << diagnosis.message;
}

TEST_F(DiagnoseTest, ListsWhatIsNotTested) {
  PoseInput matrices;
  matrices.jointMatrices = right_;
  MeshView mesh = rig_.mesh();
  mesh.influenceSets = mesh.influenceSets.first(1);
  const Result<Diagnosis> diagnosis = diagnose(mesh, matrices);
  ASSERT_TRUE(diagnosis);
  std::vector<std::string> sentences;
  for (const auto& [mistake, sentence] : diagnosis->notTested) {
    EXPECT_TRUE(sentence.starts_with(poseMistakeName(mistake))) << sentence;
    sentences.push_back(sentence);
  }
  EXPECT_EQ(sentences,
            (std::vector<std::string>{
                "inverse bind matrix missing: pass PoseInput::inverseBindMatrices",
                "inverse bind matrix twice: pass PoseInput::inverseBindMatrices",
                "inverse bind matrix on the wrong side: pass PoseInput::inverseBindMatrices",
                "joints in the order of nodes: pass PoseInput::jointNodes, parents and "
                "inverseBindMatrices",
                "joints sorted by name: pass PoseInput::jointNames, parents and "
                "inverseBindMatrices",
                "joints off by one: pass PoseInput::parents and inverseBindMatrices",
                "root transform missing: pass PoseInput::parents, localTransforms and "
                "inverseBindMatrices",
                "root transform twice: pass PoseInput::parents, localTransforms and "
                "inverseBindMatrices",
                "quaternion order: pass PoseInput::parents and inverseBindMatrices",
                "weights of another set: pass all sets of influences in MeshView::influenceSets"}));
}

TEST_F(DiagnoseTest, NamesNoMistakeForOthers) {
  std::vector<JointMatrix> pose = right_;
  for (std::size_t joint = 0; joint < pose.size(); ++joint) {
    for (float& value : pose[joint].m[joint % 3]) value *= joint % 2 == 0 ? 9.0f : -0.2f;
  }
  const Diagnosis diagnosis = found(input(pose));
  EXPECT_EQ(diagnosis.mistake, PoseMistake::unknown);
  EXPECT_GT(diagnosis.stretch, 0.5);
  pose[2].m[1][1] = std::numeric_limits<float>::quiet_NaN();
  const Diagnosis notFinite = found(input(pose));
  EXPECT_EQ(notFinite.mistake, PoseMistake::unknown);
  EXPECT_NE(notFinite.message.find("joint 2 "), std::string::npos) << notFinite.message;
}

TEST_F(DiagnoseTest, RefusesWrongInput) {
  const auto refusal = [this](const PoseInput& wrong) {
    const Result<Diagnosis> result = diagnose(rig_.mesh(), wrong);
    return result ? "" : result.error().message;
  };
  PoseInput wrong = input(right_);
  wrong.jointMatrices = {};
  EXPECT_EQ(refusal(wrong), "PoseInput::jointMatrices has 0 elements");
  wrong = input(right_);
  wrong.inverseBindMatrices = wrong.inverseBindMatrices.first(2);
  EXPECT_EQ(refusal(wrong), "PoseInput::inverseBindMatrices has 2 elements for 6 joints");
  wrong = input(right_);
  wrong.localTransforms = wrong.localTransforms.first(3);
  EXPECT_EQ(refusal(wrong),
            "PoseInput::localTransforms has 3 elements and parents 7; both have one for each node");
  wrong = input(right_);
  wrong.parents = wrong.parents.first(3);
  wrong.localTransforms = {};
  EXPECT_EQ(refusal(wrong), "joint 2 is node 6, but PoseInput::parents has only 3 nodes");
  const std::vector<std::uint32_t> cycle{1, 2, 0, 0, 0, 0, 0};
  wrong = input(right_);
  wrong.parents = cycle;
  EXPECT_EQ(refusal(wrong), "PoseInput::parents form a cycle");
  const std::vector<std::uint32_t> outside{0, 1, 4000};
  wrong = input(right_);
  wrong.triangles = outside;
  EXPECT_EQ(refusal(wrong),
            "mesh 'figure': PoseInput::triangles are not 3 vertices of the mesh for each triangle");
}

}  // namespace
}  // namespace dermis::test
