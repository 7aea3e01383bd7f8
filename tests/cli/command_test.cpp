// The command line's contract: exit statuses, one line an error, what is written.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>
#include <string>
#include <vector>

#include "dermis/layout.h"
#include "dermis_command.h"
#include "kit/batch_runner.h"
#include "ply.h"
#include "test_data.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

const std::string figure = std::string(sampleModels) + "/figure.glb";
const std::string bar = std::string(sampleModels) + "/bar.glb";

/// A glTF file of one triangle and one joint, with a joint matrix and names of the test's choice. A
/// test of its own format lives beside the importer; here it only has to get through.
std::string writeModel(const std::string& name, const std::string& nodeName,
                       const std::string& jointScale, const std::string& parentScale = "[1,1,1]") {
  // positions 3 × 12 bytes, joints 3 × 4 bytes, weights 3 × 16 bytes
  const std::string data =
      "data:application/octet-stream;base64,"
      "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAAAAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8A"
      "AAAAAAAAAAAAAAAAAIA/"
      "AAAAAAAAAAAAAAAA";
  const std::string path = outFile(name);
  std::ofstream(path)
      << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0,2]}],"nodes":[{"name":")"
      << nodeName << R"(","mesh":0,"skin":0},{"scale":)" << jointScale
      << R"(},{"children":[1],"scale":)" << parentScale
      << R"(}],"skins":[{"joints":[1]}],"meshes":[{"primitives":[{"attributes":{"POSITION":0,"JOINTS_0":1,)"
      << R"("WEIGHTS_0":2}}]}],"buffers":[{"byteLength":96,"uri":")" << data
      << R"("}],"bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":12},)"
      << R"({"buffer":0,"byteOffset":48,"byteLength":48}],"accessors":[{"bufferView":0,"componentType":5126,)"
      << R"("count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},{"bufferView":1,"componentType":5121,)"
      << R"("count":3,"type":"VEC4"},{"bufferView":2,"componentType":5126,"count":3,"type":"VEC4"}]})";
  return path;
}

TEST(CommandTest, WrongUsageEndsWithTwo) {
  const std::string out = outFile("usage.ply");
  const std::vector<std::vector<std::string>> wrong{
      {},
      {"fly"},
      {"skin", bar},
      {"skin", bar, "-o", outFile("usage.stl")},
      {"skin", bar, "-o", out, "--method", "cubic", "--device", "cpu"},
      {"skin", bar, "-o", out, "--time", "nan", "--device", "cpu"},
      {"skin", bar, "-o", out, "--time", "soon", "--device", "cpu"},
      {"skin", bar, "-o", out, "--animation", "no such clip", "--device", "cpu"},
      {"skin", bar, "-o", out, "--animation", "7", "--device", "cpu"},
      {"skin", bar, "-o", out, "--frames", "2", "--device", "cpu"},
      {"skin", bar, "-o", outFile("usage%04d.ply"), "--device", "cpu"},
      {"skin", bar, "-o", outFile("usage%4d.ply"), "--frames", "2", "--device", "cpu"},
      {"skin", bar, "-o", outFile("usage%04d%04d.ply"), "--frames", "2", "--device", "cpu"},
      {"skin", bar, "-o", out, "--fps", "10", "--device", "cpu"},
      {"skin", bar, "-o", outFile("usage%04d.ply"), "--frames", "0", "--device", "cpu"},
      {"skin", bar, "-o", outFile("usage%04d.ply"), "--frames", "2", "--fps", "0", "--device",
       "cpu"},
      {"verify", bar, "--device", "reference"},
      {"verify", bar, "--threads", "0"},
      {"skin", bar, "-o", out, "--method", "log_matrix", "--device", "cpu"},
      {"info", bar, "--yaml"},
  };
  for (const std::vector<std::string>& arguments : wrong) {
    const CommandResult result = dermis(arguments);
    SCOPED_TRACE(::testing::PrintToString(arguments));
    EXPECT_EQ(result.status, 2);
    expectOneErrorLine(result);
    EXPECT_TRUE(result.output.empty());
  }
}

