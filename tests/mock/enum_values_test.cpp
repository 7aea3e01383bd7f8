// Every public function that takes an enum, with every number that the enum can hold: a number that
// is no value is refused, and leaves nothing behind. An engine may read enums from a file.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <optional>
#include <regex>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "core_plan_simulation.h"
#include "dermis/compilers.h"
#include "dermis/cpu.h"
#include "dermis/gltf.h"
#include "dermis/mesh.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#include "dermis/vulkan/drawing.h"
#include "dermis/vulkan/scene_recorder.h"
#include "mock_batch.h"
#include "plan/variant.h"
#include "planned_scene.h"
#include "scene_meshes.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

constexpr std::uint32_t vertexCount = 20, jointCount = 4;

template <typename Enum>
Enum number(std::uint32_t value) {
  return static_cast<Enum>(value);
}

template <typename T>
bool isInvalid(const Result<T>& result) {
  return !result.ok() && result.error().code == ErrorCode::invalidArgument;
}

/// What one instance is skinned with: the enums that most functions take.
struct Choice {
  Method method = Method::dualQuaternion;
  /// Strides that are large enough for every format.
  VertexLayout layout{VertexFormat::float32x4, VertexFormat::float32x4, VertexFormat::float32x4,
                      true, true};
  JointPromise promise = JointPromise::scaling;
};

class EnumValuesTest : public MockContextTest {
 protected:
  void SetUp() override {
    create(true);
    SceneCommandsDescription ofScene;
    ofScene.limits = richLimits();
    planned_.emplace(ofScene);
    scene_ = &planned_->scene();
    instance_.mesh = must(planned_->addMesh(packed_.info()));
    instance_.pose = must(scene_->addPose(jointCount));
    instance_.box = box_;
    runner_.emplace(must(cpu::SceneRunner::create()));
    ofRunner_ = instance_;
    ofRunner_.mesh = must(runner_->scene().addMesh(packed_));
    ofRunner_.pose = must(runner_->scene().addPose(jointCount));
  }

  InstanceDescription chosen(InstanceDescription instance, const Choice& choice) const {
    instance.method = choice.method;
    instance.layout = choice.layout;
    return instance;
  }
  PipelineNeeds needs(const Choice& choice) const {
    return {.method = choice.method,
            .layout = choice.layout,
            .mesh = packed_.info(),
            .promise = choice.promise};
  }
  static VertexPlaces places(const Choice& choice) {
    VertexPlaces places = must(placeVertices(Choice().layout, vertexCount));
    places[Stream::positions].format = choice.layout.positions;
    places[Stream::normals].format = choice.layout.normals;
    places[Stream::tangents].format = choice.layout.tangents;
    places[Stream::previousPositions].format = choice.layout.positions;
    return places;
  }
  Job job(const Choice& choice) const {
    Job job;
    job.mesh = packed_.info();
    job.method = choice.method;
    job.places = places(choice);
    job.box = box_;
    return job;
  }
  Result<void> plan(const Job& job, JointPromise promise) const {
    const PoseDescription pose{jointCount, 0, promise};
    Plan plan;
    return makePlan({{&pose, 1},
                     {&job, 1},
                     job.mesh.byteSize,
                     jointCount * sizeof(JointMatrix),
                     ByStream<std::uint64_t>::all(1 << 16)},
                    richLimits(), {}, plan);
  }
  Result<void> skin(const Choice& choice) {
    cpu::Instance instance;
    instance.pose = pose_;
    instance.promise = choice.promise;
    instance.output.fill(output_.data());
    instance.box = box_;
    cpu::Job job;
    job.mesh = &mesh_;
    job.method = choice.method;
    job.places = places(choice);
    job.instances = {&instance, 1};
    return cpu::skin(job);
  }
  static Result<void> add(Scene& scene, const InstanceDescription& instance) {
    const Result<InstanceHandle> added = scene.addInstance(instance);
    return added ? scene.removeInstance(*added) : added.error();
  }
  Result<void> addPose(const Choice& choice) {
    const Result<PoseHandle> added = scene_->addPose(jointCount, {.promise = choice.promise});
    return added ? scene_->removePose(*added) : added.error();
  }
  Result<void> change(const Choice& choice) {
    const InstanceHandle handle = must(scene_->addInstance(instance_));
    Result<void> changed = scene_->change({.instance = handle, .method = choice.method});
    must(scene_->removeInstance(handle));
    return changed;
  }

