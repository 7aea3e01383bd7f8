// How files are written: whole or not at all, whatever goes wrong, and never over what is read.

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>
#include <vector>

#include "dermis_command.h"
#include "gltf_builder.h"
#include "kit/file_name.h"
#include "kit/output_file.h"
#include "ply.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

const std::string barPath = std::string(sampleModels) + "/bar.glb";
const std::string good = "What stood here before is good.\n";

std::string textOf(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// An empty folder of the running test.
std::string emptyFolder(const std::string& name = "folder") {
  const std::string folder = outFile(name);
  std::filesystem::remove_all(folder);
  std::filesystem::create_directories(folder);
  return folder;
}

std::string writeText(const std::string& path, const std::string& text = good) {
  std::ofstream(path, std::ios::binary) << text;
  return path;
}

std::vector<std::string> namesIn(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(folder))
    names.push_back(entry.path().filename().string());
  std::ranges::sort(names);
  return names;
}

mode_t permissionsOf(const std::string& path) {
  struct stat file {};
  EXPECT_EQ(stat(path.c_str(), &file), 0) << path;
  return file.st_mode & 0777;
}

std::vector<std::string> skinCommand(const std::string& out) {
  return {dermisProgram, "skin", barPath, "-o", out, "--device", "cpu"};
}

/// With files of at most 512 bytes: the kernel's answer is that of a full disk, and a signal.
CommandResult onAFullDisk(std::vector<std::string> command) {
  command.insert(command.begin(), {"/bin/sh", "-c", "ulimit -f 1; exec \"$0\" \"$@\" >/dev/null"});
  return runCommand(command);
}

/// Expects the good file untouched, in a folder of its own, by a command that fails to replace it.
void expectUntouched(const std::string& folder, const std::vector<std::string>& command,
                     std::ptrdiff_t errorLines = 1) {
  SCOPED_TRACE(::testing::PrintToString(command));
  const std::vector<std::string> before = namesIn(folder);
  const CommandResult result = onAFullDisk(command);
  EXPECT_EQ(result.status, 5) << result.errors;
  EXPECT_EQ(std::ranges::count(result.errors, '\n'), errorLines) << result.errors;
  EXPECT_NE(result.errors.find(" cannot be written: File too large\n"), std::string::npos)
      << result.errors;
  EXPECT_EQ(namesIn(folder), before) << "no temporary file is left";
  for (const std::string& name : before) {
    EXPECT_EQ(textOf(folder + "/" + name), good) << name;
  }
}

TEST(FileOutputTest, AFullDiskLeavesWhatStoodThere) {
  const std::string folder = emptyFolder();
  for (const char* ending : {".ply", ".obj", ".glb"}) {
    const std::string out = writeText(folder + "/out" + ending);
    expectUntouched(folder, skinCommand(out));
    const std::string link = folder + "/link" + ending;
    std::filesystem::create_symlink(out, link);
    expectUntouched(folder, skinCommand(link));
    EXPECT_TRUE(std::filesystem::is_symlink(link));
  }
  const std::string json = writeText(folder + "/report.json");
  expectUntouched(folder, {dermisProgram, "compare", barPath, "--device", "cpu", "--json", json});
  const std::string empty = emptyFolder("empty");
  expectUntouched(empty, skinCommand(empty + "/new.ply"));
}

TEST(FileOutputTest, AFullDiskLeavesReportsOfVerify) {
  REQUIRE_DEVICE();
  const std::string folder = emptyFolder();
  const std::string json = writeText(folder + "/report.json"),
                    junit = writeText(folder + "/report.xml");
  // Models that are not there make long reports in no time.
  for (const std::vector<std::string>& option :
       {std::vector<std::string>{"--json", json}, {"--junit", junit}}) {
    std::vector<std::string> command{dermisProgram, "verify", "1", "2", "3", "4", "5", "6"};
    command.insert(command.end(), option.begin(), option.end());
    expectUntouched(folder, command, 7);
  }
}

// Through a link to the device that is always full.
TEST(FileOutputTest, AFullDeviceIsNotReplaced) {
  const std::string link = emptyFolder() + "/full.ply";
  std::filesystem::create_symlink("/dev/full", link);
  const CommandResult result = runCommand(skinCommand(link));
  EXPECT_EQ(result.status, 5);
  EXPECT_EQ(result.errors,
            "dermis: error: " + link + " cannot be written: No space left on device\n");
  EXPECT_TRUE(std::filesystem::is_symlink(link));
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/full"));
}

