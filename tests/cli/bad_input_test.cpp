// Bad input, row by row of DESIGN.md's table: what happens, through the command where it reaches
// that far. Tests of the parts go into detail; here stands each sentence as a whole.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "dermis/compilers.h"
#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "dermis_command.h"
#include "glb.h"
#include "gltf_builder.h"
#include "intercepted_device.h"
#include "kit/batch_runner.h"
#include "mock_vulkan.h"
#include "ply.h"
#include "random_rig.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

constexpr float nan = std::numeric_limits<float>::quiet_NaN();
constexpr float infinity = std::numeric_limits<float>::infinity();
using Point = std::array<float, 3>;

/// Rows that need the device ask for it; the others run without.
class BadInput : public DeviceTest {
 protected:
  void SetUp() override {}
};

/// The importer's triangle as mesh 'Fox', its second joint 3 to the right and 4 up.
FileBuilder fox() {
  FileBuilder file = skinnedTriangle();
  file.json["meshes"][0]["name"] = "Fox";
  file.json["nodes"][2]["translation"] = {3, 4, 0};
  return file;
}

/// The pose that the command writes; empty where it does not.
Ply skinned(const std::string& model, const std::vector<std::string>& more = {}) {
  const std::string out = outFile("pose.ply");
  std::filesystem::remove(out);
  std::vector<std::string> arguments{"skin", model, "-o", out};
  arguments.insert(arguments.end(), more.begin(), more.end());
  const CommandResult result = dermis(arguments);
  EXPECT_EQ(result.status, 0) << result.errors;
  return readPly(out).value_or(Ply{});
}

Ply skinnedByReference(const FileBuilder& file, const std::string& method = "dual_quaternion") {
  return skinned(file.writtenTo(outFile("model.gltf")),
                 {"--device", "reference", "--method", method});
}

/// Two files that must be skinned alike.
void expectSamePose(const FileBuilder& file, const FileBuilder& expected) {
  for (const Method method : allMethods) {
    const std::string name(methodName(method));
    const Ply a = skinnedByReference(file, name), b = skinnedByReference(expected, name);
    ASSERT_EQ(a.positions.size(), 3u);
    ASSERT_EQ(b.positions.size(), 3u);
    for (std::size_t vertex = 0; vertex < 3; ++vertex) {
      for (std::size_t axis = 0; axis < 3; ++axis)
        EXPECT_NEAR(a.positions[vertex][axis], b.positions[vertex][axis], 1e-6f) << name;
    }
  }
}

/// Expects that `info` counts the problem and that `skin` says so and goes on, unless strict.
void expectCounted(const FileBuilder& file, MeshProblem problem, int count, int firstVertex) {
  const std::string model = file.writtenTo(outFile("counted.gltf"));
  const Json info = Json::parse(dermis({"info", model, "--json"}).output);
  const Json& problems = info.at("meshes").at(0).at("problems");
  const auto found = std::find_if(problems.begin(), problems.end(), [&](const Json& entry) {
    return entry.at("kind") == meshProblemName(problem);
  });
  ASSERT_NE(found, problems.end()) << problems;
  EXPECT_EQ(found->at("vertices"), count);
  EXPECT_EQ(found->at("firstVertex"), firstVertex);
  const std::string out = outFile("counted.ply");
  const CommandResult result = dermis({"skin", model, "-o", out, "--device", "cpu"});
  EXPECT_EQ(result.status, 0) << result.errors;
  const auto message = found->at("message").get<std::string>();
  EXPECT_NE(result.errors.find("dermis: note: " + message), std::string::npos) << result.errors;
  const CommandResult strict = dermis({"skin", model, "-o", out, "--device", "cpu", "--strict"});
  EXPECT_EQ(strict.status, 3);
  expectOneErrorLine(strict);
  EXPECT_NE(strict.errors.find(message), std::string::npos) << strict.errors;
}

/// What `--device` may be here: the reference, the CPU and, where there is one, the device.
std::vector<std::string> devicesToTry() {
  std::string reason;
  if (testDevice(true, reason) != nullptr) return {"reference", "cpu", "auto"};
  EXPECT_FALSE(isContinuousIntegration()) << reason;
  return {"reference", "cpu"};
}

/// Every method on every device that has it, with what `check` expects of the file that is written.
void skinEverywhere(const FileBuilder& file, const std::string& ending,
                    const std::function<void(const std::string& out)>& check,
                    const std::vector<std::string>& devices = devicesToTry()) {
  const std::string model = file.writtenTo(outFile("model.gltf")), out = outFile("pose" + ending);
  for (const std::string& device : devices) {
    for (const Method method : allMethods) {
      if (device == "cpu" && isForComparison(method)) continue;
      const std::string name(methodName(method));
      SCOPED_TRACE(device + ", " + name);
      const CommandResult result =
          dermis({"skin", model, "-o", out, "--device", device, "--method", name});
      EXPECT_EQ(result.status, 0) << result.errors;
      EXPECT_EQ(result.errors.find("not finite"), std::string::npos) << result.errors;
      check(out);
    }
  }
}

// ---- joint index outside the pose, NaN or infinite position/weight, negative weight, counts
// ---- that disagree, empty mesh, strides too small

/// Ten vertices on a line; vertex v hangs on joint v % 3 by 0.75 and on the next by 0.25.
struct LineMesh {
  static constexpr std::uint32_t vertexCount = 10, jointCount = 3;
  std::vector<float> positions, weights;
  std::vector<std::uint32_t> joints;
  InfluenceSet set;
  MeshView view;

  LineMesh() {
    for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
      positions.insert(positions.end(), {static_cast<float>(vertex), 1, 2});
      weights.insert(weights.end(), {0.75f, 0.25f});
      joints.insert(joints.end(), {vertex % jointCount, (vertex + 1) % jointCount});
    }
    set = {{joints.data(), vertexCount, 8, ComponentType::uint32, 2},
           attributeView(weights.data(), vertexCount, 2)};
    view.name = "Fox";
    view.vertexCount = vertexCount;
    view.positions = attributeView(positions.data(), vertexCount, 3);
    view.influenceSets = {&set, 1};
  }
  LineMesh(const LineMesh&) = delete;
  LineMesh& operator=(const LineMesh&) = delete;
};

struct BrokenMesh {
  MeshProblem problem;
  std::uint64_t count;
  std::uint32_t firstVertex;
  std::function<void(LineMesh&)> breakIt;
  /// What `repair` leaves of the first vertex: its position, all weight on its first joint.
  std::optional<Point> repaired;
};

