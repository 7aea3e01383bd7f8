// `dermis bench`: the rows that programs look for are there, and each was measured. How fast they
// are is the machine's affair: no test asks for a time.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "dermis_command.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

struct Measured {
  CommandResult result;
  nlohmann::json json;
  std::map<std::string, nlohmann::json> rows;
};

/// Runs `bench` with --json besides.
Measured bench(std::vector<std::string> arguments) {
  const std::string path = outFile("bench.json");
  std::filesystem::remove(path);
  arguments.insert(arguments.begin(), "bench");
  arguments.insert(arguments.end(), {"--json", path, "--rounds", "2"});
  Measured measured;
  measured.result = dermis(arguments);
  std::ifstream file(path);
  if (file) measured.json = nlohmann::json::parse(file, nullptr, false);
  if (measured.json.is_object()) {
    for (const nlohmann::json& row : measured.json["rows"])
      measured.rows[row["name"].get<std::string>()] = row;
  }
  return measured;
}

std::vector<std::string> cpuRows() {
  const std::string most = std::to_string(std::max(std::thread::hardware_concurrency(), 1u));
  std::vector<std::string> rows;
  for (const std::string& threads : {std::string("1"), most}) {
    rows.push_back("cpu/linear/" + threads);
    for (const char* const what :
         {"", "/tangents", "/float16x4+octahedral16x2", "/scales", "/clips"})
      rows.push_back("cpu/dual_quaternion/" + threads + what);
  }
  return rows;
}

/// The numbers of a row of `bench --on-paper`: bytes written, bytes stored, bytes read of the mesh
/// and of the palette, operations, fused ones.
std::vector<double> onPaper(const std::string& output, const std::string& name) {
  const std::size_t row = output.find("\n" + name);
  if (row == std::string::npos) return {};
  std::istringstream words(output.substr(row + 1 + name.size()));
  std::vector<double> numbers(5);
  for (double& number : numbers) words >> number;
  return words ? numbers : std::vector<double>{};
}

// A record of 24 bytes: six stores of a word touch each of its sectors, one after the other.
TEST(BenchTest, OnPaperNeedsNoDevice) {
  const CommandResult result =
      dermis({"bench", "--on-paper"}, {"VK_DRIVER_FILES=none", "VK_ICD_FILENAMES=none"});
  ASSERT_EQ(result.status, 0) << result.errors;
  const std::string dual = "dual_quaternion, float32x3 + float32x3, ";
  const std::vector<double> words = onPaper(result.output, dual + "words"),
                            staged = onPaper(result.output,
                                             "dual_quaternion, float32x3 + octahedral16x2, staged"),
                            linear = onPaper(result.output, "linear, float32x3 + float32x3, words");
  ASSERT_TRUE(words.size() == 5 && staged.size() == 5 && linear.size() == 5) << result.output;
  EXPECT_EQ(std::vector<double>(words.begin(), words.begin() + 4),
            (std::vector<double>{24, 6 * 24, 16, 4 * 32}));
  EXPECT_EQ(std::vector<double>(staged.begin(), staged.begin() + 4),
            (std::vector<double>{16, 16, 16, 4 * 32}));
  EXPECT_EQ(linear[3], 4 * 48);
  // At least four quaternions of eight numbers, each times its weight and added.
  EXPECT_GT(words[4], 4 * 8);
  EXPECT_LT(words[4], 1000);
}

