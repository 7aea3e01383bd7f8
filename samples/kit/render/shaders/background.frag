#version 450
#include "lighting.glsl"

layout(location = 0) out vec4 displayed;

void main() {
  displayed = vec4(dithered(backgroundAt(gl_FragCoord.xy), gl_FragCoord.xy), 1.0);
}
