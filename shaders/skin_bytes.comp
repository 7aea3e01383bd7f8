#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_16bit_storage : require
#extension GL_EXT_shader_8bit_storage : require

// The skin kernel for attributes at any byte.

#define STORE_HALVES
#define STORE_BYTES
#include "skin.glsl"
