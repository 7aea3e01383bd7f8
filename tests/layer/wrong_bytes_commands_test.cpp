// One wrong byte in what the device wrote, and whoever checks it says so: `dermis verify` with its
// reports, the crowd, the sample that embeds Dermis. They know nothing of the layer behind which
// they run.

#include <gtest/gtest.h>

#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "dermis/layout.h"
#include "dermis_command.h"
#include "wrong_bytes.h"

namespace dermis::test {
namespace {

/// `plants` as in wrong_bytes_layer.cpp.
CommandResult runWithWrongBytes(const std::vector<std::string>& command,
                                const std::string& plants) {
  return runCommand(command, {std::string("VK_LAYER_PATH=") + DERMIS_LAYER_FOLDER,
                              std::string("VK_INSTANCE_LAYERS=") + wrongBytesLayer,
                              "DERMIS_WRONG_BYTES=" + plants});
}

std::string readText(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

std::size_t countOf(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + 1))
    ++count;
  return count;
}

// Of the first pose, the second way to cut up the work: the sign and exponent of vertex 0's x. And
// a bit of an exponent of the first pose of clips that is read back, the rest pose. This is the
// only whole `verify` on a device that every change runs, so all other cases are held to pass.
TEST(WrongBytesCommandsTest, VerifyTellsWhichVertexAndWhichPoseOfAClipAreWrong) {
  REQUIRE_DEVICE();
  const std::string bar = std::string(sampleModels) + "/bar.glb";
  const std::string json = outFile("verify.json"), junit = outFile("verify.xml");
  const CommandResult result = runWithWrongBytes(
      {dermisProgram, "verify", bar, "--threads", "1", "--json", json, "--junit", junit},
      "2 2 " + std::to_string(VK_BUFFER_USAGE_STORAGE_BUFFER_BIT) + " 3 192 1 1000000 " +
          std::to_string(VK_BUFFER_USAGE_TRANSFER_DST_BIT) + " 3 1");
  EXPECT_EQ(result.status, 1) << result.errors;
  const std::string what = "1 vertices are outside their bound; the first is 0.";
  const std::string whatOfClip = "1 points are outside their bound; the first is of joint 0.";
  const std::string bits =
      "the result does not have the same bits as that of 64 invocations, 4 instances each";

  for (const std::string& line : {"FAILED  " + bar + "  linear: ", "FAILED  " + bar + "  clips: ",
                                  "linear, rest pose, 8 invocations, 1 instances each: " + what,
                                  bits, ", clips, rest pose, joint matrices: " + whatOfClip})
    EXPECT_EQ(countOf(result.output, line), 1u) << line << " in\n" << result.output;
  EXPECT_EQ(countOf(result.output, "FAILED  "), 2u) << result.output;

  const nlohmann::json report = nlohmann::json::parse(readText(json));
  EXPECT_FALSE(report.at("passed").get<bool>());
  EXPECT_EQ(report.at("models")[0].at("failures"), 3) << "the pose of clips moves vertices, too";
  std::map<std::string, std::size_t> cases, failed;
  for (const nlohmann::json& verified : report.at("models")[0].at("cases")) {
    EXPECT_EQ(verified.at("passed"), !verified.contains("failure"));
    EXPECT_GT(verified.value("vertices", verified.value("points", 0)), 0) << verified;
    const std::string method = verified.at("method");
    ++cases[method];
    if (verified.at("passed").get<bool>()) continue;
    ++failed[method];
    const bool isOfClip = method == "clips";
    EXPECT_EQ(verified.at("pose"), "rest pose");
    EXPECT_GT(verified.at("worstPositionOfBound").get<double>(), 1);
    if (verified.at("variant") == "in the sampled pose") {
      EXPECT_GT(verified.at("failures"), 100);
      continue;
    }
    EXPECT_EQ(verified.at("variant"),
              isOfClip ? "joint matrices" : "8 invocations, 1 instances each");
    EXPECT_EQ(verified.at("failures"), 1);
    EXPECT_TRUE(verified.at("failure").get<std::string>().starts_with(isOfClip ? whatOfClip : what))
        << verified;
  }
  EXPECT_EQ(failed, (std::map<std::string, std::size_t>{{"clips", 1}, {"linear", 2}}));
  for (const Method method : allMethods)
    EXPECT_GE(cases[std::string(methodName(method))], 30u) << methodName(method);

  const std::string xml = readText(junit);
  EXPECT_EQ(countOf(xml, "failures=\"3\" errors=\"0\""), 2u) << "of the model, and of all";
  EXPECT_EQ(countOf(xml, "<failure message=\"" + what), 1u);
  EXPECT_EQ(countOf(xml, "<failure message=\"" + whatOfClip), 1u);
  EXPECT_EQ(countOf(xml, "<failure"), 3u);
}

// All bits of a few words of the output of the first frame, and then a bit of the exponent of the
// first pose that is sampled to compare it.
TEST(WrongBytesCommandsTest, TheCrowdsCheckTellsWhichVertexIsWrong) {
  REQUIRE_DEVICE();
  std::string plants;
  for (std::size_t byte = 100000; byte < 100016; ++byte) {
    plants += "1 1 " + std::to_string(VK_BUFFER_USAGE_TRANSFER_DST_BIT) + " " +
              std::to_string(byte) + " 255 ";
  }
  plants += "2 2 " + std::to_string(VK_BUFFER_USAGE_TRANSFER_DST_BIT) + " 3 64";
  const std::string json = outFile("crowd.json");
  const std::vector<std::string> command{
      dermisCrowdProgram,   "--figures", "3", "--frames", "3", "--check-every", "1", "--json", json,
      "--frames-in-flight", "1"};
  const CommandResult result = runWithWrongBytes(command, plants);
  EXPECT_EQ(result.status, 1) << result.output << result.errors;
  EXPECT_EQ(countOf(result.errors, "instances are wrong; the first: frame 1, "), 1u)
      << result.errors;
  EXPECT_EQ(countOf(result.errors, ": vertex "), 1u) << result.errors;
  EXPECT_EQ(countOf(result.errors, " times its bound away from the clips"), 1u) << result.errors;
  EXPECT_EQ(countOf(result.output, "are inside their bounds"), 0u) << result.output;
  const nlohmann::json check = nlohmann::json::parse(readText(json)).at("check");
  EXPECT_GE(check.at("failures").get<int>(), 2);
  const std::string first = check.at("firstFailure");
  EXPECT_TRUE(first.starts_with("frame 1, ")) << first;
  // The layer alone changes nothing.
  EXPECT_EQ(runWithWrongBytes(command, "").status, 0);
}

TEST(WrongBytesCommandsTest, TheEmbeddingSampleTellsWhichVertexIsWrong) {
  REQUIRE_DEVICE();
  const std::uint32_t usage =
      VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_VERTEX_BUFFER_BIT;
  const CommandResult result =
      runWithWrongBytes({DERMIS_EMBED}, "1 100 " + std::to_string(usage) + " 3 192");
  EXPECT_EQ(result.status, 1) << result.output;
  EXPECT_EQ(result.output, "instance 0 is WRONG\n");
  EXPECT_EQ(runWithWrongBytes({DERMIS_EMBED}, "").status, 0);
}

}  // namespace
}  // namespace dermis::test
