#version 450
#include "draw.glsl"
#include "lighting.glsl"
#include "tone.glsl"

layout(location = 0) in vec3 worldPosition;
layout(location = 1) in vec3 worldNormal;
layout(location = 2) in vec2 surfaceTexcoord;
layout(location = 3) in vec4 surfaceColor;
layout(location = 4) in float surfaceValue;

layout(location = 0) out vec4 displayed;

layout(set = 1, binding = 0) uniform sampler2D baseColorTexture;

layout(constant_id = 4) const bool isFlat = false;  // there are no normals
layout(constant_id = 5) const int alphaMode = 0;    // opaque, mask, blend

vec3 surfaceNormal() {
  // As the glTF specification requires for a mesh without normals.
  if (isFlat) {
    vec3 normal = normalize(cross(dFdx(worldPosition), dFdy(worldPosition)));
    vec3 towardsEye = view.eye.w == 0.0 ? view.eye.xyz : view.eye.xyz - worldPosition;
    return dot(normal, towardsEye) < 0.0 ? -normal : normal;
  }
  float size = length(worldNormal);
  vec3 normal = size > 0.0 ? worldNormal / size : vec3(0.0, 1.0, 0.0);
  return gl_FrontFacing ? normal : -normal;
}

// From low to high values: slate, teal, green, yellow, red.
vec3 heat(float value) {
  const vec3 stops[5] = vec3[](vec3(0.10, 0.13, 0.22), vec3(0.05, 0.32, 0.42), vec3(0.25, 0.60, 0.30),
                               vec3(0.90, 0.65, 0.10), vec3(0.75, 0.05, 0.03));
  float place = clamp(value, 0.0, 1.0) * 4.0;
  int stop = min(int(place), 3);
  return mix(stops[stop], stops[stop + 1], place - float(stop));
}

// GGX (Walter et al. 2007, "Microfacet models for refraction") with the masking-shadowing term of Hammon 2017 ("PBR diffuse
// lighting for GGX+Smith microsurfaces") and Schlick's Fresnel term; times the cosine, for a light of unit irradiance.
vec3 specular(vec3 normal, vec3 towardsEye, vec3 towardsLight, float roughness, vec3 reflectance) {
  vec3 half_ = normalize(towardsEye + towardsLight);
  float cosineLight = max(dot(normal, towardsLight), 0.0);
  float cosineEye = max(dot(normal, towardsEye), 1e-3);
  float cosineHalf = max(dot(normal, half_), 0.0);
  float alpha = roughness * roughness;
  float alpha2 = alpha * alpha;
  float denominator = cosineHalf * cosineHalf * (alpha2 - 1.0) + 1.0;
  float distribution = alpha2 / (3.14159265 * denominator * denominator);
  float masking = 0.5 / mix(2.0 * cosineLight * cosineEye, cosineLight + cosineEye, alpha);
  vec3 fresnel = reflectance + (1.0 - reflectance) * pow(1.0 - max(dot(towardsEye, half_), 0.0), 5.0);
  return fresnel * distribution * masking * cosineLight;
}

void main() {
  vec4 base = surfaceColor * texture(baseColorTexture, surfaceTexcoord);
  float alpha = 1.0;
  if (alphaMode == 1) {
    // The edge is as wide as a pixel: alpha to coverage makes it smooth.
    alpha = clamp((base.a - draw.surface.z) / max(fwidth(base.a), 1e-4) + 0.5, 0.0, 1.0);
    if (alpha <= 0.0) discard;
  } else if (alphaMode == 2) {
    alpha = base.a;
    if (alpha <= 0.0) discard;
  }
  if (draw.surface.w != 0.0) base.rgb = heat(surfaceValue);

  vec3 normal = surfaceNormal();
  vec3 towardsEye = normalize(view.eye.w == 0.0 ? view.eye.xyz : view.eye.xyz - worldPosition);
  float metallic = draw.surface.x;
  // Lights are directions: on a mirror they would be points, and a metal would be black between them. So roughness has a minimum.
  float roughness = clamp(draw.surface.y, 0.35, 1.0);
  vec3 diffuse = base.rgb * (1.0 - 0.5 * metallic);
  vec3 reflectance = mix(vec3(0.04), base.rgb, metallic);

  // At an edge, the center of a pixel may lie outside the triangle. In a crease, this point is
  // below the adjacent triangle, and would be in its shadow. Half a pixel farther out it is lit
  // again.
  float seen = max(length(dFdx(worldPosition)), length(dFdy(worldPosition)));
  vec3 litPosition = worldPosition + normal * min(0.5 * seen, view.shadow.z);

  float cosine = max(dot(normal, view.keyDirection.xyz), 0.0);
  float visible = cosine > 0.0 ? keyVisibility(litPosition, normal) : 0.0;
  vec2 sky = skyLight(litPosition, normal, view.sky.y);
  float open = sky.y > 0.0 ? sky.x / sky.y : 1.0;
  float down = 0.5 - 0.5 * normal.y;

  vec3 light = view.keyColor.rgb * cosine * visible + view.skyColor.rgb * sky.x +
               view.bounceColor.rgb * down * mix(0.4, 1.0, open);
  vec3 color = diffuse * light;
  color += view.keyColor.rgb * 3.14159265 * visible * 0.6 *
           specular(normal, towardsEye, view.keyDirection.xyz, roughness, reflectance);
  color += reflectance * view.skyColor.rgb * open * (1.0 - roughness * 0.6) * (0.5 + 0.5 * normal.y);
  float rim = pow(1.0 - max(dot(normal, towardsEye), 0.0), 3.0) *
              max(dot(normal, view.rimDirection.xyz), 0.0);
  color += view.rimDirection.w * rim * open * (0.25 + 0.75 * base.rgb);

  color = toneMapped(color);
  if (view.haze.z > 0.0) {
    float far = clamp((distance(view.eye.xyz, worldPosition) - view.haze.x) * view.haze.y, 0.0, 1.0);
    color = mix(color, backgroundAt(gl_FragCoord.xy), view.haze.z * far);
  }
  displayed = vec4(dithered(color, gl_FragCoord.xy), alpha);
}
