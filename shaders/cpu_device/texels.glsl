// Tables, meshes and palettes as uniform texel buffers, which lavapipe reads much faster than storage buffers.
#ifndef DERMIS_TEXELS_GLSL
#define DERMIS_TEXELS_GLSL

#include "../abi.h"

layout(set = 0, binding = BINDING_TABLE_TEXELS) uniform utextureBuffer tableTexels;
layout(set = 0, binding = BINDING_MESH_TEXELS) uniform utextureBuffer meshTexels;
layout(set = 0, binding = BINDING_PALETTE_TEXELS) uniform utextureBuffer paletteTexels;

uvec4 tableUnit(uint word) { return texelFetch(tableTexels, int(word / 4u)); }
uvec4 meshUnit(uint unit) { return texelFetch(meshTexels, int(unit)); }
uint meshWord(uint word) { return meshUnit(word / 4u)[word % 4u]; }
uvec4 paletteBits(uint unit) { return texelFetch(paletteTexels, int(unit)); }

#endif