const std::vector<BrokenMesh>& brokenMeshes() {
  constexpr Point inPlace{7, 1, 2}, origin{0, 0, 0};
  static const std::vector<BrokenMesh> meshes{
      {MeshProblem::jointOutOfRange, 1, 7, [](LineMesh& m) { m.joints[15] = 3; }, inPlace},
      {MeshProblem::nonFinitePosition, 2, 7,
       [](LineMesh& m) { m.positions[22] = m.positions[27] = nan; }, origin},
      {MeshProblem::nonFinitePosition, 1, 7, [](LineMesh& m) { m.positions[21] = -infinity; },
       origin},
      {MeshProblem::nonFiniteWeight, 1, 7, [](LineMesh& m) { m.weights[15] = nan; }, inPlace},
      {MeshProblem::nonFiniteWeight, 2, 7,
       [](LineMesh& m) { m.weights[15] = m.weights[17] = infinity; }, inPlace},
      {MeshProblem::negativeWeight, 1, 7, [](LineMesh& m) { m.weights[15] = -0.25f; }, inPlace},
      {MeshProblem::countMismatch, 1, 0, [](LineMesh& m) { m.view.positions.count = 9; }, {}},
      {MeshProblem::emptyMesh, 1, 0, [](LineMesh& m) { m.view.vertexCount = 0; }, {}},
      {MeshProblem::strideTooSmall,
       2,
       0,
       [](LineMesh& m) { m.view.positions.stride = m.set.weights.stride = 7; },
       {}},
  };
  return meshes;
}

void expectRepaired(const LineMesh& mesh, const BrokenMesh& broken, const std::string& sentence) {
  const Result<RepairedMesh> repaired = repair(mesh.view, LineMesh::jointCount);
  if (!broken.repaired) {
    ASSERT_FALSE(repaired.ok());
    EXPECT_EQ(repaired.error().code, ErrorCode::invalidMesh);
    return;
  }
  ASSERT_TRUE(repaired.ok()) << repaired.error().message;
  const MeshReport::Finding* changed = repaired->report().find(broken.problem);
  ASSERT_NE(changed, nullptr);
  EXPECT_EQ(changed->message, sentence) << "it says what it changed";
  EXPECT_TRUE(validate(repaired->view(), LineMesh::jointCount).packable());
  ASSERT_TRUE(pack(repaired->view(), LineMesh::jointCount).ok());

  // Each joint lifts by its number: what is left of the weights is normalized.
  std::vector<JointMatrix> pose(LineMesh::jointCount);
  for (std::size_t joint = 0; joint < pose.size(); ++joint)
    pose[joint].m[2][3] = 4 * static_cast<float>(joint);
  const auto skinned = reference::skin(repaired->view(), pose, Method::linear);
  ASSERT_TRUE(skinned.ok()) << skinned.error().message;
  const bool lostWeight = broken.problem != MeshProblem::nonFinitePosition;
  const std::uint32_t vertex = broken.firstVertex, joint = vertex % LineMesh::jointCount;
  EXPECT_EQ(skinned->positions[vertex],
            (reference::Double3{(*broken.repaired)[0], (*broken.repaired)[1],
                                (*broken.repaired)[2] + 4.0 * joint + (lostWeight ? 0.0 : 1.0)}));
}

/// The file is skinned with a warning, which may say more, and refused where strict.
void expectWarning(const FileBuilder& file, const std::string& sentence,
                   const std::string& more = {}) {
  const std::string model = file.writtenTo(outFile("broken.gltf")), out = outFile("broken.ply");
  const CommandResult lenient = dermis({"skin", model, "-o", out, "--device", "cpu"});
  EXPECT_EQ(lenient.status, 0);
  EXPECT_NE(lenient.errors.find("dermis: warning: " + sentence + more + "; repaired\n"),
            std::string::npos)
      << lenient.errors;
  EXPECT_TRUE(readPly(out).has_value());
  std::filesystem::remove(out);
  const CommandResult strict = dermis({"skin", model, "-o", out, "--device", "cpu", "--strict"});
  EXPECT_EQ(strict.status, 3);
  expectOneErrorLine(strict);
  EXPECT_NE(strict.errors.find(sentence), std::string::npos) << strict.errors;
  EXPECT_FALSE(std::filesystem::exists(out));
}

// A rule of glTF is broken, and what is meant is clear all the same.
TEST_F(BadInput, ABrokenRuleIsNotedAndRefusedWhereStrict) {
  FileBuilder file = skinnedTriangle();
  const std::string whole = file.writtenTo(outFile("whole.gltf"));
  file.json["skins"][0]["inverseBindMatrices"] =
      file.addFloats({1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1,
                      1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1},
                     "MAT4");
  file.json["bufferViews"].back()["byteStride"] = 64;
  const std::string broken = file.writtenTo(outFile("rule.gltf"));
  const std::string sentence =
      "skin 0 inverseBindMatrices: bufferView 3 of accessor 3 has a byteStride of 64, which only "
      "vertex attributes may have";
  EXPECT_NE(dermis({"info", broken}).output.find("note   " + sentence + "\n"), std::string::npos);
  const Json info = Json::parse(dermis({"info", broken, "--json"}).output);
  EXPECT_EQ(info.at("notes"), Json::array({sentence}));

  const std::string out = outFile("rule.ply"), expected = outFile("whole.ply");
  const CommandResult lenient = dermis({"skin", broken, "-o", out, "--device", "cpu"});
  EXPECT_EQ(lenient.status, 0) << lenient.errors;
  EXPECT_EQ(lenient.errors, "dermis: note: " + sentence + "\n");
  EXPECT_EQ(dermis({"skin", whole, "-o", expected, "--device", "cpu"}).status, 0);
  ASSERT_TRUE(readPly(out) && readPly(expected));
  EXPECT_EQ(readPly(out)->positions, readPly(expected)->positions);
  for (const std::vector<std::string>& command : {std::vector<std::string>{"info", broken},
                                                  {"skin", broken, "-o", out, "--device", "cpu"},
                                                  {"render", broken, "-o", outFile("rule.png")},
                                                  {"verify", broken},
                                                  {"compare", broken}}) {
    std::vector<std::string> arguments = command;
    arguments.push_back("--strict");
    const CommandResult strict = dermis(arguments);
    EXPECT_EQ(strict.status, 3) << command[0] << ": " << strict.errors;
    expectOneErrorLine(strict);
    EXPECT_NE(strict.errors.find(sentence), std::string::npos) << strict.errors;
  }
  EXPECT_EQ(dermis({"info", whole, "--strict"}).status, 0);
}

