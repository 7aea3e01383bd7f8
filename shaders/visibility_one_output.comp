#version 450
#extension GL_GOOGLE_include_directive : require
#extension GL_KHR_memory_scope_semantics : require

// The visibility kernel for devices with four storage buffers a stage.

#define ONE_OUTPUT
#include "visibility.glsl"
