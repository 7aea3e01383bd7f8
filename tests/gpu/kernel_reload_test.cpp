// Kernels that are edited while a program runs: what changes on the device, and what does not.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "dermis/compilers.h"
#include "kit/batch_runner.h"
#include "plan/variant.h"
#include "shader_folder.h"
#include "system_test.h"

namespace dermis::test {
namespace {

class KernelReloadTest : public SystemTest {
 protected:
  void SetUp() override {
    SystemTest::SetUp();
    if (IsSkipped() || HasFatalFailure()) return;
    folder_.emplace(::testing::UnitTest::GetInstance()->current_test_info()->name());
    // [create]
    // The folder of the GLSL files, and one for compiled modules (here none).
    compiler_.emplace(must(RuntimeCompiler::create(folder_->path())));
    vulkan::DeviceDescription description = device().description();
    description.kernelSource = compiler_->source();
    context_.emplace(must(vulkan::Context::create(description)));
    // [/create]
  }

  PipelineId helper(Kernel kernel) const;
  RuntimeCompiler::Reload reload() {
    ++frame_;
    return must(compiler_->reload(*context_, frame_, frame_ - 1));
  }
  /// The message that an edit leads to.
  std::string refusal() {
    ++frame_;
    const Result<RuntimeCompiler::Reload> reload = compiler_->reload(*context_, frame_, frame_ - 1);
    EXPECT_FALSE(reload.ok());
    return reload ? std::string() : reload.error().message;
  }

