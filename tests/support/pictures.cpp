#include "pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <fstream>
#include <iterator>
#include <span>
#include <utility>
#include <vector>

#include "kit/render/image.h"
#include "test_paths.h"

namespace dermis::test {
namespace {

using samples::render::Picture;

constexpr std::uint32_t window = 8;

struct Window {
  std::array<double, 3> color{};
  std::array<double, window * window> luminance{};
};

Window windowAt(const Picture& picture, std::uint32_t left, std::uint32_t top) {
  Window result;
  for (std::uint32_t i = 0; i < window * window; ++i) {
    const std::size_t place = std::size_t{top + i / window} * picture.width + left + i % window;
    const std::uint8_t* pixel = &picture.pixels[place * 4];
    for (std::size_t channel = 0; channel < 3; ++channel)
      result.color[channel] += pixel[channel] / static_cast<double>(window * window);
    result.luminance[i] = 0.2126 * pixel[0] + 0.7152 * pixel[1] + 0.0722 * pixel[2];
  }
  return result;
}

double meanOf(const Window& of) {
  double sum = 0;
  for (const double value : of.luminance) sum += value;
  return sum / static_cast<double>(of.luminance.size());
}

double similarityOf(const Window& a, const Window& b) {
  // The constants of the paper, for values from 0 to 255.
  constexpr double c1 = 6.5025, c2 = 58.5225;
  const double meanA = meanOf(a), meanB = meanOf(b);
  double varianceA = 0, varianceB = 0, covariance = 0;
  for (std::size_t i = 0; i < a.luminance.size(); ++i) {
    const double da = a.luminance[i] - meanA, db = b.luminance[i] - meanB;
    varianceA += da * da;
    varianceB += db * db;
    covariance += da * db;
  }
  const double count = static_cast<double>(a.luminance.size()) - 1;
  return (2 * meanA * meanB + c1) * (2 * covariance / count + c2) /
         ((meanA * meanA + meanB * meanB + c1) * ((varianceA + varianceB) / count + c2));
}

/// Every fourth place, and the last, so that no pixel is left out.
std::vector<std::uint32_t> windowPlaces(std::uint32_t size) {
  std::vector<std::uint32_t> places;
  for (std::uint32_t place = 0; place + window < size; place += window / 2) places.push_back(place);
  places.push_back(size - window);
  return places;
}

/// Of a whole picture.
struct Statistics {
  std::array<double, 3> color{};
  double deviation = 0;  ///< of the luminance
};

Statistics statisticsOf(const Picture& picture) {
  const double count = static_cast<double>(picture.width) * picture.height;
  Statistics result;
  double sum = 0, squares = 0;
  for (std::size_t pixel = 0; pixel < picture.pixels.size(); pixel += 4) {
    const std::uint8_t* rgb = &picture.pixels[pixel];
    for (std::size_t channel = 0; channel < 3; ++channel)
      result.color[channel] += rgb[channel] / count;
    const double luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
    sum += luminance / count;
    squares += luminance * luminance / count;
  }
  result.deviation = std::sqrt(std::max(0.0, squares - sum * sum));
  return result;
}

void compareWholes(const Picture& a, const Picture& b, PictureDifference& difference) {
  const Statistics ofA = statisticsOf(a), ofB = statisticsOf(b);
  difference.meanColor = 0;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    difference.meanColor =
        std::max(difference.meanColor, std::abs(ofA.color[channel] - ofB.color[channel]));
  }
  // One step of 255 more, so that pictures of one color have a quotient, too.
  difference.contrast = std::abs((ofA.deviation + 1) / (ofB.deviation + 1) - 1);
}

int differenceAt(const Picture& a, const Picture& b, std::size_t pixel) {
  int largest = 0;
  for (std::size_t channel = 0; channel < 3; ++channel)
    largest =
        std::max(largest, std::abs(a.pixels[4 * pixel + channel] - b.pixels[4 * pixel + channel]));
  return largest;
}

void comparePatches(const Picture& a, const Picture& b, PictureDifference& difference) {
  difference.worstPatch = 0;
  for (std::size_t top = 0; top + 3 <= a.height; ++top) {
    for (std::size_t left = 0; left + 3 <= a.width; ++left) {
      int least = 255;
      for (std::size_t i = 0; i < 9; ++i)
        least = std::min(least, differenceAt(a, b, (top + i / 3) * a.width + left + i % 3));
      difference.worstPatch = std::max(difference.worstPatch, static_cast<double>(least));
    }
  }
}

}  // namespace

std::optional<Picture> readPng(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  const std::vector<char> bytes(std::istreambuf_iterator<char>(file), {});
  Result<samples::render::TexturePixels> pixels =
      samples::render::decodeImage(std::as_bytes(std::span(bytes)));
  if (!pixels) return std::nullopt;
  return Picture{pixels->width, pixels->height, std::move(pixels->pixels)};
}

PictureDifference comparePictures(const Picture& a, const Picture& b) {
  PictureDifference difference;
  if (a.width != b.width || a.height != b.height || a.width < window || a.height < window)
    return difference;
  difference.worstColor = 0;
  difference.worstSimilarity = 1;
  double sum = 0;
  std::size_t count = 0;
  for (const std::uint32_t top : windowPlaces(a.height)) {
    for (const std::uint32_t left : windowPlaces(a.width)) {
      const Window ofA = windowAt(a, left, top), ofB = windowAt(b, left, top);
      const double similarity = similarityOf(ofA, ofB);
      sum += similarity;
      ++count;
      difference.worstSimilarity = std::min(difference.worstSimilarity, similarity);
      for (std::size_t channel = 0; channel < 3; ++channel) {
        difference.worstColor =
            std::max(difference.worstColor, std::abs(ofA.color[channel] - ofB.color[channel]));
      }
    }
  }
  difference.similarity = sum / static_cast<double>(count);
  compareWholes(a, b, difference);
  comparePatches(a, b, difference);
  return difference;
}

bool isWithin(const PictureTolerance& tolerance, const PictureDifference& difference) {
  return difference.similarity > tolerance.similarity &&
         difference.worstSimilarity > tolerance.worstSimilarity &&
         difference.worstColor < tolerance.worstColor &&
         difference.meanColor < tolerance.meanColor && difference.contrast < tolerance.contrast &&
         difference.worstPatch < tolerance.worstPatch;
}

void expectAsReference(const std::string& name, const Picture& picture,
                       const PictureTolerance& tolerance) {
  SCOPED_TRACE(name);
  const std::string path = std::string(sourceFolder) + "/tests/render/references/" + name + ".png";
  if (std::getenv("DERMIS_UPDATE_REFERENCES") != nullptr) {
    const auto bytes = samples::render::encodePng(picture);
    ASSERT_TRUE(bytes);
    std::ofstream(path, std::ios::binary)
        .write(reinterpret_cast<const char*>(bytes->data()),
               static_cast<std::streamsize>(bytes->size()));
  }
  const auto reference = readPng(path);
  ASSERT_TRUE(reference) << path;
  const PictureDifference difference = comparePictures(picture, *reference);
  EXPECT_TRUE(isWithin(tolerance, difference))
      << "similarity " << difference.similarity << ", in the worst window "
      << difference.worstSimilarity << "; colors differ by " << difference.worstColor
      << " in a window, " << difference.meanColor << " altogether, " << difference.worstPatch
      << " in 3 x 3 pixels; contrast by " << difference.contrast;
}

}  // namespace dermis::test