  template <typename T>
  static Result<void> verdict(const Result<T>& result) {
    return result ? Result<void>() : result.error();
  }

  /// A function, what it reads of a choice, and what it refuses although it is valid.
  struct Entry {
    std::string name;
    std::function<Result<void>(const Choice&)> call;
    std::set<std::string> reads;
    std::function<bool(const Choice&)> excepts = [](const Choice&) { return false; };
  };
  std::vector<Entry> entries() {
    const std::set<std::string> formats{"positions", "normals", "tangents"};
    std::set<std::string> layout = formats, attributes = formats;
    attributes.insert("method");
    std::set<std::string> all = layout;
    all.insert("method");
    std::set<std::string> withPromise = all;
    withPromise.insert("promise");
    const auto isForComparison = [](const Choice& choice) {
      return dermis::isForComparison(choice.method);
    };
    return {
        {"placeVertices",
         [](const Choice& choice) { return verdict(placeVertices(choice.layout, vertexCount)); },
         layout},
        {"vulkan::vertexInput",
         [](const Choice& choice) { return verdict(vulkan::vertexInput(choice.layout)); }, layout,
         [](const Choice& choice) {
           return std::ranges::any_of(
               std::array{choice.layout.positions, choice.layout.normals, choice.layout.tangents},
               [](VertexFormat format) {
                 return format != VertexFormat::none &&
                        vulkan::vertexInputFormat(format) == VK_FORMAT_UNDEFINED;
               });
         }},
        {"pipelines of needs",
         [this](const Choice& choice) {
           return verdict(pipelines(needs(choice), richLimits(), {}));
         },
         withPromise},
        {"pipelines of a job",
         [this](const Choice& choice) { return verdict(pipelines(job(choice), richLimits(), {})); },
         attributes},
        {"Context::prepare of needs",
         [this](const Choice& choice) { return context->prepare(needs(choice)); }, withPromise},
        {"makePlan", [this](const Choice& choice) { return plan(job(choice), choice.promise); },
         withPromise},
        {"Scene::addPose", [this](const Choice& choice) { return addPose(choice); }, {"promise"}},
        {"Scene::pipelineNeeds",
         [this](const Choice& choice) {
           return verdict(scene_->pipelineNeeds(chosen(instance_, choice)));
         },
         all},
        {"Scene::addInstance",
         [this](const Choice& choice) { return add(*scene_, chosen(instance_, choice)); }, all},
        {"Scene::change", [this](const Choice& choice) { return change(choice); }, {"method"}},
        {"cpu::SceneRunner::addInstance",
         [this](const Choice& choice) { return add(runner_->scene(), chosen(ofRunner_, choice)); },
         all, isForComparison},
        {"cpu::skin", [this](const Choice& choice) { return skin(choice); }, withPromise,
         isForComparison},
        {"cpu::skinVertices",
         [this](const Choice& choice) {
           cpu::Instance instance;
           instance.pose = pose_;
           instance.promise = choice.promise;
           return cpu::skinVertices(mesh_, choice.method, instance, {}, {});
         },
         {"method", "promise"},
         isForComparison},
        {"reference::skin",
         [this](const Choice& choice) {
           return verdict(reference::skin(source_.view(), pose_, choice.method));
         },
         {"method"}},
        {"compareWithReference",
         [this](const Choice& choice) { return compare(choice); },
         {"positions", "normals", "tangents"},
         [](const Choice& choice) {
           return choice.layout.normals == VertexFormat::none ||
                  choice.layout.tangents == VertexFormat::none;
         }},
    };
  }
  Result<void> compare(const Choice& choice) {
    const auto attribute = [&](VertexFormat format) {
      return SkinnedAttribute{output_.data(), vertexCount, 16, format};
    };
    SkinnedView view{attribute(choice.layout.positions), attribute(choice.layout.normals),
                     attribute(choice.layout.tangents), box_};
    return verdict(
        compareWithReference(must(reference::skin(source_.view(), pose_, Method::linear)), view));
  }