TEST(FileOutputTest, LinksAreFollowed) {
  const std::string folder = emptyFolder();
  std::filesystem::create_directory(folder + "/elsewhere");
  const std::string target = writeText(folder + "/elsewhere/target");
  std::filesystem::create_symlink("elsewhere/second", folder + "/first.ply");
  std::filesystem::create_symlink("target", folder + "/elsewhere/second");
  ASSERT_EQ(runCommand(skinCommand(folder + "/first.ply")).status, 0);
  EXPECT_TRUE(readPly(target).has_value());
  EXPECT_TRUE(std::filesystem::is_symlink(folder + "/first.ply"));
  EXPECT_EQ(namesIn(folder + "/elsewhere"), (std::vector<std::string>{"second", "target"}));
  EXPECT_FALSE(std::filesystem::is_symlink(target));

  std::filesystem::create_symlink("elsewhere/new", folder + "/dangling.ply");
  ASSERT_EQ(runCommand(skinCommand(folder + "/dangling.ply")).status, 0);
  EXPECT_TRUE(readPly(folder + "/elsewhere/new").has_value());
  std::filesystem::create_symlink("loop.ply", folder + "/loop.ply");
  EXPECT_EQ(runCommand(skinCommand(folder + "/loop.ply")).status, 5);
}

TEST(FileOutputTest, PermissionsAreThoseOfTheUmaskOrOfTheOldFile) {
  const std::string folder = emptyFolder();
  const std::string fresh = folder + "/fresh.ply", old = writeText(folder + "/old.ply");
  std::filesystem::permissions(old, std::filesystem::perms(0604));
  for (const std::string& out : {fresh, old}) {
    std::vector<std::string> command = skinCommand(out);
    command.insert(command.begin(), {"/bin/sh", "-c", "umask 027; exec \"$0\" \"$@\""});
    ASSERT_EQ(runCommand(command).status, 0);
  }
  EXPECT_EQ(permissionsOf(fresh), 0640u);
  EXPECT_EQ(permissionsOf(old), 0604u);
}

TEST(FileOutputTest, StandardOutputFifosAndDevicesAreWrittenThrough) {
  const std::string folder = emptyFolder();
  const std::string expected = folder + "/expected.ply";
  ASSERT_EQ(runCommand(skinCommand(expected)).status, 0);
  const std::string bytes = textOf(expected);

  // Standard output is a file here, whose contents must not be replaced.
  std::filesystem::create_symlink("/dev/stdout", folder + "/stdout.ply");
  const CommandResult direct = runCommand(skinCommand(folder + "/stdout.ply"));
  EXPECT_EQ(direct.status, 0) << direct.errors;
  EXPECT_TRUE(direct.output == bytes);
  std::vector<std::string> piped = skinCommand(folder + "/stdout.ply");
  piped.insert(piped.begin(), {"/bin/sh", "-c", "\"$0\" \"$@\" | cat"});
  EXPECT_TRUE(runCommand(piped).output == bytes);

  const std::string fifo = folder + "/fifo.ply";
  ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
  std::vector<std::string> read = skinCommand(fifo);
  read.insert(read.begin(), {"/bin/sh", "-c", "\"$0\" \"$@\" & cat \"$4\"; wait"});
  EXPECT_TRUE(runCommand(read).output == bytes);
  EXPECT_TRUE(std::filesystem::is_fifo(fifo));

  std::filesystem::create_symlink("/dev/null", folder + "/null.ply");
  EXPECT_EQ(runCommand(skinCommand(folder + "/null.ply")).status, 0);
  EXPECT_TRUE(std::filesystem::is_character_file("/dev/null"));
  EXPECT_EQ(namesIn(folder).size(), 4u) << "no temporary file is left";
}

/// The first word is the option whose file is refused; the rest is the command.
void expectRefusedOutput(std::vector<std::string> command, const std::string& why) {
  SCOPED_TRACE(::testing::PrintToString(command));
  const std::string option = command.front();
  command.erase(command.begin());
  const CommandResult result = dermis(command);
  EXPECT_EQ(result.status, 2);
  expectOneErrorLine(result);
  EXPECT_NE(result.errors.find(option + " /"), std::string::npos) << result.errors;
  EXPECT_NE(result.errors.find(why), std::string::npos) << result.errors;
}