/// A sentence that names what is wrong, and a hint at the help that lists its options.
void expectComplaint(const std::vector<std::string>& arguments, const std::string& sentence) {
  const CommandResult result = dermis(arguments);
  SCOPED_TRACE(::testing::PrintToString(arguments));
  EXPECT_EQ(result.status, 2);
  const bool isCommand = !arguments.empty() && arguments[0][0] != '-' && arguments[0] != "fly";
  const std::string help = isCommand ? "dermis " + arguments[0] : "dermis";
  EXPECT_EQ(result.errors, "dermis: error: " + sentence + " (see " + help + " --help)\n");
}

TEST(CommandTest, WrongUsageNamesTheOptionAndTheSubcommandsHelp) {
  const std::string out = outFile("usage.ply");
  expectComplaint({"info", "--bogus"}, "there is no option --bogus");
  expectComplaint({"info", "--bogus=3"}, "there is no option --bogus");
  expectComplaint({"skin", bar, "--bogus"}, "there is no option --bogus");
  expectComplaint({"-x"}, "there is no option -x");
  expectComplaint({"fly"}, "there is no command 'fly'");
  expectComplaint({"info"}, "MODEL is required");
  expectComplaint({"skin", bar}, "--output is required");
  expectComplaint({"skin", bar, "-o", out, "--fps", "3"}, "--fps requires --frames");
  expectComplaint({"skin", bar, "-o", out, "--time", "nan"}, "--time must be a number of seconds");
  expectComplaint({"skin", bar, "-o", outFile("a%04d.ply")},
                  "-o OUT has a placeholder for a number, so --frames is required");
  expectComplaint({"skin", bar, "-o", out, "--device", "cpu", "--animation", "zzz"},
                  "--animation: there is no clip 'zzz'; there is 1 clip");
  expectComplaint({"render", bar, "-o", "a.png", "--elevation", "91"},
                  "--elevation must be from -90 to 90 degrees");
  expectComplaint({"compare", bar, "--repetitions", "0"}, "--repetitions must be from 1 to 10000");
  expectComplaint({"skin", bar, "-o", out, "--bulge-strength", "2"},
                  "--bulge-strength must be from 0 to 1");
}

TEST(CommandTest, ValuesThatMeanNothingAreRefused) {
  const std::string out = outFile("usage.ply");
  for (const char* option : {"--time", "--animation", "--frames", "--method", "--device", "--fps"})
    expectComplaint({"skin", bar, "-o", out, option, ""},
                    std::string(option) + " has an empty value");
  expectComplaint({"skin", bar, "-o", ""}, "-o has an empty value");
  expectComplaint({"skin", bar, "-o", out, "--time="}, "--time has an empty value");
  expectComplaint({"skin", "", "-o", out}, "an argument is empty");
  expectComplaint({"skin", "--strict", "", "-o", out}, "an argument is empty");
  expectComplaint({"verify", bar, "--json", ""}, "--json has an empty value");
  expectComplaint({"render", bar, "-o", "a.png", "--width", ""}, "--width has an empty value");
  expectComplaint({"compare", "", "-o", "a.png"}, "an argument is empty");
  expectComplaint({"skin", bar, "-o=x.ply", "--device", "cpu"}, "-o takes its value without '='");
  EXPECT_FALSE(std::filesystem::exists("=x.ply"));
  expectComplaint({"render", bar, "-o", "a.png", "--orthographic=false"},
                  "--orthographic takes no value");
  expectComplaint({"skin", bar, "-o", out, "--strict=1"}, "--strict takes no value");
  EXPECT_EQ(dermis({"skin", bar, "--output=" + out, "--time=0.5", "--device=cpu"}).status, 0);
}

TEST(CommandTest, StandardErrorMayBeClosedOrFull) {
  const std::string note = writeModel("note.gltf", "a", "[1e30,1,1]", "[1e30,1,1]");
  for (const char* redirection : {"2>&-", "2>/dev/full", ">&- 2>&-"}) {
    SCOPED_TRACE(redirection);
    const auto run = [&](std::vector<std::string> arguments) {
      const std::string script = "exec \"$0\" \"$@\" " + std::string(redirection);
      arguments.insert(arguments.begin(), {"/bin/sh", "-c", script, dermisProgram});
      return runCommand(arguments).status;
    };
    EXPECT_EQ(run({"info", "nope.glb"}), 3);
    EXPECT_EQ(run({"fly"}), 2);
    const std::string out = outFile("warned.ply");
    std::filesystem::remove(out);
    EXPECT_EQ(run({"skin", note, "-o", out, "--device", "cpu"}), 0);
    EXPECT_EQ(readPly(out).value_or(Ply{}).positions.size(), 3u)
        << "the file is no place for what is said on standard error";
  }
}

