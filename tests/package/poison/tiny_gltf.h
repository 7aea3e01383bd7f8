#error "dermis::core must not need <tiny_gltf.h>"
