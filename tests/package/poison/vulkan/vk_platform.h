#error "dermis::core must not need <vulkan/vk_platform.h>"
