// Uniform data of one view of a picture. samples/kit/render/lighting.h declares the same in C++.
#ifndef DERMIS_RENDER_VIEW_GLSL
#define DERMIS_RENDER_VIEW_GLSL

const int maxSkyLights = 32;

layout(std140, set = 0, binding = 0) uniform View {
  mat4 viewProjection;
  mat4 keyMatrix;                   // world to the key light's shadow map: clip coordinates
  mat4 skyMatrices[maxSkyLights];
  vec4 skyDirections[maxSkyLights]; // towards the light; w: its share of the sky's light
  vec4 eye;                         // perspective: position, w 1; orthographic: direction towards
                                    // the eye, w 0
  vec4 keyDirection;                // towards the light; w: tangent of its angular radius
  vec4 keyColor;                    // reflected by a white surface that faces the light
  vec4 skyColor;                    // reflected by a white surface under the whole sky
  vec4 bounceColor;                 // reflected by a white surface that faces the ground
  vec4 rimDirection;                // towards the rim light; w: its strength
  vec4 shadow;                      // x: key texel, y: key depth range, z: sky texel (world units);
                                    // w: 1 / size of the key map
  vec4 sky;                         // x: number of lights, y: 1 / size of their maps;
                                    // z: maximum penumbra radius of the key light, in world units;
                                    // w: filter radius of the sky on the ground, as a fraction of its map
  vec4 horizonColor;                // of the background, as displayed, in linear values
  vec4 zenithColor;
  vec4 ground;                      // center; w: radius at which it has faded into the background
  vec4 viewport;                    // origin and size in pixels
  vec4 haze;                        // x: distance at which it begins,
                                    // y: 1 / (distance from there to the maximum), z: maximum
} view;

#endif
