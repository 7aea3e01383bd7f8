#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_samplerless_texture_functions : require

// The skin kernel reading through uniform texel buffers.

#define TEXELS
#include "skin.glsl"
