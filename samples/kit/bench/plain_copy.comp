#version 450

// An upper bound of the speed of skinning: copies the positions and normals of the mesh for each instance. One invocation per
// vertex, for up to 24 instances, as in Dermis' kernels on lavapipe.

layout(local_size_x = 64) in;

layout(push_constant) uniform Push {
  uint vertexCount;
  uint instanceCount;  // of this dispatch
};

layout(set = 0, binding = 0, std430) restrict readonly buffer Vertices { uvec4 vertices[]; };  // as in plain_skin.comp
layout(set = 0, binding = 2, std430) restrict writeonly buffer Skinned { uvec2 skinned[]; };

const uint INSTANCES = 24u;

void main() {
  uint vertex = gl_GlobalInvocationID.x;
  if (vertex >= vertexCount) return;
  uvec4 first = vertices[vertex * 3u];
  uvec2 second = vertices[vertex * 3u + 1u].xy;
  uint instance = gl_WorkGroupID.y * INSTANCES;
  uint end = min(instance + INSTANCES, instanceCount);
  uint place = (instance * vertexCount + vertex) * 3u;
  do {
    skinned[place] = first.xy;
    skinned[place + 1u] = first.zw;
    skinned[place + 2u] = second;
    place += vertexCount * 3u;
    ++instance;
  } while (instance < end);
}
