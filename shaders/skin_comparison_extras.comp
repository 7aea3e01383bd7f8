#version 450
#extension GL_GOOGLE_include_directive : require

// skin_extras.comp for the methods that are there for comparison.

#define COMPARISON
#define EXTRAS
#include "skin.glsl"
