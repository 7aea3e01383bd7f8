#version 450
#include "lighting.glsl"

layout(location = 0) in vec3 worldPosition;

layout(location = 0) out vec4 displayed;

// The ground is the background plus shadows, so it has no edge and no horizon.
void main() {
  vec3 background = backgroundAt(gl_FragCoord.xy);
  const vec3 up = vec3(0.0, 1.0, 0.0);
  float away = distance(worldPosition.xz, view.ground.xz) / view.ground.w;
  float fade = 1.0 - smoothstep(0.45, 1.0, away);
  vec2 sky = skyLight(worldPosition, up, view.sky.w);
  vec3 key = view.keyColor.rgb * view.keyDirection.y;
  vec3 skyColor = view.skyColor.rgb * 0.75;
  vec3 arriving = key * keyVisibility(worldPosition, up) + skyColor * sky.x;
  vec3 most = key + skyColor * sky.y;
  if (view.haze.z > 0.0) {
    float far = clamp((distance(view.eye.xyz, worldPosition) - view.haze.x) * view.haze.y, 0.0, 1.0);
    fade *= 1.0 - view.haze.z * far;
  }
  vec3 shaded = background * mix(vec3(1.0), arriving / most, fade);
  displayed = vec4(dithered(shaded, gl_FragCoord.xy), 1.0);
}