  /// Passes 0 to 255 in one member of the choice to every function that reads it. Leaves out
  /// formats that a planar layout may have on the CPU only.
  void expectChecked(const std::string& member,
                     const std::function<void(Choice&, std::uint32_t)>& set,
                     const std::function<bool(std::uint32_t)>& isValue) {
    for (std::uint32_t value = 0; value < 256; ++value) {
      Choice choice;
      set(choice, value);
      const VertexLayout& layout = choice.layout;
      if (shareWords(layout.positions, layout.normals, layout.tangents)) continue;
      for (const Entry& entry : entries()) {
        if (!entry.reads.contains(member)) continue;
        SCOPED_TRACE(entry.name + ", " + member + " " + std::to_string(value));
        const int pipelines = mock.alive["Pipeline"];
        const Result<void> done = entry.call(choice);
        if (isValue(value) && entry.excepts(choice)) continue;
        EXPECT_EQ(isInvalid(done), !isValue(value)) << (done ? "ok" : done.error().message);
        EXPECT_TRUE(isValue(value) || mock.alive["Pipeline"] == pipelines);
      }
    }
  }

  OwnedMesh source_ = [] {
    OwnedMesh mesh = randomMesh(1, vertexCount, jointCount, 4);
    addTangents(mesh, 2);
    return mesh;
  }();
  PackedMesh packed_ = must(pack(source_.view(), jointCount));
  cpu::Mesh mesh_ = must(cpu::Mesh::create(packed_));
  Pose pose_ = systemPose(1, jointCount);
  Box box_{{-100, -100, -100}, {100, 100, 100}};
  std::vector<std::byte> output_{4 * 16 * (vertexCount + 3)};
  std::optional<PlannedScene> planned_;
  Scene* scene_ = nullptr;
  std::optional<cpu::SceneRunner> runner_;
  InstanceDescription instance_, ofRunner_;
};

TEST_F(EnumValuesTest, MethodsPromisesFormatsAndLayoutsAreChecked) {
  const auto isFormat = [](bool (*allows)(VertexFormat), bool mayBeNone) {
    return [=](std::uint32_t value) {
      return allows(number<VertexFormat>(value)) || (mayBeNone && value == 0);
    };
  };
  expectChecked(
      "method", [](Choice& choice, std::uint32_t value) { choice.method = number<Method>(value); },
      [](std::uint32_t value) { return value < allMethods.size(); });
  expectChecked(
      "promise",
      [](Choice& choice, std::uint32_t value) { choice.promise = number<JointPromise>(value); },
      [](std::uint32_t value) { return value < 3; });
  expectChecked(
      "positions",
      [](Choice& choice, std::uint32_t value) {
        choice.layout.positions = number<VertexFormat>(value);
      },
      isFormat(isPositionFormat, false));
  expectChecked(
      "normals",
      [](Choice& choice, std::uint32_t value) {
        choice.layout.normals = number<VertexFormat>(value);
      },
      isFormat(isNormalFormat, true));
  expectChecked(
      "tangents",
      [](Choice& choice, std::uint32_t value) {
        choice.layout.tangents = number<VertexFormat>(value);
      },
      isFormat(isTangentFormat, true));
}

