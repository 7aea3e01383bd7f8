#error "dermis::core must not need <vulkan/vulkan.h>"
