#version 450
#extension GL_GOOGLE_include_directive : require

// The palette kernel.

#include "palette.glsl"
