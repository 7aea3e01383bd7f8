// `diagnose` on all models of the test data: each well-known mistake, made on purpose in the poses
// of their clips, must be named; sound poses must have no finding. The mistakes are made here from
// the files, by code that the library does not share.
#include <dermis/gltf.h>
#include <dermis/verify.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

#include "gltf_builder.h"
#include "matrix_of.h"
#include "model_files.h"
#include "test_data.h"

namespace dermis::test {
namespace {

using glm::dmat3;
using glm::dmat4;
using glm::dvec3;
using glm::dvec4;

using Matrices = std::vector<dmat4>;

JointMatrix rounded(const dmat4& m) {
  JointMatrix result;
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column)
      result.m[row][column] = static_cast<float>(m[column][row]);
  return result;
}

std::vector<JointMatrix> rounded(const Matrices& matrices) {
  std::vector<JointMatrix> result;
  for (const dmat4& m : matrices) result.push_back(rounded(m));
  return result;
}

dmat4 withTranslation(dmat4 m, const dvec3& translation) {
  m[3] = dvec4(translation, 1);
  return m;
}

/// The unit quaternion x, y, z, w of a rotation: Shepperd 1978.
std::array<double, 4> quaternionOf(const dmat3& r) {
  const double trace = r[0][0] + r[1][1] + r[2][2];
  std::array<double, 4> squares{1 + 2 * r[0][0] - trace, 1 + 2 * r[1][1] - trace,
                                1 + 2 * r[2][2] - trace, 1 + trace};
  const auto largest = static_cast<int>(std::ranges::max_element(squares) - squares.begin());
  std::array<double, 4> q{};
  if (largest == 3) {
    q = {r[1][2] - r[2][1], r[2][0] - r[0][2], r[0][1] - r[1][0], squares[3]};
  } else {
    const int i = largest, j = (i + 1) % 3, k = (i + 2) % 3;
    q[static_cast<std::size_t>(i)] = squares[static_cast<std::size_t>(i)];
    q[static_cast<std::size_t>(j)] = r[i][j] + r[j][i];
    q[static_cast<std::size_t>(k)] = r[i][k] + r[k][i];
    q[3] = r[j][k] - r[k][j];
  }
  const double length = std::sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3]);
  for (double& part : q) part /= length;
  return q;
}

dmat3 rotationOf(const std::array<double, 4>& q) {
  const auto [x, y, z, w] = q;
  return {{1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)},
          {2 * (x * y - z * w), 1 - 2 * (x * x + z * z), 2 * (y * z + x * w)},
          {2 * (x * z + y * w), 2 * (y * z - x * w), 1 - 2 * (x * x + y * y)}};
}

/// The local transform that an engine gets which reads the quaternion in another order.
dmat4 withOrder(const dmat4& local, const std::array<std::size_t, 4>& order) {
  dvec3 scale(glm::length(dvec3(local[0])), glm::length(dvec3(local[1])),
              glm::length(dvec3(local[2])));
  dmat3 rotation(local);
  if (glm::determinant(rotation) < 0) scale.x = -scale.x;
  for (int axis = 0; axis < 3; ++axis)
    if (scale[axis] != 0) rotation[axis] /= scale[axis];
  const std::array<double, 4> q = quaternionOf(rotation);
  dmat3 changed = rotationOf({q[order[0]], q[order[1]], q[order[2]], q[order[3]]});
  for (int axis = 0; axis < 3; ++axis) changed[axis] *= scale[axis];
  return withTranslation(dmat4(changed), dvec3(local[3]));
}

/// A skinned primitive in one pose, and all that an engine may know of it.
struct PosedPart {
  const gltf::Model* model = nullptr;
  const gltf::Primitive* primitive = nullptr;
  MeshView mesh;
  std::vector<std::uint32_t> joints;
  std::vector<std::uint32_t> parents;
  std::vector<std::string_view> names;
  Matrices inverseBind;
  Matrices locals;   ///< by node
  Matrices globals;  ///< by node
  Matrices right;    ///< by joint
};

Matrices globalsOf(const PosedPart& part, const Matrices& locals) {
  Matrices globals = locals;
  for (const std::uint32_t node : part.model->nodeOrder)
    if (part.parents[node] != noIndex) globals[node] = globals[part.parents[node]] * locals[node];
  return globals;
}

