#error "dermis::core must not need <vulkan/vulkan_core.h>"
