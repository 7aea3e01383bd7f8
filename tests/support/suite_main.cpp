// The main function of programs that ctest runs by suite. Its exit status tells of skipped tests,
// so that a suite with any is not called passed; a failure goes before.

#include <gtest/gtest.h>

int main(int argc, char** argv) {
  constexpr int skipped = 77;  // tests/discover_suites.cmake
  ::testing::InitGoogleTest(&argc, argv);
  if (const int failed = RUN_ALL_TESTS(); failed != 0) return failed;
  return ::testing::UnitTest::GetInstance()->skipped_test_count() > 0 ? skipped : 0;
}
