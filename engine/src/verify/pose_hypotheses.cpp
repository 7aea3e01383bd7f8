#include "verify/pose_hypotheses.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <initializer_list>
#include <numeric>

#include <glm/matrix.hpp>

#include "strict_floating_point.h"
#include "verify/joint.h"
#include "verify/rigid.h"

namespace dermis::diagnosis {
namespace {

using glm::dmat3;
using glm::dvec3;
using Change = Hypothesis::Change;

/// The nodes from a root to this one.
std::vector<std::uint32_t> pathTo(const PoseSkeleton& skeleton, std::uint32_t node) {
  std::vector<std::uint32_t> path;
  for (; node != noJoint; node = skeleton.nodeParents[node]) path.push_back(node);
  std::ranges::reverse(path);
  return path;
}

/// The nodes above all joints, from the root on, and the joint that is above all others.
std::vector<std::uint32_t> commonPath(const PoseSkeleton& skeleton) {
  std::vector<std::uint32_t> common = pathTo(skeleton, skeleton.nodeOfJoint[0]);
  for (const std::uint32_t node : skeleton.nodeOfJoint) {
    const std::vector<std::uint32_t> path = pathTo(skeleton, node);
    const auto [end, ignored] = std::ranges::mismatch(common, path);
    common.erase(end, common.end());
  }
  return common;
}

Pose times(const Pose& a, const Pose& b) {
  Pose product(a.size());
  for (std::size_t i = 0; i < a.size(); ++i) product[i] = a[i] * b[i];
  return product;
}

Pose inverses(const Pose& pose) {
  Pose result(pose.size());
  std::ranges::transform(pose, result.begin(), [](const Affine& a) { return inverse(a); });
  return result;
}

/// The pose in which joints that have no matrix move with their parents.
std::optional<Pose> completed(std::vector<std::optional<Affine>> found,
                              const PoseSkeleton& skeleton) {
  Pose pose(found.size());
  for (std::size_t joint = 0; joint < found.size(); ++joint) {
    auto from = static_cast<std::uint32_t>(joint);
    // Parents have no cycles: `skeletonOf` checks that.
    while (!found[from] && !skeleton.bind.parents.empty() &&
           skeleton.bind.parents[from] != noJoint) {
      from = skeleton.bind.parents[from];
    }
    if (found[from]) {
      pose[joint] = *found[from];
      pose[joint].guessed = from != joint;
    } else {  // a root: moves with any child
      const auto any = std::ranges::find_if(found, [](const auto& a) { return a.has_value(); });
      if (any == found.end()) return std::nullopt;
      pose[joint] = **any;
      pose[joint].guessed = true;
    }
  }
  return pose;
}

/// The same rotation with the parts of its quaternion elsewhere: part i is what was part order[i].
/// Scale and shear stay.
Affine reordered(const Affine& local, const std::array<int, 4>& order) {
  const reference::Joint joint = reference::takeApart(toJointMatrix(local));
  glm::dvec4 q;
  for (int i = 0; i < 4; ++i) q[i] = joint.rigid.real[order[static_cast<std::size_t>(i)]];
  return {reference::matrixOf(q) * joint.scaleShear, local.translation};
}

/// Transposed back. Translations are lost: they are chosen so that each joint is where its parent
/// takes it.
std::optional<Pose> transposedBack(const PoseSkeleton& skeleton, const Pose& pose) {
  Pose result;
  bool moved = false;
  for (const Affine& a : pose) {
    if (a.translation != dvec3(0)) return std::nullopt;
    moved = moved || a.linear != dmat3(1);
    result.push_back({glm::transpose(a.linear), dvec3(0)});
  }
  if (!moved) return std::nullopt;
  if (skeleton.bind.inverseBind.empty() || skeleton.nodeParents.empty()) return result;
  std::vector<bool> placed(pose.size());
  for (const std::uint32_t node : skeleton.nodeOrder) {
    for (std::uint32_t joint = 0; joint < pose.size(); ++joint) {
      const std::uint32_t parent = skeleton.bind.parents[joint];
      if (skeleton.nodeOfJoint[joint] != node || parent == noJoint) continue;
      const dvec3 place = inverse(skeleton.bind.inverseBind[joint]).translation;
      result[joint].translation =
          result[parent].linear * place + result[parent].translation - result[joint].linear * place;
    }
  }
  return result;
}

/// With other rotations of all nodes. If local transforms are not known, they are computed from
/// the pose.
std::optional<Pose> withOrder(const PoseSkeleton& skeleton, const Pose& pose,
                              const std::array<int, 4>& order) {
  const Pose& bind = skeleton.bind.inverseBind;
  if (skeleton.hasLocals()) {
    Pose locals;
    for (const Affine& local : skeleton.locals) locals.push_back(reordered(local, order));
    return rebuild(skeleton, globalsOf(skeleton, locals));
  }
  const Pose globals = times(pose, inverses(bind));
  Pose changed = globals;
  for (const std::uint32_t node : skeleton.nodeOrder) {
    for (std::uint32_t joint = 0; joint < pose.size(); ++joint) {
      const std::uint32_t parent = skeleton.bind.parents[joint];
      // What is above the skeleton is not known, and turns the whole model.
      if (skeleton.nodeOfJoint[joint] != node || parent == noJoint) continue;
      const Affine local = inverse(globals[parent]) * globals[joint];
      if (!isFinite(local)) return std::nullopt;
      changed[joint] = changed[parent] * reordered(local, order);
    }
  }
  return times(changed, bind);
}

class Builder {
 public:
  explicit Builder(const PoseSkeleton& skeleton) : skeleton_(skeleton) {}

