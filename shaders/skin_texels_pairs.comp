#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_samplerless_texture_functions : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

// skin_texels.comp for positions and normals that stand together.

#define TEXELS
#define STORE_PAIRS
#include "skin.glsl"
