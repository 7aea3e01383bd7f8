// A skeleton and its clips, for the caller.
#pragma once

#include <array>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "dermis/clips.h"
#include "dermis/dermis.h"

namespace dermis::c {

/// What a source points to. The keys remain those of the views.
struct ClipsForCaller {
  ClipsForCaller(const Skeleton& skeleton, std::span<const ClipView> views);
  ClipsForCaller(const ClipsForCaller&) = delete;
  ClipsForCaller& operator=(const ClipsForCaller&) = delete;

  dermis_clips_source source{};

 private:
  std::deque<std::string> names_;
  std::deque<std::array<double, 12>> matrices_;
  std::deque<std::vector<dermis_channel>> channels_;
  std::vector<dermis_node> nodes_;
  std::vector<dermis_skin> skins_;
  std::vector<dermis_clip_view> clips_;
};

}  // namespace dermis::c
