// Films by a real ffmpeg: that what is written can be played, and shows what was drawn. Other tests
// pretend to be ffmpeg; tests/run.sh nightly runs this one.

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "dermis_command.h"
#include "pictures.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

/// "codec,width,height,pictures a second,pictures" of the film, counted by decoding it.
std::string probe(const std::string& film) {
  const CommandResult result = runCommand(
      {"/usr/bin/env", "ffprobe", "-v", "error", "-count_frames", "-select_streams", "v:0",
       "-show_entries", "stream=codec_name,width,height,r_frame_rate,nb_read_frames", "-of",
       "csv=p=0", film});
  EXPECT_EQ(result.status, 0) << result.errors;
  return result.output.substr(0, result.output.find('\n'));
}

TEST(RealFilmTest, RenderWritesAFilmThatPlays) {
  REQUIRE_DEVICE();
  const auto withFrames = [](const std::string& out) {
    return std::vector<std::string>{"render",   std::string(sampleModels) + "/arm.glb",
                                    "-o",       out,
                                    "--frames", "3",
                                    "--fps",    "4",
                                    "--time",   "0.25",
                                    "--width",  "320",
                                    "--height", "180"};
  };
  const std::string film = outFile("film.mp4"), second = outFile("second.png");
  const CommandResult filmed = dermis(withFrames(film));
  ASSERT_EQ(filmed.status, 0) << filmed.errors;
  EXPECT_EQ(probe(film), "h264,320,180,4/1,3");

  const CommandResult extracted =
      runCommand({"/usr/bin/env", "ffmpeg", "-v", "error", "-y", "-i", film, "-vf",
                  "select=eq(n\\,1)", "-frames:v", "1", second});
  ASSERT_EQ(extracted.status, 0) << extracted.errors;
  // The camera looks at all pictures of a film, so that one alone would be another.
  ASSERT_EQ(dermis(withFrames(outFile("drawn%01d.png"))).status, 0);
  const auto shown = readPng(second), expected = readPng(outFile("drawn1.png")),
             other = readPng(outFile("drawn2.png"));
  ASSERT_TRUE(shown && expected && other);
  // H.264 loses little; the next picture is quite another.
  EXPECT_GT(comparePictures(*shown, *expected).similarity, 0.95);
  EXPECT_LT(comparePictures(*shown, *expected).worstColor, 10);
  EXPECT_GT(comparePictures(*shown, *other).worstColor, 30);
}

}  // namespace
}  // namespace dermis::test
