#error "dermis::core must not need <spirv-tools/optimizer.hpp>"