  std::vector<Hypothesis> build() {
    addTransposed();
    if (hasBind()) addInverseBind();
    addOrders();
    if (skeleton_.isComplete()) addRoot();
    addUnits();
    addAxes();
    if (hasBind() && !skeleton_.nodeParents.empty()) addQuaternions();
    return std::move(hypotheses_);
  }

 private:
  bool hasBind() const { return !skeleton_.bind.inverseBind.empty(); }

  void add(PoseMistake mistake, std::string message, Change make, Change undo) {
    hypotheses_.push_back({mistake, std::move(message), std::move(make), std::move(undo)});
  }

  /// A change of each joint matrix.
  static Change each(std::function<Affine(const Affine&)> change) {
    return [change = std::move(change)](const Pose& pose) {
      Pose result(pose.size());
      std::ranges::transform(pose, result.begin(), change);
      return std::optional(std::move(result));
    };
  }

  /// The same change, of the joints' global transforms.
  Change ofGlobals(Change change) const {
    const Pose& inverseBind = skeleton_.bind.inverseBind;
    return [change = std::move(change), &inverseBind](const Pose& pose) {
      std::optional<Pose> globals = change(times(pose, inverses(inverseBind)));
      if (globals) globals = times(*globals, inverseBind);
      return globals;
    };
  }

  /// A change of the joint matrices; if inverse bind matrices are known, also of the globals.
  void addBoth(PoseMistake mistake, const std::string& message, const Change& make,
               const Change& undo) {
    if (hasBind()) add(mistake, message, ofGlobals(make), undo ? ofGlobals(undo) : Change());
    add(mistake, message, make, undo);
  }

  /// A change of the whole skeleton: of joint matrices and inverse bind matrices, or of the first
  /// only; and of the globals.
  void addSkeleton(PoseMistake mistake, const std::string& message, const Change& make,
                   const Change& undo) {
    addBoth(mistake, message, make, undo);
    if (hasBind()) hypotheses_.push_back({mistake, message, {}, undo, undo});
  }

  void addTransposed() {
    add(PoseMistake::transposed,
        "the joint matrices are transposed, which loses their translations: use "
        "jointMatrices[j] = toJointMatrix(matrices[j]), which reads column-major 4x4 matrices",
        each([](const Affine& a) {
          return Affine{glm::transpose(a.linear), dvec3(0)};
        }),
        [&skeleton = skeleton_](const Pose& pose) { return transposedBack(skeleton, pose); });
    const auto readWrongly = [](const Affine& a, bool make) {
      // As 12 floats: 4 columns of 3, or 3 rows of 4.
      std::array<double, 12> floats{};
      const auto value = [](auto& of, std::size_t row, std::size_t column) -> auto& {
        const auto r = static_cast<int>(row), c = static_cast<int>(column);
        return c < 3 ? of.linear[c][r] : of.translation[r];
      };
      Affine result;
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 4; ++column)
          floats[make ? column * 3 + row : row * 4 + column] = value(a, row, column);
      }
      for (std::size_t row = 0; row < 3; ++row) {
        for (std::size_t column = 0; column < 4; ++column)
          value(result, row, column) = floats[make ? row * 4 + column : column * 3 + row];
      }
      return result;
    };
    add(PoseMistake::columnMajor,
        "the 12 floats of the joint matrices are in column-major order: use "
        "jointMatrices[j].m[row][column] = columns[column][row], as toJointMatrix does",
        each([readWrongly](const Affine& a) { return readWrongly(a, true); }),
        each([readWrongly](const Affine& a) { return readWrongly(a, false); }));
  }