// An ID has few bits for each member. A number that no plan uses must not become a pipeline, and
// one that spills into the next member would stand for another, by which instances would then be
// skinned wrong.
TEST_F(EnumValuesTest, NoVariantPoisonsThePipelinesOfAnother) {
  const auto expectOnly = [&](auto member, std::set<std::uint32_t> good, std::uint32_t end,
                              const char* name) {
    for (std::uint32_t value = 0; value < end; ++value) {
      SCOPED_TRACE(name + (" " + std::to_string(value)));
      Variant variant;
      variant.*member = static_cast<std::remove_reference_t<decltype(variant.*member)>>(value);
      const PipelineId id = variant.id();
      ASSERT_EQ(variantOf(id), variant);
      const int pipelines = mock.alive["Pipeline"];
      EXPECT_EQ(isInvalid(context->prepare({&id, 1})), !good.contains(value));
      EXPECT_EQ(isInvalid(vulkan::pipelineDescription(id)), !good.contains(value));
      EXPECT_TRUE(good.contains(value) || mock.alive["Pipeline"] == pipelines);
    }
  };
  // To the end of what the bits of each can hold.
  expectOnly(&Variant::kernel, {0, 1, 2, 3, 4, 5, 6, 7}, 8, "kernel");
  expectOnly(&Variant::method, {0, 1, 2, 3, 4, 5, 6, 7, 8}, 16, "method");
  expectOnly(&Variant::positions, {1, 2, 3, 4, 5, 6}, 16, "positions");
  expectOnly(&Variant::motion, {0, 1}, 2, "motion");
  expectOnly(&Variant::rigid, {0}, 2, "rigid");  // which palette kernels alone have
  expectOnly(&Variant::recordBytes, {0, 8, 12, 16, 24, 32}, 64, "recordBytes");
  expectOnly(&Variant::influences, {0, 1, 2, 4}, 8, "influences");
  expectOnly(&Variant::workgroupSize, {8, 16, 32, 64, 128}, 256, "workgroupSize");
  std::set<std::uint32_t> upTo32;
  for (std::uint32_t instances = 1; instances <= 32; ++instances) upTo32.insert(instances);
  expectOnly(&Variant::instancesPerInvocation, upTo32, 64, "instancesPerInvocation");
  // Tunings that plans refuse have no pipelines, for the same reason.
  for (const Tuning& tuning : {Tuning{.workgroupSize = 65600}, Tuning{.workgroupSize = 256},
                               Tuning{.instancesPerInvocation = 64}}) {
    EXPECT_TRUE(isInvalid(pipelines(needs({}), {}, tuning)));
    EXPECT_TRUE(isInvalid(pipelines(job({}), {}, tuning)));
  }
}

TEST_F(EnumValuesTest, RolesAndWritersAreChecked) {
  Plan plan;
  for (std::uint32_t value = 0; value < 256; ++value) {
    SCOPED_TRACE(value);
    const auto role = number<BufferRole>(value);
    const bool isRole = value < bufferRoleCount;
    EXPECT_EQ(isInvalid(vulkan::SceneRecorder::requirement(*context, {}, role)), !isRole);
    if (!isRole) {
      EXPECT_EQ(plan.buffer(role).size, 0u);
    }
  }
}

TEST_F(EnumValuesTest, ComponentTypesAreChecked) {
  struct Member {
    std::function<AttributeView&(MeshView&, InfluenceSet&)> of;
    std::set<ComponentType> allowed;
  };
  using enum ComponentType;
  const std::set<ComponentType> directions{float32, float16, snorm8, snorm16};
  const std::set<ComponentType> shares{float32, unorm8, unorm16};
  const std::array<Member, 8> members{
      {{[](MeshView& view, InfluenceSet&) -> AttributeView& { return view.positions; },
        {float32, float16, snorm16, unorm16}},
       {[](MeshView& view, InfluenceSet&) -> AttributeView& { return view.normals; }, directions},
       {[](MeshView& view, InfluenceSet&) -> AttributeView& { return view.tangents; }, directions},
       {[](MeshView&, InfluenceSet& set) -> AttributeView& { return set.joints; },
        {float32, uint8, uint16, uint32}},
       {[](MeshView&, InfluenceSet& set) -> AttributeView& { return set.weights; }, shares},
       {[](MeshView& view, InfluenceSet&) -> AttributeView& { return view.dualQuaternionWeights; },
        shares},
       {[](MeshView& view, InfluenceSet&) -> AttributeView& { return view.bulgeStrengths; },
        shares},
       {[](MeshView& view, InfluenceSet&) -> AttributeView& { return view.centersOfRotation; },
        {float32}}}};
  const std::array<std::uint32_t, 3> triangle{0, 1, 2};
  for (std::size_t index = 0; index < members.size(); ++index) {
    for (std::uint32_t value = 0; value < 256; ++value) {
      MeshView view = source_.view();
      InfluenceSet set = view.influenceSets[0];
      view.influenceSets = {&set, 1};
      members[index].of(view, set).type = number<ComponentType>(value);
      if (members[index].allowed.contains(number<ComponentType>(value))) continue;
      SCOPED_TRACE("attribute " + std::to_string(index) + ", type " + std::to_string(value));
      EXPECT_FALSE(validate(view, jointCount).repairable());
      EXPECT_FALSE(repair(view, jointCount).ok());
      EXPECT_FALSE(pack(view, jointCount).ok());
      EXPECT_FALSE(jointBounds(view, jointCount).ok());
      EXPECT_FALSE(reference::skin(view, pose_, Method::linear).ok());
      const bool isCenter = index + 1 == members.size();  // which the solver ignores
      EXPECT_EQ(CenterOfRotationSolver::make(view, jointCount, triangle).ok(), isCenter);
    }
  }
}

