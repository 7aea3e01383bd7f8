#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_samplerless_texture_functions : require

// The same with previous positions and results.

#define EXTRAS
#define TEXELS
#include "skin.glsl"