Matrices poseOf(const PosedPart& part, const Matrices& globals, const Matrices& inverseBind) {
  Matrices pose;
  for (std::size_t j = 0; j < part.joints.size(); ++j)
    pose.push_back(globals[part.joints[j]] * inverseBind[j]);
  return pose;
}

void pose(PosedPart& part, std::uint32_t clip, double time) {
  const gltf::Model& model = *part.model;
  part.globals.clear();
  for (const Transform& global : gltf::nodeGlobals(model, clip, time))
    part.globals.push_back(matrixOf(global));
  part.locals = part.globals;
  for (std::size_t node = 0; node < part.locals.size(); ++node) {
    if (part.parents[node] == noIndex) continue;
    const dmat4& parent = part.globals[part.parents[node]];
    part.locals[node] =
        glm::determinant(dmat3(parent)) != 0 ? glm::inverse(parent) * part.globals[node] : dmat4(1);
  }
  part.right = poseOf(part, part.globals, part.inverseBind);
}

/// A wrong pose, as the engine that makes the mistake would pass it.
struct Wrong {
  PoseMistake mistake;
  std::string form;
  Matrices pose;
  Matrices inverseBind, locals;
  std::vector<InfluenceSet> sets;  ///< if not empty, those of the mesh
  std::vector<dvec3> skinned = {};
};

class Mistakes {
 public:
  explicit Mistakes(const PosedPart& part) : part_(part) {
    transposed();
    inverseBind();
    orders();
    root();
    units();
    axes();
    quaternions();
    weightSets();
  }

  std::vector<Wrong> all;

 private:
  Wrong& add(PoseMistake mistake, std::string form, Matrices pose) {
    all.push_back({mistake, std::move(form), std::move(pose), part_.inverseBind, part_.locals, {}});
    return all.back();
  }

  template <typename Change>
  Matrices each(const Matrices& matrices, Change change) const {
    Matrices result;
    for (const dmat4& m : matrices) result.push_back(change(m));
    return result;
  }

  Matrices jointGlobals() const {
    Matrices globals;
    for (const std::uint32_t node : part_.joints) globals.push_back(part_.globals[node]);
    return globals;
  }

  static Matrices product(const Matrices& a, const Matrices& b) {
    Matrices result;
    for (std::size_t i = 0; i < a.size(); ++i) result.push_back(a[i] * b[i]);
    return result;
  }

  void transposed() {
    add(PoseMistake::transposed, "4x4",
        each(part_.right, [](const dmat4& m) { return dmat4(glm::transpose(dmat3(m))); }));
    add(PoseMistake::columnMajor, "12 floats", each(part_.right, [](const dmat4& m) {
          std::array<double, 12> floats{};
          for (std::size_t i = 0; i < 12; ++i)
            floats[i] = m[static_cast<int>(i / 3)][static_cast<int>(i % 3)];
          dmat4 wrong(1);
          for (std::size_t i = 0; i < 12; ++i)
            wrong[static_cast<int>(i % 4)][static_cast<int>(i / 4)] = floats[i];
          return wrong;
        }));
  }

  void inverseBind() {
    add(PoseMistake::inverseBindMissing, "", jointGlobals());
    add(PoseMistake::inverseBindTwice, "", product(part_.right, part_.inverseBind));
    add(PoseMistake::inverseBindWrongSide, "", product(part_.inverseBind, jointGlobals()));
  }

  /// Joint j gets the matrix of joint from[j], or an identity.
  void order(PoseMistake mistake, const std::string& form, const std::vector<std::size_t>& from) {
    const auto ordered = [&from](const Matrices& matrices) {
      Matrices result;
      for (const std::size_t joint : from)
        result.push_back(joint < matrices.size() ? matrices[joint] : dmat4(1));
      return result;
    };
    add(mistake, form + ", joint matrices", ordered(part_.right));
    add(mistake, form + ", global transforms", product(ordered(jointGlobals()), part_.inverseBind));
  }

