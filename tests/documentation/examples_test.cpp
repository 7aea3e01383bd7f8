// Code that the documents show and no sample has.

#include <gtest/gtest.h>
#include <vulkan/vulkan.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <span>
#include <string>
#include <string_view>
#include <thread>
#include <utility>
#include <vector>

#include "dermis/clips.h"
#include "dermis/cpu.h"
#include "dermis/gltf.h"
#include "dermis/mesh.h"
#include "dermis/rig.h"
#include "dermis/scene.h"
#include "dermis/verify.h"
#include "dermis/vulkan/drawing.h"
#include "test_paths.h"

using namespace dermis;

namespace {

/// What the draw below said to Vulkan.
struct Drawn {
  VkBuffer buffer = VK_NULL_HANDLE;
  VkDeviceSize offset = 0;
  std::uint32_t indices = 0;
};
Drawn drawn;

}  // namespace

// In place of a driver.
VKAPI_ATTR void VKAPI_CALL vkCmdBindVertexBuffers(VkCommandBuffer, std::uint32_t, std::uint32_t,
                                                  const VkBuffer* buffers,
                                                  const VkDeviceSize* offsets) {
  drawn.buffer = buffers[0];
  drawn.offset = offsets[0];
}
VKAPI_ATTR void VKAPI_CALL vkCmdBindIndexBuffer(VkCommandBuffer, VkBuffer, VkDeviceSize,
                                                VkIndexType) {}
VKAPI_ATTR void VKAPI_CALL vkCmdDrawIndexed(VkCommandBuffer, std::uint32_t indexCount,
                                            std::uint32_t, std::uint32_t, std::int32_t,
                                            std::uint32_t) {
  drawn.indices = indexCount;
}

