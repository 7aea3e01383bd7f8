// The dermis command under test: running it, and what all tests of it ask.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <fstream>
#include <iterator>
#include <sstream>
#include <string>
#include <vector>

#include "run_command.h"
#include "test_device.h"
#include "test_paths.h"

namespace dermis::test {

inline CommandResult dermis(std::vector<std::string> arguments,
                            const std::vector<std::string>& environment = {}) {
  arguments.insert(arguments.begin(), dermisProgram);
  return runCommand(arguments, environment);
}

/// Of the running test alone: others may run at the same time.
inline std::string outFile(const std::string& name) {
  const ::testing::TestInfo* test = ::testing::UnitTest::GetInstance()->current_test_info();
  return ::testing::TempDir() + test->test_suite_name() + "_" + test->name() + "_" + name;
}

inline std::string readText(const std::string& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

/// One line "dermis: error: …"; any others are warnings and notes.
inline void expectOneErrorLine(const CommandResult& result) {
  std::size_t errors = 0;
  std::istringstream lines(result.errors);
  for (std::string line; std::getline(lines, line);) {
    if (line.starts_with("dermis: error: ")) {
      ++errors;
    } else {
      EXPECT_TRUE(line.starts_with("dermis: warning: ") || line.starts_with("dermis: note: "))
          << line;
    }
  }
  EXPECT_EQ(errors, 1u) << result.errors;
}

}  // namespace dermis::test

/// Skips, or fails in CI, without a device.
#define REQUIRE_DEVICE()                                                 \
  do {                                                                   \
    std::string reason;                                                  \
    if (::dermis::test::testDevice(true, reason) == nullptr) {           \
      ASSERT_FALSE(::dermis::test::isContinuousIntegration()) << reason; \
      GTEST_SKIP() << reason;                                            \
    }                                                                    \
  } while (false)

/// Skips, or fails in CI, where the system has no pseudo-terminals.
#define REQUIRE_TERMINAL()                                               \
  do {                                                                   \
    const std::string reason = ::dermis::test::whyNoTerminal();          \
    if (!reason.empty()) {                                               \
      ASSERT_FALSE(::dermis::test::isContinuousIntegration()) << reason; \
      GTEST_SKIP() << reason;                                            \
    }                                                                    \
  } while (false)