TEST(FileOutputTest, TheModelIsNeverOverwritten) {
  const std::string folder = emptyFolder();
  const std::string model = folder + "/a0.glb";
  std::filesystem::copy_file(barPath, model);
  std::filesystem::create_symlink("a0.glb", folder + "/soft.glb");
  std::filesystem::create_hard_link(model, folder + "/hard.glb");
  std::filesystem::create_hard_link(model, folder + "/b03.glb");
  std::filesystem::create_hard_link(model, folder + "/film.png");
  const std::string bytes = textOf(model);
  const std::string spelling =
      folder + "/../" + outFile("").substr(outFile("").rfind('/') + 1) + "folder/./a0.glb";
  const std::vector<std::vector<std::string>> commands{
      {"-o", "skin", model, "-o", model},
      {"-o", "skin", model, "-o", spelling},
      {"-o", "skin", model, "-o", folder + "/soft.glb"},
      {"-o", "skin", model, "-o", folder + "/hard.glb"},
      {"-o", "skin", folder + "/soft.glb", "-o", folder + "/hard.glb"},
      {"-o", "skin", model, "-o", folder + "/a%01d.glb", "--frames", "1"},
      {"-o", "skin", model, "-o", folder + "/b%02d.glb", "--frames", "4"},
      {"-o", "render", model, "-o", folder + "/film.png"},
      {"-o", "compare", model, "-o", folder + "/film.png"},
      {"--json", "compare", model, "--json", folder + "/soft.glb"},
      {"-o", "skin", barPath, "--clips", barPath, "--clips", model, "-o", folder + "/soft.glb"},
      {"-o", "render", barPath, "--clips", model, "-o", folder + "/film.png"},
      {"--json", "compare", barPath, "--clips", model, "--json", folder + "/soft.glb"},
      {"--json", "verify", barPath, model, "--json", model},
      {"--junit", "verify", model, "--junit", folder + "/hard.glb"},
  };
  for (const std::vector<std::string>& command : commands) {
    expectRefusedOutput(command, " would overwrite an input file");
    EXPECT_TRUE(textOf(model) == bytes);
  }
  const CommandResult few =
      dermis({"skin", model, "-o", folder + "/b%02d.glb", "--frames", "3", "--device", "cpu"});
  EXPECT_EQ(few.status, 0) << "the fourth would be the model" << few.errors;
}

TEST(FileOutputTest, TwoOutputsAreNotOneFile) {
  const std::string folder = emptyFolder();
  const std::string there = folder + "/there.json", link = folder + "/link.xml";
  std::ofstream(there) << "kept";
  std::filesystem::create_symlink("there.json", link);
  const std::vector<std::vector<std::string>> commands{
      {"--junit", "verify", barPath, "--json", there, "--junit", link},
      {"--junit", "verify", "--json", folder + "/new", "--junit", folder + "/./new"},
      {"--json", "compare", barPath, "-o", folder + "/new.png", "--json", folder + "/new.png"},
  };
  for (const std::vector<std::string>& command : commands) {
    expectRefusedOutput(command, " is also the output of -");
    EXPECT_EQ(textOf(there), "kept");
    EXPECT_FALSE(std::filesystem::exists(folder + "/new"));
  }
  const CommandResult devices =
      dermis({"verify", folder + "/no.glb", "--json", "/dev/null", "--junit", "/dev/null"});
  EXPECT_EQ(devices.status, 3) << "it is the model that is missing; " << devices.errors;
}

TEST(FileOutputTest, AReportThatCannotBeWrittenDoesNotKeepTheOtherOne) {
  REQUIRE_DEVICE();
  const std::string folder = emptyFolder(), report = folder + "/good.xml";
  const CommandResult result = dermis(
      {"verify", folder + "/no.glb", "--json", folder + "/none/bad.json", "--junit", report});
  EXPECT_EQ(result.status, 5) << result.errors;
  EXPECT_NE(result.errors.find("bad.json"), std::string::npos) << result.errors;
  EXPECT_NE(textOf(report).find("<error message="), std::string::npos) << textOf(report);
}