  void orders() {
    const std::size_t count = part_.joints.size();
    std::vector<std::size_t> from(count);
    for (std::size_t j = 0; j < count; ++j) from[j] = j;
    const std::vector<std::size_t> same = from;
    std::ranges::stable_sort(from, {}, [this](std::size_t j) { return part_.joints[j]; });
    if (from != same) order(PoseMistake::jointsInNodeOrder, "sorted by node", from);
    from = same;
    std::ranges::stable_sort(from, {}, [this](std::size_t j) { return part_.names[j]; });
    if (from != same) order(PoseMistake::jointsSortedByName, "", from);
    for (std::size_t j = 0; j < count; ++j) from[j] = std::min(j + 1, count - 1);
    order(PoseMistake::jointsOffByOne, "next", from);
    for (std::size_t j = 0; j < count; ++j) from[j] = j - 1;  // the first gets an identity
    order(PoseMistake::jointsOffByOne, "previous", from);
    Matrices nodes;
    for (std::size_t j = 0; j < count && j < part_.globals.size(); ++j)
      nodes.push_back(part_.globals[j]);
    add(PoseMistake::jointsInNodeOrder, "joint numbers as node numbers",
        product(nodes, part_.inverseBind));
  }

  /// The nodes from the root to this one.
  std::vector<std::uint32_t> path(std::uint32_t node) const {
    std::vector<std::uint32_t> nodes;
    for (; node != noIndex; node = part_.parents[node]) nodes.insert(nodes.begin(), node);
    return nodes;
  }

  void root() {
    std::vector<std::uint32_t> common = path(part_.joints[0]);
    for (const std::uint32_t joint : part_.joints) {
      const std::vector<std::uint32_t> other = path(joint);
      common.erase(std::ranges::mismatch(common, other).in1, common.end());
    }
    // From the scene's root to the joint above all others: an engine may mean any of them.
    for (std::size_t depth = 0; depth < common.size(); ++depth) {
      const dmat4 transform = part_.globals[common[depth]];
      if (glm::determinant(dmat3(transform)) == 0) return;
      const dmat4 back = glm::inverse(transform);
      const std::string form = "of " + std::to_string(depth + 1) + " nodes";
      add(PoseMistake::rootMissing, form,
          each(part_.right, [&](const dmat4& m) { return back * m; }));
      add(PoseMistake::rootTwice, form,
          each(part_.right, [&](const dmat4& m) { return transform * m; }));
    }
  }

  /// Local transforms that are changed by a loader: `diagnose` gets the wrong ones. By the code
  /// that samples: it gets the right ones.
  void local(PoseMistake mistake, const std::string& form, const Matrices& locals) {
    const Matrices wrong = poseOf(part_, globalsOf(part_, locals), part_.inverseBind);
    add(mistake, form + ", on sampling", wrong);
    add(mistake, form + ", on loading", wrong).locals = locals;
  }

  void units() {
    for (const double factor : {100.0, 0.01}) {
      const std::string name = factor > 1 ? "x100" : "x0.01";
      const auto scaled = [factor](const dmat4& m) {
        return withTranslation(m, dvec3(m[3]) * factor);
      };
      local(PoseMistake::units, name + " of local transforms", each(part_.locals, scaled));
      Wrong& skeleton =
          add(PoseMistake::units, name + " of the skeleton, on loading", each(part_.right, scaled));
      skeleton.locals = each(part_.locals, scaled);
      skeleton.inverseBind = each(part_.inverseBind, scaled);
      add(PoseMistake::units, name + " of the model", each(part_.right, [factor](const dmat4& m) {
            return dmat4(factor * m[0], factor * m[1], factor * m[2],
                         dvec4(dvec3(m[3]) * factor, 1));
          }));
    }
  }

