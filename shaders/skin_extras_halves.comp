#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_16bit_storage : require

// The same for attributes at any 2 bytes.

#define EXTRAS
#define STORE_HALVES
#include "skin.glsl"
