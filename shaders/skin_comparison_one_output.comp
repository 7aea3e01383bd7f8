#version 450
#extension GL_GOOGLE_include_directive : require

// skin_one_output.comp for the methods that are there for comparison.

#define COMPARISON
#define ONE_OUTPUT
#include "skin.glsl"
