#version 450
#extension GL_GOOGLE_include_directive : require

// The visibility kernel.

#include "visibility.glsl"
