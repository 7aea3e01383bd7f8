// `dermis diagnose`: its exit status, and what it says of poses in files.

#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "dermis/gltf.h"
#include "dermis_command.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

const std::string figurePath = std::string(sampleModels) + "/figure.glb";

/// The pose of the figure at a time of its first clip.
std::vector<JointMatrix> poseOfFigure(double time) {
  const Result<gltf::Model> model = gltf::load(figurePath);
  if (!model) return {};
  return gltf::pose(*model, model->skinnedPrimitives.at(0).skin, 0, time);
}

std::string writePose(const std::string& name, const std::vector<JointMatrix>& pose) {
  const std::string path = outFile(name);
  std::ofstream file(path);
  file << "# joint matrices\n\n";
  for (const JointMatrix& matrix : pose) {
    for (const auto& row : matrix.m)
      for (const float value : row) file << value << ' ';
    file << '\n';
  }
  return path;
}

TEST(DiagnoseCommandTest, TheModelsOwnPoseIsPlausible) {
  for (const std::string time : {"0", "0.7"}) {
    const CommandResult result = dermis({"diagnose", figurePath, "--time", time});
    EXPECT_EQ(result.status, 0) << result.output << result.errors;
    EXPECT_TRUE(result.output.starts_with("plausible  ")) << result.output;
  }
}

TEST(DiagnoseCommandTest, APoseOfAFileIsPlausibleOrWrong) {
  std::vector<JointMatrix> pose = poseOfFigure(0.7);
  const CommandResult sound =
      dermis({"diagnose", figurePath, "--pose", writePose("sound.txt", pose)});
  EXPECT_EQ(sound.status, 0) << sound.output << sound.errors;
  EXPECT_NE(sound.output.find("not tested: root transform missing: pass "), std::string::npos)
      << sound.output;

  for (JointMatrix& matrix : pose) {
    const JointMatrix right = matrix;
    for (std::size_t i = 0; i < 12; ++i) matrix.m[i / 4][i % 4] = right.m[i % 3][i / 3];
  }
  const std::string wrong = writePose("wrong.txt", pose);
  for (const std::vector<std::string>& more :
       {std::vector<std::string>{}, std::vector<std::string>{"--time", "0.7"}}) {
    std::vector<std::string> arguments{"diagnose", figurePath, "--pose", wrong};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const CommandResult result = dermis(arguments);
    EXPECT_EQ(result.status, 1) << result.output << result.errors;
    EXPECT_TRUE(result.output.starts_with("WRONG  ")) << result.output;
    EXPECT_NE(result.output.find(": the 12 floats of the joint matrices are in column-major order"),
              std::string::npos)
        << result.output;
  }
}

TEST(DiagnoseCommandTest, WrongFilesAreRefused) {
  const auto refused = [](const std::string& text, const std::string& complaint) {
    const std::string path = outFile("refused.txt");
    std::ofstream(path) << text;
    const CommandResult result = dermis({"diagnose", figurePath, "--pose", path});
    EXPECT_EQ(result.status, 3);
    expectOneErrorLine(result);
    EXPECT_NE(result.errors.find(complaint), std::string::npos) << result.errors;
  };
  refused("1 0 0 0 0 1 0 0 0 0 1 0\n", "has 1 joint matrices; no skin of ");
  refused("# nothing\n", "has 0 joint matrices");
  refused("1 0 0 0 0 1 0 0 0 0 1 0\n1 2 3\n",
          "line 2: a joint matrix has 12 numbers, row by row; this line has 3");
  refused("1 0 0 0 0 one 0 0 0 0 1 0\n", "line 1: 'one' is not a number");
  const CommandResult absent = dermis({"diagnose", figurePath, "--pose", outFile("absent.txt")});
  EXPECT_EQ(absent.status, 3);
  expectOneErrorLine(absent);
  EXPECT_EQ(dermis({"diagnose", figurePath, "--time", "nan"}).status, 2);
}

}  // namespace
}  // namespace dermis::test
