#version 450

layout(location = 0) flat in vec4 positionIn;
layout(location = 1) flat in vec4 normalIn;
layout(location = 2) flat in vec4 tangentIn;
layout(location = 0) out vec4 position;
layout(location = 1) out vec4 normal;
layout(location = 2) out vec4 tangent;

void main() {
  position = positionIn;
  normal = normalIn;
  tangent = tangentIn;
}