TEST(FileOutputTest, FilesBesideTheModelAreNotOverwritten) {
  const std::string folder = outFile("beside");
  std::filesystem::create_directories(folder);
  FileBuilder file = skinnedTriangle();
  const std::string binary = folder + "/triangle.bin", model = folder + "/triangle.gltf";
  std::ofstream(binary, std::ios::binary)
      .write(reinterpret_cast<const char*>(file.binary.data()),
             static_cast<std::streamsize>(file.binary.size()));
  file.json["buffers"] = {{{"byteLength", file.binary.size()}, {"uri", "triangle.bin"}}};
  std::ofstream(model) << file.json.dump();
  const std::string bytes = textOf(binary), link = folder + "/link.ply";
  std::filesystem::remove(link);
  std::filesystem::create_symlink("triangle.bin", link);
  const CommandResult result = dermis({"skin", model, "-o", link, "--device", "cpu"});
  EXPECT_EQ(result.status, 2);
  expectOneErrorLine(result);
  EXPECT_NE(result.errors.find("would overwrite an input file"), std::string::npos)
      << result.errors;
  const CommandResult report =
      dermis({"compare", model, "--device", "cpu", "--json", folder + "/./triangle.bin"});
  EXPECT_EQ(report.status, 2) << report.errors;
  EXPECT_TRUE(textOf(binary) == bytes);
}

// Billions of names cannot be asked for one by one.
TEST(FileOutputTest, FramesAreComparedWithTheFilesThatExist) {
  const std::string folder = emptyFolder();
  const std::vector<std::filesystem::path> inputs{writeText(folder + "/model_00012345.ply")};
  std::filesystem::create_directories(folder + "/07");
  std::filesystem::create_symlink("../model_00012345.ply", folder + "/07/link.ply");
  const auto refusal = [&](const std::string& pattern, std::uint32_t frames) {
    const samples::RequestedOutput output{"-o", folder + "/" + pattern, frames};
    const Result<void> kept = samples::checkOutputFiles({&output, 1}, inputs);
    return kept ? "" : kept.error().message;
  };
  const auto overwrites = [&](const std::string& name) {
    return "-o " + folder + "/" + name + " would overwrite an input file";
  };
  const std::string file = "model_00012345.ply", link = "07/link.ply";
  EXPECT_EQ(refusal("model_%08d.ply", 0xffffffff), overwrites(file));
  EXPECT_EQ(refusal("model_%08d.ply", 12346), overwrites(file));
  EXPECT_EQ(refusal("model_%08d.ply", 12345), "");
  EXPECT_EQ(refusal("model_000%01d.ply", 0xffffffff), overwrites(file)) << "more digits than one";
  EXPECT_EQ(refusal("model_%07d.ply", 0xffffffff), "");
  EXPECT_EQ(refusal("%02d/link.ply", 0xffffffff), overwrites(link));
  EXPECT_EQ(refusal("%02d/other.ply", 0xffffffff), "");
  EXPECT_EQ(refusal("none/%02d.ply", 0xffffffff), "");
}

