#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_shader_16bit_storage : require

// skin_halves.comp for the methods that are there for comparison.

#define COMPARISON
#define STORE_HALVES
#include "skin.glsl"
