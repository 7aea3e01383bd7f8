// Makes everything that can happen to figures happen often: for tests, not for show.
#pragma once

#include "character.h"
#include "figures.h"

namespace crowd {

class Drill final : public Figures {
 public:
  Drill(const Character& character, std::uint32_t count) : Figures(count), character_(&character) {}

  FigureFrame at(std::uint32_t figure, std::uint64_t frame) const override;

 private:
  PoseKey poseAt(std::uint32_t figure, std::uint64_t frame) const;

  const Character* character_;
};

}  // namespace crowd
