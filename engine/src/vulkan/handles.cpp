// context.h declares what vulkan_core.h declares: this file compiles only if both agree.
#include "dermis/vulkan/context.h"

#include <vulkan/vulkan_core.h>

namespace dermis::vulkan {

static_assert(vertexBufferUsage == VK_BUFFER_USAGE_VERTEX_BUFFER_BIT);

}  // namespace dermis::vulkan