TEST_F(EnumValuesTest, FunctionsThatCannotFailHaveAnAnswerForEveryNumber) {
  const std::array<std::byte, 16> bytes{};
  for (std::uint32_t value = 0; value < 256; ++value) {
    SCOPED_TRACE(value);
    const auto method = number<Method>(value);
    const auto format = number<VertexFormat>(value);
    if (value >= allMethods.size()) {
      EXPECT_EQ(methodName(method), "unknown");
      EXPECT_FALSE(isForComparison(method) || needsCentersOfRotation(method));
      EXPECT_EQ(skinnedBounds({}, pose_, method).max[0], INFINITY);
    }
    if (value > allVertexFormats.size()) {
      EXPECT_EQ(formatSize(format), 0u);
      EXPECT_EQ(formatAlignment(format), 1u);
      EXPECT_EQ(formatName(format), formatName(VertexFormat::none));
      EXPECT_FALSE(isPositionFormat(format) || isNormalFormat(format) || isTangentFormat(format));
      EXPECT_EQ(decodePosition(format, bytes.data(), box_), (std::array<double, 3>{}));
      EXPECT_EQ(decodeNormal(format, bytes.data()), (std::array<double, 3>{}));
      EXPECT_EQ(decodeTangent(format, bytes.data()), (std::array<double, 4>{}));
      EXPECT_EQ(vulkan::vertexInputFormat(format), VK_FORMAT_UNDEFINED);
      EXPECT_EQ(vulkan::buildInputFormat(format), VK_FORMAT_UNDEFINED);
      EXPECT_FALSE(vulkan::buildInput({0, 16, format}, 1, 16).ok());
      EXPECT_EQ(positionFormatBound(format, {1, 1, 1}, box_), 0);
      EXPECT_EQ(normalFormatBound(format), 0);
      EXPECT_EQ(tangentFormatBound(format), 0);
    }
    EXPECT_EQ(componentSize(number<ComponentType>(value)) == 0, value > 8);
    EXPECT_EQ(errorCodeName(number<ErrorCode>(value)) == "unknown", value > 11);
    const auto problem = number<MeshProblem>(value);
    EXPECT_EQ(meshProblemName(problem) == std::string("unknown"), value > 21);
    EXPECT_TRUE(value < 22 || !refusedByPack(problem));
    EXPECT_EQ(MeshReport().find(problem), nullptr);

    EXPECT_EQ(poseMistakeName(number<PoseMistake>(value)) == std::string("unknown"),
              value == 1 || value > 15)
        << poseMistakeName(number<PoseMistake>(value));

    // Barriers that Vulkan accepts: with stages on both sides.
    const auto use = static_cast<Use>(value << 8);
    for (const vulkan::Barrier& barrier :
         {vulkan::barrierBetween(use, Use::dermis), vulkan::barrierBetween(Use::dermis, use),
          vulkan::barrierBetween(use, use, number<vulkan::QueueTransfer>(value))}) {
      EXPECT_NE(barrier.sourceStages, 0u);
      EXPECT_NE(barrier.destinationStages, 0u);
    }

    ShaderCompiler compiler;
    ShaderSource shader{"s", "void main() {}", number<ShaderStage>(value), {}};
    EXPECT_TRUE(value <= 2 || isInvalid(compiler.compile(shader)));

    const gltf::LoadOptions options{.missingNormals = number<gltf::MissingNormals>(value)};
    EXPECT_EQ(isInvalid(gltf::loadFromMemory({}, {}, options)), value > 2);

    gltf::Model model;
    model.nodes.resize(1);
    model.nodeOrder = {0};
    gltf::Channel channel{
        0,      gltf::ChannelPath::translation, number<gltf::Interpolation>(value), 3,
        {0, 1}, std::vector<float>(18, 1.0f)};
    model.clips.resize(1);
    model.clips[0].channels = {channel};
    EXPECT_EQ(gltf::nodeGlobals(model, 0, 0.5)[0][0][3], 1);
    model.clips[0].channels[0].path = number<gltf::ChannelPath>(value);
    if (value > 3) {
      EXPECT_EQ(gltf::nodeGlobals(model, 0, 0.5), gltf::nodeGlobals(model, noIndex, 0));
      EXPECT_TRUE(gltf::morphWeights(model, 0, 0, 0.5).empty());
    }
  }
}