TEST(CommandTest, StandardOutputMayBeClosedOrFull) {
  for (const char* redirection : {">&-", ">/dev/full", "| true"}) {
    const std::string script =
        "{ sleep 0.2; \"$0\" \"$@\"; echo $? >&2; } " + std::string(redirection);
    const CommandResult result =
        runCommand({"/bin/sh", "-c", script, dermisProgram, "info", bar, "--json"});
    EXPECT_EQ(result.errors, "dermis: error: standard output cannot be written\n5\n")
        << redirection;
  }
}

TEST(CommandTest, BadInputEndsWithThree) {
  const std::string broken = outFile("broken.glb");
  std::ofstream(broken, std::ios::binary) << "glTF is not what this is";
  const std::string noSkin = outFile("noskin.gltf");
  std::ofstream(noSkin) << R"({"asset": {"version": "2.0"}})";
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"info", outFile("does not exist.glb")},
           {"info", broken},
           {"skin", broken, "-o", outFile("bad.ply"), "--device", "cpu"},
           {"skin", noSkin, "-o", outFile("bad.ply"), "--device", "cpu"}}) {
    const CommandResult result = dermis(arguments);
    SCOPED_TRACE(::testing::PrintToString(arguments));
    EXPECT_EQ(result.status, 3);
    expectOneErrorLine(result);
  }
  EXPECT_EQ(dermis({"info", noSkin}).status, 0);
}

TEST(CommandTest, WhatIsNoFileIsRefusedAndNotReadForever) {
  for (const char* path : {"/dev/zero", "/", "/dev/null"}) {
    const CommandResult result = dermis({"info", path});
    EXPECT_EQ(result.status, 3) << path;
    expectOneErrorLine(result);
  }
}

TEST(CommandTest, AFullDiskEndsWithFive) {
  const CommandResult result = dermis({"skin", bar, "-o", outFile("full.ply"), "--device", "cpu"});
  EXPECT_EQ(result.status, 0);
  const std::string link = outFile("full_link.ply");
  std::filesystem::remove(link);
  std::filesystem::create_symlink("/dev/full", link);
  const CommandResult full = dermis({"skin", bar, "-o", link, "--device", "cpu"});
  EXPECT_EQ(full.status, 5);
  expectOneErrorLine(full);
  EXPECT_TRUE(std::filesystem::is_symlink(link)) << "what is not a regular file stays";
}

TEST(CommandTest, NamesFromAFileCannotForgeLines) {
  // In JSON's escapes: a terminal's escape, a line end, and one of the upper control characters.
  const std::string name = "a\\u001b]0;b\\nclip   9 'forged'\\u009b1m";
  const std::string path = writeModel("names.gltf", name, "[1,1,1]");
  const CommandResult result = dermis({"info", path});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_EQ(result.output.find("\nclip"), std::string::npos);
  for (const char c : result.output)
    EXPECT_TRUE(c == '\n' || static_cast<unsigned char>(c) >= 0x20);
  EXPECT_EQ(result.output.find("\xc2\x9b"), std::string::npos);
}

TEST(CommandTest, APoseThatIsNotFiniteIsNotVerified) {
  // Each scale fits into float32, their product does not.
  const std::string path = writeModel("infinite.gltf", "a", "[1e30,1,1]", "[1e30,1,1]");
  EXPECT_EQ(dermis({"verify", path, "--quick", "--device", "cpu"}).status, 1);
  const CommandResult skinned =
      dermis({"skin", path, "-o", outFile("infinite.ply"), "--device", "cpu"});
  EXPECT_EQ(skinned.status, 0);
  EXPECT_NE(skinned.errors.find("not finite"), std::string::npos) << skinned.errors;
  const CommandResult good = dermis(
      {"verify", writeModel("finite.gltf", "a", "[1,2,-0.001]"), "--quick", "--device", "cpu"});
  EXPECT_EQ(good.status, 0) << good.output;
  EXPECT_EQ(good.output.find("only asked"), std::string::npos) << good.output;
}

