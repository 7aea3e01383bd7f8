#version 450

// The baseline: dual-quaternion skinning of positions and normals as in many engines. One invocation per vertex and instance,
// vertices of fixed size with four influences, storage buffers, nothing reused between instances.

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
  uint vertexCount;
  uint jointCount;
  uint firstInstance;  // first instance of this dispatch in the palettes; the output range begins with it
};

// 48 bytes per vertex: position, normal, four 16-bit joints, four weights.
layout(set = 0, binding = 0, std430) restrict readonly buffer Vertices { uvec4 vertices[]; };
layout(set = 0, binding = 1, std430) restrict readonly buffer Palettes { vec4 palettes[]; };
layout(set = 0, binding = 2, std430) restrict writeonly buffer Skinned { float skinned[]; };

// Kavan et al. 2007: v + 2 r × (r × v + w v), for a unit quaternion.
vec3 rotate(vec4 q, vec3 v) { return v + 2.0 * cross(q.xyz, cross(q.xyz, v) + q.w * v); }

void main() {
  uint vertex = gl_GlobalInvocationID.x;
  if (vertex >= vertexCount) return;
  uint instance = gl_WorkGroupID.y;

  uvec4 first = vertices[vertex * 3u];
  uvec4 second = vertices[vertex * 3u + 1u];
  vec4 weights = uintBitsToFloat(vertices[vertex * 3u + 2u]);
  vec3 position = uintBitsToFloat(first.xyz);
  vec3 normal = uintBitsToFloat(uvec3(first.w, second.xy));
  uvec4 joints = uvec4(second.z & 0xffffu, second.z >> 16u, second.w & 0xffffu, second.w >> 16u);

  uvec4 units = ((firstInstance + instance) * jointCount + joints) * 2u;
  vec4 pivot = palettes[units.x];
  vec4 real1 = palettes[units.y];
  vec4 real2 = palettes[units.z];
  vec4 real3 = palettes[units.w];
  if (dot(pivot, real1) < 0.0) weights.y = -weights.y;
  if (dot(pivot, real2) < 0.0) weights.z = -weights.z;
  if (dot(pivot, real3) < 0.0) weights.w = -weights.w;
  vec4 real = weights.x * pivot + weights.y * real1 + weights.z * real2 + weights.w * real3;
  vec4 dual = weights.x * palettes[units.x + 1u] + weights.y * palettes[units.y + 1u] + weights.z * palettes[units.z + 1u] +
              weights.w * palettes[units.w + 1u];
  float inverse = inversesqrt(dot(real, real));
  real *= inverse;
  dual *= inverse;

  vec3 translation = 2.0 * (real.w * dual.xyz - dual.w * real.xyz + cross(real.xyz, dual.xyz));
  position = rotate(real, position) + translation;
  normal = normalize(rotate(real, normal));

  uint place = (instance * vertexCount + vertex) * 6u;
  skinned[place] = position.x;
  skinned[place + 1u] = position.y;
  skinned[place + 2u] = position.z;
  skinned[place + 3u] = normal.x;
  skinned[place + 4u] = normal.y;
  skinned[place + 5u] = normal.z;
}
