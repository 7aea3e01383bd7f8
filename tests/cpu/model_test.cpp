// Random steps on the CPU beside the model (model_steps.h).
#include <gtest/gtest.h>

#include <array>
#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "cpu_engine.h"
#include "dermis/cpu.h"
#include "model_steps.h"

namespace dermis::test {
namespace {

class CpuModelTest : public ::testing::TestWithParam<std::uint32_t>, public ModelSteps<CpuEngine> {
 protected:
  CpuModelTest() : ModelSteps(GetParam()) {}

  void makeEngine() override {
    SceneDescription small;
    small.jointCapacity = {8, 8 * 40};
    small.instanceCapacity = instanceCapacity;
    small.boundsCapacity = Capacity::fixed(boundsCapacity);
    small.outputCapacity = outputCapacity;
    engine_.emplace(small);
    engine_->verticesPerJob = GetParam() % 2 == 0 ? 1 << 16 : 24;
  }
  Result<void> tryToPrepare(const InstanceDescription&) override { return {}; }
  Result<void> trySubmit() override {
    engine_->submit();
    return {};
  }
  void addRefusedCalls(std::vector<RefusedCall>& calls) override {
    const auto add = [&](auto set) {
      InstanceDescription wrong = anyInstance().description;
      set(wrong);
      calls.push_back({[this, wrong] { return withoutValue(system().addInstance(wrong)); }});
    };
    add([](InstanceDescription& wrong) { wrong.culledOnGpu = true; });
    add([](InstanceDescription& wrong) { wrong.method = Method::logMatrix; });
    const InstanceChange wrong{.instance = anyInstance().handle, .method = Method::logMatrix};
    calls.push_back({[this, wrong] { return system().change(wrong); }});
    calls.push_back({[this, wrong] { return system().change({&wrong, 1}); }});
    calls.push_back({[this] { return withoutValue(system().addPose(8, {.writtenByGpu = true})); }});
    calls.push_back({[this] { return system().abandonFrame(engine_->frame()); }});
    calls.push_back({[] {
      static std::array<std::byte, 3> few;
      return withoutValue(cpu::SceneRunner::create({}, few));
    }});
  }
  std::vector<RefusedCall> callsBetweenFrames() override {
    return {{[this] { return withoutValue(engine_->runner().jobs()); }},
            {[this] { return withoutValue(system().writePose({})); }}};
  }
  void abandon() override {
    engine_->abandon([this] { changeMeanwhile(); });
  }
  std::uint64_t outputNow() override {
    return reinterpret_cast<std::uintptr_t>(engine_->runner().output().data());
  }
  std::vector<JointMatrix> sampleAlone(std::uint32_t play, std::uint32_t skin) override {
    return playedPose(play, skin);
  }
  std::vector<JointMatrix> driveAlone(std::span<const JointMatrix> written) override {
    std::vector<JointMatrix> all(written.begin(), written.end());
    const Driven driven = evaluated(smallRig(), written, {});
    all.insert(all.end(), driven.joints.begin(), driven.joints.end());
    return all;
  }
  Streams skinAlone(const PackedMesh& mesh, std::span<const JointMatrix> pose,
                    const InstanceDescription& description,
                    std::span<const MorphWeight> morphs) override {
    VertexLayout layout = description.layout;
    const bool hasPrevious = std::exchange(layout.motion, false);
    cpu::Instance instance;
    instance.pose = pose;
    instance.morphs = morphs;
    instance.box = description.box;
    const std::vector<std::byte> bytes = skinOne(mesh, description.method, layout, instance);
    const VertexPlaces places = must(placeVertices(layout, mesh.vertexCount()));
    const std::array<OutputAttribute, streamCount> attributes{
        places[Stream::positions], places[Stream::normals], places[Stream::tangents], {}};
    Streams streams;
    for (std::size_t stream = 0; stream < previousStream; ++stream)
      streams[stream] = readAttribute(bytes, attributes[stream], mesh.vertexCount());
    if (hasPrevious) streams[previousStream] = streams[positionStream];
    return streams;
  }
};

TEST_P(CpuModelTest, EveryStepGivesWhatTheModelSays) {
  run();
  std::set<std::string> texts = errorTexts("cpu/scene_runner.cpp");
  texts.merge(errorTexts("core/scene/figures.cpp"));
  texts.merge(errorTexts("core/scene/rigs.cpp"));
  EXPECT_GE(texts.size(), 3u);
  // On the CPU clips and rigs have no buffer.
  std::erase_if(texts, [](const std::string& text) {
    return text == "the clips take " || text == "bytes of meshes and clips" ||
           text == "the rig takes " || text == "bytes of meshes, clips and rigs";
  });
  expectAllGiven(texts);
}
INSTANTIATE_TEST_SUITE_P(Seeds, CpuModelTest, ::testing::Values(1u, 2u, 3u));

}  // namespace
}  // namespace dermis::test
