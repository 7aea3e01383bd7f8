#version 450
#extension GL_GOOGLE_include_directive : require

// The skin kernel with previous positions and results.

#define EXTRAS
#include "skin.glsl"
