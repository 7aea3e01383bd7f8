#version 450
#extension GL_GOOGLE_include_directive : require

// The skin kernel for attributes that fill whole words.

#include "skin.glsl"