  void addInverseBind() {
    const Pose& bind = skeleton_.bind.inverseBind;
    const Pose unbind = inverses(bind);
    add(
        PoseMistake::inverseBindMissing,
        "the inverse bind matrices are missing: use "
        "jointMatrices[j] = globalTransforms[j] * inverseBindMatrices[j]",
        [unbind](const Pose& pose) { return std::optional(times(pose, unbind)); },
        [&bind](const Pose& pose) { return std::optional(times(pose, bind)); });
    add(
        PoseMistake::inverseBindTwice,
        "the inverse bind matrices are multiplied twice: use "
        "jointMatrices[j] = globalTransforms[j] * inverseBindMatrices[j], once",
        [&bind](const Pose& pose) { return std::optional(times(pose, bind)); },
        [unbind](const Pose& pose) { return std::optional(times(pose, unbind)); });
    add(
        PoseMistake::inverseBindWrongSide,
        "the inverse bind matrices are on the wrong side: use "
        "jointMatrices[j] = globalTransforms[j] * inverseBindMatrices[j], not "
        "inverseBindMatrices[j] * globalTransforms[j]",
        [&bind, unbind](const Pose& pose) {
          return std::optional(times(times(bind, pose), unbind));
        },
        [&bind, unbind](const Pose& pose) {
          return std::optional(times(times(unbind, pose), bind));
        });
  }

  /// `from[j]` is the joint whose matrix joint j gets, or `noJoint` for the identity.
  void addOrder(PoseMistake mistake, const std::string& message,
                const std::vector<std::uint32_t>& from) {
    bool same = true;
    for (std::uint32_t joint = 0; joint < from.size(); ++joint) same &= from[joint] == joint;
    if (same) return;
    const Change make = [from](const Pose& pose) {
      Pose result(pose.size());
      for (std::size_t joint = 0; joint < pose.size(); ++joint)
        if (from[joint] != noJoint) result[joint] = pose[from[joint]];
      return std::optional(std::move(result));
    };
    for (const bool ofGlobal : {true, false}) {
      if (ofGlobal && !hasBind()) continue;
      if (!hasBind() || skeleton_.nodeParents.empty()) {  // nothing shows which order is right
        add(mistake, message, make, {});
        continue;
      }
      const auto undo = [from, ofGlobal, &skeleton = skeleton_](const Pose& pose) {
        const Pose& bind = skeleton.bind.inverseBind;
        std::vector<std::optional<Affine>> found(pose.size());
        for (std::size_t joint = pose.size(); joint-- > 0;) {
          const std::uint32_t right = from[joint];
          if (right == noJoint) continue;
          found[right] = ofGlobal ? pose[joint] * inverse(bind[joint]) * bind[right] : pose[joint];
        }
        return completed(std::move(found), skeleton);
      };
      add(mistake, message, ofGlobal ? ofGlobals(make) : make, undo);
    }
  }

  void addOrders() {
    const auto count = static_cast<std::uint32_t>(skeleton_.nodeOfJoint.size());
    std::vector<std::uint32_t> order(count), inverted(count);
    const auto addSorted = [&](PoseMistake mistake, const std::string& message, const auto& less) {
      std::iota(order.begin(), order.end(), 0u);
      std::ranges::stable_sort(order, less);
      for (std::uint32_t i = 0; i < count; ++i) inverted[order[i]] = i;
      addOrder(mistake, message, order);
      if (inverted != order) addOrder(mistake, message, inverted);
    };
    const std::string inNodeOrder =
        "the joint matrices are in the order of the nodes: use "
        "jointMatrices[j] = globalTransforms[skin.joints[j]] * inverseBindMatrices[j]";
    addSorted(PoseMistake::jointsInNodeOrder, inNodeOrder,
              [this](std::uint32_t a, std::uint32_t b) {
                return skeleton_.nodeOfJoint[a] < skeleton_.nodeOfJoint[b];
              });
    addNodesAsJoints(inNodeOrder);
    if (!skeleton_.names.empty()) {
      addSorted(PoseMistake::jointsSortedByName,
                "the joint matrices are sorted by name: use the order of the skin's joints, "
                "jointMatrices[j] = globalTransforms[nodeNamed(jointNames[j])] * "
                "inverseBindMatrices[j]",
                [this](std::uint32_t a, std::uint32_t b) {
                  return skeleton_.names[a] < skeleton_.names[b];
                });
    }
    for (const bool next : {false, true}) {
      // What the first or last joint gets: the identity, the matrix of the other end, or its own.
      const std::uint32_t end = next ? count - 1 : 0;
      for (const std::uint32_t other : {noJoint, count - 1 - end, end}) {
        for (std::uint32_t joint = 0; joint < count; ++joint)
          order[joint] = joint == end ? other : next ? joint + 1 : joint - 1;
        addOrder(PoseMistake::jointsOffByOne,
                 next ? "each joint has the matrix of the next one: use jointMatrices[j - 1] for "
                        "what is now jointMatrices[j]"
                      : "each joint has the matrix of the previous one: use jointMatrices[j + 1] "
                        "for what is now jointMatrices[j]",
                 order);
      }
    }
  }