TEST(CommandTest, WithoutAVulkanDriverOnlyTheReferenceWorks) {
  const std::vector<std::string> noDriver{"VK_DRIVER_FILES=/nonexistent.json",
                                          "VK_ICD_FILENAMES=/nonexistent.json"};
  for (const std::vector<std::string>& arguments : std::vector<std::vector<std::string>>{
           {"devices"}, {"verify", bar}, {"skin", bar, "-o", outFile("none.ply")}}) {
    const CommandResult result = dermis(arguments, noDriver);
    SCOPED_TRACE(::testing::PrintToString(arguments));
    EXPECT_EQ(result.status, 4);
    expectOneErrorLine(result);
  }
  EXPECT_EQ(dermis({"skin", bar, "-o", outFile("none.ply"), "--device", "cpu"}, noDriver).status,
            0);
  EXPECT_EQ(dermis({"info", bar}, noDriver).status, 0);
}

TEST(CommandTest, AnUnknownDeviceEndsWithFour) {
  REQUIRE_DEVICE();
  for (const char* device : {"no such device", "99"}) {
    const CommandResult result =
        dermis({"skin", bar, "-o", outFile("device.ply"), "--device", device});
    EXPECT_EQ(result.status, 4) << device;
    expectOneErrorLine(result);
  }
}

TEST(CommandTest, AnOutputThatCannotBeWrittenEndsWithFive) {
  const CommandResult result =
      dermis({"skin", bar, "-o", "/nonexistent/folder/out.ply", "--device", "cpu"});
  EXPECT_EQ(result.status, 5);
  expectOneErrorLine(result);
  REQUIRE_DEVICE();
  // Without a model, which would take its time.
  EXPECT_EQ(dermis({"verify", "none", "--json", "/nonexistent/folder/out.json"}).status, 5);
  EXPECT_EQ(dermis({"verify", "none", "--junit", "/nonexistent/folder/out.xml"}).status, 5);
}

TEST(CommandTest, SkinWritesOnePose) {
  const std::string out = outFile("pose.ply");
  const CommandResult result = dermis(
      {"skin", figure, "-o", out, "--animation", "walk", "--time", "0.25", "--device", "cpu"});
  EXPECT_EQ(result.status, 0) << result.errors;
  EXPECT_TRUE(result.output.empty()) << result.output;
  const std::optional<Ply> ply = readPly(out);
  ASSERT_TRUE(ply.has_value());
  EXPECT_GE(ply->positions.size(), 5000u);
  EXPECT_GE(ply->faces.size(), 5000u);
  for (const std::array<std::int32_t, 3>& face : ply->faces) {
    for (const std::int32_t index : face)
      ASSERT_TRUE(index >= 0 && index < static_cast<int>(ply->positions.size()));
  }
  for (const std::array<float, 3>& normal : ply->normals) {
    ASSERT_NEAR(std::hypot(normal[0], normal[1], normal[2]), 1.0f, 1e-5f);
  }
}

TEST(CommandTest, AnAnimationsNumberGoesBeforeItsName) {
  const std::string byNumber = outFile("number.ply"), byName = outFile("name.ply"),
                    rest = outFile("rest.ply");
  EXPECT_EQ(dermis({"skin", figure, "-o", byNumber, "--time", "0.2", "--animation", "0", "--device",
                    "cpu"})
                .status,
            0);
  EXPECT_EQ(dermis({"skin", figure, "-o", byName, "--time", "0.2", "--device", "cpu"}).status, 0);
  EXPECT_EQ(dermis({"skin", figure, "-o", rest, "--time", "0.2", "--animation", "none", "--device",
                    "cpu"})
                .status,
            0);
  EXPECT_EQ(readPly(byNumber)->positions, readPly(byName)->positions)
      << "animation 0 is the default";
  EXPECT_NE(readPly(byNumber)->positions, readPly(rest)->positions);
}

