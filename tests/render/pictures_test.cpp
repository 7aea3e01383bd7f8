// Whether what is wrong with a picture is seen, and what two drivers round differently is not: the
// references themselves, and what must not pass for them.

#include "pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <string>
#include <utility>

#include "test_paths.h"

namespace dermis::test {
namespace {

using samples::render::Picture;

class PicturesTest : public ::testing::TestWithParam<const char*> {
 protected:
  void SetUp() override {
    const std::string path =
        std::string(sourceFolder) + "/tests/render/references/" + GetParam() + ".png";
    std::optional<Picture> read = readPng(path);
    ASSERT_TRUE(read.has_value()) << path;
    reference_ = std::move(*read);
  }

  /// Whether the picture would pass for the reference.
  bool passes(const Picture& picture) const {
    return isWithin({}, comparePictures(picture, reference_));
  }

  /// The reference, each channel of each pixel changed.
  template <typename Change>
  Picture changed(const Change& change) const {
    Picture picture = reference_;
    for (std::size_t i = 0; i < picture.pixels.size(); ++i) {
      if (i % 4 == 3) continue;
      const double value = change(picture.pixels[i]);
      picture.pixels[i] = static_cast<std::uint8_t>(std::clamp(std::lround(value), 0L, 255L));
    }
    return picture;
  }

  std::uint8_t* pixelOf(Picture& picture, std::uint32_t x, std::uint32_t y) const {
    return &picture.pixels[4 * (std::size_t{y} * picture.width + x)];
  }

  Picture reference_;
};

TEST_P(PicturesTest, TheSamePasses) {
  EXPECT_TRUE(passes(reference_));
}

TEST_P(PicturesTest, RoundingPasses) {
  std::minstd_rand random(1);
  EXPECT_TRUE(
      passes(changed([&random](int value) { return value + static_cast<int>(random() % 3) - 1; })));
}

TEST_P(PicturesTest, BrighterOrDarkerAllOverIsSeen) {
  for (const int shift : {8, -8, 3, -3})
    EXPECT_FALSE(passes(changed([shift](int value) { return value + shift; }))) << shift;
}

TEST_P(PicturesTest, LessOrMoreContrastIsSeen) {
  for (const double factor : {0.9, 0.95, 1.05, 1.1}) {
    EXPECT_FALSE(passes(changed([factor](int value) { return 127.5 + (value - 127.5) * factor; })))
        << factor;
  }
}

TEST_P(PicturesTest, AHoleOfThreeByThreeIsSeen) {
  // Everywhere, corners included, in black and in white.
  std::size_t holes = 0;
  for (const std::uint8_t color : {std::uint8_t{0}, std::uint8_t{255}}) {
    for (std::uint32_t i = 0; i <= 4; ++i) {
      for (std::uint32_t j = 0; j <= 4; ++j) {
        const std::uint32_t left = (reference_.width - 3) * i / 4;
        const std::uint32_t top = (reference_.height - 3) * j / 4;
        Picture picture = reference_;
        int least = 255;
        for (std::uint32_t pixel = 0; pixel < 9; ++pixel) {
          std::uint8_t* rgb = pixelOf(picture, left + pixel % 3, top + pixel / 3);
          int largest = 0;
          for (int channel = 0; channel < 3; ++channel) {
            largest = std::max(largest, std::abs(rgb[channel] - color));
            rgb[channel] = color;
          }
          least = std::min(least, largest);
        }
        if (least < 25) continue;  // it is nearly of that color
        ++holes;
        EXPECT_FALSE(passes(picture)) << left << ", " << top;
      }
    }
  }
  EXPECT_GT(holes, 25u);
}

TEST_P(PicturesTest, ItsLastRowsAndColumnsCount) {
  Picture rows = reference_, columns = reference_;
  for (std::uint32_t x = 0; x < rows.width; ++x) {
    for (std::uint32_t y = rows.height - 3; y < rows.height; ++y) pixelOf(rows, x, y)[0] ^= 0x80;
  }
  for (std::uint32_t y = 0; y < columns.height; ++y) {
    for (std::uint32_t x = columns.width - 3; x < columns.width; ++x)
      pixelOf(columns, x, y)[1] ^= 0x80;
  }
  EXPECT_GT(comparePictures(rows, reference_).worstColor, 40);
  EXPECT_GT(comparePictures(columns, reference_).worstColor, 40);
  EXPECT_FALSE(passes(rows));
  EXPECT_FALSE(passes(columns));
}

TEST_P(PicturesTest, AShiftByOnePixelIsSeen) {
  Picture shifted = reference_;
  std::copy(reference_.pixels.begin() + 4, reference_.pixels.end(), shifted.pixels.begin());
  EXPECT_FALSE(passes(shifted));
}

INSTANTIATE_TEST_SUITE_P(References, PicturesTest,
                         ::testing::Values("arm", "bar", "comparison", "crowd", "film", "walk",
                                           "wave"),
                         [](const ::testing::TestParamInfo<const char*>& reference) {
                           return std::string(reference.param);
                         });

}  // namespace
}  // namespace dermis::test
