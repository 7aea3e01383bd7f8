#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_memory_scope_semantics : require

// The visibility kernel.

#include "visibility.glsl"