TEST_F(EnumValuesTest, MorphWritersAreChecked) {
  for (std::uint32_t value = 3; value < 256; ++value) {
    InstanceDescription instance = instance_;
    instance.morphWriter = number<MorphWriter>(value);
    for (const Result<void>& refused :
         {add(*scene_, instance), verdict(scene_->pipelineNeeds(instance))}) {
      ASSERT_FALSE(refused.ok()) << value;
      EXPECT_NE(refused.error().message.find("morphWriter"), std::string::npos);
    }
  }
}

/// A new enum is missing here, and so are the functions that take it.
TEST_F(EnumValuesTest, NoEnumIsMissing) {
  const std::set<std::string> known{
      "Method", "VertexFormat", "PipelineId", "BufferRole", "ComponentType", "MeshProblem",
      "ErrorCode", "Use", "QueueTransfer", "PoseMistake", "ShaderStage", "Interpolation",
      "ChannelPath", "MissingNormals", "JointPromise", "MorphWriter",
      // No function reads one: an index of arrays, and what functions return or pass on.
      "Stream", "BufferUse", "AlphaMode", "Wrap"};
  std::set<std::string> found;
  const std::regex declaration("enum class (\\w+)");
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           std::filesystem::path(sourceFolder) / "engine/include")) {
    std::ifstream file(entry.path());
    for (std::string line; std::getline(file, line);) {
      std::smatch match;
      if (std::regex_search(line, match, declaration)) found.insert(match[1]);
    }
  }
  EXPECT_EQ(found, known);
}

/// Files and other languages store the numbers: inserting a value must not change the others.
TEST_F(EnumValuesTest, EveryValueIsWritten) {
  const std::regex declaration("enum class \\w+ : std::uint\\d+_t \\{([^}]*)\\};");
  const std::regex comment("//[^\n]*"), value("\\s*\\w+ = \\d+\\s*"), space("\\s*");
  int enums = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(
           std::filesystem::path(sourceFolder) / "engine/include")) {
    if (!entry.is_regular_file()) continue;
    std::ifstream file(entry.path());
    std::string text(std::istreambuf_iterator<char>(file), {});
    text = std::regex_replace(text, comment, "");
    for (std::sregex_iterator match(text.begin(), text.end(), declaration), end; match != end;
         ++match, ++enums) {
      std::istringstream values((*match)[1]);
      for (std::string one; std::getline(values, one, ',');)
        EXPECT_TRUE(std::regex_match(one, value) || std::regex_match(one, space)) << one;
    }
  }
  EXPECT_GT(enums, 15);
}

}  // namespace
}  // namespace dermis::test
