#version 450

// The linear counterpart of plain_skin.comp: linear blend skinning of positions and normals as in many engines, with unmodified
// joint matrices. Normals are transformed by the blended matrix, which assumes uniform scale.

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
  uint vertexCount;
  uint jointCount;
  uint firstInstance;  // first instance of this dispatch in the matrices; the output range begins with it
};

// 48 bytes per vertex: position, normal, four 16-bit joints, four weights.
layout(set = 0, binding = 0, std430) restrict readonly buffer Vertices { uvec4 vertices[]; };
layout(set = 0, binding = 1, std430) restrict readonly buffer Matrices { vec4 matrices[]; };  // 3×4 by rows
layout(set = 0, binding = 2, std430) restrict writeonly buffer Skinned { float skinned[]; };

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

  uvec4 units = ((firstInstance + instance) * jointCount + joints) * 3u;
  vec4 rows[3];
  for (uint row = 0u; row < 3u; ++row) {
    rows[row] = weights.x * matrices[units.x + row] + weights.y * matrices[units.y + row] + weights.z * matrices[units.z + row] +
                weights.w * matrices[units.w + row];
  }
  position = vec3(dot(rows[0], vec4(position, 1.0)), dot(rows[1], vec4(position, 1.0)), dot(rows[2], vec4(position, 1.0)));
  normal = normalize(vec3(dot(rows[0].xyz, normal), dot(rows[1].xyz, normal), dot(rows[2].xyz, normal)));

  uint place = (instance * vertexCount + vertex) * 6u;
  skinned[place] = position.x;
  skinned[place + 1u] = position.y;
  skinned[place + 2u] = position.z;
  skinned[place + 3u] = normal.x;
  skinned[place + 4u] = normal.y;
  skinned[place + 5u] = normal.z;
}