  std::optional<ShaderFolder> folder_;
  std::optional<RuntimeCompiler> compiler_;
  std::optional<vulkan::Context> context_;
  std::uint64_t frame_ = 0;
};

std::vector<float> floatsOf(const std::vector<std::byte>& bytes) {
  std::vector<float> floats(bytes.size() / sizeof(float));
  std::memcpy(floats.data(), bytes.data(), floats.size() * sizeof(float));
  return floats;
}

/// Positions one to the right of others.
void expectMoved(const std::vector<std::byte>& positions, const std::vector<std::byte>& from) {
  const std::vector<float> moved = floatsOf(positions), before = floatsOf(from);
  ASSERT_EQ(moved.size(), before.size());
  ASSERT_FALSE(moved.empty());
  for (std::size_t i = 0; i < moved.size(); ++i)
    ASSERT_EQ(moved[i], i % 3 == 0 ? before[i] + 1.0f : before[i]) << i;
}

bool namesOnly(const std::vector<std::string>& modules, const std::string& beginning) {
  return !modules.empty() && std::ranges::all_of(modules, [&](const std::string& name) {
    return name.starts_with(beginning);
  });
}

// Tier 1.
TEST_F(KernelReloadTest, AnEditedKernelSkinsOtherwiseAndABrokenOneIsNotUsed) {
  OwnedMesh mesh = randomMesh(1, 200, 8, 4);
  const PackedMesh packed = must(pack(mesh.view(), 8));
  const std::vector<JointMatrix> pose = randomPose(2, 8, Rigidity::rigid);
  const samples::SkinRequest request{&packed, pose};
  const auto skin = [&] {
    return must(samples::runBatch(device(), *context_, {&request, 1})).instances[0].streams;
  };
  const Streams original = skin();
  EXPECT_EQ(original,
            must(samples::runBatch(device(), context(), {&request, 1})).instances[0].streams)
      << "the library's kernels";
  static_cast<void>(reload());  // files that were written just now may be read once more
  const std::uint32_t compiled = compiler_->compiledModules();
  EXPECT_EQ(reload().changed, 0u);

  folder_->edit("skin.comp", ShaderFolder::storedPosition, ShaderFolder::movedPosition);
  EXPECT_EQ(skin(), original) << "not before the reload";
  const RuntimeCompiler::Reload moved = reload();
  EXPECT_TRUE(namesOnly(moved.replaced, "skin")) << moved.replaced.size();
  EXPECT_EQ(moved.replaced.size(), moved.changed);
  EXPECT_EQ(compiler_->compiledModules(), compiled + moved.changed) << "not the palette's";
  EXPECT_GE(moved.pipelines, moved.replaced.size());
  expectMoved(skin()[positionStream], original[positionStream]);
  EXPECT_EQ(skin()[normalStream], original[normalStream]);

  const int line =
      folder_->edit("skin.comp", ShaderFolder::movedPosition, ShaderFolder::brokenPosition);
  const std::string message = refusal();
  EXPECT_TRUE(message.starts_with((folder_->path() / "skin.comp").string() + ":" +
                                  std::to_string(line) + ": "))
      << message;
  EXPECT_NE(message.find("positron"), std::string::npos) << message;
  EXPECT_EQ(reload().changed, 0u) << "it is said once";
  expectMoved(skin()[positionStream], original[positionStream]);

  // Another file's change does not come alone.
  folder_->edit("quaternion.glsl", "#ifndef DERMIS_QUATERNION_GLSL",
                "// Changed.\n#ifndef DERMIS_QUATERNION_GLSL");
  EXPECT_NE(refusal().find("positron"), std::string::npos);
  folder_->edit("skin.comp", ShaderFolder::brokenPosition, ShaderFolder::storedPosition);
  const RuntimeCompiler::Reload mended = reload();
  EXPECT_TRUE(namesOnly(mended.replaced, "skin")) << "a comment in quaternion.glsl changes no word";
  EXPECT_GT(mended.changed, mended.replaced.size());
  EXPECT_EQ(skin(), original);
}

/// The pipeline of a kernel that needs nothing but its name.
PipelineId KernelReloadTest::helper(Kernel kernel) const {
  return Variant{.kernel = kernel,
                 .oneOutput = context_->limits().maxStorageBuffersPerStage < storageBuffersWanted}
      .id();
}

TEST_F(KernelReloadTest, AFileThatIsMissingForAWhileOrOfAnotherVersionIsNotUsed) {
  const PipelineId palette = helper(Kernel::palette);
  must(context_->prepare({&palette, 1}));
  static_cast<void>(reload());
  std::filesystem::rename(folder_->path() / "quaternion.glsl", folder_->path() / "quaternion");
  EXPECT_NE(refusal().find("quaternion.glsl"), std::string::npos);
  std::filesystem::rename(folder_->path() / "quaternion", folder_->path() / "quaternion.glsl");
  EXPECT_EQ(reload().changed, 1u);
  folder_->edit("abi.h", "BINDING_TABLES = 0u", "BINDING_TABLES = 7u");
  EXPECT_NE(refusal().find("abi.h"), std::string::npos);
  folder_->edit("abi.h", "BINDING_TABLES = 7u", "BINDING_TABLES = 0u");
  const RuntimeCompiler::Reload again = reload();
  EXPECT_EQ(again.changed, 1u);
  EXPECT_TRUE(again.replaced.empty());
}

// The compiler may have read what it held before.
TEST_F(KernelReloadTest, AFileThatIsWrittenDuringItsFirstCompilationIsReadAgain) {
  namespace fs = std::filesystem;
  const auto now = fs::file_time_type::clock::now();
  for (const auto& file : fs::directory_iterator(folder_->path()))
    fs::last_write_time(file, now - std::chrono::hours(1));
  const PipelineId clear = helper(Kernel::clear);
  must(context_->prepare({&clear, 1}));
  EXPECT_EQ(reload().changed, 0u);
  fs::last_write_time(folder_->path() / "palette.comp", now + std::chrono::hours(1));
  const PipelineId palette = helper(Kernel::palette);
  must(context_->prepare({&palette, 1}));
  EXPECT_EQ(reload().changed, 1u);
  EXPECT_EQ(reload().changed, 0u);
}

// Tier 2, with a frame under way that uses the old pipelines. The validation layer says where one
// is destroyed too early.
TEST_F(KernelReloadTest, ASystemIsReloadedBetweenTwoFrames) {
  vulkan::SceneRecorderDescription system = description();
  SingleInstance single(device(), *context_, system, plainLayout());
  SystemEngine& engine = single.engine;
  engine.submit();
  const Streams original = engine.read(single.instance);
  static_cast<void>(
      must(compiler_->reload(*context_, engine.frame() + 1, engine.completedFrame())));

  const auto runFrame = [&] {
    engine.begin(1);
    engine.writePose(single.description.pose, systemPose(1));
    engine.submit();
  };
  runFrame();
  folder_->edit("skin.comp", ShaderFolder::storedPosition, ShaderFolder::movedPosition);
  const RuntimeCompiler::Reload moved =
      must(compiler_->reload(*context_, engine.frame() + 1, engine.completedFrame()));
  EXPECT_TRUE(namesOnly(moved.replaced, "skin"));
  for (int frame = 0; frame < 4; ++frame) {
    runFrame();
    static_cast<void>(
        must(compiler_->reload(*context_, engine.frame() + 1, engine.completedFrame())));
  }
  expectMoved(engine.read(single.instance)[positionStream], original[positionStream]);

  // What is prepared from now on is of the new kernels, too.
  InstanceDescription other = single.description;
  other.layout.normals = VertexFormat::none;
  engine.begin(1);
  const InstanceHandle later = engine.addInstance(other);
  engine.submit();
  expectMoved(engine.read(later)[positionStream], original[positionStream]);
  engine.finish();
}

}  // namespace
}  // namespace dermis::test
