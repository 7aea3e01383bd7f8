#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_16bit_storage : require
#extension GL_EXT_shader_8bit_storage : require

// skin_extras_bytes.comp for the methods that are there for comparison.

#define COMPARISON
#define EXTRAS
#define STORE_HALVES
#define STORE_BYTES
#include "skin.glsl"