TEST(CommandTest, FramesAreNumberedPosesFromTimeOn) {
  const std::string pattern = outFile("frame_%03d.ply");
  EXPECT_EQ(dermis({"skin", bar, "-o", pattern, "--frames", "3", "--fps", "4", "--time", "0.25",
                    "--device", "cpu"})
                .status,
            0);
  const std::string single = outFile("single.ply");
  EXPECT_EQ(dermis({"skin", bar, "-o", single, "--time", "0.75", "--device", "cpu"}).status, 0);
  ASSERT_TRUE(readPly(outFile("frame_000.ply")) && readPly(outFile("frame_002.ply")));
  EXPECT_EQ(readPly(outFile("frame_002.ply"))->positions, readPly(single)->positions);
  EXPECT_FALSE(std::filesystem::exists(outFile("frame_003.ply")));
}

TEST(CommandTest, StrictRefusesWhatIsRepairedOtherwise) {
  const std::optional<std::filesystem::path> data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  const std::string wasp = (*data / "models/QuaterniusWasp/Wasp.glb").string();
  const CommandResult lenient =
      dermis({"skin", wasp, "-o", outFile("wasp.ply"), "--device", "cpu"});
  EXPECT_EQ(lenient.status, 0);
  EXPECT_NE(lenient.errors.find("dermis: warning: mesh 'Wasp"), std::string::npos)
      << lenient.errors;
  const CommandResult strict =
      dermis({"skin", wasp, "-o", outFile("wasp.ply"), "--device", "cpu", "--strict"});
  EXPECT_EQ(strict.status, 3);
  expectOneErrorLine(strict);
}

TEST(CommandTest, InfoListsMeshesAndClips) {
  const CommandResult text = dermis({"info", figure});
  EXPECT_EQ(text.status, 0);
  EXPECT_NE(text.output.find("'walk'"), std::string::npos) << text.output;
  const CommandResult json = dermis({"info", figure, "--json"});
  EXPECT_EQ(json.status, 0);
  const nlohmann::json parsed = nlohmann::json::parse(json.output);
  EXPECT_GE(parsed["meshes"].size(), 2u);
  int vertices = 0;
  for (const nlohmann::json& mesh : parsed["meshes"]) vertices += mesh["vertices"].get<int>();
  EXPECT_GE(vertices, 5000);
  EXPECT_GE(parsed["skins"][0]["joints"].get<int>(), 20);
}

/// What `devices` should say of a device, asked of the driver.
std::string describe(const samples::Device& device) {
  const samples::VulkanFunctions& functions = device.functions();
  VkPhysicalDeviceProperties properties{};
  functions.GetPhysicalDeviceProperties(device.physicalDevice(), &properties);
  std::uint32_t count = 0;
  functions.EnumerateDeviceExtensionProperties(device.physicalDevice(), nullptr, &count, nullptr);
  std::vector<VkExtensionProperties> extensions(count);
  functions.EnumerateDeviceExtensionProperties(device.physicalDevice(), nullptr, &count,
                                               extensions.data());
  const bool pushes = std::ranges::any_of(extensions, [](const VkExtensionProperties& extension) {
    return std::string(extension.extensionName) == VK_KHR_PUSH_DESCRIPTOR_EXTENSION_NAME;
  });
  const auto yes = [](bool is) { return is ? "yes" : "no"; };
  const char* types[] = {"other", "integrated GPU", "discrete GPU", "virtual GPU", "CPU"};
  std::ostringstream text;
  text << properties.deviceName << "\n   " << types[properties.deviceType] << ", Vulkan "
       << VK_API_VERSION_MAJOR(properties.apiVersion) << '.'
       << VK_API_VERSION_MINOR(properties.apiVersion) << '.'
       << VK_API_VERSION_PATCH(properties.apiVersion)
       << ", usable\n   maximum storage buffer range "
       << (properties.limits.maxStorageBufferRange >> 20) << " MiB; "
       << properties.limits.maxPerStageDescriptorStorageBuffers << " storage buffers per stage; "
       << properties.limits.maxComputeWorkGroupCount[0]
       << " workgroups per dimension; push descriptors: " << yes(pushes) << '\n';
  return text.str();
}

TEST(CommandTest, DevicesListsTheDevice) {
  REQUIRE_DEVICE();
  std::string reason;
  const std::string expected = describe(*testDevice(true, reason)->device);
  const CommandResult result = dermis({"devices"});
  EXPECT_EQ(result.status, 0);
  EXPECT_EQ(result.errors, "");
  const std::size_t place = result.output.find("  " + expected);
  ASSERT_NE(place, std::string::npos) << result.output << "\nexpected " << expected;
  // The number before it counts the devices, of which each takes three lines.
  const std::size_t line = result.output.rfind('\n', place) + 1;  // npos + 1 is the first line
  const auto before = std::count(result.output.begin(),
                                 result.output.begin() + static_cast<std::ptrdiff_t>(line), '\n');
  EXPECT_EQ(before % 3, 0);
  EXPECT_EQ(result.output.substr(line, place - line), std::to_string(before / 3));
}