TEST_F(BadInput, BadJointsPositionsWeightsCountsAndStridesAreReportedRefusedAndRepaired) {
  for (const BrokenMesh& broken : brokenMeshes()) {
    LineMesh mesh;
    broken.breakIt(mesh);
    const MeshReport report = validate(mesh.view, LineMesh::jointCount);
    ASSERT_EQ(report.findings.size(), 1u) << meshProblemName(broken.problem);
    const MeshReport::Finding& finding = report.findings[0];
    SCOPED_TRACE(finding.message);
    EXPECT_EQ(finding.problem, broken.problem);
    EXPECT_EQ(finding.count, broken.count);
    EXPECT_EQ(finding.firstVertex, broken.firstVertex);
    const Result<PackedMesh> packed = pack(mesh.view, LineMesh::jointCount);
    ASSERT_FALSE(packed.ok());
    EXPECT_EQ(packed.error().code, ErrorCode::invalidMesh);
    EXPECT_EQ(packed.error().message,
              finding.message + (broken.repaired ? "; repair() can fix it" : ""));
    expectRepaired(mesh, broken, finding.message);
  }

  FileBuilder joint = fox();
  joint.attributes()["JOINTS_0"] =
      joint.add<std::uint8_t>({0, 9, 0, 0, 1, 9, 0, 0, 0, 1, 0, 0}, "VEC4", unsignedByteType);
  joint.attributes()["WEIGHTS_0"] =
      joint.addFloats({1, 0, 0, 0, 0.5f, 0.5f, 0, 0, 0.25f, 0.75f, 0, 0}, "VEC4");
  expectWarning(joint, "mesh 'Fox', vertex 1: joint 9 is outside the pose of 2 joints");
  FileBuilder position = fox();
  position.attributes()["POSITION"] =
      position.addFloats({0, 0, 0, 1, 0, 0, nan, 2, infinity}, "VEC3");
  expectWarning(position, "mesh 'Fox', vertex 2: the position is not finite");
  FileBuilder weight = fox();
  weight.attributes()["WEIGHTS_0"] =
      weight.addFloats({1, 0, 0, 0, 1, nan, 0, 0, 0.25f, infinity, 0, 0}, "VEC4");
  expectWarning(weight, "mesh 'Fox', vertex 1: the weight of joint 0 is not finite",
                " (and 1 more such vertices)");
  FileBuilder negative = fox();
  negative.attributes()["WEIGHTS_0"] =
      negative.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 1, -0.5f, 0, 0}, "VEC4");
  expectWarning(negative, "mesh 'Fox', vertex 2: the weight of joint 1 is negative");

  // Views that make no sense do not get past the importer.
  FileBuilder counts = fox();
  counts.attributes()["WEIGHTS_0"] = counts.addFloats({1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  const CommandResult refused = dermis({"skin", counts.writtenTo(outFile("counts.gltf")), "-o",
                                        outFile("counts.ply"), "--device", "cpu"});
  EXPECT_EQ(refused.status, 3);
  expectOneErrorLine(refused);
}

// ---- weights that do not sum to 1

TEST_F(BadInput, WeightsThatDoNotSumToOneAreNormalizedOverAllSetsAndCounted) {
  FileBuilder file = fox(), expected = fox();
  const std::vector<std::uint8_t> swapped{1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0};
  file.attributes()["JOINTS_1"] = file.add(swapped, "VEC4", unsignedByteType);
  // Set 0 has 1 for joints 0, 1 and both; set 1 adds 3 for joint 1.
  file.attributes()["WEIGHTS_1"] = file.addFloats({3, 0, 0, 0, 0, 0, 0, 0, 3, 0, 0, 0}, "VEC4");
  expected.attributes()["JOINTS_0"] =
      expected.add<std::uint8_t>({0, 1, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0}, "VEC4", unsignedByteType);
  expected.attributes()["WEIGHTS_0"] =
      expected.addFloats({0.25f, 0.75f, 0, 0, 1, 0, 0, 0, 0.0625f, 0.9375f, 0, 0}, "VEC4");
  expectSamePose(file, expected);
  expectCounted(file, MeshProblem::weightsNotNormalized, 2, 0);
}

// ---- the same joint twice in one vertex

TEST_F(BadInput, TheSameJointTwiceInOneVertexHasItsWeightsAddedAndIsCounted) {
  FileBuilder file = fox(), expected = fox();
  file.attributes()["JOINTS_0"] =
      file.add<std::uint8_t>({0, 1, 0, 0, 1, 0, 1, 1, 0, 0, 0, 0}, "VEC4", unsignedByteType);
  file.attributes()["WEIGHTS_0"] =
      file.addFloats({1, 0, 0, 0, 0.25f, 0.25f, 0.25f, 0.25f, 1, 0, 0, 0}, "VEC4");
  expected.attributes()["JOINTS_0"] =
      expected.add<std::uint8_t>({0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0}, "VEC4", unsignedByteType);
  expected.attributes()["WEIGHTS_0"] =
      expected.addFloats({1, 0, 0, 0, 0.75f, 0.25f, 0, 0, 1, 0, 0, 0}, "VEC4");
  expectSamePose(file, expected);
  expectCounted(file, MeshProblem::duplicateJoint, 1, 1);
}

// ---- rotation keys that are not of unit length

FileBuilder rotating(const std::vector<float>& times, const std::vector<float>& values,
                     const char* interpolation) {
  FileBuilder file = fox();
  const std::size_t input = file.addFloats(times, "SCALAR");
  const std::size_t output = file.addFloats(values, "VEC4");
  file.json["animations"] = {
      {{"samplers", {{{"input", input}, {"output", output}, {"interpolation", interpolation}}}},
       {"channels", {{{"sampler", 0}, {"target", {{"node", 1}, {"path", "rotation"}}}}}}}};
  return file;
}

TEST_F(BadInput, RotationKeysThatAreNotOfUnitLengthAreNormalizedAndCounted) {
  const FileBuilder file = rotating({0, 1}, {0, 0, 0, 7, 0, 0, 3, 3}, "LINEAR");
  const float half = std::sqrt(0.5f);
  const FileBuilder unit = rotating({0, 1}, {0, 0, 0, 1, 0, 0, half, half}, "LINEAR");
  const CommandResult info = dermis({"info", file.writtenTo(outFile("keys.gltf"))});
  EXPECT_NE(info.output.find("output: the rotation of key 0 has a length of 7, not 1 (and 1 more"),
            std::string::npos)
      << info.output;
  for (const char* time : {"0", "0.3", "1"}) {
    const std::vector<std::string> at{"--device", "cpu", "--time", time};
    const Ply a = skinned(file.writtenTo(outFile("keys.gltf")), at),
              b = skinned(unit.writtenTo(outFile("unit.gltf")), at);
    ASSERT_EQ(a.positions.size(), 3u);
    for (std::size_t i = 0; i < 9; ++i)
      EXPECT_NEAR(a.positions[i / 3][i % 3], b.positions.at(i / 3)[i % 3], 1e-6f) << time;
  }
  // Splines leave the unit sphere between their keys.
  const gltf::Model spline = loaded(rotating({0, 1}, {0, 0, 0, 0, 0, 0, 0,    1,    5, 0, 0, 5,  //
                                                      0, 9, 0, 0, 0, 0, half, half, 0, 0, 0, 0},
                                             "CUBICSPLINE"));
  const Transform turned = gltf::nodeGlobals(spline, 0, 0.5).at(1);
  for (std::size_t a = 0; a < 3; ++a) {
    for (std::size_t b = 0; b < 3; ++b) {
      const double dot =
          turned[0][a] * turned[0][b] + turned[1][a] * turned[1][b] + turned[2][a] * turned[2][b];
      EXPECT_NEAR(dot, a == b ? 1 : 0, 1e-12);
    }
  }
}

// ---- a vertex with no weight left

TEST_F(BadInput, AVertexWithNoWeightLeftStaysInBindPoseAndIsCounted) {
  FileBuilder file = fox();
  file.json["nodes"][1]["translation"] = {0, 0, 5};
  file.attributes()["WEIGHTS_0"] = file.addFloats({1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4");
  expectCounted(file, MeshProblem::vertexWithoutWeight, 2, 1);
  skinEverywhere(file, ".ply", [](const std::string& out) {
    const std::vector<Point> expected{{0, 0, 5}, {1, 0, 0}, {0, 2, 0}};
    EXPECT_EQ(readPly(out).value_or(Ply{}).positions, expected);
  });
  // Nor has one whose only weight was dropped.
  file.attributes()["WEIGHTS_0"] = file.addFloats({1, 0, 0, 0, -1, 0, 0, 0, 1, 0, 0, 0}, "VEC4");
  expectWarning(file, "mesh 'Fox', vertex 1: the weight of joint 1 is negative");
  EXPECT_EQ(skinnedByReference(file).positions.at(1), (Point{1, 0, 0}));
}

// ---- a singular joint matrix (scale 0)

// On devices one of them: BatchTest.SingularJointsGiveFiniteVertices skins with all of them.
TEST_F(BadInput, ASingularJointMatrixGivesFiniteVertices) {
  std::vector<std::string> devices = devicesToTry();
  for (const Json& scale : {Json{0, 0, 0}, Json{0, 1, 1}, Json{0, 0, 1}, Json{1e-30, 1, 1e-30}}) {
    FileBuilder file = fox();
    file.attributes()["NORMAL"] = file.addFloats({1, 0, 0, 0, 1, 0, 0, 0, 1}, "VEC3");
    file.json["nodes"][2]["scale"] = scale;
    SCOPED_TRACE(scale.dump());
    const auto isFinite = [](const std::string& out) {
      const std::optional<Ply> ply = readPly(out);
      ASSERT_TRUE(ply.has_value());
      ASSERT_EQ(ply->positions.size(), 3u);
      for (std::size_t i = 0; i < 9; ++i) {
        EXPECT_TRUE(std::isfinite(ply->positions[i / 3][i % 3])) << i;
        EXPECT_TRUE(std::isfinite(ply->normals[i / 3][i % 3])) << i;
      }
    };
    skinEverywhere(file, ".ply", isFinite, devices);
    devices = {"cpu"};
  }
}

// ---- mirrored joints (negative determinant)

TEST_F(BadInput, MirroredJointsKeepTheSenseOfNormalsAndTangents) {
  FileBuilder file = fox();
  file.attributes()["NORMAL"] = file.addFloats({1, 0, 0, 0, 0, 1, 0.6f, 0.8f, 0}, "VEC3");
  file.attributes()["TANGENT"] =
      file.addFloats({0, 1, 0, 1, 1, 0, 0, -1, -0.8f, 0.6f, 0, 1}, "VEC4");
  file.json["nodes"][1]["scale"] = {-1, 1, 1};
  const std::vector<Point> normals{{-1, 0, 0}, {0, 0, 1}, {-0.6f, 0.8f, 0}};
  const std::vector<std::array<float, 4>> tangents{
      {0, 1, 0, -1}, {-1, 0, 0, 1}, {0.8f, 0.6f, 0, -1}};
  skinEverywhere(file, ".glb", [&](const std::string& out) {
    const Glb glb = readGlb(out);
    const GlbPart& part = glb.parts.at(0);
    ASSERT_EQ(part.tangents.size(), 3u);
    for (std::size_t vertex = 0; vertex < 3; ++vertex) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_NEAR(part.normals[vertex][axis], normals[vertex][axis], 1e-6f) << vertex;
        EXPECT_NEAR(part.tangents[vertex][axis], tangents[vertex][axis], 1e-6f) << vertex;
      }
      EXPECT_EQ(part.tangents[vertex][3], tangents[vertex][3]) << vertex;
    }
    EXPECT_NEAR(part.positions[1][0], -1 - 3, 1e-6f);
  });
}

// ---- blended rotation near zero

/// Half turns about the axes, and the turn by nothing: quaternions at right angles, whose blend is
/// as short as it can be.
std::vector<JointMatrix> halfTurns() {
  std::vector<JointMatrix> pose(8);
  for (int joint = 0; joint < 8; ++joint) {
    for (int axis = 0; axis < 3; ++axis)
      pose[static_cast<std::size_t>(joint)].m[axis][axis] =
          joint % 4 == 0 || joint % 4 - 1 == axis ? 1.0f : -1.0f;
  }
  return pose;
}

TEST_F(BadInput, ABlendedRotationIsNeverNearZero) {
  OwnedMesh mesh = randomMesh(21, 2000, 8, 8);
  for (std::size_t slot = 0; slot < mesh.weights.size(); ++slot) {
    mesh.joints[slot] = static_cast<std::uint32_t>(slot % 8);
    mesh.weights[slot] = slot / 8 % 2 == 0 ? 0.125f : mesh.weights[slot];
  }
  const MeshView view = mesh.view();
  const std::vector<JointMatrix> pose = halfTurns();
  const reference::SkinnedMesh expected = *reference::skin(view, pose, Method::dualQuaternion);
  const auto lengthOf = [](double x, double y, double z) { return std::hypot(x, y, z); };
  // Joints that only turn leave every vertex as far from the origin as it was.
  for (std::size_t i = 0; i < expected.positions.size(); ++i) {
    const auto& [x, y, z] = expected.positions[i];
    const float* bind = mesh.positions.data() + i * 3;
    ASSERT_NEAR(lengthOf(x, y, z), lengthOf(bind[0], bind[1], bind[2]), 1e-12) << i;
  }
  useDevice(true);
  if (IsSkipped() || HasFatalFailure()) return;
  const PackedMesh packed = *pack(view, 8);
  const samples::SkinRequest request{&packed, pose};
  const auto result = samples::runBatch(device(), context(), {&request, 1});
  ASSERT_TRUE(result.ok()) << result.error().message;
  const std::vector<float>& positions = result->instances.at(0).positions;
  ASSERT_EQ(positions.size(), mesh.positions.size());
  for (std::size_t i = 0; i < positions.size(); i += 3) {
    const float* bind = mesh.positions.data() + i;
    ASSERT_NEAR(lengthOf(positions[i], positions[i + 1], positions[i + 2]),
                lengthOf(bind[0], bind[1], bind[2]), 1e-5)
        << i;
  }
}

// ---- NaN in a pose

TEST_F(BadInput, NanInAPoseAffectsThatInstanceAlone) {
  useDevice(true);
  if (IsSkipped() || HasFatalFailure()) return;
  OwnedMesh mesh = randomMesh(22, 500, 10, 4);
  const PackedMesh packed = *pack(mesh.view(), 10);
  std::vector<std::vector<JointMatrix>> poses;
  for (std::uint32_t instance = 0; instance < 6; ++instance)
    poses.push_back(randomPose(instance, 10, Rigidity::rigid));
  std::vector<samples::SkinRequest> requests;
  for (std::size_t instance = 0; instance < 6; ++instance) {
    requests.push_back({&packed, poses[instance], JointPromise::scaling,
                        instance < 3 ? Method::linear : Method::dualQuaternion});
  }
  const auto before = samples::runBatch(device(), context(), requests);
  for (JointMatrix& joint : poses[1]) joint.m[0][0] = nan;
  for (JointMatrix& joint : poses[4]) joint.m[2][3] = nan;
  const auto after = samples::runBatch(device(), context(), requests);
  ASSERT_TRUE(before.ok() && after.ok());
  for (std::size_t instance = 0; instance < 6; ++instance) {
    EXPECT_EQ(before->instances[instance].streams == after->instances[instance].streams,
              instance != 1 && instance != 4)
        << instance;
  }
}

// ---- truncated or hostile glTF

/// Runs `info` with 1 GiB of address space, and expects it to refuse the file soon.
void expectRefusedSoon(const std::string& model, const std::string& text) {
#ifdef DERMIS_SANITIZED
  const std::string limit;  // a sanitizer's shadow memory is larger
#else
  const std::string limit = "ulimit -v 1048576; ";
#endif
  const auto start = std::chrono::steady_clock::now();
  const CommandResult result =
      runCommand({"/bin/sh", "-c", limit + "exec \"$0\" info \"$1\"", dermisProgram, model});
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_EQ(result.status, 3) << result.errors;
  expectOneErrorLine(result);
  EXPECT_NE(result.errors.find(text), std::string::npos) << result.errors;
  EXPECT_LT(seconds.count(), 20);
}

TEST_F(BadInput, TruncatedOrHostileGltfEndsWithAClearErrorAndNeverWithMore) {
  const std::vector<std::byte> glb = fox().glb();
  const std::string text = fox().text();
  for (std::size_t length = 0; length < glb.size(); ++length) {
    const Result<gltf::Model> cut = gltf::loadFromMemory({glb.data(), length}, {});
    ASSERT_FALSE(cut.ok()) << length;
    EXPECT_FALSE(cut.error().message.empty());
  }
  for (std::size_t length = 0; length < text.size(); ++length)
    ASSERT_FALSE(gltf::loadFromMemory(std::as_bytes(std::span(text).first(length)), {})) << length;
  const std::string truncated = outFile("truncated.glb");
  std::ofstream(truncated, std::ios::binary)
      .write(reinterpret_cast<const char*>(glb.data()),
             static_cast<std::streamsize>(glb.size() - 5));
  expectRefusedSoon(truncated, " bytes, but the file has " + std::to_string(glb.size() - 5));

  const auto expectHostile = [](const std::string& expected, auto change) {
    FileBuilder file = fox();
    change(file);
    expectRefusedSoon(file.writtenTo(outFile("hostile.gltf")), expected);
  };
  expectHostile("accessor 0", [](FileBuilder& f) { f.accessor("POSITION")["count"] = 4294967295; });
  expectHostile("POSITION has 2000000000", [](FileBuilder& f) {
    f.accessor("POSITION").erase("bufferView");
    f.accessor("POSITION")["count"] = 2000000000;
  });
  expectHostile("accessor 1", [](FileBuilder& f) { f.accessor("JOINTS_0")["byteOffset"] = 1e15; });
  expectHostile("bufferView 2", [](FileBuilder& f) { f.json["bufferViews"][2]["buffer"] = 7; });
  expectHostile("node", [](FileBuilder& f) { f.json["nodes"][2]["children"] = {1}; });
  expectHostile("skin 0", [](FileBuilder& f) { f.json["skins"][0]["joints"] = {1, 99}; });
  const std::string deep = outFile("deep.gltf");
  std::ofstream(deep) << std::string(200000, '[');
  expectRefusedSoon(deep, "deep.gltf");
}

/// `nodes` nodes of one mesh with skins of 2, 3, … joints. Its accessors have no data.
FileBuilder copies(std::size_t nodes, std::size_t primitives, std::size_t vertices) {
  FileBuilder file = skinnedTriangle();
  for (const char* attribute : {"POSITION", "JOINTS_0", "WEIGHTS_0"}) {
    file.accessor(attribute).erase("bufferView");
    file.accessor(attribute)["count"] = vertices;
  }
  const Json primitive = file.primitive();
  file.json["meshes"][0]["primitives"] = std::vector<Json>(primitives, primitive);
  for (std::size_t node = 1; node < nodes; ++node) {
    file.json["scenes"][0]["nodes"].push_back(file.json["nodes"].size());
    file.json["nodes"].push_back({{"mesh", 0}, {"skin", 0}});
  }
  return file;
}

// 64 MiB and 64 times the file; and what has no end in memory has none in time.
TEST_F(BadInput, NothingThatAFileMultipliesIsMadeBeyondItsBudget) {
  const std::string limit = "than the limit for a file of this size";
  expectRefusedSoon(copies(5000, 5000, 3).writtenTo(outFile("parts.gltf")), limit);
  expectRefusedSoon(copies(400, 1, 100'000).writtenTo(outFile("vertices.gltf")), limit);
  FileBuilder name = copies(1, 20'000, 3);
  name.json["nodes"][0]["name"] = std::string(1'000'000, 'N');
  expectRefusedSoon(name.writtenTo(outFile("name.gltf")), limit);
  FileBuilder targets = copies(20'000, 1, 3);
  targets.primitive()["targets"] = std::vector<Json>(100'000, Json::object());
  expectRefusedSoon(targets.writtenTo(outFile("targets.gltf")), limit);
}

TEST_F(BadInput, FilesThatAreNoModelsAreRefusedBeforeTheyAreRead) {
  const std::string sparse = outFile("sparse.glb");
  std::ofstream(sparse, std::ios::binary) << std::string("glTF\x02\0\0\0\x00\x10\0\0", 12);
  std::error_code error;
  std::filesystem::resize_file(sparse, std::uint64_t{1} << 40, error);
  if (error) GTEST_SKIP() << "no sparse files here";
  expectRefusedSoon(sparse, "the maximum is 4294967296");
  std::filesystem::remove(sparse);
}

TEST_F(BadInput, MorphTargetsOfNothingAreRefused) {
  FileBuilder file = fox();
  file.primitive()["targets"] = {{{"POSITION", file.attributes()["POSITION"]}}};
  file.attributes() = Json::object();
  expectRefusedSoon(file.writtenTo(outFile("nothing.gltf")), "morph targets, but no attribute");
}

// Skins that a mesh cannot tell apart share what is made of it; its clip has a channel a node.
TEST_F(BadInput, ManyNodesAreSkinnedInATimeThatGrowsWithTheirNumber) {
  constexpr std::size_t count = 20'000;
  FileBuilder file = copies(count, 1, 3);
  file.primitive()["targets"] = {{{"POSITION", file.attributes()["POSITION"]}}};
  const std::size_t keys = file.addFloats({0}, "SCALAR");
  Json channels = Json::array();
  for (const Json& node : file.json["scenes"][0]["nodes"]) {
    if (!file.json["nodes"][node.get<std::size_t>()].contains("mesh")) continue;
    channels.push_back({{"sampler", 0}, {"target", {{"node", node}, {"path", "weights"}}}});
  }
  file.json["animations"] = {
      {{"samplers", {{{"input", keys}, {"output", keys}}}}, {"channels", channels}}};
  EXPECT_EQ(skinned(file.writtenTo(outFile("nodes.gltf")), {"--device", "cpu"}).positions.size(),
            3 * count);
}

// What a terminal would obey, and what fills it, is not printed.
TEST_F(BadInput, NamesArePrintedShortAndOnOneLine) {
  const std::string hostile = "\n\x1b[31m\xe2\x80\xae";
  FileBuilder file = rotating({0, 1}, {0, 0, 0, 1, 0, 0, 0, 1}, "LINEAR");
  const std::string name = hostile + std::string(3'000'000, 'A');
  file.json["meshes"][0]["name"] = name;
  file.json["nodes"][0]["name"] = name;
  file.json["animations"][0]["name"] = name;
  file.json["skins"][0]["name"] = name;
  file.attributes()["WEIGHTS_0"] =
      file.addFloats({1, 0, 0, 0, nan, 0, 0, 0, 0.5f, 0, 0, 0}, "VEC4");
  const std::string model = file.writtenTo(outFile("names.gltf"));
  const auto expectTame = [&](const std::string& text) {
    EXPECT_LT(text.size(), 3000u);
    EXPECT_NE(text.find("'\\n\\u001b[31m\\u202eAAA"), std::string::npos) << text.substr(0, 3000);
    EXPECT_EQ(text.find('\x1b'), std::string::npos);
    EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos);
  };
  expectTame(dermis({"info", model}).output);
  const std::string out = outFile("names.ply");
  expectTame(dermis({"skin", model, "-o", out, "--device", "cpu"}).errors);
  expectTame(dermis({"skin", model, "-o", out, "--device", "cpu", "--strict"}).errors);
  expectTame(dermis({"compare", model, "--device", "cpu"}).output);
  const Json info = Json::parse(dermis({"info", model, "--json"}).output);
  EXPECT_EQ(info.at("clips").at(0).at("name"), name) << "JSON has its own way to write them";
  EXPECT_EQ(info.at("skins").at(0).at("name"), name);
}

/// All vertices weighted to the same two joints, no two alike: centres of rotation cost the square.
FileBuilder denseMesh(std::uint32_t vertexCount) {
  FileBuilder file = skinnedTriangle();
  std::vector<float> positions, weights;
  std::vector<std::uint8_t> joints;
  std::vector<std::uint32_t> triangles;
  for (std::uint32_t vertex = 0; vertex < vertexCount; ++vertex) {
    const auto number = static_cast<float>(vertex);
    positions.insert(positions.end(), {std::sin(number), std::cos(2 * number), number * 1e-4f});
    const float share = (number + 1) / static_cast<float>(vertexCount + 2);
    weights.insert(weights.end(), {share, 1 - share, 0, 0});
    joints.insert(joints.end(), {0, 1, 0, 0});
    if (vertex < 2) continue;
    for (const std::uint32_t corner : {vertex - 2, vertex - 1, vertex}) triangles.push_back(corner);
  }
  file.attributes()["POSITION"] = file.addFloats(positions, "VEC3");
  file.attributes()["JOINTS_0"] = file.add(joints, "VEC4", unsignedByteType);
  file.attributes()["WEIGHTS_0"] = file.addFloats(weights, "VEC4");
  file.primitive()["indices"] = file.add(triangles, "SCALAR", unsignedIntType);
  return file;
}

// Nobody waits for centres of rotation unless a method that needs them was named.
TEST_F(BadInput, CentresOfRotationTakeLongOnlyIfTheyAreAskedFor) {
  const std::string model = denseMesh(34'000).writtenTo(outFile("dense.gltf"));
  const std::string report = outFile("dense.json");
  const CommandResult compared =
      dermis({"compare", model, "--device", "cpu", "--json", report, "--repetitions", "1"});
  EXPECT_EQ(compared.status, 0) << compared.errors;
  EXPECT_NE(compared.errors.find(": its centers of rotation need "), std::string::npos)
      << compared.errors;
  std::ifstream file(report);
  EXPECT_EQ(Json::parse(file).at("methods").size(), allMethods.size() - 2);
  const CommandResult asked = dermis({"skin", model, "-o", outFile("dense.ply"), "--device", "cpu",
                                      "--method", "center_of_rotation"});
  EXPECT_EQ(asked.status, 0) << asked.errors;
}

TEST_F(BadInput, AMeshTooDenseForCentresOfRotationIsSkinnedWithoutThem) {
  const std::string model = denseMesh(110'000).writtenTo(outFile("dense.gltf"));
  const std::string out = outFile("dense.ply");
  const auto skin = [&](const char* method) {
    return dermis({"skin", model, "-o", out, "--device", "cpu", "--method", method});
  };
  const CommandResult refused = skin("center_of_rotation");
  EXPECT_EQ(refused.status, 3) << refused.errors;
  EXPECT_NE(refused.errors.find("centers of rotation"), std::string::npos) << refused.errors;
  EXPECT_EQ(skin("dual_quaternion").status, 0);
  const std::string report = outFile("dense.json");
  const CommandResult compared = dermis({"compare", model, "--device", "cpu", "--json", report});
  EXPECT_EQ(compared.status, 0) << compared.errors;
  EXPECT_NE(compared.errors.find("centers of rotation"), std::string::npos) << compared.errors;
  std::ifstream file(report);
  const Json written = Json::parse(file);
  std::vector<std::string> methods;
  for (const Json& row : written.at("methods")) methods.push_back(row.at("method"));
  EXPECT_EQ(methods.size(), allMethods.size() - 2) << "the two that need centres are left out";
  EXPECT_EQ(std::count(methods.begin(), methods.end(), "bulge_controlled"), 0);
}

// Forty skins for one mesh differ in nothing that it can tell: its centres are found once, or this
// would be too much work.
TEST_F(BadInput, CentresOfRotationAreFoundOncePerMesh) {
  FileBuilder file = denseMesh(20'000);
  for (std::size_t skin = 1; skin < 40; ++skin) {
    Json joints = Json::array();
    for (std::size_t joint = 0; joint < 2 + skin; ++joint) {
      joints.push_back(file.json["nodes"].size());
      file.json["scenes"][0]["nodes"].push_back(file.json["nodes"].size());
      file.json["nodes"].push_back(Json::object());
    }
    file.json["skins"].push_back({{"joints", joints}});
    file.json["scenes"][0]["nodes"].push_back(file.json["nodes"].size());
    file.json["nodes"].push_back({{"mesh", 0}, {"skin", skin}});
  }
  const std::string model = file.writtenTo(outFile("skins.gltf"));
  const CommandResult result = dermis({"skin", model, "-o", outFile("skins.ply"), "--device", "cpu",
                                       "--method", "center_of_rotation"});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.errors.find("centers of rotation"), std::string::npos) << result.errors;
}

// ---- ordinary files that share vertices, and sparse morph targets

enum class Targets { sparse, dense };

/// A strip of triangles whose `materials` primitives share all vertices, with `targets` morph
/// targets of three vertices each. The first two are active.
FileBuilder strip(std::uint32_t vertices, std::uint32_t materials, std::uint32_t targets,
                  Targets kind = Targets::sparse) {
  FileBuilder file = denseMesh(vertices);
  file.json["nodes"][2]["rotation"] = {0, 0, 0.6, 0.8};
  std::vector<float> normals(std::size_t{vertices} * 3, 0.0f);
  for (std::size_t vertex = 0; vertex < vertices; ++vertex) normals[vertex * 3 + 1] = 1;
  file.attributes()["NORMAL"] = file.addFloats(normals, "VEC3");
  for (std::uint32_t target = 0; target < targets; ++target) {
    const std::vector<std::uint32_t> elements{target, target + 7, vertices - 1 - target};
    std::vector<float> values{1, 2, 3, 4, 5, 6, 7, 8, static_cast<float>(target)};
    Json accessor = {{"componentType", floatType}, {"count", vertices}, {"type", "VEC3"}};
    if (kind == Targets::sparse) {
      accessor["sparse"] = {
          {"count", elements.size()},
          {"indices",
           {{"bufferView", file.addView(bytesOf(elements))}, {"componentType", unsignedIntType}}},
          {"values", {{"bufferView", file.addView(bytesOf(values))}}}};
    } else {
      std::vector<float> all(std::size_t{vertices} * 3, 0.0f);
      for (std::size_t i = 0; i < 9; ++i) all[elements[i / 3] * std::size_t{3} + i % 3] = values[i];
      accessor["bufferView"] = file.addView(bytesOf(all));
    }
    const std::size_t number = file.addAccessor(accessor);
    file.primitive()["targets"].push_back({{"POSITION", number}, {"NORMAL", number}});
  }
  if (targets > 0) {
    file.json["meshes"][0]["weights"] = std::vector<float>(targets, 0.0f);
    file.json["meshes"][0]["weights"][0] = 1;
    file.json["meshes"][0]["weights"][1] = -0.5;
  }
  Json triangles = file.json["accessors"][file.primitive()["indices"].get<std::size_t>()];
  const std::uint32_t all = 3 * (vertices - 2), each = all / 3 / materials * 3;
  Json primitives = Json::array();
  for (std::uint32_t material = 0; material < materials; ++material) {
    triangles["byteOffset"] = 4 * each * material;
    triangles["count"] = material + 1 < materials ? each : all - each * material;
    primitives.push_back(file.primitive());
    primitives.back()["indices"] = file.addAccessor(triangles);
  }
  file.json["meshes"][0]["primitives"] = primitives;
  return file;
}

/// Expects that each of the primitives of `shared` is skinned as the only one of `single` is.
void expectSkinnedAlike(const FileBuilder& shared, std::size_t materials, const FileBuilder& single,
                        const std::vector<std::string>& options) {
  const Ply one = skinned(single.writtenTo(outFile("single.gltf")), options);
  const Ply all = skinned(shared.writtenTo(outFile("shared.gltf")), options);
  ASSERT_FALSE(one.positions.empty());
  ASSERT_EQ(all.positions.size(), one.positions.size() * materials);
  for (std::size_t i = 0; i < all.positions.size(); ++i) {
    ASSERT_EQ(all.positions[i], one.positions[i % one.positions.size()]) << i;
    ASSERT_EQ(all.normals[i], one.normals[i % one.positions.size()]) << i;
  }
  EXPECT_EQ(all.faces.size(), one.faces.size());
}

// What is shared, and what is sparse, takes memory once, and for its values alone.
TEST_F(BadInput, SharedVerticesAndSparseTargetsFitTheBudget) {
  struct Shape {
    std::uint32_t vertices, materials, targets;
  };
  for (const Shape& shape : {Shape{20'000, 40, 0}, Shape{8'000, 1, 300}, Shape{3'000, 9, 57}}) {
    const FileBuilder file = strip(shape.vertices, shape.materials, shape.targets);
    expectSkinnedAlike(file, shape.materials,
                       strip(shape.vertices, 1, std::min(shape.targets, 2u), Targets::dense),
                       {"--device", "cpu"});
    const CommandResult info = dermis({"info", outFile("shared.gltf"), "--strict"});
    EXPECT_EQ(info.status, 0) << info.errors;
  }
}

TEST_F(BadInput, SharedVerticesHaveTheCentersOfRotationOfOneMesh) {
  expectSkinnedAlike(strip(500, 3, 2), 3, strip(500, 1, 2),
                     {"--device", "reference", "--method", "center_of_rotation"});
}

TEST_F(BadInput, SparseTargetsMoveAMeshWithoutJoints) {
  const auto inBindPose = [](FileBuilder file) {
    for (Json& primitive : file.json["meshes"][0]["primitives"]) {
      primitive["attributes"].erase("JOINTS_0");
      primitive["attributes"].erase("WEIGHTS_0");
    }
    return file;
  };
  expectSkinnedAlike(inBindPose(strip(100, 2, 3)), 2, inBindPose(strip(100, 1, 3, Targets::dense)),
                     {"--device", "cpu"});
}

// Few accessors make many meshes: each pair of joints and weights is one.
TEST_F(BadInput, PairsOfSharedAccessorsAreCounted) {
  FileBuilder file = copies(1, 1, 20'000);
  const Json joints = file.accessor("JOINTS_0"), weights = file.accessor("WEIGHTS_0");
  Json primitives = Json::array();
  std::vector<std::size_t> ofJoints, ofWeights;
  for (std::size_t i = 0; i < 30; ++i) {
    ofJoints.push_back(file.addAccessor(joints));
    ofWeights.push_back(file.addAccessor(weights));
  }
  for (const std::size_t joint : ofJoints) {
    for (const std::size_t weight : ofWeights) {
      primitives.push_back(file.primitive());
      primitives.back()["attributes"]["JOINTS_0"] = joint;
      primitives.back()["attributes"]["WEIGHTS_0"] = weight;
    }
  }
  file.json["meshes"][0]["primitives"] = primitives;
  expectRefusedSoon(file.writtenTo(outFile("pairs.gltf")),
                    "than the limit for a file of this size");
}

// ---- no Vulkan loader, no device, a missing feature

TEST_F(BadInput, NoLoaderNoDeviceOrAMissingFeatureIsNamedAndTheReferenceStillWorks) {
  const std::string model = fox().writtenTo(outFile("model.gltf"));
  const std::string folder = outFile("libraries");
  std::filesystem::create_directory(folder);
  std::ofstream(folder + "/libvulkan.so.1") << "This is no library.";
  const struct {
    std::vector<std::string> environment;
    const char* named;
  } machines[] = {
      {{"LD_LIBRARY_PATH=" + folder}, "there is no Vulkan loader (libvulkan.so.1)"},
      {{"VK_DRIVER_FILES=/nonexistent.json", "VK_ICD_FILENAMES=/nonexistent.json"}, "Vulkan"}};
  for (const auto& [environment, named] : machines) {
    const std::string out = outFile("pose.ply");
    const CommandResult none = dermis({"skin", model, "-o", out}, environment);
    EXPECT_EQ(none.status, 4);
    expectOneErrorLine(none);
    EXPECT_NE(none.errors.find(named), std::string::npos) << none.errors;
    EXPECT_EQ(dermis({"skin", model, "-o", out, "--device", "cpu"}, environment).status, 0);
  }

  MockVulkan few;
  few.limits.maxPerStageDescriptorStorageBuffers = 3;
  const Result<vulkan::Context> refused = vulkan::Context::create(few.description());
  ASSERT_FALSE(refused.ok());
  EXPECT_EQ(refused.error().code, ErrorCode::missingFeature);
  EXPECT_NE(refused.error().message.find("storage buffers"), std::string::npos)
      << refused.error().message;
}

// ---- device lost, out of memory

/// What Dermis does with a device, up to the first error.
Result<void> useContext(const vulkan::DeviceDescription& description) {
  Result<vulkan::Context> context = vulkan::Context::create(description);
  if (!context) return context.error();
  const PoseDescription pose{1};
  Job job;
  job.mesh.byteSize = 4096;
  job.mesh.vertexCount = job.mesh.requiredJoints = job.mesh.maxInfluences = 1;
  job.places[Stream::positions] = {0, 12, VertexFormat::float32x3};
  Plan plan;
  const Batch batch{{&pose, 1}, {&job, 1}, 4096, 4096, ByStream<std::uint64_t>::all(4096)};
  if (Result<void> made = makePlan(batch, context->limits(), {}, plan); !made) return made;
  if (Result<void> done = context->prepare(plan.pipelines()); !done) return done;
  const vulkan::BufferRange range{reinterpret_cast<VkBuffer>(std::uintptr_t{64}), 0, 4096};
  const Result<vulkan::Bindings> bindings = context->createBindings(
      {range, range, range, range, ByStream<vulkan::BufferRange>::all(range), range});
  if (!bindings) return bindings.error();
  return context->record(reinterpret_cast<VkCommandBuffer>(std::uintptr_t{64}), plan, *bindings);
}

TEST_F(BadInput, ALostDeviceOrTooLittleMemoryIsAnErrorThatLeaksNothing) {
  {
    MockVulkan mock;
    const Result<void> done = useContext(mock.description());
    ASSERT_TRUE(done.ok()) << done.error().message;
  }
  for (const char* function :
       {"vkCreateShaderModule", "vkCreateDescriptorSetLayout", "vkCreatePipelineLayout",
        "vkCreateComputePipelines", "vkCreateDescriptorPool", "vkAllocateDescriptorSets"}) {
    for (const VkResult failure :
         {VK_ERROR_OUT_OF_HOST_MEMORY, VK_ERROR_OUT_OF_DEVICE_MEMORY, VK_ERROR_DEVICE_LOST}) {
      SCOPED_TRACE(function);
      MockVulkan mock;
      mock.failing = function;
      mock.failure = failure;
      const Result<void> done = useContext(mock.description());
      ASSERT_FALSE(done.ok());
      EXPECT_EQ(done.error().code, ErrorCode::vulkanError);
      EXPECT_EQ(done.error().vulkanResult, failure);
      EXPECT_NE(done.error().message.find(function), std::string::npos) << done.error().message;
      EXPECT_EQ(mock.aliveObjects(), 0);
      EXPECT_TRUE(mock.commands.empty()) << "the engine's command buffers are untouched";
    }
  }
}

// ---- a damaged shader or pipeline cache

// The pipeline cache is the engine's own; Dermis stores none.
TEST_F(BadInput, ADamagedShaderCacheIsNoticedThrownAwayAndRebuilt) {
  ShaderCompilerOptions options;
  options.cacheFolder = outFile("cache");
  std::filesystem::remove_all(options.cacheFolder);
  ShaderCompiler compiler(options);
  const ShaderSource source{"small.comp",
                            "#version 450\nlayout(local_size_x = 8) in;\nvoid main() {}\n",
                            ShaderStage::compute,
                            {}};
  const auto expected = compiler.compile(source);
  ASSERT_TRUE(expected.ok()) << expected.error().message;
  const std::filesystem::directory_iterator entries(options.cacheFolder);
  ASSERT_NE(entries, std::filesystem::directory_iterator());
  const std::filesystem::path entry = entries->path();
  std::fstream file(entry, std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(-3, std::ios::end);
  file.put('\x55');
  file.close();

  const auto again = compiler.compile(source);
  ASSERT_TRUE(again.ok()) << again.error().message;
  EXPECT_EQ(*again, *expected);
  EXPECT_FALSE(compiler.lastFromCache());
  EXPECT_NE(compiler.lastCacheProblem().find("was deleted"), std::string::npos);
  ASSERT_TRUE(compiler.compile(source).ok());
  EXPECT_TRUE(compiler.lastFromCache()) << "it has been made again";
}

}  // namespace
}  // namespace dermis::test