  void axes() {
    const std::array<std::pair<const char*, dmat3>, 4> systems{{
        {"mirrored x", dmat3({-1, 0, 0}, {0, 1, 0}, {0, 0, 1})},
        {"mirrored z", dmat3({1, 0, 0}, {0, 1, 0}, {0, 0, -1})},
        {"y up to z up", dmat3({1, 0, 0}, {0, 0, 1}, {0, -1, 0})},
        {"z up to y up", dmat3({1, 0, 0}, {0, 0, -1}, {0, 1, 0})},
    }};
    for (const auto& [name, to] : systems) {
      const dmat4 c(to), back(glm::transpose(to));
      const auto between = [&](const dmat4& m) { return c * m * back; };
      const std::string form = name;
      local(PoseMistake::axes, form + " of local transforms", each(part_.locals, between));
      Wrong& skeleton =
          add(PoseMistake::axes, form + " of the skeleton, on loading", each(part_.right, between));
      skeleton.locals = each(part_.locals, between);
      skeleton.inverseBind = each(part_.inverseBind, between);
      add(PoseMistake::axes, form + " of the model",
          each(part_.right, [&](const dmat4& m) { return c * m; }));
    }
  }

  void quaternions() {
    const std::array<std::pair<const char*, std::array<std::size_t, 4>>, 2> orders{
        {{"w first, read as last", {3, 0, 1, 2}}, {"w last, read as first", {1, 2, 3, 0}}}};
    for (const auto& [form, order] : orders) {
      local(PoseMistake::quaternionOrder, form,
            each(part_.locals, [chosen = order](const dmat4& m) { return withOrder(m, chosen); }));
    }
  }

  void weightSets() {
    const std::span<const InfluenceSet> sets = part_.mesh.influenceSets;
    for (std::size_t other = 1; other < sets.size(); ++other) {
      std::vector<InfluenceSet> wrong(sets.begin(), sets.end());
      std::swap(wrong[0].weights, wrong[other].weights);
      add(PoseMistake::weightSet, "", part_.right).sets = wrong;
    }
  }

  const PosedPart& part_;
};

/// The vertices of a pose, at most about 1,000 of them.
std::vector<dvec3> skinned(const PosedPart& part, const Matrices& pose,
                           const std::vector<InfluenceSet>& sets) {
  // The reference skins all vertices; a view of each n-th one is enough here.
  const std::uint32_t step = std::max(1u, part.mesh.vertexCount / 1000);
  MeshView mesh = part.mesh;
  const auto thin = [step](AttributeView& view) {
    view.stride *= step;
    view.count = (view.count + step - 1) / step;
  };
  std::vector<InfluenceSet> thinSets(mesh.influenceSets.begin(), mesh.influenceSets.end());
  if (!sets.empty()) thinSets = sets;
  for (InfluenceSet& set : thinSets) {
    thin(set.joints);
    thin(set.weights);
  }
  thin(mesh.positions);
  mesh.vertexCount = mesh.positions.count;
  mesh.normals = mesh.tangents = {};
  mesh.morphTargets = {};
  mesh.influenceSets = thinSets;
  const auto result = reference::skin(mesh, rounded(pose), Method::linear);
  std::vector<dvec3> positions;
  if (!result) return positions;
  for (const reference::Double3& p : result->positions) positions.emplace_back(p[0], p[1], p[2]);
  return positions;
}

double largestDistance(const std::vector<dvec3>& a, const std::vector<dvec3>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i) largest = std::max(largest, glm::distance(a[i], b[i]));
  return largest;
}

double sizeOf(const std::vector<dvec3>& points) {
  dvec3 low = points.at(0), high = low;
  for (const dvec3& p : points) {
    low = glm::min(low, p);
    high = glm::max(high, p);
  }
  return glm::distance(low, high);
}

enum class Known { all, skeleton, matrices };

Diagnosis diagnosed(const PosedPart& part, const Wrong& wrong, Known known) {
  MeshView mesh = part.mesh;
  if (!wrong.sets.empty()) mesh.influenceSets = wrong.sets;
  const std::vector<JointMatrix> pose = rounded(wrong.pose), locals = rounded(wrong.locals),
                                 inverseBind = rounded(wrong.inverseBind);
  PoseInput input;
  input.jointMatrices = pose;
  input.triangles = part.primitive->triangles.values();
  if (known != Known::matrices) {
    input.inverseBindMatrices = inverseBind;
    input.jointNames = part.names;
    input.jointNodes = part.joints;
    input.parents = part.parents;
    if (known == Known::all) input.localTransforms = locals;
  }
  const Result<Diagnosis> result = diagnose(mesh, input);
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result ? *result : Diagnosis();
}

struct Count {
  int cases = 0, small = 0, untested = 0, right = 0, silent = 0;
  std::map<std::string, int> others;
};