std::size_t countOf(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (std::size_t place = 0; (place = text.find(part, place)) != std::string::npos; ++place)
    ++count;
  return count;
}

/// The report on random meshes: each method in many combinations, and all of them passed.
void expectRandomMeshes(const CommandResult& result, const nlohmann::json& model,
                        const std::string& xml) {
  EXPECT_EQ(model.at("model"), "random meshes");
  const nlohmann::json& cases = model.at("cases");
  std::string variants;
  std::map<std::string, std::size_t> byMethod;
  for (const nlohmann::json& verified : cases) {
    EXPECT_TRUE(verified.at("passed").get<bool>()) << verified;
    EXPECT_GT(verified.at("vertices").get<int>(), 0) << verified;
    ++byMethod[verified.at("method").get<std::string>()];
    variants += verified.at("variant").get<std::string>() + "\n";
  }
  EXPECT_EQ(byMethod.size(), samples::CpuTarget().methods().size());
  for (const auto& [method, count] : byMethod) {
    EXPECT_GE(count, 30u) << method;
    EXPECT_EQ(countOf(result.output, "passed  random meshes  " + method + ": "), 1u)
        << result.output;
  }
  for (const char* output : {"positions float32x3", "positions float16x4", "normals float32x3",
                             "tangents float32x4", "previous kept"})
    EXPECT_GE(countOf(variants, output), 1u) << output;
  const std::string tests = "tests=\"" + std::to_string(cases.size()) + "\" failures=\"0\"";
  EXPECT_EQ(countOf(xml, "<testsuite name=\"random meshes\" " + tests), 1u) << xml.substr(0, 300);
  EXPECT_GE(countOf(xml, "<testcase "), cases.size());
}

TEST(CommandTest, VerifyAddsRandomMeshesToModelsWhereAsked) {
  REQUIRE_TERMINAL();
  const std::string json = outFile("verify.json"), junit = outFile("verify.xml");
  const CommandResult result = runOnTerminal({dermisProgram, "verify", bar, figure, "--random",
                                              "--device", "cpu", "--json", json, "--junit", junit});
  EXPECT_EQ(result.status, 0) << result.output << result.errors;
  EXPECT_TRUE(result.output.starts_with("device  ")) << result.output;
  const nlohmann::json parsed = nlohmann::json::parse(readText(json));
  EXPECT_TRUE(parsed.at("passed").get<bool>());
  ASSERT_EQ(parsed.at("models").size(), 3u);
  expectRandomMeshes(result, parsed.at("models")[0], readText(junit));
  EXPECT_EQ(parsed.at("models")[1].at("model"), bar);
  EXPECT_EQ(parsed.at("models")[2].at("model"), figure);
  for (const nlohmann::json& model : parsed.at("models")) EXPECT_FALSE(model.at("cases").empty());
  EXPECT_NE(readText(junit).find("classname=\"dermis.verify.dual_quaternion\""), std::string::npos);
  // Each counts its own steps, and leaves a clean line behind.
  EXPECT_GE(countOf(result.errors, "\rrandom meshes: "), 20u) << result.errors;
  EXPECT_GE(countOf(result.errors, "\r" + bar + ": "), 20u) << result.errors;
  EXPECT_TRUE(result.errors.ends_with("\r\x1b[K")) << result.errors;
  EXPECT_EQ(countOf(result.output, "\r"), 0u) << "results have no progress in them";
}

TEST(CommandTest, ProgressIsShownOnATerminalOnly) {
  REQUIRE_TERMINAL();
  const std::vector<std::string> frames{"skin",     bar, "-o",       outFile("frame_%02d.ply"),
                                        "--frames", "3", "--device", "cpu"};
  std::vector<std::string> command{dermisProgram};
  command.insert(command.end(), frames.begin(), frames.end());
  const CommandResult terminal = runOnTerminal(command);
  EXPECT_EQ(terminal.status, 0);
  EXPECT_EQ(terminal.output, "");
  EXPECT_EQ(terminal.errors, "\rskinning: 1 of 3\rskinning: 2 of 3\rskinning: 3 of 3\r\x1b[K");
  const CommandResult pipe = dermis(frames);
  EXPECT_EQ(pipe.status, 0);
  EXPECT_EQ(pipe.output + pipe.errors, "");
}

