#version 450

// The baseline's palettes: converts rigid joint matrices (3×4, row-major) to unit dual quaternions, one invocation per joint of an
// instance.

layout(local_size_x = 64) in;

layout(push_constant) uniform Push { uint jointTotal; };

layout(set = 0, binding = 0, std430) restrict readonly buffer Matrices { vec4 matrices[]; };
layout(set = 0, binding = 1, std430) restrict writeonly buffer Palettes { vec4 palettes[]; };

// From the largest component (Shepperd 1978).
vec4 quaternionOf(vec3 r0, vec3 r1, vec3 r2) {
  float trace = r0.x + r1.y + r2.z;
  vec4 q;
  if (trace > 0.0) {
    q = vec4(r2.y - r1.z, r0.z - r2.x, r1.x - r0.y, 1.0 + trace);
  } else if (r0.x > r1.y && r0.x > r2.z) {
    q = vec4(1.0 + r0.x - r1.y - r2.z, r0.y + r1.x, r0.z + r2.x, r2.y - r1.z);
  } else if (r1.y > r2.z) {
    q = vec4(r0.y + r1.x, 1.0 - r0.x + r1.y - r2.z, r1.z + r2.y, r0.z - r2.x);
  } else {
    q = vec4(r0.z + r2.x, r1.z + r2.y, 1.0 - r0.x - r1.y + r2.z, r1.x - r0.y);
  }
  return normalize(q);
}

void main() {
  uint joint = gl_GlobalInvocationID.x;
  if (joint >= jointTotal) return;
  vec4 r0 = matrices[joint * 3u];
  vec4 r1 = matrices[joint * 3u + 1u];
  vec4 r2 = matrices[joint * 3u + 2u];
  vec4 real = quaternionOf(r0.xyz, r1.xyz, r2.xyz);
  vec3 translation = vec3(r0.w, r1.w, r2.w);
  palettes[joint * 2u] = real;
  palettes[joint * 2u + 1u] =
      0.5 * vec4(real.w * translation + cross(translation, real.xyz), -dot(translation, real.xyz));
}