  /// Global transforms of nodes, with joints as indices.
  void addNodesAsJoints(const std::string& message) {
    if (!hasBind()) return;
    const std::vector<std::uint32_t>& nodes = skeleton_.nodeOfJoint;
    bool same = true;
    for (std::uint32_t joint = 0; joint < nodes.size(); ++joint) same &= nodes[joint] == joint;
    if (same) return;
    Change make;
    if (skeleton_.isComplete()) {
      make = [&skeleton = skeleton_](const Pose&) {
        const Pose globals = globalsOf(skeleton, skeleton.locals);
        Pose result(skeleton.nodeOfJoint.size());
        for (std::size_t joint = 0; joint < result.size() && joint < globals.size(); ++joint)
          result[joint] = globals[joint] * skeleton.bind.inverseBind[joint];
        return std::optional(std::move(result));
      };
    }
    const auto undo = [&skeleton = skeleton_](const Pose& pose) {
      std::vector<std::optional<Affine>> found(pose.size());
      for (std::size_t joint = 0; joint < pose.size(); ++joint) {
        const std::uint32_t node = skeleton.nodeOfJoint[joint];
        if (node >= pose.size()) continue;
        found[joint] = pose[node] * inverse(skeleton.bind.inverseBind[node]) *
                       skeleton.bind.inverseBind[joint];
      }
      return completed(std::move(found), skeleton);
    };
    add(PoseMistake::jointsInNodeOrder, message, make, undo);
  }

  void addRoot() {
    Affine root;
    for (const std::uint32_t node : commonPath(skeleton_)) {
      root = root * skeleton_.locals[node];
      const Affine back = inverse(root);
      add(PoseMistake::rootMissing,
          "the root transform is missing: use "
          "jointMatrices[j] = rootTransform * globalTransforms[j] * inverseBindMatrices[j], or "
          "begin the globals at the nodes above the skeleton",
          each([back](const Affine& a) { return back * a; }), {});
      add(PoseMistake::rootTwice,
          "the root transform is applied twice: use "
          "jointMatrices[j] = globalTransforms[j] * inverseBindMatrices[j], without "
          "rootTransform, which the globals contain",
          each([root](const Affine& a) { return root * a; }), {});
    }
  }

  void addUnits() {
    for (const double factor : {100.0, 0.01}) {
      const std::string message =
          factor > 1 ? "lengths of the skeleton are 100 times too large for the mesh: use "
                       "translation *= 0.01f for all local translations and inverse bind matrices"
                     : "lengths of the skeleton are 100 times too small for the mesh: use "
                       "translation *= 100.0f for all local translations and inverse bind matrices";
      const auto scaled = [](double by) {
        return each([by](const Affine& a) { return Affine{a.linear, a.translation * by}; });
      };
      addSkeleton(PoseMistake::units, message, scaled(factor), scaled(1 / factor));
      if (!skeleton_.isComplete()) continue;
      add(PoseMistake::units, message, each([factor](const Affine& a) {
            return Affine{a.linear * factor, a.translation * factor};
          }),
          {});
    }
  }

