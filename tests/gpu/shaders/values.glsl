// Draws the values of a vertex shader, one pixel for each vertex.
layout(location = 0) flat out vec4 positionOut;
layout(location = 1) flat out vec4 normalOut;
layout(location = 2) flat out vec4 tangentOut;

layout(push_constant) uniform Push {
  uvec2 pictureSize;
  vec4 boxMin;
  vec4 boxMax;
};

void drawValues(vec3 position, vec3 normal, vec4 tangent) {
  positionOut = vec4(position, 1.0);
  normalOut = vec4(normal, 0.0);
  tangentOut = tangent;
  uvec2 pixel = uvec2(uint(gl_VertexIndex) % pictureSize.x, uint(gl_VertexIndex) / pictureSize.x);
  gl_Position = vec4((vec2(pixel) + 0.5) / vec2(pictureSize) * 2.0 - 1.0, 0.0, 1.0);
  gl_PointSize = 1.0;
}
