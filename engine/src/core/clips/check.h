// Checks what `packClips` gets.
#pragma once

#include <string>

#include "dermis/clips.h"

namespace dermis {

Result<void> checkClipInput(const Skeleton& skeleton, std::span<const ClipView> clips,
                            const PackClipsOptions& options);

/// "node 3 'hand'", for messages.
std::string titled(const char* kind, std::size_t number, std::string_view name);

}  // namespace dermis