namespace {

template <typename T>
T must(Result<T> result) {
  EXPECT_TRUE(result.ok()) << result.error().message;
  if constexpr (!std::is_void_v<T>) return *std::move(result);
}

std::vector<std::string> logged;
void logWarning(const std::string& message) {
  logged.push_back(message);
}

// [own-arrays]
/// A vertex as this engine stores it: interleaved, with normals and weights in integers.
struct Vertex {
  float position[3];
  std::int16_t normal[4];  ///< snorm16; the fourth is not used
  std::uint8_t joints[4];
  std::uint8_t weights[4];  ///< unorm8
};

/// A view copies nothing: `vertices` must stay as they are until `pack` returns.
Result<PackedMesh> packMesh(std::string_view name, std::span<const Vertex> vertices,
                            std::uint32_t jointCount) {
  const Vertex* first = vertices.data();
  const auto count = static_cast<std::uint32_t>(vertices.size());
  InfluenceSet influences;
  influences.joints = {first->joints, count, sizeof(Vertex), ComponentType::uint8, 4};
  influences.weights = {first->weights, count, sizeof(Vertex), ComponentType::unorm8, 4};
  MeshView mesh;
  mesh.name = name;  // for messages
  mesh.vertexCount = count;
  mesh.positions = {first->position, count, sizeof(Vertex), ComponentType::float32, 3};
  mesh.normals = {first->normal, count, sizeof(Vertex), ComponentType::snorm16, 3};
  mesh.influenceSets = {&influences, 1};

  if (validate(mesh, jointCount).packable()) return pack(mesh, jointCount);
  // For example, an influence names a joint that does not exist: `repair` drops it.
  Result<RepairedMesh> repaired = repair(mesh, jointCount);
  if (!repaired) return repaired.error();
  for (const MeshReport::Finding& finding : repaired->report().findings)
    logWarning(finding.message);
  return pack(repaired->view(), jointCount);
}
// [/own-arrays]

/// Two joints; the second moves the second vertex alone, and half of the third.
std::vector<Vertex> threeVertices() {
  return {{{0, 0, 0}, {0, 0, 32767, 0}, {0, 0, 0, 0}, {255, 0, 0, 0}},
          {{1, 0, 0}, {0, 0, 32767, 0}, {1, 0, 0, 0}, {255, 0, 0, 0}},
          {{0, 1, 0}, {0, 0, 32767, 0}, {0, 1, 0, 0}, {128, 127, 0, 0}}};
}

TEST(DocumentedExampleTest, AMeshIsMadeOfTheEnginesArrays) {
  logged.clear();
  std::vector<Vertex> vertices = threeVertices();
  const MeshInfo info = must(packMesh("triangle", vertices, 2)).info();
  EXPECT_EQ(info.vertexCount, 3u);
  EXPECT_EQ(info.requiredJoints, 2u);
  EXPECT_EQ(info.maxInfluences, 2u);
  EXPECT_TRUE(info.hasNormals);
  EXPECT_TRUE(logged.empty());

  vertices[2].joints[1] = 9;
  const MeshInfo mended = must(packMesh("triangle", vertices, 2)).info();
  EXPECT_EQ(mended.maxInfluences, 1u);
  ASSERT_FALSE(logged.empty());
  EXPECT_NE(logged[0].find("'triangle', vertex 2"), std::string::npos) << logged[0];
}

// [clips]
/// Import: a bank of all clips of a file, to be stored with the assets.
Result<PackedClips> packAnimations(const gltf::Model& model) {
  PackClipsReport report;
  const Skeleton skeleton = gltf::skeleton(model);
  Result<PackedClips> bank = packClips(skeleton, gltf::clips(model), {}, &report);
  if (bank) logWarning("largest error " + std::to_string(report.worstError) + ": " + report.worst);
  return bank;
}

/// Each frame: the pose of a figure that walks, and runs more and more. `pose` is what `writePose`
/// returned.
Result<void> animate(const PackedClips& bank, double seconds, float speed,
                     std::span<JointMatrix> pose) {
  constexpr std::uint32_t walk = 0, run = 1, skin = 0;
  const ClipLayer layers[] = {{.clip = walk, .time = seconds, .weight = 1 - speed},
                              {.clip = run, .time = seconds, .weight = speed}};
  return samplePose(bank, layers, skin, pose);
}
// [/clips]

// [rigs]
/// Import: the rig of the only skin, to be stored with the assets. Meshes are packed for all joints
/// of the rig.
Result<PackedRig> importRig(gltf::Model& model, std::vector<PackedMesh>& meshes) {
  const auto rig = gltf::applyRig(model, 0, model.skins[0].rig);
  if (!rig) return rig.error();
  const auto joints = static_cast<std::uint32_t>((*rig)->joints.size());
  for (const gltf::SkinnedPrimitive& skinned : model.skinnedPrimitives) {
    const gltf::PrimitiveView view(model.meshes[skinned.mesh].primitives[skinned.primitive]);
    Result<PackedMesh> mesh = pack(view.mesh(), joints);
    if (!mesh) return mesh.error();
    meshes.push_back(std::move(*mesh));
  }
  return packRig(**rig);
}

/// Each frame, without a scene: the matrices of driven joints, after those of written ones, and the
/// weights of driven morph targets.
Result<void> driveJoints(const PackedRig& rig, std::span<JointMatrix> pose,
                         std::span<float> weights) {
  const std::size_t written = rig.writtenJoints();
  return evaluateRig(rig, pose.first(written), {}, pose.subspan(written), weights);
}
// [/rigs]

TEST(DocumentedExampleTest, ARigIsImported) {
  gltf::Model model =
      must(gltf::load(std::filesystem::path(test::sourceFolder) / "tests/fuzz/seeds/rig.gltf"));
  std::vector<PackedMesh> meshes;
  const PackedRig rig = must(importRig(model, meshes));
  ASSERT_EQ(meshes.size(), 1u);
  EXPECT_EQ(rig.drivenJoints(), 5u);
  std::vector<JointMatrix> pose = gltf::pose(model, 0, noIndex, 0);
  pose.resize(pose.size() + rig.drivenJoints());
  std::vector<float> weights(rig.drivenWeights(), 7.0f);
  must(driveJoints(rig, pose, weights));
  EXPECT_NEAR(weights[0], 0, 1e-5) << "in bind pose";
}

// [clips-root-motion]
/// Each frame: moves a figure, which is turned by `heading`, by what its clip walked.
void walk(const RootMotion& step, std::array<double, 3>& place, double& heading) {
  const auto& [x, y, z] = step.displacement;
  place[0] += std::cos(heading) * x + std::sin(heading) * z;
  place[2] += std::cos(heading) * z - std::sin(heading) * x;
  heading += step.turn;  // radians about the y axis
}
// [/clips-root-motion]

TEST(DocumentedExampleTest, AFigureWalksByItsRootMotion) {
  Skeleton skeleton;
  skeleton.nodes.resize(1);
  constexpr std::array<std::uint32_t, 1> joints{0};
  constexpr std::array<JointMatrix, 1> inverseBind{};
  skeleton.skins = {{"one", joints, inverseBind}};
  constexpr std::array<float, 2> times{0, 1};
  constexpr std::array<float, 6> places{0, 1, 0, 0, 1, 2};
  constexpr std::array<float, 8> turns{0, 0, 0, 1, 0, 0.70710678f, 0, 0.70710678f};
  ClipView clip{.name = "walk", .duration = 1, .channels = {}};
  clip.channels = {{.path = ChannelPath::translation, .times = times, .values = places},
                   {.path = ChannelPath::rotation, .times = times, .values = turns}};
  const RootMotionOptions options{.node = 0, .upAxis = 1};
  const PackedClips bank = must(packClips(skeleton, {&clip, 1}, {.rootMotion = options}));
  std::array<double, 3> place{};
  double heading = 0;
  for (int frame = 0; frame < 40; ++frame)
    walk(must(rootMotion(bank, 0, frame * 0.05, (frame + 1) * 0.05)), place, heading);
  // 2 along z in the first second, and along what was z in the second one, which is x then.
  EXPECT_NEAR(place[0], 2, 0.02);
  EXPECT_NEAR(place[2], 2, 0.02);
  EXPECT_NEAR(heading, 3.14159265, 0.01);
}

// [clips-scene]
/// Loading: a figure that plays clips. `clips` is what `addClips` returned for its bank.
Result<FigureHandle> addCharacter(Scene& scene, ClipsHandle clips, MeshHandle mesh) {
  const Result<FigureHandle> figure = scene.addFigure(clips);
  if (!figure) return figure.error();
  InstanceDescription body;
  body.mesh = mesh;
  body.pose = *scene.pose(*figure);  // of skin 0
  const Result<InstanceHandle> instance = scene.addInstance(body);
  if (!instance) return instance.error();
  return figure;
}

/// Each frame: one call for all figures.
Result<void> playAll(Scene& scene, std::span<const FigureHandle> figures, double seconds,
                     float speed) {
  constexpr std::uint32_t walk = 0, run = 1;
  const ClipLayer layers[] = {{.clip = walk, .time = seconds, .weight = 1 - speed},
                              {.clip = run, .time = seconds, .weight = speed}};
  std::vector<FigurePlay> plays;
  for (const FigureHandle figure : figures) plays.push_back({figure, layers});
  return scene.play(plays);
}
// [/clips-scene]

TEST(DocumentedExampleTest, FiguresOfASceneAreAnimatedFromABank) {
  const auto file = std::filesystem::path(test::sampleModels) / "figure.glb";
  const gltf::Model model = must(gltf::load(file));
  const gltf::SkinnedPrimitive& skinned = model.skinnedPrimitives.at(0);
  const gltf::PrimitiveView view(model.meshes[skinned.mesh].primitives[skinned.primitive]);
  cpu::SceneRunner runner = must(cpu::SceneRunner::create());
  Scene& scene = runner.scene();
  const ClipsHandle clips = must(scene.addClips(must(packAnimations(model))));
  const MeshHandle mesh = must(scene.addMesh(
      must(pack(view.mesh(), static_cast<std::uint32_t>(model.skins[0].joints.size())))));
  std::vector<FigureHandle> figures;
  for (int i = 0; i < 3; ++i) figures.push_back(must(addCharacter(scene, clips, mesh)));
  for (std::uint64_t frame = 1; frame <= 2; ++frame) {
    must(scene.beginFrame(frame, frame - 1));
    must(playAll(scene, figures, static_cast<double>(frame), 0.5f));
    for (const cpu::PlannedJob& job : must(runner.jobs())) cpu::run(job);
    EXPECT_EQ(scene.statistics().lastFrame.sampledFigures, 3u);
    EXPECT_EQ(scene.statistics().lastFrame.skinnedInstances, 3u);
  }
}

TEST(DocumentedExampleTest, FiguresAreAnimatedFromABank) {
  logged.clear();
  const auto file = std::filesystem::path(test::sampleModels) / "figure.glb";
  const gltf::Model model = must(gltf::load(file));
  const PackedClips packed = must(packAnimations(model));
  ASSERT_FALSE(logged.empty());
  const PackedClips bank = must(PackedClips::fromBytes(packed.bytes()));
  ASSERT_GE(bank.clipCount(), 2u);
  std::vector<JointMatrix> pose(bank.jointCount(0));
  must(animate(bank, 0.3, 0, pose));
  const std::vector<JointMatrix> exact = gltf::pose(model, 0, 0, 0.3);
  ASSERT_EQ(pose.size(), exact.size());
  for (std::size_t joint = 0; joint < pose.size(); ++joint)
    EXPECT_NEAR(pose[joint].m[1][3], exact[joint].m[1][3], 1e-3);
  must(animate(bank, 0.3, 0.5f, pose));
  EXPECT_NE(pose[5].m[0][0], exact[5].m[0][0]);
}

// [gltf]
struct Character {
  PackedMesh mesh;
  std::vector<JointMatrix> pose;
};

/// The first skinned mesh of a file, and its pose `seconds` after the beginning of a clip.
Result<Character> loadCharacter(const std::filesystem::path& file, std::uint32_t clip,
                                double seconds) {
  const Result<gltf::Model> model = gltf::load(file);
  if (!model) return model.error();
  if (model->skinnedPrimitives.empty())
    return Error{ErrorCode::invalidData, file.string() + " has no skinned mesh"};
  const gltf::SkinnedPrimitive& part = model->skinnedPrimitives[0];
  const gltf::PrimitiveView view(model->meshes[part.mesh].primitives[part.primitive]);
  const std::size_t jointCount = model->skins[part.skin].joints.size();
  Result<PackedMesh> mesh = pack(view.mesh(), static_cast<std::uint32_t>(jointCount));
  if (!mesh) return mesh.error();
  return Character{*std::move(mesh), gltf::pose(*model, part.skin, clip, seconds)};
}
// [/gltf]

TEST(DocumentedExampleTest, ACharacterIsLoadedFromAFile) {
  const std::filesystem::path models = test::sampleModels;
  const Character bar = must(loadCharacter(models / "bar.glb", 0, 0.5));
  EXPECT_GT(bar.mesh.info().vertexCount, 0u);
  EXPECT_GE(bar.pose.size(), bar.mesh.info().requiredJoints);
  const Result<Character> none = loadCharacter(models / "none.glb", 0, 0);
  ASSERT_FALSE(none.ok());
  EXPECT_EQ(none.error().code, ErrorCode::ioError);
}

TEST(DocumentedExampleTest, AWrongPoseIsDiagnosed) {
  logged.clear();
  const gltf::Model model = must(gltf::load(std::filesystem::path(test::sampleModels) / "bar.glb"));
  const gltf::SkinnedPrimitive& part = model.skinnedPrimitives.at(0);
  const gltf::Skin& skin = model.skins[part.skin];
  const gltf::PrimitiveView view(model.meshes[part.mesh].primitives[part.primitive]);
  const MeshView mesh = view.mesh();
  const std::span<const std::uint32_t> triangles =
      model.meshes[part.mesh].primitives[part.primitive].triangles.values();
  const std::vector<JointMatrix> right = gltf::pose(model, part.skin, 0, 0.5);
  std::vector<JointMatrix> jointMatrices = right;
  for (std::size_t joint = 0; joint < right.size(); ++joint)
    for (std::size_t i = 0; i < 12; ++i)
      jointMatrices[joint].m[i / 4][i % 4] = right[joint].m[i % 3][i / 3];
  std::vector<std::uint32_t> parents;
  for (const gltf::Node& node : model.nodes) parents.push_back(node.parent);
  const std::vector<JointMatrix> localTransforms;

  // [diagnose]
  PoseInput known{.jointMatrices = jointMatrices, .triangles = triangles};
  known.inverseBindMatrices = skin.inverseBindMatrices, known.jointNodes = skin.joints;
  known.parents = parents, known.localTransforms = localTransforms;  // of all nodes
  const Diagnosis diagnosis = must(diagnose(mesh, known));
  if (!diagnosis.plausible()) logWarning(diagnosis.message);
  // [/diagnose]

  ASSERT_EQ(logged.size(), 1u);
  EXPECT_EQ(diagnosis.mistake, PoseMistake::columnMajor) << logged[0];
}

/// One thread for each job.
struct ThreadPool {
  std::vector<std::thread> threads;
  template <typename Work>
  void run(Work work) {
    threads.emplace_back(work);
  }
  void wait() {
    for (std::thread& thread : threads) thread.join();
    threads.clear();
  }
};

TEST(DocumentedExampleTest, ASceneIsSkinnedOnTheCpu) {
  const std::vector<Vertex> vertices = threeVertices();
  std::vector<JointMatrix> jointMatrices(2);
  jointMatrices[1].m[0][3] = 2;  // moved by 2 along x
  ThreadPool threadPool;

  // [cpu-load]
  cpu::SceneRunner runner = must(cpu::SceneRunner::create());
  Scene& scene = runner.scene();
  InstanceDescription figure;
  figure.mesh = must(scene.addMesh(must(packMesh("triangle", vertices, 2))));
  figure.pose = must(scene.addPose(2));
  figure.layout = {.positions = VertexFormat::float32x3, .normals = VertexFormat::float32x3};
  const InstanceHandle instance = must(scene.addInstance(figure));
  // [/cpu-load]

  // [cpu-frame]
  must(scene.beginFrame(1, 0));
  std::ranges::copy(jointMatrices, must(scene.writePose(figure.pose)).begin());
  const std::span<const cpu::PlannedJob> jobs = must(runner.jobs());
  for (const cpu::PlannedJob& job : jobs) threadPool.run([&] { cpu::run(job); });
  threadPool.wait();
  const InstanceOutput output = must(scene.output(instance));
  const std::byte* skinned = runner.output().data() + output.offset;
  // [/cpu-frame]

  std::array<float, 18> floats{};
  ASSERT_EQ(output.places.size, sizeof(floats));
  std::memcpy(floats.data(), skinned, sizeof(floats));
  EXPECT_FLOAT_EQ(floats[0], 0);
  EXPECT_FLOAT_EQ(floats[6], 3);
  EXPECT_NEAR(floats[12], 2 * 127.0 / 255, 1e-6);
  EXPECT_FLOAT_EQ(floats[5], 1);
}

/// As a vulkan::SceneRecorder, without Vulkan.
struct DrawnScene {
  VkBuffer buffer;
  VkBuffer outputBuffer() const { return buffer; }
};

TEST(DocumentedExampleTest, AnInstanceIsDrawn) {
  int something = 0;
  const DrawnScene recorder{reinterpret_cast<VkBuffer>(&something)};
  cpu::SceneRunner runner = must(cpu::SceneRunner::create());
  Scene& scene = runner.scene();
  InstanceDescription figure;
  figure.mesh = must(scene.addMesh(must(packMesh("triangle", threeVertices(), 2))));
  figure.pose = must(scene.addPose(2));
  figure.layout = {.positions = VertexFormat::float32x3, .normals = VertexFormat::float32x3};
  must(scene.addInstance(figure));
  const InstanceHandle instance = must(scene.addInstance(figure));
  must(scene.beginFrame(1, 0));
  must(runner.jobs());
  const VkCommandBuffer commandBuffer = VK_NULL_HANDLE;
  const VkBuffer indices = VK_NULL_HANDLE;
  const std::uint32_t indexCount = 3;

  // [vertex-input]
  const vulkan::VertexInput input = must(vulkan::vertexInput(figure.layout));
  VkPipelineVertexInputStateCreateInfo state{};  // of the pipeline that draws
  state.sType = VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO;
  state.vertexBindingDescriptionCount = input.bindingCount;
  state.pVertexBindingDescriptions = input.bindings.data();
  state.vertexAttributeDescriptionCount = input.attributeCount;
  state.pVertexAttributeDescriptions = input.attributes.data();
  // [/vertex-input]
  // [draw]
  const InstanceOutput output = must(scene.output(instance));
  const VkBuffer vertices = recorder.outputBuffer();
  vkCmdBindVertexBuffers(commandBuffer, 0, 1, &vertices, &output.offset);
  vkCmdBindIndexBuffer(commandBuffer, indices, 0, VK_INDEX_TYPE_UINT32);
  vkCmdDrawIndexed(commandBuffer, indexCount, 1, 0, 0, 0);
  // [/draw]

  EXPECT_EQ(state.vertexBindingDescriptionCount, 1u);
  EXPECT_EQ(state.vertexAttributeDescriptionCount, 2u);
  EXPECT_EQ(state.pVertexAttributeDescriptions[1].offset, 12u);
  EXPECT_EQ(drawn.buffer, recorder.buffer);
  EXPECT_EQ(drawn.offset, output.offset);
  EXPECT_EQ(drawn.indices, 3u);
}

}  // namespace
