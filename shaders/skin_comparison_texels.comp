#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_samplerless_texture_functions : require

// skin_texels.comp for the methods that are there for comparison.

#define COMPARISON
#define TEXELS
#include "skin.glsl"
