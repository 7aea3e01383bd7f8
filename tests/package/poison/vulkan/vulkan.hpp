#error "dermis::core must not need <vulkan/vulkan.hpp>"