TEST(FileOutputTest, FramesInAFolderThatCannotBeListedAreCompared) {
  const std::string folder = emptyFolder();
  writeText(folder + "/model_12.ply");
  const pid_t child = fork();
  if (child == 0) {
    // Root may list every folder: the child becomes somebody else.
    if (chdir(folder.c_str()) != 0 || chmod(".", 0111) != 0) _exit(1);
    if (geteuid() == 0 && setuid(65534) != 0) _exit(2);
    const std::vector<std::filesystem::path> inputs{"model_12.ply"};
    const samples::RequestedOutput output{"-o", "model_%02d.ply", 20};
    _exit(samples::checkOutputFiles({&output, 1}, inputs) ? 3 : 0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  EXPECT_EQ(status, 0);
  std::filesystem::permissions(folder, std::filesystem::perms::owner_all);
}

/// A child that has half written a file when a signal comes. How it ended, as waitpid says.
int interruptHalfway(const std::string& out, int signal) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit noCore{0, 0};
    setrlimit(RLIMIT_CORE, &noCore);
    samples::handleSignals();
    auto file = samples::OutputFile::create(out);
    if (!file || !(*file)->write(std::as_bytes(std::span(good).first(5)))) _exit(1);
    raise(signal);
    _exit(2);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return status;
}

TEST(FileOutputTest, ASignalHalfwayRemovesWhatIsUnfinished) {
  std::size_t tried = 0;
  for (int signal = 1; signal < NSIG; ++signal) {
    SCOPED_TRACE(signal);
    const std::set harmless{SIGKILL, SIGSTOP, SIGCHLD, SIGCONT, SIGTSTP, SIGTTIN,
                            SIGTTOU, SIGURG,  SIGPIPE, SIGXFSZ, SIGWINCH};
    struct sigaction action {};
    // A sanitizer handles some.
    if (harmless.contains(signal) || sigaction(signal, nullptr, &action) != 0 ||
        action.sa_handler != SIG_DFL)
      continue;
    ++tried;
    const std::string folder = emptyFolder();
    const std::string out = writeText(folder + "/out");
    const int status = interruptHalfway(out, signal);
    ASSERT_TRUE(WIFSIGNALED(status)) << status;
    EXPECT_EQ(WTERMSIG(status), signal);
    EXPECT_EQ(namesIn(folder), std::vector<std::string>{"out"});
    EXPECT_EQ(textOf(out), good);
  }
  EXPECT_GE(tried, 15u);
}

TEST(FileOutputTest, AnInterruptedCommandLeavesWholeFilesOnly) {
  const std::string folder = emptyFolder();
  const std::string pattern = folder + "/frame%06d.ply";
  const auto hasSome = [&] { return std::filesystem::exists(folder + "/frame000004.ply"); };
  const CommandResult result = runAndSignal(
      {dermisProgram, "skin", barPath, "-o", pattern, "--frames", "5000", "--device", "cpu"}, {},
      hasSome, SIGINT);
  EXPECT_EQ(result.signal, SIGINT) << result.status << result.errors;
  const std::vector<std::string> names = namesIn(folder);
  ASSERT_GE(names.size(), 5u);
  for (const std::string& name : names)
    EXPECT_TRUE(readPly(folder + "/" + name).has_value()) << name;
}

TEST(FileOutputTest, AFileThatIsNotCommittedIsRemoved) {
  const std::string folder = emptyFolder();
  const std::string out = writeText(folder + "/out");
  {
    const auto file = samples::OutputFile::create(out);
    ASSERT_TRUE(file.ok());
    EXPECT_EQ(namesIn(folder).size(), 2u) << "beside it";
    ASSERT_TRUE((*file)->write(std::as_bytes(std::span(good))).ok());
  }
  EXPECT_EQ(namesIn(folder), std::vector<std::string>{"out"});
}

TEST(FileOutputTest, OnlyOnePatternIsAPlaceForANumber) {
  EXPECT_EQ(samples::frameName("a%04d.ply", 7), "a0007.ply");
  EXPECT_EQ(samples::frameName("a%01d.ply", 123), "a123.ply");
  EXPECT_EQ(samples::frameName("100%/a%09d", 7), "100%/a000000007");
  EXPECT_EQ(samples::frameName("%%02d", 7), "%07");
  for (const char* name : {"a.ply", "50% of all.ply", "%s.ply", "%04x.ply", "100%"}) {
    EXPECT_FALSE(samples::frameName(name, 0)) << name;
    EXPECT_FALSE(samples::hasWrongPattern(name)) << name;
  }
  const std::string digits(100'000, '9');
  for (const std::string name :
       {"%d", "%4d", "%0d", "%00d", "%010d", "%-4d", "%+04d", "%.4d", "%04d%04d", "%04d%d"})
    EXPECT_TRUE(samples::hasWrongPattern(name + ".ply")) << name;
  EXPECT_TRUE(samples::hasWrongPattern("%" + digits + "d"));
  EXPECT_FALSE(samples::hasWrongPattern("%" + digits));
  for (const std::string& pattern : {"%" + digits + "d.ply", "%" + digits + ".ply"}) {
    const CommandResult result = runCommand(skinCommand(outFile(pattern)));
    EXPECT_EQ(result.status, pattern.ends_with("d.ply") ? 2 : 5);
    EXPECT_EQ(result.signal, 0);
  }
}

TEST(FileOutputTest, EndingsAreTakenInAnyCase) {
  const std::string folder = emptyFolder();
  for (const char* name : {"A.PLY", "B.Obj", "C.gLB"})
    EXPECT_EQ(runCommand(skinCommand(folder + "/" + name)).status, 0) << name;
  EXPECT_TRUE(readPly(folder + "/A.PLY").has_value());
  EXPECT_EQ(textOf(folder + "/C.gLB").substr(0, 4), "glTF");
}

}  // namespace
}  // namespace dermis::test
