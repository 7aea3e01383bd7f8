// Checks what `packClips` gets.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "dermis/clips.h"

namespace dermis {

Result<void> checkClipInput(const Skeleton& skeleton, std::span<const ClipView> clips,
                            const PackClipsOptions& options);

/// The nodes with parents before their children. Those of a cycle, and below one, are left out.
std::vector<std::uint32_t> parentsFirst(const std::vector<SkeletonNode>& nodes);

/// "node 3 'hand'", for messages.
std::string titled(const char* kind, std::size_t number, std::string_view name);

}  // namespace dermis
