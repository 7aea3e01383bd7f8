// Sample models that the command contains, as binary glTF: samples/models/bar.glb and arm.glb.
#pragma once

#include <cstddef>
#include <span>

namespace dermis::cli {

extern const std::span<const std::byte> embeddedBar, embeddedArm;

}  // namespace dermis::cli