using Table = std::map<std::pair<PoseMistake, std::string>, Count>;

void print(const Table& table) {
  std::printf("%-40s %-50s %6s %6s %8s %6s %7s  others\n", "mistake", "form", "cases", "small",
              "untested", "right", "%");
  for (const auto& [key, count] : table) {
    std::string others;
    for (const auto& [name, times] : count.others)
      others += (others.empty() ? "" : ", ") + name + " " + std::to_string(times);
    std::printf("%-40s %-50s %6d %6d %8d %6d %6.1f%%  %s\n", poseMistakeName(key.first),
                key.second.c_str(), count.cases, count.small, count.untested, count.right,
                count.cases == 0 ? 0.0 : 100.0 * count.right / count.cases, others.c_str());
  }
}

Table byMistake(const Table& table) {
  Table summed;
  Count& all = summed[{PoseMistake::none, "all"}];
  for (const auto& [key, count] : table) {
    for (Count* sum : {&summed[{key.first, ""}], &all}) {
      sum->cases += count.cases;
      sum->small += count.small;
      sum->untested += count.untested;
      sum->right += count.right;
      for (const auto& [name, times] : count.others) sum->others[name] += times;
    }
  }
  return summed;
}

/// The pose of one moment with each mistake.
void countMistakes(const PosedPart& part, Known known, Table& table) {
  std::vector<Wrong> wrongs = Mistakes(part).all;
  const std::vector<dvec3> right = skinned(part, part.right, {});
  const double size = sizeOf(right);
  for (Wrong& wrong : wrongs) wrong.skinned = skinned(part, wrong.pose, wrong.sets);
  for (const Wrong& wrong : wrongs) {
    Count& count = table[{wrong.mistake, wrong.form}];
    if (wrong.skinned.empty() || !(largestDistance(right, wrong.skinned) >= 0.02 * size)) {
      ++count.small;
      continue;
    }
    const Diagnosis diagnosis = diagnosed(part, wrong, known);
    if ((known != Known::all && wrong.form.ends_with("of the model")) ||
        std::ranges::any_of(diagnosis.notTested,
                            [&](const auto& entry) { return entry.first == wrong.mistake; })) {
      ++count.untested;
      continue;
    }
    ++count.cases;
    const bool named = std::ranges::any_of(wrongs, [&](const Wrong& other) {
      return other.mistake == diagnosis.mistake &&
             (other.mistake == wrong.mistake ||
              largestDistance(wrong.skinned, other.skinned) <= 1e-4 * sizeOf(wrong.skinned));
    });
    if (named) {
      ++count.right;
    } else {
      ++count.others[poseMistakeName(diagnosis.mistake)];
    }
  }
}

/// Which of the poses are used.
struct Choice {
  std::size_t everyModel = 1;
  std::size_t maxParts = 1000;  ///< of a model
  std::vector<double> times;    ///< in durations of the clip
};

PosedPart partOf(const gltf::Model& model, const gltf::SkinnedPrimitive& source,
                 const MeshView& mesh) {
  PosedPart part;
  part.model = &model;
  part.primitive = &model.meshes[source.mesh].primitives[source.primitive];
  part.mesh = mesh;
  const gltf::Skin& skin = model.skins[source.skin];
  part.joints = skin.joints;
  for (const gltf::Node& node : model.nodes) part.parents.push_back(node.parent);
  for (const std::uint32_t joint : skin.joints) part.names.push_back(model.nodes[joint].name);
  for (const JointMatrix& matrix : skin.inverseBindMatrices)
    part.inverseBind.push_back(matrixOf(matrix.m));
  return part;
}

