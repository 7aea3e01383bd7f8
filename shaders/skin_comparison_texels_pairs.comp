#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_samplerless_texture_functions : require
#extension GL_EXT_shader_explicit_arithmetic_types_int64 : require

// skin_texels_pairs.comp for the methods that are there for comparison.

#define COMPARISON
#define TEXELS
#define STORE_PAIRS
#include "skin.glsl"
