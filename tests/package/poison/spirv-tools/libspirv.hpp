#error "dermis::core must not need <spirv-tools/libspirv.hpp>"