/// Calls with the skinned parts of the models, in poses of all clips, or in the rest pose of a
/// model without clips. Returns the number of models.
int forEachPose(const std::filesystem::path& data, const Choice& choice,
                const std::function<void(const PosedPart&, const std::string&)>& call) {
  const std::vector<std::filesystem::path> files = modelFiles(data);
  int models = 0;
  for (std::size_t file = 0; file < files.size(); file += choice.everyModel) {
    const Result<gltf::Model> model = gltf::load(files[file]);
    if (!model) continue;
    std::size_t parts = 0;
    for (const gltf::SkinnedPrimitive& source : model->skinnedPrimitives) {
      const gltf::Primitive& primitive = model->meshes[source.mesh].primitives[source.primitive];
      const gltf::PrimitiveView view(primitive);
      PosedPart part = partOf(*model, source, view.mesh());
      if (!validate(part.mesh, static_cast<std::uint32_t>(part.joints.size())).packable()) continue;
      if (++parts > choice.maxParts) break;
      const auto clips = static_cast<std::uint32_t>(model->clips.size());
      for (std::uint32_t clip = 0; clip < std::max(clips, 1u); ++clip) {
        for (const double time : choice.times) {
          pose(part, clips == 0 ? noIndex : clip,
               clips == 0 ? 0 : time * model->clips[clip].duration);
          call(part, files[file].filename().string() + ", " + primitive.name + ", clip " +
                         std::to_string(clip) + " at " + std::to_string(time));
          if (clips == 0) break;
        }
      }
    }
    if (parts != 0) ++models;
  }
  return models;
}

#ifdef DERMIS_EXHAUSTIVE
const Choice soundChoice{.times = {0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.7, 0.8, 0.9, 1}};
const Choice wrongChoice{.maxParts = 4, .times = {0.3, 0.7}};
#elif defined(DERMIS_FEW_CASES)  // few_cases.h
const Choice soundChoice{.maxParts = 4, .times = {0, 0.45}};
const Choice wrongChoice{.everyModel = 6, .maxParts = 1, .times = {0.3}};
#else
const Choice soundChoice{.maxParts = 20, .times = {0, 0.2, 0.45, 0.7, 1}};
const Choice wrongChoice{.everyModel = 3, .maxParts = 1, .times = {0.3}};
#endif

TEST(DiagnoseModelsTest, SoundPosesHaveNoFinding) {
  const auto data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  int poses = 0;
  const int models =
      forEachPose(*data, soundChoice, [&](const PosedPart& part, const std::string& name) {
        ++poses;
        const Wrong sound{.mistake = PoseMistake::none,
                          .form = "",
                          .pose = part.right,
                          .inverseBind = part.inverseBind,
                          .locals = part.locals,
                          .sets = {}};
        for (const Known known : {Known::all, Known::skeleton, Known::matrices}) {
          const Diagnosis diagnosis = diagnosed(part, sound, known);
          EXPECT_TRUE(diagnosis.plausible()) << name << ": " << diagnosis.message;
        }
      });
  std::printf("%d sound poses of %d models\n", poses, models);
  EXPECT_GE(models, 15);
}

/// The share of the cases that are named right, by what the engine knows.
double namedRight(const char* title, Known known) {
  const auto data = testDataFolder();
  if (!data) return 1;
  Table table;
  const int models = forEachPose(
      *data, wrongChoice,
      [&](const PosedPart& part, const std::string&) { countMistakes(part, known, table); });
  EXPECT_GE(models, 15 / static_cast<int>(wrongChoice.everyModel));
  std::printf("\n%s: %d models\n", title, models);
  print(table);
  const Table summed = byMistake(table);
  print(summed);
  const Count& all = summed.at({PoseMistake::none, "all"});
  EXPECT_GT(all.cases, 0);
  return static_cast<double>(all.right) / std::max(all.cases, 1);
}

TEST(DiagnoseModelsTest, MistakesAreNamed) {
  if (!testDataFolder()) GTEST_SKIP() << noTestData;
  EXPECT_GE(namedRight("Everything is known", Known::all), 0.9);
}

// Of the mistakes that can be tested then.
TEST(DiagnoseModelsTest, MostAreNamedWithoutLocalTransforms) {
  if (!testDataFolder()) GTEST_SKIP() << noTestData;
  EXPECT_GE(namedRight("No local transforms", Known::skeleton), 0.8);
}

#ifdef DERMIS_EXHAUSTIVE
// Few are: there is no bar. The table shows it.
TEST(DiagnoseModelsTest, FewAreNamedWithoutASkeleton) {
  if (!testDataFolder()) GTEST_SKIP() << noTestData;
  namedRight("Only joint matrices and triangles", Known::matrices);
}
#endif

}  // namespace
}  // namespace dermis::test
