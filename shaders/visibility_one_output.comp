#version 450
#extension GL_GOOGLE_include_directive : require

// The visibility kernel for devices with four storage buffers a stage.

#define ONE_OUTPUT
#include "visibility.glsl"