  void addAxes() {
    struct Axes {
      const char* message;
      dmat3 matrix;
    };
    // Columns are the images of x, y and z.
    const std::array<Axes, 7> all{{
        {"the skeleton is mirrored along x: use the same handedness for mesh and skeleton, or "
         "jointMatrices[j] = mirrorX * jointMatrices[j] * mirrorX",
         dmat3({-1, 0, 0}, {0, 1, 0}, {0, 0, 1})},
        {"the skeleton is mirrored along y: use the same handedness for mesh and skeleton, or "
         "jointMatrices[j] = mirrorY * jointMatrices[j] * mirrorY",
         dmat3({1, 0, 0}, {0, -1, 0}, {0, 0, 1})},
        {"the skeleton is mirrored along z: use the same handedness for mesh and skeleton, or "
         "jointMatrices[j] = mirrorZ * jointMatrices[j] * mirrorZ",
         dmat3({1, 0, 0}, {0, 1, 0}, {0, 0, -1})},
        {"the skeleton has z as its up axis, the mesh has y: use the same axes for both, or "
         "jointMatrices[j] = toYUp * jointMatrices[j] * inverse(toYUp)",
         dmat3({1, 0, 0}, {0, 0, 1}, {0, -1, 0})},
        {"the skeleton has y as its up axis, the mesh has z: use the same axes for both, or "
         "jointMatrices[j] = toZUp * jointMatrices[j] * inverse(toZUp)",
         dmat3({1, 0, 0}, {0, 0, -1}, {0, 1, 0})},
        {"the skeleton has another up axis and handedness than the mesh: use the same axes for "
         "both, or jointMatrices[j] = swapYZ * jointMatrices[j] * swapYZ",
         dmat3({1, 0, 0}, {0, 0, 1}, {0, 1, 0})},
        {"the skeleton is turned by 180 degrees against the mesh: use the same forward axis for "
         "both, or jointMatrices[j] = turnY * jointMatrices[j] * turnY",
         dmat3({-1, 0, 0}, {0, 1, 0}, {0, 0, -1})},
    }};
    for (const auto& [message, matrix] : all) {
      const Affine to{matrix, dvec3(0)}, back{glm::transpose(matrix), dvec3(0)};
      const auto between = [](const Affine& a, const Affine& b) {
        return each([a, b](const Affine& m) { return a * m * b; });
      };
      addSkeleton(PoseMistake::axes, message, between(to, back), between(back, to));
      if (skeleton_.isComplete()) {
        add(PoseMistake::axes, message, each([to](const Affine& m) { return to * m; }), {});
      }
    }
  }

  void addQuaternions() {
    const std::array<int, 4> wFirst{3, 0, 1, 2}, wLast{1, 2, 3, 0};
    add(
        PoseMistake::quaternionOrder,
        "quaternions are read in the wrong order: use rotation = {x, y, z, w} with w last in "
        "memory, as in glTF; they are read as if w were last but have it first",
        [=, &skeleton = skeleton_](const Pose& pose) { return withOrder(skeleton, pose, wFirst); },
        [=, &skeleton = skeleton_](const Pose& pose) { return withOrder(skeleton, pose, wLast); });
    add(
        PoseMistake::quaternionOrder,
        "quaternions are read in the wrong order: use rotation = {w, x, y, z} with w first in "
        "memory; they are read as if w were first but have it last, as in glTF",
        [=, &skeleton = skeleton_](const Pose& pose) { return withOrder(skeleton, pose, wLast); },
        [=, &skeleton = skeleton_](const Pose& pose) { return withOrder(skeleton, pose, wFirst); });
  }

  const PoseSkeleton& skeleton_;
  std::vector<Hypothesis> hypotheses_;
};

}  // namespace

std::vector<Hypothesis> hypothesesFor(const PoseSkeleton& skeleton) {
  return Builder(skeleton).build();
}

std::vector<std::pair<PoseMistake, std::string>> untested(const PoseInput& input,
                                                          const MeshView& mesh) {
  std::vector<std::pair<PoseMistake, std::string>> list;
  const auto needs = [&list](std::initializer_list<PoseMistake> mistakes, const std::string& what) {
    for (const PoseMistake mistake : mistakes)
      list.emplace_back(mistake, std::string(poseMistakeName(mistake)) + ": pass " + what);
  };
  if (input.inverseBindMatrices.empty()) {
    needs({PoseMistake::inverseBindMissing, PoseMistake::inverseBindTwice,
           PoseMistake::inverseBindWrongSide},
          "PoseInput::inverseBindMatrices");
  }
  const bool isSkeleton = !input.inverseBindMatrices.empty() && !input.parents.empty();
  const std::string skeleton = "PoseInput::parents and inverseBindMatrices";
  if (!isSkeleton || input.jointNodes.empty()) {
    needs({PoseMistake::jointsInNodeOrder},
          "PoseInput::jointNodes, parents and inverseBindMatrices");
  }
  if (!isSkeleton || input.jointNames.empty()) {
    needs({PoseMistake::jointsSortedByName},
          "PoseInput::jointNames, parents and inverseBindMatrices");
  }
  if (!isSkeleton) needs({PoseMistake::jointsOffByOne}, skeleton);
  if (input.inverseBindMatrices.empty() || input.localTransforms.empty()) {
    needs({PoseMistake::rootMissing, PoseMistake::rootTwice},
          "PoseInput::parents, localTransforms and inverseBindMatrices");
  }
  if (!isSkeleton) needs({PoseMistake::quaternionOrder}, skeleton);
  if (mesh.influenceSets.size() < 2)
    needs({PoseMistake::weightSet}, "all sets of influences in MeshView::influenceSets");
  return list;
}

}  // namespace dermis::diagnosis
