// Tests how programs write files, on every system: Windows has its own implementation.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

#include "kit/file_name.h"
#include "kit/output_file.h"

namespace dermis::test {
namespace {

namespace fs = std::filesystem;

constexpr bool isWindows = fs::path::preferred_separator != '/';

class FilesTest : public testing::Test {
 protected:
  void SetUp() override {
    fs::remove_all(folder_);
    fs::create_directories(folder_);
  }
  void TearDown() override { fs::remove_all(folder_); }

  static std::string read(const fs::path& path) {
    std::ifstream stream(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(stream), {}};
  }
  std::ptrdiff_t fileCount() const {
    return std::distance(fs::directory_iterator(folder_), fs::directory_iterator());
  }

  // Of each test, since they run at the same time.
  const fs::path folder_ = fs::path(testing::TempDir()) /
                           (std::string("dermis_files_") +
                            testing::UnitTest::GetInstance()->current_test_info()->name());
};

TEST_F(FilesTest, AreMadeAndReplacedWhole) {
  const fs::path path = folder_ / fs::path(u8"gr\u00fcn \u65e5\u672c.txt");
  ASSERT_TRUE(samples::writeFile(path, std::string("one\n\x1a two")));
  EXPECT_EQ(read(path), "one\n\x1a two") << "no byte is translated";
  ASSERT_TRUE(samples::writeFile(path, std::string("2")));
  EXPECT_EQ(read(path), "2");
  EXPECT_EQ(fileCount(), 1) << "nothing is left beside it";
}

TEST_F(FilesTest, StayAsTheyAreUntilTheNewOneIsWhole) {
  const fs::path path = folder_ / "a.txt";
  ASSERT_TRUE(samples::writeFile(path, std::string("old")));
  {
    auto file = samples::OutputFile::create(path);
    ASSERT_TRUE(file) << file.error().message;
    ASSERT_TRUE((*file)->write(std::as_bytes(std::span("new", 3))));
    EXPECT_EQ(fileCount(), 2);
  }
  EXPECT_EQ(read(path), "old");
  EXPECT_EQ(fileCount(), 1);
  auto file = samples::OutputFile::create(path);
  ASSERT_TRUE(file) << file.error().message;
  ASSERT_TRUE((*file)->write(std::as_bytes(std::span("new", 3))));
  ASSERT_TRUE((*file)->commit());
  EXPECT_EQ(read(path), "new");
}

TEST_F(FilesTest, SayWhyTheyCannotBeWritten) {
  const auto refused = [](const fs::path& path) {
    const Result<void> written = samples::writeFile(path, std::string("x"));
    EXPECT_FALSE(written) << path;
    return written ? std::string() : written.error().message;
  };
  EXPECT_NE(refused(folder_).find("Is a directory"), std::string::npos) << refused(folder_);
  const std::string absent = refused(folder_ / "absent" / "a.txt");
  EXPECT_NE(absent.find("cannot be written: "), std::string::npos) << absent;
  EXPECT_GT(absent.size(), absent.find("cannot be written: ") + 24) << absent;
#ifdef _WIN32  // elsewhere root may write to it
  const fs::path path = folder_ / "protected.txt";
  ASSERT_TRUE(samples::writeFile(path, std::string("old")));
  fs::permissions(path, fs::perms::owner_write, fs::perm_options::remove);
  EXPECT_NE(refused(path).find("Permission denied"), std::string::npos) << refused(path);
  EXPECT_EQ(read(path), "old");
  fs::permissions(path, fs::perms::owner_write, fs::perm_options::add);
#endif
}

TEST_F(FilesTest, DevicesAreWrittenThrough) {
  const fs::path nowhere = isWindows ? "NUL" : "/dev/null";
  const Result<void> written = samples::writeFile(nowhere, std::string("x"));
  EXPECT_TRUE(written) << written.error().message;
  const auto file = samples::OutputFile::create(nowhere);
  EXPECT_EQ(file.ok(), !isWindows);
}

TEST_F(FilesTest, OneFileWithTwoNamesIsFound) {
  const fs::path path = folder_ / "model.glb";
  ASSERT_TRUE(samples::writeFile(path, std::string("model")));
  ASSERT_TRUE(samples::writeFile(folder_ / "other.glb", std::string("other")));
  const std::vector<fs::path> inputs{path};
  const auto check = [&](const fs::path& output) {
    const samples::RequestedOutput wanted{"--output", output.string()};
    return samples::checkOutputFiles({&wanted, 1}, inputs);
  };
  EXPECT_FALSE(check(path));
  EXPECT_FALSE(check(folder_ / "." / "model.glb"));
  EXPECT_EQ(!check(folder_ / "MODEL.GLB"), isWindows);
  EXPECT_TRUE(check(folder_ / "other.glb"));
  EXPECT_TRUE(check(folder_ / "new.glb"));
  // Two outputs, neither of which is there.
  const samples::RequestedOutput both[] = {{"--a", (folder_ / "new.txt").string()},
                                           {"--b", (folder_ / "." / "new.txt").string()}};
  EXPECT_FALSE(samples::checkOutputFiles(both, {}));
}

}  // namespace
}  // namespace dermis::test