TEST(BenchTest, MeasuresMethodsFormatsAndInstancesBesidePlainKernels) {
  const std::string picture = outFile("bench.png");
  std::filesystem::remove(picture);
  const Measured measured = bench({"--instances", "30", "-o", picture});
  ASSERT_EQ(measured.result.status, 0) << measured.result.errors;
  std::vector<std::string> expected{"gpu/dual_quaternion/float32x3",
                                    "gpu/linear/float32x3",
                                    "gpu/dual_quaternion/float16x4+octahedral16x2",
                                    "gpu/dual_quaternion/float32x3/bounds",
                                    "gpu/dual_quaternion/float32x3/clips",
                                    "gpu/dual_quaternion/float32x3/1_instance",
                                    "gpu/dual_quaternion/float32x3/10_instances",
                                    "gpu/plain/dual_quaternion",
                                    "gpu/plain/linear",
                                    "gpu/copy"};
  for (const std::string& row : cpuRows()) expected.push_back(row);
  for (const std::string& name : expected) {
    ASSERT_TRUE(measured.rows.contains(name)) << name;
    const nlohmann::json& row = measured.rows.at(name);
    const double vertices = 10'000 * row["instances"].get<double>();
    const double rate = row["million_vertices_per_second"].get<double>();
    EXPECT_GT(rate, 0) << name;
    EXPECT_NEAR(rate * 1e6 * row["best_seconds"].get<double>(), vertices, vertices * 1e-6) << name;
    EXPECT_NE(measured.result.output.find(name + " "), std::string::npos) << name;
  }
  EXPECT_EQ(measured.rows.at("gpu/dual_quaternion/float32x3/1_instance")["instances"], 1);
  EXPECT_EQ(measured.rows.at("gpu/copy")["instances"], 30);
  EXPECT_EQ(measured.json["vertices"], 10'000);
  EXPECT_GT(measured.json["start_up"]["seconds"].get<double>(), 0);
  EXPECT_GT(measured.json["start_up"]["seconds_without_scale"].get<double>(), 0);
  EXPECT_GT(measured.json["start_up"]["seconds_rigid"].get<double>(), 0);
  EXPECT_NE(measured.result.output.find("to the first frame"), std::string::npos);
  EXPECT_GT(std::filesystem::file_size(picture), 10'000u);
}

TEST(BenchTest, MeasuresAModel) {
  const std::string figure = std::string(sampleModels) + "/figure.glb";
  const Measured measured = bench({figure, "--instances", "4"});
  ASSERT_EQ(measured.result.status, 0) << measured.result.errors;
  EXPECT_EQ(measured.json["vertices"], 9918);
  EXPECT_EQ(measured.json["joints"], 26);
  for (const char* const row :
       {"gpu/plain/linear", "gpu/dual_quaternion/float32x3/clips", "cpu/dual_quaternion/1/clips"})
    EXPECT_TRUE(measured.rows.contains(row)) << row;
}

TEST(BenchTest, AModelWithoutClipsHasNoRowsOfThem) {
  std::ifstream figure(std::string(sampleModels) + "/figure.glb", std::ios::binary);
  std::string bytes((std::istreambuf_iterator<char>(figure)), std::istreambuf_iterator<char>());
  const std::size_t place = bytes.find("\"animations\"");
  ASSERT_NE(place, std::string::npos);
  bytes[place + 1] = 'A';  // a property that glTF does not have
  const std::string path = outFile("without_clips.glb");
  std::ofstream(path, std::ios::binary) << bytes;
  const Measured measured = bench({path, "--instances", "2", "--device", "cpu"});
  ASSERT_EQ(measured.result.status, 0) << measured.result.errors;
  EXPECT_TRUE(measured.rows.contains("cpu/dual_quaternion/1"));
  EXPECT_FALSE(measured.rows.contains("cpu/dual_quaternion/1/clips"));
  EXPECT_NE(measured.result.errors.find("rows of clips are left out: there are no clips"),
            std::string::npos)
      << measured.result.errors;
}

TEST(BenchTest, TheCpuNeedsNoVulkan) {
  const Measured measured = bench({"--instances", "20", "--device", "cpu"});
  ASSERT_EQ(measured.result.status, 0) << measured.result.errors;
  for (const std::string& row : cpuRows()) EXPECT_TRUE(measured.rows.contains(row)) << row;
  for (const auto& [name, row] : measured.rows) EXPECT_EQ(name.substr(0, 4), "cpu/");
  EXPECT_FALSE(measured.json.contains("start_up"));
}

TEST(BenchTest, WhatMakesNoSenseIsRefused) {
  const auto expectStatus = [](std::vector<std::string> arguments, int status,
                               const std::string& text) {
    arguments.insert(arguments.begin(), "bench");
    const CommandResult result = dermis(arguments);
    EXPECT_EQ(result.status, status) << text;
    EXPECT_NE(result.errors.find(text), std::string::npos) << result.errors;
  };
  expectStatus({"--rounds", "0"}, 2, "--rounds");
  expectStatus({"--instances", "0"}, 2, "--instances");
  expectStatus({"--instances", "100001"}, 2, "--instances");
  expectStatus({"--device", "reference"}, 2, "reference");
  expectStatus({"-o", "bars.jpg"}, 2, ".png");
  expectStatus({"-o", "bars%03d.png"}, 2, "one picture");
  const std::string copy = outFile("figure.glb");
  std::filesystem::copy_file(std::string(sampleModels) + "/figure.glb", copy,
                             std::filesystem::copy_options::overwrite_existing);
  const std::uintmax_t size = std::filesystem::file_size(copy);
  expectStatus({copy, "--json", copy}, 2, "figure.glb");
  EXPECT_EQ(std::filesystem::file_size(copy), size);
  expectStatus({"no-such-file.glb"}, 3, "no-such-file.glb");
}

}  // namespace
}  // namespace dermis::test
