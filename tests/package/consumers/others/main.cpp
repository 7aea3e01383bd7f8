// Compiles the installed kernels at run time, and reads glTF from memory: a skinned and morphed
// triangle, viewed, packed and skinned on the CPU.
//
//   others_consumer SHADERS

#include <cstddef>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <vector>

#include "abi.h"
#include "dermis/compilers.h"
#include "dermis/cpu.h"
#include "dermis/gltf.h"
#include "dermis/mesh.h"
#include "dermis/plan.h"
#include "dermis/verify.h"
#include "dermis/vulkan/context.h"
#ifdef HAS_RUNTIME_COMPILER
#endif

namespace {

using namespace dermis;

int fail(const Error& error) {
  std::printf("%s\n", error.message.c_str());
  return 1;
}

Result<gltf::Model> read(std::string_view text) {
  return gltf::loadFromMemory(std::as_bytes(std::span(text)), {});
}

/// Positions, joints and weights of three vertices, which are their own displacements too; the
/// joint stands at z = 3.
constexpr std::string_view triangle =
    R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,1]}],)"
    R"("nodes":[{"mesh":0,"skin":0},{"translation":[0,0,3]}],"skins":[{"joints":[1]}],)"
    R"("meshes":[{"weights":[0.5],"primitives":[{"attributes":{"POSITION":0,"JOINTS_0":1,)"
    R"("WEIGHTS_0":2},"targets":[{"POSITION":0}]}]}],"buffers":[{"byteLength":96,)"
    R"("uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA)"
    R"(AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAIA/AAAAAAAAAAAAAAAA"}],)"
    R"("bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12},)"
    R"({"buffer":0,"byteOffset":48,"byteLength":48}],"accessors":[{"bufferView":0,)"
    R"("componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},)"
    R"({"bufferView":1,"componentType":5121,"count":3,"type":"VEC4"},)"
    R"({"bufferView":2,"componentType":5126,"count":3,"type":"VEC4"}]})";

/// Whether every vertex of the triangle is half as far out again, at z = 3.
Result<bool> skinTriangle() {
  const Result<gltf::Model> model = read(triangle);
  if (!model) return model.error();
  const gltf::SkinnedPrimitive& skinned = model->skinnedPrimitives.at(0);
  const gltf::PrimitiveView view(model->meshes[skinned.mesh].primitives[skinned.primitive]);
  const Result<PackedMesh> packed = pack(view.mesh(), 1);
  if (!packed) return packed.error();
  const std::vector<JointMatrix> palette = gltf::pose(*model, skinned.skin, noIndex, 0);
  const std::vector<float> weights = gltf::morphWeights(*model, skinned.node, noIndex, 0);
  const MorphWeight morph{0, weights.at(0)};
  const auto vertices = reference::skin(view.mesh(), palette, Method::dualQuaternion, {&morph, 1});
  if (!vertices) return vertices.error();
  const std::vector<reference::Double3> expected{{0, 0, 3}, {1.5, 0, 3}, {0, 1.5, 3}};
  if (packed->info().morphTargetCount != 1 || vertices->positions != expected) return false;

  const Result<cpu::Mesh> mesh = cpu::Mesh::create(*packed);
  const Result<VertexPlaces> places = placeVertices({}, 3);
  if (!mesh || !places) return false;
  float skinnedFloats[3][3] = {};
  cpu::Instance instance;
  instance.pose = palette;
  instance.output.fill(skinnedFloats);
  instance.morphs = {&morph, 1};
  cpu::Job job;
  job.mesh = &*mesh;
  job.places = *places;
  job.instances = {&instance, 1};
  if (const Result<void> done = cpu::skin(job); !done) return done.error();
  const auto isExpected = [&] {
    for (std::size_t vertex = 0; vertex < 9; ++vertex) {
      if (static_cast<double>(skinnedFloats[vertex / 3][vertex % 3]) !=
          expected[vertex / 3][vertex % 3])
        return false;
    }
    return true;
  };
  if (!isExpected()) return false;

  // The same in a scene.
  SceneDescription description;
  Result<cpu::SceneRunner> scene =
      cpu::SceneRunner::create(description, std::as_writable_bytes(std::span(skinnedFloats)));
  if (!scene) return scene.error();
  InstanceDescription inScene;
  inScene.mesh = *scene->scene().addMesh(*packed);
  inScene.pose = *scene->scene().addPose(1);
  const Result<InstanceHandle> added = scene->scene().addInstance(inScene);
  if (!added) return added.error();
  const Result<void> morphed = scene->scene().change({.instance = *added, .morphs = {{&morph, 1}}});
  if (!morphed) return morphed.error();
  if (const Result<void> begun = scene->scene().beginFrame(1, 0); !begun) return begun.error();
  scene->scene().writePose(inScene.pose)->front() = palette.front();
  std::memset(skinnedFloats, 0, sizeof(skinnedFloats));
  for (const cpu::PlannedJob& planned : *scene->jobs()) cpu::run(planned);
  return isExpected();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  ShaderCompiler compiler;
  std::size_t kernels = 0;
  for (const auto& entry : std::filesystem::directory_iterator(argv[1])) {
    if (entry.path().extension() != ".comp") continue;
    const auto words = compiler.compileFile(entry.path());
    if (!words) return fail(words.error());
    ++kernels;
  }
  std::printf("%zu kernels\n", kernels);
  if (kernels < 2) return 2;
  ShaderSource broken;
  broken.name = "broken.comp";
  broken.text = "#version 450\nvoid main() { nonsense }\n";
  const auto refused = compiler.compile(broken);
  if (refused || refused.error().code != ErrorCode::shaderError) return 3;
  std::printf("%s\n", refused.error().message.c_str());

#ifdef HAS_RUNTIME_COMPILER
  const Result<RuntimeCompiler> runtime = RuntimeCompiler::create(argv[1]);
  if (!runtime) return fail(runtime.error());
  const vulkan::KernelSource source = runtime->source();
  if (const auto palette = source.get(source.user, "palette"); !palette)
    return fail(palette.error());
#endif

  const Result<bool> right = skinTriangle();
  if (!right) return fail(right.error());
  if (!*right) return 4;
  const Result<gltf::Model> nonsense = read("{");
  if (nonsense) return 5;
  std::printf("%s\n", nonsense.error().message.c_str());
  return abi::BINDING_COUNT == storageBuffersWanted ? 0 : 6;
}
