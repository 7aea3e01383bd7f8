// Names from files in messages: short, on one line, and nothing in them that a terminal obeys.
#include <dermis/mesh.h>
#include <gtest/gtest.h>
#include "core/text.h"

#include <string>

namespace dermis::test {
namespace {

TEST(Text, KeepsWhatCanBePrinted) {
  for (const char* name : {"", "Fox", "gr\xc3\xbcn", "\xe7\x8b\x90", "\xf0\x9f\xa6\x8a", "a\\b'c"})
    EXPECT_EQ(oneLine(name), name);
}

TEST(Text, EscapesControlsAndMarksOfDirection) {
  EXPECT_EQ(oneLine("a\nb\r\t\x1b[31m\x7f"), "a\\nb\\u000d\\u0009\\u001b[31m\\u007f");
  EXPECT_EQ(oneLine(std::string("\0", 1)), "\\u0000");
  EXPECT_EQ(oneLine("\xc2\x9b"), "\\u009b");      // C1: another way to begin a sequence
  EXPECT_EQ(oneLine("\xe2\x80\xae"), "\\u202e");  // right-to-left override
  EXPECT_EQ(oneLine("\xe2\x81\xa6\xe2\x81\xa9\xe2\x80\x8f\xd8\x9c"),
            "\\u2066\\u2069\\u200f\\u061c");
  EXPECT_EQ(oneLine("\xe2\x80\xa8\xe2\x80\xa9"), "\\u2028\\u2029");
}

TEST(Text, EscapesWhatIsNotUtf8) {
  EXPECT_EQ(oneLine("\xff\x80"), "\\xff\\x80");
  EXPECT_EQ(oneLine("\xc3"), "\\xc3");
  EXPECT_EQ(oneLine("\xc0\x8a"), "\\xc0\\x8a") << "a line end in two bytes";
  EXPECT_EQ(oneLine("\xed\xa0\x80"), "\\xed\\xa0\\x80") << "half of a surrogate pair";
  EXPECT_EQ(oneLine("\xf4\x90\x80\x80"), "\\xf4\\x90\\x80\\x80") << "beyond Unicode";
  EXPECT_EQ(oneLine("\xe2\x82z"), "\\xe2\\x82z");
}

TEST(Text, CutsNamesAtEightyCharacters) {
  const std::string eighty(80, 'x');
  EXPECT_EQ(shortName(eighty), eighty);
  EXPECT_EQ(shortName(eighty + "y"), eighty + "...");
  EXPECT_EQ(inQuotes(std::string(3'000'000, 'x')), "'" + eighty + "...'");
  std::string foxes;
  for (int i = 0; i < 81; ++i) foxes += "\xf0\x9f\xa6\x8a";
  EXPECT_EQ(shortName(foxes), foxes.substr(0, 4 * 80) + "...") << "characters, not bytes";
  EXPECT_EQ(shortName(std::string(81, '\n')).size(), 83u) << "what is shown counts";
}

TEST(Text, MeshNamesInFindingsAreShort) {
  MeshView mesh;
  const std::string name = "\x1b" + std::string(3'000'000, 'x');
  mesh.name = name;
  const MeshReport report = validate(mesh, 1);
  ASSERT_FALSE(report.findings.empty());
  EXPECT_TRUE(report.findings[0].message.starts_with("mesh '\\u001bxxx"))
      << report.findings[0].message.substr(0, 100);
  EXPECT_LT(report.findings[0].message.size(), 150u);
}

}  // namespace
}  // namespace dermis::test
