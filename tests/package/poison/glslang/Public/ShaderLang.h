#error "dermis::core must not need <glslang/Public/ShaderLang.h>"
