#version 450
#extension GL_GOOGLE_include_directive : require

// skin.comp for the methods that are there for comparison.

#define COMPARISON
#include "skin.glsl"
