// Pictures compared as an eye does it: what two drivers round differently does not count, what is
// in another place or of another color does.
#pragma once

#include <optional>
#include <string>

#include "kit/render/picture.h"

namespace dermis::test {

/// A PNG file.
std::optional<samples::render::Picture> readPng(const std::string& path);

struct PictureDifference {
  /// Mean structural similarity of the luminances, in windows of 8 x 8 pixels: 1 for the same
  /// (Wang et al. 2004, "Image quality assessment").
  double similarity = 0;
  double worstSimilarity = 0;  ///< of a window
  /// The largest difference of the mean colors of two such windows, 0 to 255.
  double worstColor = 255;
  /// That of the whole pictures: all a little brighter is seen by no window.
  double meanColor = 255;
  double contrast = 1;  ///< how far the quotient of both luminances' standard deviations is from 1
  /// The largest difference that all of 3 x 3 pixels have, 0 to 255. Where an edge is drawn a pixel
  /// further it is a line of pixels that differs, at most two wide.
  double worstPatch = 255;
};

/// Pictures of different sizes have nothing in common.
PictureDifference comparePictures(const samples::render::Picture& a,
                                  const samples::render::Picture& b);

/// How little alike and how far apart pictures of the same may be.
struct PictureTolerance {
  double similarity = 0.99, worstSimilarity = 0.7;
  double worstColor = 10;
  double meanColor = 1.5;
  double contrast = 0.03;
  double worstPatch = 24;
};

bool isWithin(const PictureTolerance& tolerance, const PictureDifference& difference);

/// A test fails unless the picture looks as tests/render/references/NAME.png does. With
/// DERMIS_UPDATE_REFERENCES in the environment it becomes that file: look at it before it is
/// committed.
void expectAsReference(const std::string& name, const samples::render::Picture& picture,
                       const PictureTolerance& tolerance = {});

}  // namespace dermis::test