// A model that is not there, and numbers that float32 cannot compute with: whatever becomes of such
// a model, it is named, and the others are verified and reported.
TEST(CommandTest, NoModelSpoilsTheReportOfAnother) {
  // Vertex 1 of the model stands at (FLT_MAX, 0, 0).
  const std::string far = writeModel("far.gltf", "a", "[1,1,1]");
  std::string text = readText(far);
  const std::size_t one = text.find("AACAPwAA");  // 1.0f, 0
  ASSERT_NE(one, std::string::npos);
  text.replace(one, 8, "//9/fwAA");
  std::ofstream(far) << text;
  // Positions that fit, of joints that do not fit their own squares; and the least box at a place
  // where that is not told from a point.
  const std::string huge = writeModel("huge.gltf", "a", "[1e37,1,1]");
  const std::string larger = writeModel("larger.gltf", "a", "[1e38,1e38,1e38]");
  const std::string json = outFile("verify.json"), junit = outFile("verify.xml");
  const CommandResult result =
      dermis({"verify", outFile("none.glb"), far, huge, larger, bar, "--quick", "--device", "cpu",
              "--json", json, "--junit", junit});
  EXPECT_EQ(result.status, 3) << result.output << result.errors;
  for (const std::string& refused : {far, larger}) {
    EXPECT_EQ(countOf(result.errors, "dermis: error: " + refused + ": node 0 'a', mesh"), 1u)
        << result.errors;
  }
  const std::size_t methods = samples::CpuTarget().methods().size();
  EXPECT_EQ(countOf(result.output, huge), methods) << "each with a verdict";
  EXPECT_EQ(countOf(result.output, "passed  " + bar), methods + 1) << "with its clips";
  const nlohmann::json models = nlohmann::json::parse(readText(json)).at("models");
  ASSERT_EQ(models.size(), 5u);
  EXPECT_TRUE(models[0].contains("error"));
  EXPECT_TRUE(models[1].contains("error"));
  EXPECT_FALSE(models[2].contains("error"));
  EXPECT_TRUE(models[3].contains("error"));
  EXPECT_FALSE(models[2].at("cases").empty());
  EXPECT_EQ(models[4].at("failures"), 0);
  EXPECT_FALSE(models[4].at("cases").empty());
  EXPECT_EQ(countOf(readText(junit), "<error message="), 3u);
}

// Every file that is broken on purpose: status 3 with one sentence, or accepted (the importer's
// tests give the reasons). Most break rules that leave the meaning clear.
TEST(CommandTest, BrokenModelsAreRefusedWithOneSentence) {
  const std::optional<std::filesystem::path> data = testDataFolder();
  if (!data) GTEST_SKIP() << noTestData;
  std::size_t files = 0, refused = 0, refusedWhereStrict = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(*data / "models")) {
    const std::string path = entry.path().string();
    if (!path.ends_with(".gltf") && !path.ends_with(".glb")) continue;
    if (path.find("/negative_") == std::string::npos) continue;
    SCOPED_TRACE(path);
    ++files;
    for (const CommandResult& result :
         {dermis({"info", path}),
          dermis({"skin", path, "-o", outFile("negative.ply"), "--device", "cpu"})}) {
      EXPECT_TRUE(result.status == 0 || result.status == 3)
          << result.status << " " << result.errors;
      if (result.status == 3) expectOneErrorLine(result);
    }
    refused += static_cast<std::size_t>(dermis({"info", path}).status == 3);
    const CommandResult strict = dermis({"info", path, "--strict"});
    if (strict.status == 3) expectOneErrorLine(strict);
    refusedWhereStrict += static_cast<std::size_t>(strict.status == 3);
  }
  EXPECT_GE(files, 25u);
  EXPECT_GE(refused, 1u);
  EXPECT_GE(refusedWhereStrict, refused + 11);
}

}  // namespace
}  // namespace dermis::test
